//! Further candidates where they pay: column generation for the relaxed choice.
//!
//! At optimal weights every candidate in use has the same sensitivity (the derivative of the criterion by its weight), and no
//! other one a better: Kiefer and Wolfowitz. A new pose improves the optimum only if it beats that, which is looked up without
//! solving anything.

use nalgebra::DMatrix;
use rayon::prelude::*;

use super::candidates::{Candidate, Search, Tally};
use super::criterion::{Criterion, Evaluated};
use super::relax::{Design, GOOD_ENOUGH, NoDesign, Relaxed};
use crate::linalg::LinearRow;

/// What stays the same from round to round.
pub struct Refinement<'a> {
    /// Where poses come from.
    pub search: &'a Search<'a>,
    /// Information of a candidate.
    pub inform: &'a (dyn Fn(&Candidate) -> DMatrix<f64> + Sync),
    /// Rows of the polytope over candidates; those of earlier candidates do not change when more are added.
    pub rows: &'a (dyn Fn(&[Candidate]) -> Vec<LinearRow> + Sync),
    /// `M_0`.
    pub known: &'a DMatrix<f64>,
    /// Criterion.
    pub criterion: &'a Criterion,
    /// Number of images.
    pub count: usize,
    /// Rounds at most.
    pub rounds: usize,
}

/// Candidates with their information and the best weights.
#[derive(Debug, Clone)]
pub struct Refined {
    /// Candidates: those given, then those that were added.
    pub pool: Vec<Candidate>,
    /// Their information.
    pub information: Vec<DMatrix<f64>>,
    /// Rows of the polytope.
    pub rows: Vec<LinearRow>,
    /// Weights.
    pub relaxed: Relaxed,
    /// What fell out, with the views of all rounds.
    pub tally: Tally,
    /// Number of the first view that was not drawn yet.
    fresh_from: usize,
    /// Criterion of the weights before the first round and after each.
    pub values: Vec<f64>,
}

/// Rounds at most, where nothing else is wanted.
pub const USUAL_ROUNDS: usize = 16;
/// Weight from which a candidate is in use.
const IN_USE: f64 = 1e-3;
/// Fresh views of a round.
const FRESH: usize = 32;
/// Poses tried one after the other on the way from each candidate in use.
const TRIES: usize = 12;
/// Newcomers of a round, at most.
const NEWCOMERS: usize = 150;
/// Certified share of the weights at which a round is content: prices need not be exact.
const NEAR_ENOUGH: f64 = 0.998;
/// Gain of a round below which the search ends, as a share of the gain of all rounds: so that what no pose can mend (the scale of
/// the plate) does not count.
const LEAST_GAIN: f64 = 0.02;

/// A candidate with its derivative of the criterion.
struct Priced {
    candidate: Candidate,
    information: DMatrix<f64>,
    slope: f64,
}

impl Refinement<'_> {
    fn design<'d>(&'d self, information: &'d [DMatrix<f64>], rows: &'d [LinearRow]) -> Design<'d> {
        Design { known: self.known, candidates: information, criterion: self.criterion, count: self.count, rows }
    }

    /// Optimal weights of the candidates given, and of those that rounds of search add to them.
    ///
    /// # Errors
    /// Where the rows allow no choice among the candidates given, or numbers break down.
    pub fn refine(&self, pool: Vec<Candidate>, tally: Tally) -> Result<Refined, NoDesign> {
        let information: Vec<DMatrix<f64>> = pool.par_iter().map(self.inform).collect();
        let rows = (self.rows)(&pool);
        let relaxed = self.design(&information, &rows).relax()?;
        let values = vec![relaxed.value];
        let mut now = Refined { fresh_from: tally.views, pool, information, rows, relaxed, tally, values };
        for round in 0..self.rounds {
            if !self.extend(&mut now, round as u64)? {
                break;
            }
            now.values.push(now.relaxed.value);
            let [.., before, after] = now.values[..] else { break };
            if before - after < LEAST_GAIN * (now.values[0] - after) {
                break;
            }
        }
        let weights = std::mem::take(&mut now.relaxed.weights);
        now.relaxed = self.design(&now.information, &now.rows).relax_from(weights, GOOD_ENOUGH)?;
        Ok(now)
    }

    /// One round; false where it found nothing better.
    fn extend(&self, now: &mut Refined, round: u64) -> Result<bool, NoDesign> {
        let design = self.design(&now.information, &now.rows);
        let at = self.criterion.evaluate(&design.information(&now.relaxed.weights)).map_err(|_| NoDesign::Numerical)?;
        let in_use = (0..now.pool.len()).filter(|&k| now.relaxed.weights[k] > IN_USE);
        let used: Vec<(&Candidate, f64)> = in_use.map(|k| (&now.pool[k], at.gradient(&now.information[k]))).collect();
        let climb = |(k, (from, slope)): (usize, &(&Candidate, f64))| {
            self.climb(from, *slope, &at, ((round + 1) << 32) + k as u64)
        };
        let mut found: Vec<Priced> = used.par_iter().enumerate().flat_map_iter(climb).collect();
        let first = now.fresh_from;
        now.fresh_from += FRESH;
        let (fresh, counted) = self.search.drawn(first..now.fresh_from);
        now.tally.add(&counted);
        found.par_extend(fresh.into_par_iter().map(|candidate| self.priced(candidate, &at)));
        // Limits per placement give each its own price: the worst slope in use there.
        let price = |placement: usize| {
            let slopes = |all: bool| used.iter().filter(move |u| all || u.0.placement == placement).map(|u| u.1);
            slopes(false).reduce(f64::max).or_else(|| slopes(true).reduce(f64::max)).unwrap_or(0.0)
        };
        let mut gains: Vec<(f64, Priced)> =
            found.into_iter().map(|p| (p.slope - price(p.candidate.placement), p)).collect();
        gains.retain(|(gain, _)| *gain < 0.0);
        gains.sort_by(|a, b| a.0.total_cmp(&b.0));
        gains.truncate(NEWCOMERS);
        if gains.is_empty() {
            return Ok(false);
        }
        for (_, newcomer) in gains {
            now.pool.push(newcomer.candidate);
            now.information.push(newcomer.information);
        }
        now.rows = (self.rows)(&now.pool);
        let mut weights = std::mem::take(&mut now.relaxed.weights);
        weights.resize(now.pool.len(), 0.0);
        now.relaxed = self.design(&now.information, &now.rows).relax_from(weights, NEAR_ENOUGH)?;
        Ok(true)
    }

    fn priced(&self, candidate: Candidate, at: &Evaluated) -> Priced {
        let information = (self.inform)(&candidate);
        Priced { slope: at.gradient(&information), candidate, information }
    }

    /// Poses on the way from one in use to a better slope, each better than the one before.
    fn climb(&self, from: &Candidate, slope: f64, at: &Evaluated, stream: u64) -> Vec<Priced> {
        let mut rng = self.search.rng(stream);
        let mut way: Vec<Priced> = Vec::new();
        for _ in 0..TRIES {
            let (here, best) = way.last().map_or((from, slope), |p| (&p.candidate, p.slope));
            let next = self.search.near(here, &mut rng).map(|c| self.priced(c, at));
            way.extend(next.filter(|p| p.slope < best));
        }
        way
    }
}
