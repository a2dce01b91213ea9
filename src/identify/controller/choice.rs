//! The choice among the postures of all stops with the least sum of squares.

use nalgebra::{DMatrix, DVector};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use crate::assess::Limits;
use crate::linalg::SymmetricFactor;

/// Random choices that are started from.
const STARTS: u64 = 64;
/// Choices of a beam search that are gone on with.
const WIDTH: usize = 256;
/// The same where a fit has most postures right already.
const WIDTH_FITTED: usize = 64;
/// Of these the best, from which postures are fitted and chosen in turns.
const OF_BEAM: usize = 32;
/// The best choices of fitting and choosing in turns, from which every stop is chosen by the others.
const DESCENDED: usize = 16;
/// Most turns of fitting and choosing.
const TURNS: usize = 50;
/// Share of the information that holds what nothing tells.
const HELD: f64 = 1e-12;

/// What was seen at a stop says of one of its postures.
#[derive(Clone)]
pub(super) struct Candidate {
    pub readings: Vec<f64>,
    /// `V^-1/2 G` and `V^-1/2 e` of all that was seen there.
    pub g: DMatrix<f64>,
    pub e: DVector<f64>,
}

impl Candidate {
    /// What parameters leave.
    pub fn residual(&self, x: &DVector<f64>) -> DVector<f64> {
        &self.e - &self.g * x
    }
}

/// A stop whose pose was read.
pub(super) struct Stop {
    /// The first is that of the series as it stands.
    pub candidates: Vec<Candidate>,
    /// `G' V^-1/2` of all candidates side by side.
    across: DMatrix<f64>,
}

/// A choice of postures that no single stop would change.
#[derive(Clone, PartialEq)]
pub(super) struct Choice {
    pub postures: Vec<usize>,
    cost: f64,
}

/// The choice that is taken.
pub(super) struct Chosen {
    pub postures: Vec<usize>,
    /// Whether other choices at many stops together are as good.
    pub is_open: bool,
    /// Stops that are as good in another posture by themselves.
    pub undecided: usize,
}

/// The stops, and the prior information of the parameters.
pub(super) struct Stops {
    pub all: Vec<Stop>,
    pub prior: DVector<f64>,
}

/// What the postures of a series are before they are told.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::identify) enum Before {
    /// Those nearest to the stops before.
    Nearest,
    /// Those of a fit, nearly all of them right.
    Fitted,
}

impl Stops {
    /// The best choice, of those that are as good the one with most postures as they are, from those of a fit the one nearest to it, unless
    /// another is clearly better; and what others are as good.
    pub fn chosen(&self, from: Before, limits: &Limits) -> Option<Chosen> {
        let all: Vec<Choice> = self.starts(from).into_par_iter().filter_map(|c| self.descended(c.postures)).collect();
        let least = all.iter().min_by(|a, b| a.cost.total_cmp(&b.cost))?.clone();
        let equations: usize = self.all.iter().map(|s| s.candidates[0].e.len()).sum();
        let as_good = 2.0 * limits.decisive_log_odds * (least.cost / equations as f64).max(1.0);
        let most = least.cost + as_good;
        let base = match from {
            Before::Nearest => least,
            Before::Fitted => {
                let fitted = self.descended(vec![0; self.all.len()])?;
                if fitted.cost <= most { fitted } else { least }
            }
        };
        let mut best = vec![self.without_doubtful(base.postures, as_good)?];
        for choice in all.into_iter().filter(|c| c.cost <= most) {
            let postures = self.without_doubtful(choice.postures, as_good)?;
            if !best.contains(&postures) {
                best.push(postures);
            }
        }
        let kept = |postures: &&Vec<usize>| postures.iter().filter(|p| **p == 0).count();
        let postures = match from {
            Before::Nearest => best.iter().max_by_key(kept)?,
            Before::Fitted => &best[0],
        };
        let others = |other: &Vec<usize>| other.iter().zip(postures).filter(|(a, b)| a != b).count();
        let many = limits.open_postures * self.all.len() as f64;
        let is_open = best.iter().any(|other| others(other) as f64 > many);
        let undecided = self.undecided(postures, as_good)?;
        Some(Chosen { postures: postures.clone(), is_open, undecided })
    }

    /// Choices that no fit to them changes, the best first.
    fn starts(&self, from: Before) -> Vec<Choice> {
        let first = std::iter::once(self.settled(vec![0; self.all.len()]));
        let random = |seed| {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            self.settled(self.all.iter().map(|s| rng.random_range(0..s.candidates.len())).collect())
        };
        let random: Vec<Option<Choice>> = (0..STARTS).into_par_iter().map(random).collect();
        let width = match from {
            Before::Nearest => WIDTH,
            Before::Fitted => WIDTH_FITTED,
        };
        let forwards: Vec<usize> = (0..self.all.len()).collect();
        let backwards: Vec<usize> = forwards.iter().rev().copied().collect();
        let of_beam = [forwards, backwards].into_iter().flat_map(|order| self.by_beam(&order, width));
        let of_beam: Vec<Vec<usize>> = of_beam.collect();
        let of_beam: Vec<Option<Choice>> = of_beam.into_par_iter().map(|postures| self.settled(postures)).collect();
        let mut all: Vec<Choice> = Vec::new();
        for choice in first.chain(random).chain(of_beam).flatten() {
            if !all.contains(&choice) {
                all.push(choice);
            }
        }
        all.sort_by(|a, b| a.cost.total_cmp(&b.cost));
        all.truncate(DESCENDED);
        all
    }

    /// The best choices where stops are taken in one after the other, and only the best so far are gone on with.
    fn by_beam(&self, order: &[usize], width: usize) -> Vec<Vec<usize>> {
        let mut kept = vec![(vec![0; self.all.len()], Knowledge::of_priors(&self.prior))];
        for &s in order {
            let stop = &self.all[s];
            let next = |(k, (_, known)): (usize, &(Vec<usize>, Knowledge))| {
                let least = known.least()?;
                let costs = stop.predicted(&least)?;
                Some(costs.into_iter().enumerate().map(|(c, cost)| (least.cost + cost, k, c)).collect::<Vec<_>>())
            };
            let grown: Vec<Option<Vec<(f64, usize, usize)>>> = kept.par_iter().enumerate().map(next).collect();
            let mut grown: Vec<(f64, usize, usize)> = grown.into_iter().flatten().flatten().collect();
            grown.sort_by(|a, b| a.0.total_cmp(&b.0));
            grown.truncate(width);
            let with = |&(_, k, c): &(f64, usize, usize)| {
                let (mut postures, mut known) = kept[k].clone();
                postures[s] = c;
                known.add(&stop.candidates[c], 1.0);
                (postures, known)
            };
            kept = grown.par_iter().map(with).collect();
        }
        kept.into_iter().take(OF_BEAM).map(|(postures, _)| postures).collect()
    }

    /// How many stops fit as well in another posture, the others as they are.
    fn undecided(&self, postures: &[usize], as_good: f64) -> Option<usize> {
        let mut known = self.told_by(postures);
        let mut count = 0;
        for (stop, &c) in self.all.iter().zip(postures).filter(|(stop, _)| stop.candidates.len() > 1) {
            known.add(&stop.candidates[c], -1.0);
            let costs = stop.predicted(&known.least()?)?;
            let is_as_good = |(k, cost): (usize, &f64)| k != c && *cost <= costs[c] + as_good;
            count += usize::from(costs.iter().enumerate().any(is_as_good));
            known.add(&stop.candidates[c], 1.0);
        }
        Some(count)
    }

    /// What a choice says of the parameters.
    fn told_by(&self, postures: &[usize]) -> Knowledge {
        let mut known = Knowledge::of_priors(&self.prior);
        self.all.iter().zip(postures).for_each(|(stop, &c)| known.add(&stop.candidates[c], 1.0));
        known
    }

    /// With its cost.
    fn choice(&self, postures: Vec<usize>) -> Option<Choice> {
        let cost = self.told_by(&postures).least()?.cost;
        Some(Choice { postures, cost })
    }

    /// Fits and chooses in turns.
    fn settled(&self, mut postures: Vec<usize>) -> Option<Choice> {
        for _ in 0..TURNS {
            let Least { x, cost, .. } = self.told_by(&postures).least()?;
            let next: Vec<usize> = self.all.iter().map(|s| s.nearest(&x)).collect();
            if next == postures {
                return Some(Choice { postures, cost });
            }
            postures = next;
        }
        None
    }

    /// Every stop in the posture that all others predict best, in turns.
    pub fn descended(&self, mut postures: Vec<usize>) -> Option<Choice> {
        let mut known = self.told_by(&postures);
        for _ in 0..TURNS {
            let mut is_changed = false;
            for (stop, c) in self.all.iter().zip(&mut postures) {
                known.add(&stop.candidates[*c], -1.0);
                let costs = stop.predicted(&known.least()?)?;
                let best = (0..costs.len()).min_by(|&a, &b| costs[a].total_cmp(&costs[b])).unwrap_or(*c);
                if costs[best] < costs[*c] {
                    *c = best;
                    is_changed = true;
                }
                known.add(&stop.candidates[*c], 1.0);
            }
            if !is_changed {
                break;
            }
        }
        self.choice(postures)
    }

    /// With every stop that it hardly matters to as it was.
    fn without_doubtful(&self, mut postures: Vec<usize>, as_good: f64) -> Option<Vec<usize>> {
        let mut known = self.told_by(&postures);
        for (stop, c) in self.all.iter().zip(&mut postures).filter(|(_, c)| **c > 0) {
            known.add(&stop.candidates[*c], -1.0);
            let costs = stop.predicted(&known.least()?)?;
            if costs[0] <= costs[*c] + as_good {
                *c = 0;
            }
            known.add(&stop.candidates[*c], 1.0);
        }
        Some(postures)
    }
}

/// Normal equations of the parameters.
#[derive(Clone)]
pub(super) struct Knowledge {
    information: DMatrix<f64>,
    rhs: DVector<f64>,
    squares: f64,
}

/// The parameters with the least cost.
pub(super) struct Least {
    pub x: DVector<f64>,
    pub cost: f64,
    /// Of their information.
    pub factor: SymmetricFactor,
}

impl Knowledge {
    pub fn of_priors(prior: &DVector<f64>) -> Self {
        let n = prior.len();
        Self { information: DMatrix::from_diagonal(prior), rhs: DVector::zeros(n), squares: 0.0 }
    }

    /// Takes a posture of a stop in, or by a weight of -1 out again.
    pub fn add(&mut self, Candidate { g, e, .. }: &Candidate, weight: f64) {
        self.information.gemm(weight, &g.transpose(), g, 1.0);
        self.rhs.gemv_tr(weight, g, e, 1.0);
        self.squares += weight * e.norm_squared();
    }

    pub fn least(&self) -> Option<Least> {
        let mut n = self.information.clone();
        let held = HELD * n.diagonal().max();
        (0..n.nrows()).for_each(|k| n[(k, k)] += held);
        let factor = SymmetricFactor::new(&n).ok()?;
        let x = factor.solve(&self.rhs);
        Some(Least { cost: self.squares - self.rhs.dot(&x), x, factor })
    }
}

impl Stop {
    pub fn of(candidates: Vec<Candidate>) -> Self {
        let rows: Vec<_> = candidates.iter().flat_map(|c| c.g.row_iter()).collect();
        let across = DMatrix::from_rows(&rows).transpose();
        Self { candidates, across }
    }

    fn nearest(&self, x: &DVector<f64>) -> usize {
        let costs: Vec<f64> = self.candidates.iter().map(|c| c.residual(x).norm_squared()).collect();
        (0..costs.len()).min_by(|&a, &b| costs[a].total_cmp(&costs[b])).unwrap_or(0)
    }

    /// What every posture adds to the cost of the other stops: with `r = e - G x` and `W = 1 + G N^-1 G'` by their `x` and `N`, `r' W^-1 r`.
    fn predicted(&self, Least { x, factor, .. }: &Least) -> Option<Vec<f64>> {
        let solved = factor.solve_many(&self.across);
        let cost = |(c, candidate): (usize, &Candidate)| {
            let rows = candidate.e.len();
            let mut w = DMatrix::identity(rows, rows);
            w.gemm(1.0, &candidate.g, &solved.columns(c * rows, rows), 1.0);
            let r = candidate.residual(x);
            Some(r.dot(&w.cholesky()?.solve(&r)))
        };
        self.candidates.iter().enumerate().map(cost).collect()
    }
}
