//! Which posture every pose of a controller means, by the images.
//!
//! A pose is reached in up to eight postures. The nominal robot is at the same place in all of them, the real one is not: with the derivatives
//! `G_ic` of the camera pose at posture `c` of stop `i`, and `e_i` from the nominal pose to that of the images, wanted are the parameters `x` and
//! the choice with the least
//!
//! ```text
//! sum_i min_c (e_i - G_ic x)' V_ic^-1 (e_i - G_ic x) + x' P^-1 x
//! ```
//!
//! `x` is fitted to a choice and the choice made by `x` in turns (S. Lloyd 1957), from the postures nearest to those before and from random
//! ones. Where the axes of a wrist meet, all stops with the wrist turned over are a robot as likely as the first: the images do not tell which.

use std::borrow::Cow;
use std::collections::BTreeMap;

use nalgebra::{DMatrix, DVector, Matrix6};
use rand::rngs::SmallRng;
use rand::{RngExt, SeedableRng};
use rayon::prelude::*;

use super::free_poses::free_poses_of;
use super::start::{StartGiven, start_robot};
use crate::assess::Limits;
use crate::diagnose::ComputedPostures;
use crate::error::Result;
use crate::fit::FreePoses;
use crate::linalg::SymmetricFactor;
use crate::model::robot::{Posture, Robot};
use crate::problem::{Adjustment, MeasuredSeries, TakenFrom};
use crate::stage::stage;

/// Noise of the readings of the stops that are compared, rad or m.
const JOINT_SIGMA: f64 = 1e-4;
/// Random choices that are started from.
const STARTS: u64 = 64;
/// Most turns of fitting and choosing.
const TURNS: usize = 50;
/// Share of the information that holds what nothing tells.
const HELD: f64 = 1e-12;

/// What the images say of one posture of a stop.
struct Candidate {
    readings: Vec<f64>,
    /// `G' V^-1 G`, `G' V^-1 e` and `e' V^-1 e`.
    information: DMatrix<f64>,
    rhs: DVector<f64>,
    squares: f64,
}

/// A stop whose pose was read.
struct Stop {
    /// Series and row of everything that was seen there.
    rows: Vec<(usize, usize)>,
    /// The first is that of the series as it stands.
    candidates: Vec<Candidate>,
}

/// A choice of postures that no single stop would change.
#[derive(Clone, PartialEq)]
struct Choice {
    postures: Vec<usize>,
    cost: f64,
}

/// The stops, and the prior information of the parameters.
struct Stops {
    all: Vec<Stop>,
    prior: DVector<f64>,
}

/// The series with the postures that the images tell, and what is to be said of them; unchanged where readings were read. `hold` holds the
/// columns that are not to be fitted.
pub(super) fn told_by_images<'a>(
    robot: &Robot,
    series: &'a [MeasuredSeries],
    limits: &Limits,
    hold: impl FnOnce(&mut Adjustment) -> Result<()>,
) -> (Cow<'a, [MeasuredSeries]>, Option<ComputedPostures>) {
    let unchanged = (Cow::Borrowed(series), None);
    if series.iter().flat_map(|s| &s.postures).all(Vec::is_empty) {
        return unchanged;
    }
    let _stage = stage("postures");
    let Some(stops) = Stops::of(robot, series, limits, hold) else { return unchanged };
    let Some((chosen, is_open)) = stops.chosen(limits.decisive_log_odds) else { return unchanged };
    let mut told = series.to_vec();
    let mut others = Vec::new();
    for (stop, &c) in stops.all.iter().zip(&chosen.postures).filter(|(_, c)| **c > 0) {
        for &(s, row) in &stop.rows {
            told[s].stops[row].readings = Some(stop.candidates[c].readings.clone());
        }
        let (s, row) = stop.rows[0];
        others.push(series[s].stops[row].image.clone());
    }
    let computed = |s: &MeasuredSeries| s.postures.iter().any(|others| !others.is_empty());
    let count = stops.all.iter().filter(|stop| computed(&series[stop.rows[0].0])).count();
    let series = series.iter().filter(|s| computed(s)).map(|s| s.name.clone()).collect();
    (Cow::Owned(told), Some(ComputedPostures { series, stops: count, others, is_open }))
}

impl Stops {
    fn of(
        robot: &Robot,
        series: &[MeasuredSeries],
        limits: &Limits,
        hold: impl FnOnce(&mut Adjustment) -> Result<()>,
    ) -> Option<Self> {
        let (mut adjustment, free, mut verdicts) = free_poses_of(robot, series, limits, hold).ok()?;
        start_robot(&mut adjustment, &free, StartGiven { series, limits }, &mut verdicts).ok()?;
        let layout = &adjustment.problem.layout;
        let columns: Vec<usize> = (0..layout.theta_len()).filter(|&c| layout.columns[c].free).collect();
        let prior = columns.iter().map(|&c| layout.columns[c].prior_sigma.powi(-2));
        let prior = DVector::from_iterator(columns.len(), prior);
        let mut by_stop: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
        for i in adjustment.problem.used_on_robot() {
            by_stop.entry(adjustment.problem.images[i].stop).or_default().push(i);
        }
        let of = |images: Vec<usize>| stop(&adjustment, &free, series, &images, &columns);
        let all: Vec<Stop> = by_stop.into_values().collect::<Vec<_>>().into_par_iter().filter_map(of).collect();
        (!all.is_empty()).then_some(Self { all, prior })
    }

    /// The best choice, of those that are as good the one with most postures as they are; and whether there are others as good.
    fn chosen(&self, decisive: f64) -> Option<(Choice, bool)> {
        let first = std::iter::once(self.settled(vec![0; self.all.len()]));
        let random = |seed| {
            let mut rng = SmallRng::seed_from_u64(seed);
            self.settled(self.all.iter().map(|s| rng.random_range(0..s.candidates.len())).collect())
        };
        let random: Vec<Option<Choice>> = (0..STARTS).into_par_iter().map(random).collect();
        let all: Vec<Choice> = first.chain(random).flatten().collect();
        let least = all.iter().map(|c| c.cost).min_by(f64::total_cmp)?;
        let equations: usize = self.all.iter().map(|s| 6 * s.rows.len()).sum();
        let noise = (least / equations.saturating_sub(self.prior.len()).max(1) as f64).max(1.0);
        let as_good = 2.0 * decisive * noise;
        let mut best: Vec<Choice> = Vec::new();
        for choice in all.into_iter().filter(|c| c.cost <= least + as_good) {
            let choice = self.without_doubtful(choice, as_good)?;
            if !best.iter().any(|b| b.postures == choice.postures) {
                best.push(choice);
            }
        }
        let is_open = best.len() > 1;
        let kept = |c: &Choice| c.postures.iter().filter(|p| **p == 0).count();
        Some((best.into_iter().max_by_key(kept)?, is_open))
    }

    /// Parameters of a choice.
    fn fitted(&self, postures: &[usize]) -> Option<DVector<f64>> {
        let mut n = DMatrix::from_diagonal(&self.prior);
        let mut rhs = DVector::zeros(self.prior.len());
        for (stop, &c) in self.all.iter().zip(postures) {
            n += &stop.candidates[c].information;
            rhs += &stop.candidates[c].rhs;
        }
        let held = HELD * n.diagonal().max();
        (0..n.nrows()).for_each(|k| n[(k, k)] += held);
        Some(SymmetricFactor::new(&n).ok()?.solve(&rhs))
    }

    /// Fits and chooses in turns.
    fn settled(&self, mut postures: Vec<usize>) -> Option<Choice> {
        for _ in 0..TURNS {
            let x = self.fitted(&postures)?;
            let next: Vec<usize> = self.all.iter().map(|s| s.nearest(&x)).collect();
            let prior: f64 = x.iter().zip(self.prior.iter()).map(|(x, p)| x * x * p).sum();
            let cost = prior + self.all.iter().zip(&postures).map(|(s, &c)| s.candidates[c].cost(&x)).sum::<f64>();
            if next == postures {
                return Some(Choice { postures, cost });
            }
            postures = next;
        }
        None
    }

    /// With every stop that it hardly matters to as it was.
    fn without_doubtful(&self, mut choice: Choice, as_good: f64) -> Option<Choice> {
        let x = self.fitted(&choice.postures)?;
        for (stop, c) in self.all.iter().zip(&mut choice.postures) {
            if stop.candidates[0].cost(&x) <= stop.candidates[*c].cost(&x) + as_good {
                *c = 0;
            }
        }
        Some(choice)
    }
}

impl Stop {
    fn nearest(&self, x: &DVector<f64>) -> usize {
        let costs: Vec<f64> = self.candidates.iter().map(|c| c.cost(x)).collect();
        (0..costs.len()).min_by(|&a, &b| costs[a].total_cmp(&costs[b])).unwrap_or(0)
    }
}

impl Candidate {
    fn cost(&self, x: &DVector<f64>) -> f64 {
        self.squares - 2.0 * self.rhs.dot(x) + x.dot(&(&self.information * x))
    }
}

/// What the images of one stop say of its postures.
fn stop(
    adjustment: &Adjustment,
    free: &FreePoses,
    series: &[MeasuredSeries],
    images: &[usize],
    columns: &[usize],
) -> Option<Stop> {
    let Adjustment { problem, state } = adjustment;
    let row = |&i: &usize| {
        let image = &problem.images[i];
        let row = series[image.series].stops.iter().position(|s| s.image == image.name)?;
        Some((image.series, row))
    };
    let rows: Vec<(usize, usize)> = images.iter().filter_map(row).collect();
    let &(s, row) = rows.first()?;
    let own = series[s].stops[row].readings.clone()?;
    let others = series[s].postures.get(row).cloned().unwrap_or_default();
    let origins = state.robot.linear_origins();
    let of = |readings: Vec<f64>| {
        let (posture, zeros) = (Posture::at(&readings), vec![0.0; readings.len()]);
        let mut information = DMatrix::zeros(columns.len(), columns.len());
        let (mut rhs, mut squares) = (DVector::zeros(columns.len()), 0.0);
        for &i in images {
            let pose = free.poses[i].as_ref()?;
            let from = TakenFrom::rigid(&posture, &zeros);
            let chained = state.chained_from(&origins, &problem.layout, &problem.images[i], from)?;
            let by_readings = chained.d_latent.columns(0, readings.len()) * JOINT_SIGMA;
            let noise =
                pose.covariance + Matrix6::from_column_slice((&by_readings * by_readings.transpose()).as_slice());
            let root = noise.cholesky()?.l().try_inverse()?;
            let e = root * (chained.pose.inverse() * pose.camera_from_plate).log();
            let g = root * chained.d_theta.select_columns(columns);
            information += g.tr_mul(&g);
            rhs += g.tr_mul(&e);
            squares += e.norm_squared();
        }
        Some(Candidate { readings, information, rhs, squares })
    };
    let candidates = std::iter::once(own).chain(others).map(of).collect::<Option<Vec<_>>>()?;
    Some(Stop { rows, candidates })
}
