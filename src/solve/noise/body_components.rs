//! Variance components of measured bodies: factors on the stated sigmas of position and rotation, by their redundancy (REML).

use nalgebra::{DMatrix, Matrix6};

use crate::problem::Noise;
use crate::solve::linear::LinearStop;
use crate::solve::optimum::fit::Fit;

/// Weight, in coordinates, with which a stated sigma is believed: 95 % of the factor lie between 1/2 and 2 before the data.
const STATED: f64 = 4.0;

/// Squares and counts of the coordinates of one component.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct BodyTally {
    /// Sum of weighted squares in units of the stated sigmas.
    squares: f64,
    /// Number of coordinates.
    count: f64,
    /// How many of them the parameters use up.
    taken: f64,
}

impl BodyTally {
    /// How many coordinates the parameters use up.
    pub fn taken(&self) -> f64 {
        self.taken
    }

    /// The factor that is asked for, drawn to the stated sigma.
    fn asked(&self) -> Option<f64> {
        (self.count > 0.0).then(|| ((self.squares + STATED) / ((self.count - self.taken).max(0.0) + STATED)).sqrt())
    }
}

impl Fit {
    /// Of every component, position and rotation, from the covariances of the bodies that were measured at some stops.
    pub(super) fn body_tallies(&self, stops: &[LinearStop], covariances: &[Vec<DMatrix<f64>>]) -> Vec<[BodyTally; 2]> {
        let problem = &self.problem;
        let mut tallies = vec![[BodyTally::default(); 2]; problem.noise.body.len()];
        for (stop, covariances) in stops.iter().zip(covariances) {
            for (covariance, part) in covariances.iter().zip(stop.bodies()) {
                let measured = &problem.body_measurements[part.index];
                let used_up: Matrix6<f64> = Matrix6::from_column_slice(covariance.as_slice()) * part.terms.pp;
                let tally = &mut tallies[problem.instruments[measured.instrument].component];
                // The rotation of a pose moves no position: the trace falls apart as its blocks do.
                for (k, tally) in tally.iter_mut().enumerate().take(measured.seen.coordinates() / 3) {
                    tally.squares += part.terms.weight * part.terms.squares[k];
                    tally.count += 3.0;
                    tally.taken += match measured.seen.coordinates() {
                        3 => used_up.trace(),
                        _ => used_up.fixed_view::<3, 3>(3 * k, 3 * k).trace(),
                    };
                }
            }
        }
        tallies
    }
}

/// New factors; returns the largest relative change.
pub(super) fn update_bodies(tallies: &[[BodyTally; 2]], noise: &mut Noise) -> f64 {
    let mut change: f64 = 0.0;
    for (factor, tally) in noise.body.iter_mut().flatten().zip(tallies.iter().flatten()) {
        if let Some(next) = tally.asked() {
            change = change.max((next / *factor - 1.0).abs());
            *factor = next;
        }
    }
    change
}
