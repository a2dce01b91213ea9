//! A problem in parts that share no stop: what each tells is made once, and that of all but one is a sum.

use std::collections::HashSet;

use nalgebra::DMatrix;
use rayon::prelude::*;

use super::by_stops::StopsEliminated;
use super::seen_markers::SeenMarkers;
use super::system::{Elimination, System};
use crate::solve::linear::LinearProblem;

/// What some of the images tell.
struct Part {
    /// Stops in use, ascending.
    stops: Vec<usize>,
    /// With the priors of what is latent and of every marker.
    information: DMatrix<f64>,
    eliminated: StopsEliminated,
}

/// The parts of a problem, each with what is latent at its stops eliminated.
pub struct Parts(Vec<Part>);

impl Parts {
    /// By sets of images; what is in none of them is a part by itself. `None` where markers are rather eliminated, and where a stop belongs to two parts or
    /// bodies were measured.
    pub fn of(whole: LinearProblem, sets: &[Vec<usize>]) -> Option<Self> {
        let problem = &whole.adjustment.problem;
        if problem.used_bodies().next().is_some() || Elimination::of_steps(whole) != Elimination::Stops {
            return None;
        }
        let seen = SeenMarkers::of(whole);
        let in_sets: HashSet<usize> = sets.iter().flatten().copied().collect();
        let rest: Vec<usize> = whole.lin.images.iter().copied().filter(|i| !in_sets.contains(i)).collect();
        let part = |own: &Vec<usize>| {
            let own: HashSet<usize> = own.iter().copied().collect();
            let others: Vec<usize> = whole.lin.images.iter().copied().filter(|i| !own.contains(i)).collect();
            let left = whole.without_images(&others);
            let (information, eliminated) = StopsEliminated::build(left.linear(), 0.0, seen.clone());
            Part { stops: left.linearised.stops.iter().map(|s| s.stop).collect(), information, eliminated }
        };
        let sets: Vec<&Vec<usize>> = sets.iter().chain(Some(&rest).filter(|rest| !rest.is_empty())).collect();
        let parts: Vec<Part> = sets.into_par_iter().map(part).collect();
        let stops: usize = parts.iter().map(|part| part.stops.len()).sum();
        (stops == whole.lin.stops.len()).then_some(Self(parts))
    }

    /// The system of all parts but one, of which `linear` is the problem, at the linearisation of the whole.
    pub fn without(&self, part: usize, linear: LinearProblem) -> Option<System> {
        let others = || self.0.iter().enumerate().filter(|(k, _)| *k != part).map(|(_, other)| other);
        let mut all = others();
        let mut information = all.next()?.information.clone();
        all.for_each(|other| information += &other.information);
        let place = |stop: usize| linear.lin.stops.binary_search_by_key(&stop, |s| s.stop).ok();
        let eliminated = StopsEliminated::together(others().map(|p| (&p.eliminated, p.stops.as_slice())), place)?;
        eliminated.take_priors(linear, others().count() - 1, &mut information);
        Some(System::by_stops(linear, information, eliminated))
    }
}
