//! Further candidates where they pay: column generation for the relaxed choice.
//!
//! At optimal weights every candidate in use has the same sensitivity (the derivative of the criterion by its weight), and no
//! other one a better: Kiefer and Wolfowitz. A new pose improves the optimum only if it beats that, which is looked up without
//! solving anything.

use nalgebra::DMatrix;
use rand::{Rng, RngExt};
use rayon::prelude::*;

use super::candidates::{Candidate, CandidateCounts, Search};
use super::criterion::{Criterion, Evaluated};
use super::relax::{Design, GOOD_ENOUGH, NoDesign, Relaxed};
use super::rounding::Rounded;
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
    /// Rounds at most; none: no search at all.
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
    pub tally: CandidateCounts,
    /// Number of the first view that was not drawn yet.
    fresh_from: usize,
    /// Criterion of the weights before the first round and after each.
    pub values: Vec<f64>,
}

/// Rounds at most, where nothing else is wanted.
pub const USUAL_ROUNDS: usize = 12;
/// Images visited at most in the sweeps that make whole images better, these sweeps at least, and the relative gain for every visit
/// below which they end.
const POLISH_VISITS: usize = 300;
const POLISH_SWEEPS: usize = 10;
const POLISHED: f64 = 1e-3 / 30.0;
/// Ways tried for all images of a sweep, those for one image at least, and the poses on each.
const POLISH_WAYS: usize = 60;
const LEAST_WAYS: usize = 2;
const POLISH_TRIES: usize = 24;
/// First stream of random numbers of the sweeps.
const POLISH_STREAM: u64 = 1 << 62;
/// Weight from which a candidate is in use.
const IN_USE: f64 = 1e-3;
/// Fresh views of a round.
const FRESH: usize = 8;
/// Poses tried one after the other on the way from each candidate in use.
const TRIES: usize = 16;
/// Certified share of the weights at which a round is content: prices need not be exact.
const NEAR_ENOUGH: f64 = 0.9995;
/// Gain of three rounds below which the search ends, as a share of the gain of all rounds: so that what no pose can mend (the scale of
/// the plate) does not count.
const LEAST_GAIN: f64 = 0.02;

/// Least and greatest step, as shares of the ranges of a view; the first one is drawn evenly in the logarithm.
const NEAREST: f64 = 0.005;
const FARTHEST: f64 = 0.2;

/// By how much a step grows after a good one, and shrinks after others.
const LONGER: f64 = 1.6;
const SHORTER: f64 = 0.87;

/// Size of the steps on a way: longer after a good one, shorter after others, so that about one in five is good
/// (I. Rechenberg, *Evolutionsstrategie*, 1973).
struct Steps {
    size: f64,
}

impl Steps {
    fn new(rng: &mut impl Rng) -> Self {
        Self { size: NEAREST * (FARTHEST / NEAREST).powf(rng.random::<f64>()) }
    }

    fn after(&mut self, is_better: bool) {
        let factor = if is_better { LONGER } else { SHORTER };
        self.size = (self.size * factor).clamp(NEAREST, FARTHEST);
    }
}

/// A candidate with its derivative of the criterion.
struct Priced {
    candidate: Candidate,
    information: DMatrix<f64>,
    slope: f64,
}

impl Refinement<'_> {
    /// The choice among candidates with this information, under these rows.
    pub fn design<'d>(&'d self, information: &'d [DMatrix<f64>], rows: &'d [LinearRow]) -> Design<'d> {
        Design { known: self.known, candidates: information, criterion: self.criterion, count: self.count, rows }
    }

    /// Optimal weights of the candidates given (with their information), and of those that rounds of search add to them.
    ///
    /// # Errors
    /// Where the rows allow no choice among the candidates given, or numbers break down.
    pub fn refine(
        &self,
        pool: Vec<Candidate>,
        information: Vec<DMatrix<f64>>,
        tally: CandidateCounts,
    ) -> Result<Refined, NoDesign> {
        let rows = (self.rows)(&pool);
        let relaxed = self.design(&information, &rows).relax()?;
        let values = vec![relaxed.value];
        let mut now = Refined { fresh_from: tally.views, pool, information, rows, relaxed, tally, values };
        for round in 0..self.rounds {
            if !self.extend(&mut now, round as u64)? {
                break;
            }
            now.values.push(now.relaxed.value);
            let [.., before, _, _, after] = now.values[..] else { continue };
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

    /// Whole images made better one by one: poses near a chosen one that lower the criterion of all images together take its place,
    /// until a sweep gains little. They join the candidates, and the weights are found again. Where rows limit the choice, or no search is
    /// wanted, nothing happens.
    ///
    /// # Errors
    /// Where numbers break down.
    pub fn polish(&self, now: &mut Refined, rounded: &mut Rounded) -> Result<(), NoDesign> {
        if !now.rows.is_empty() || self.rounds == 0 {
            return Ok(());
        }
        let mut m = rounded.chosen.iter().fold(self.known.clone(), |m, &k| m + &now.information[k]);
        let before_polish = now.pool.len();
        let ways = (POLISH_WAYS / self.count).max(LEAST_WAYS) as u64;
        let mut stream = POLISH_STREAM;
        for _ in 0..(POLISH_VISITS / self.count).max(POLISH_SWEEPS) {
            let before = rounded.value;
            for place in 0..rounded.chosen.len() {
                stream += ways;
                let here = rounded.chosen[place];
                let without = &m - &now.information[here];
                let way = |k: u64| self.descend(&now.pool[here], &without, rounded.value, stream + k);
                let ends: Vec<Option<(Candidate, DMatrix<f64>, f64)>> = (0..ways).into_par_iter().map(way).collect();
                let best = ends.into_iter().flatten().min_by(|a, b| a.2.total_cmp(&b.2));
                if let Some((candidate, information, value)) = best {
                    m = without + &information;
                    rounded.value = value;
                    if here >= before_polish {
                        (now.pool[here], now.information[here]) = (candidate, information);
                    } else {
                        rounded.chosen[place] = now.pool.len();
                        now.pool.push(candidate);
                        now.information.push(information);
                    }
                }
            }
            if before - rounded.value < POLISHED * self.count as f64 * before.abs() {
                break;
            }
        }
        let mut weights = std::mem::take(&mut now.relaxed.weights);
        weights.resize(now.pool.len(), 0.0);
        now.relaxed = self.design(&now.information, &now.rows).relax_from(weights, GOOD_ENOUGH)?;
        rounded.chosen.sort_unstable();
        let whole = rounded.chosen.iter().fold(self.known.clone(), |m, &k| m + &now.information[k]);
        rounded.value = self.criterion.value(&whole).map_err(|_| NoDesign::Numerical)?;
        rounded.efficiency = self.criterion.share(now.relaxed.bound, rounded.value).min(1.0);
        Ok(())
    }

    /// The best pose on a way from `from` on which the criterion with its image falls below `value`.
    fn descend(
        &self,
        from: &Candidate,
        without: &DMatrix<f64>,
        value: f64,
        stream: u64,
    ) -> Option<(Candidate, DMatrix<f64>, f64)> {
        let mut rng = self.search.rng(stream);
        let mut best: Option<(Candidate, DMatrix<f64>, f64)> = None;
        let mut steps = Steps::new(&mut rng);
        for _ in 0..POLISH_TRIES {
            let (here, least) = best.as_ref().map_or((from, value), |b| (&b.0, b.2));
            let next = self.search.near(here, steps.size, &mut rng).and_then(|next| {
                let information = (self.inform)(&next);
                let reached = self.criterion.value(&(without + &information)).ok()?;
                (reached < least).then_some((next, information, reached))
            });
            steps.after(next.is_some());
            best = next.or(best);
        }
        best
    }

    fn priced(&self, candidate: Candidate, at: &Evaluated) -> Priced {
        let information = (self.inform)(&candidate);
        Priced { slope: at.gradient(&information), candidate, information }
    }

    /// The best pose on a way from one in use; `None` where no step led to a better slope.
    fn climb(&self, from: &Candidate, slope: f64, at: &Evaluated, stream: u64) -> Option<Priced> {
        let mut rng = self.search.rng(stream);
        let mut steps = Steps::new(&mut rng);
        let mut best: Option<Priced> = None;
        for _ in 0..TRIES {
            let (here, least) = best.as_ref().map_or((from, slope), |p| (&p.candidate, p.slope));
            let next = self.search.near(here, steps.size, &mut rng).map(|c| self.priced(c, at));
            let better = next.filter(|p| p.slope < least);
            steps.after(better.is_some());
            best = better.or(best);
        }
        best
    }
}
