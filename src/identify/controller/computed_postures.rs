//! Which posture every pose of a controller means, by what was seen at its stop: images, and bodies on the tip.
//!
//! A pose is reached in up to eight postures. The nominal robot is at the same place in all of them, the real one is not: with the derivatives
//! `G_ic` of the camera pose, or of a body as a tracker sees it, at posture `c` of stop `i`, and `e_i` from the nominal one to that which was seen, wanted
//! are the parameters `x` and the choice with the least
//!
//! ```text
//! sum_i min_c (e_i - G_ic x)' V_ic^-1 (e_i - G_ic x) + x' P^-1 x
//! ```
//!
//! `x` is fitted to a choice and the choice made by `x` in turns (S. Lloyd 1957), from the postures nearest to those before, from random ones, and
//! from those of a beam search (B. Lowerre 1976) that takes stop after stop in, forwards and backwards; then every stop takes the posture that all
//! others predict best, in turns. Where the axes of a wrist meet, all stops with the wrist turned over are a robot as likely as the first: the
//! images do not tell which.

use std::borrow::Cow;
use std::collections::{BTreeMap, BTreeSet};

use nalgebra::{DMatrix, DVector};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use crate::assess::Limits;
use crate::diagnose::ComputedPostures;
use crate::error::Result;
use crate::fit::FreePoses;
use crate::identify::bodies::start::start_bodies;
use crate::identify::photogrammetry::free_poses::free_poses_of;
use crate::identify::problem::build::build;
use crate::identify::start::robot::{StartGiven, start_robot};
use crate::linalg::{SymmetricFactor, dense};
use crate::model::robot::{LinearOrigins, Posture, Robot};
use crate::problem::{Adjustment, Chained, MeasuredSeries, Problem, State, TakenFrom};
use crate::stage::stage;

/// Noise of the readings of the stops that are compared, rad or m.
const JOINT_SIGMA: f64 = 1e-4;
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

/// The robot at its start beside free camera poses: what stops are compared by.
pub(super) struct Compared {
    pub adjustment: Adjustment,
    free: FreePoses,
    columns: Vec<usize>,
    /// Prior information of the parameters.
    pub prior: DVector<f64>,
    pub stops: Vec<SeenAt>,
}

/// What was seen at a stop.
#[derive(Debug, Clone, Default)]
pub(super) struct SeenAt {
    stop: usize,
    /// Images by their indices.
    pub images: Vec<usize>,
    /// Measurements of bodies by their indices.
    bodies: Vec<usize>,
}

impl SeenAt {
    /// What images alone saw; `None` where there is none.
    pub fn by_images(&self) -> Option<Self> {
        (!self.images.is_empty()).then(|| Self { bodies: Vec::new(), ..self.clone() })
    }
}

impl Compared {
    /// What is `found` with series of which some have readings that were computed from poses; `None` where all were read. `hold` holds the columns
    /// that are not to be fitted.
    pub fn with<T>(
        stage_name: &'static str,
        robot: &Robot,
        (series, limits): (&[MeasuredSeries], &Limits),
        hold: impl FnOnce(&mut Adjustment) -> Result<()>,
        found: impl FnOnce(&Self) -> Option<T>,
    ) -> Option<T> {
        if !series.iter().any(MeasuredSeries::readings_are_computed) {
            return None;
        }
        let _stage = stage(stage_name);
        found(&Self::of(robot, series, limits, hold)?)
    }

    fn of(
        robot: &Robot,
        series: &[MeasuredSeries],
        limits: &Limits,
        hold: impl FnOnce(&mut Adjustment) -> Result<()>,
    ) -> Option<Self> {
        let has_images = series.iter().any(|s| s.stops.iter().any(|stop| !stop.observations.is_empty()));
        let (mut adjustment, free, mut verdicts) = match has_images {
            true => free_poses_of(robot, series, limits, hold).ok()?,
            false => {
                let mut start = build(robot, series, false, limits).ok()?;
                hold(&mut start).ok()?;
                let free = FreePoses::none(start.state.clone());
                (start, free, Vec::new())
            }
        };
        start_robot(&mut adjustment, &free, StartGiven::of(series, limits), &mut verdicts).ok()?;
        // Where they do not fit, the joint fit says why, and the images tell by themselves.
        let bodies_fit = start_bodies(&mut adjustment, series, limits).is_ok();
        let layout = &adjustment.problem.layout;
        let columns: Vec<usize> = (0..layout.theta_len()).filter(|&c| layout.columns[c].free).collect();
        let prior = columns.iter().map(|&c| layout.columns[c].prior_sigma.powi(-2));
        let prior = DVector::from_iterator(columns.len(), prior);
        let mut by_stop: BTreeMap<usize, SeenAt> = BTreeMap::new();
        for i in adjustment.problem.used_on_robot() {
            by_stop.entry(adjustment.problem.images[i].stop).or_default().images.push(i);
        }
        for (k, measured) in adjustment.problem.used_bodies().filter(|_| bodies_fit) {
            by_stop.entry(measured.stop).or_default().bodies.push(k);
        }
        let stops = by_stop.into_iter().map(|(stop, seen)| SeenAt { stop, ..seen }).collect();
        Some(Self { adjustment, free, columns, prior, stops })
    }

    /// `V^-1/2 G` and `V^-1/2 e` of what was seen at a stop at some readings, by the unknowns of a state.
    pub fn seen_at(
        &self,
        (state, origins): (&State, &LinearOrigins),
        seen: &SeenAt,
        readings: &[f64],
    ) -> Option<(DMatrix<f64>, DVector<f64>)> {
        let problem = &self.adjustment.problem;
        let read = problem.stops[seen.stop].posture.as_ref()?;
        let (posture, zeros) = (approached(read, readings), vec![0.0; readings.len()]);
        let from = || TakenFrom::rigid(&posture, &zeros);
        let of_image = |&i: &usize| {
            let pose = self.free.poses[i].as_ref()?;
            let chained = state.chained_from(origins, &problem.layout, &problem.images[i], from())?;
            let e = (chained.pose.inverse() * pose.camera_from_plate).log();
            let noise = dense(&pose.covariance);
            self.whitened(&chained, DMatrix::identity(6, 6), (DVector::from_column_slice(e.as_slice()), noise))
        };
        let of_body = |&k: &usize| {
            let measured = &problem.body_measurements[k];
            let chained = state.body_chained(origins, &problem.layout, measured, from())?;
            let (e, by_pose) = measured.residual(&chained.pose);
            let count = measured.seen.coordinates();
            let by_pose = DMatrix::from_fn(count, 6, |row, column| by_pose[(row, column)]);
            let sigma = |row: usize| if row < 3 { measured.sigma_m } else { measured.sigma_rad };
            let noise = DMatrix::from_diagonal(&DVector::from_fn(count, |row, _| sigma(row).powi(2)));
            self.whitened(&chained, by_pose, (DVector::from_fn(count, |row, _| e[row]), noise))
        };
        let all = seen.images.iter().map(of_image).chain(seen.bodies.iter().map(of_body));
        let (g, e): (Vec<_>, Vec<_>) = all.collect::<Option<Vec<_>>>()?.into_iter().unzip();
        let rows: Vec<_> = g.iter().flat_map(DMatrix::row_iter).collect();
        (!rows.is_empty())
            .then(|| (DMatrix::from_rows(&rows), DVector::from_vec(e.iter().flatten().copied().collect())))
    }

    /// Of a residual that depends on a pose, with the noise of what was seen and that of the readings.
    fn whitened(
        &self,
        chained: &Chained,
        by_pose: DMatrix<f64>,
        (e, noise): (DVector<f64>, DMatrix<f64>),
    ) -> Option<(DMatrix<f64>, DVector<f64>)> {
        let by_readings = &by_pose * &chained.d_latent * JOINT_SIGMA;
        let root = (noise + &by_readings * by_readings.transpose()).cholesky()?.l().try_inverse()?;
        Some((&root * by_pose * chained.d_theta.select_columns(&self.columns), root * e))
    }
}

/// What was seen at a stop says of one of its postures.
struct Candidate {
    readings: Vec<f64>,
    /// `V^-1/2 G` and `V^-1/2 e` of all that was seen there.
    g: DMatrix<f64>,
    e: DVector<f64>,
}

impl Candidate {
    fn equations(&self) -> (&DMatrix<f64>, &DVector<f64>) {
        (&self.g, &self.e)
    }
}

/// A stop whose pose was read.
struct Stop {
    /// Series and row of everything that was seen there.
    rows: Vec<(usize, usize)>,
    /// The first is that of the series as it stands.
    candidates: Vec<Candidate>,
    /// `G' V^-1/2` of all candidates side by side.
    across: DMatrix<f64>,
}

/// A choice of postures that no single stop would change.
#[derive(Clone, PartialEq)]
struct Choice {
    postures: Vec<usize>,
    cost: f64,
}

/// The choice that is taken.
struct Chosen {
    postures: Vec<usize>,
    /// Whether other choices at many stops together are as good.
    is_open: bool,
    /// Stops that are as good in another posture by themselves.
    undecided: usize,
}

/// The stops, and the prior information of the parameters.
struct Stops {
    all: Vec<Stop>,
    prior: DVector<f64>,
}

/// What the postures of a series are before they are told.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::identify) enum Before {
    /// Those nearest to the stops before.
    Nearest,
    /// Those of a fit, nearly all of them right.
    Fitted,
}

/// The series with the postures that images and bodies tell; unchanged where readings were read. `hold` holds the columns that are not to be fitted.
pub(in crate::identify) fn told_by_seen<'a>(
    robot: &Robot,
    (series, from): (&'a [MeasuredSeries], Before),
    limits: &Limits,
    hold: impl FnOnce(&mut Adjustment) -> Result<()>,
) -> (Cow<'a, [MeasuredSeries]>, Option<ChosenPostures>) {
    let found = Compared::with("postures", robot, (series, limits), hold, |compared| {
        let stops = Stops::of(compared, series)?;
        let chosen = stops.chosen(from, limits)?;
        Some((stops, chosen))
    });
    let Some((stops, chosen)) = found else { return (Cow::Borrowed(series), None) };
    let mut told = series.to_vec();
    let mut changed = 0;
    for (stop, &c) in stops.all.iter().zip(&chosen.postures).filter(|(_, c)| **c > 0) {
        for &(s, row) in &stop.rows {
            let MeasuredSeries { stops, postures, .. } = &mut told[s];
            let before = stops[row].readings.replace(stop.candidates[c].readings.clone());
            if let Some((other, before)) = postures.get_mut(row).and_then(|own| own.get_mut(c - 1)).zip(before) {
                *other = before;
            }
        }
        changed += 1;
    }
    let count = stops.all.iter().filter(|stop| series[stop.rows[0].0].readings_are_computed()).count();
    (
        Cow::Owned(told),
        Some(ChosenPostures { stops: count, changed, is_open: chosen.is_open, undecided: chosen.undecided }),
    )
}

/// What was told of the postures.
#[derive(Debug, Clone, Copy)]
pub(in crate::identify) struct ChosenPostures {
    /// Stops whose poses were read.
    pub stops: usize,
    /// Stops that are in another posture now.
    pub changed: usize,
    /// Whether other choices at many stops together are as good.
    pub is_open: bool,
    /// Stops that fit as well in another posture, the others as they are.
    pub undecided: usize,
}

impl ChosenPostures {
    /// What is to be said where the series were `given` and are `told` now.
    pub fn finding(&self, given: &[MeasuredSeries], told: &[MeasuredSeries]) -> ComputedPostures {
        // Cameras at the same stops say it once.
        let mut stops: BTreeSet<(&str, usize)> = BTreeSet::new();
        let mut others: Vec<String> = Vec::new();
        for (given, told) in given.iter().zip(told) {
            let run = given.run.as_deref().unwrap_or(&given.name);
            let turned = given.stops.iter().zip(&told.stops).filter(|(g, t)| g.readings != t.readings);
            others.extend(turned.filter(|(g, _)| stops.insert((run, g.row))).map(|(g, _)| g.image.clone()));
        }
        let series = given.iter().filter(|s| s.readings_are_computed()).map(|s| s.name.clone()).collect();
        ComputedPostures { series, stops: self.stops, others, is_open: self.is_open, undecided: self.undecided }
    }
}

impl Stops {
    fn of(compared: &Compared, series: &[MeasuredSeries]) -> Option<Self> {
        let of = |seen: &SeenAt| stop(compared, series, seen);
        let all: Vec<Stop> = compared.stops.par_iter().filter_map(of).collect();
        (!all.is_empty()).then_some(Self { all, prior: compared.prior.clone() })
    }

    /// The best choice, of those that are as good the one with most postures as they are, from those of a fit the one nearest to it, unless
    /// another is clearly better; and what others are as good.
    fn chosen(&self, from: Before, limits: &Limits) -> Option<Chosen> {
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
                let factor = known.factor()?;
                let x = factor.solve(&known.rhs);
                let so_far = known.squares - known.rhs.dot(&x);
                let costs = stop.predicted_by(&factor, &x)?;
                Some(costs.into_iter().enumerate().map(move |(c, cost)| (so_far + cost, k, c)).collect::<Vec<_>>())
            };
            let grown: Vec<Option<Vec<(f64, usize, usize)>>> = kept.par_iter().enumerate().map(next).collect();
            let mut grown: Vec<(f64, usize, usize)> = grown.into_iter().flatten().flatten().collect();
            grown.sort_by(|a, b| a.0.total_cmp(&b.0));
            grown.truncate(width);
            let with = |&(_, k, c): &(f64, usize, usize)| {
                let (mut postures, mut known) = kept[k].clone();
                postures[s] = c;
                known.add(stop.candidates[c].equations(), 1.0);
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
            known.add(stop.candidates[c].equations(), -1.0);
            let costs = stop.predicted(&known)?;
            let is_as_good = |(k, cost): (usize, &f64)| k != c && *cost <= costs[c] + as_good;
            count += usize::from(costs.iter().enumerate().any(is_as_good));
            known.add(stop.candidates[c].equations(), 1.0);
        }
        Some(count)
    }

    /// What a choice says of the parameters.
    fn told_by(&self, postures: &[usize]) -> Knowledge {
        let mut known = Knowledge::of_priors(&self.prior);
        self.all.iter().zip(postures).for_each(|(stop, &c)| known.add(stop.candidates[c].equations(), 1.0));
        known
    }

    /// With its cost.
    fn choice(&self, postures: Vec<usize>) -> Option<Choice> {
        let known = self.told_by(&postures);
        let x = known.factor()?.solve(&known.rhs);
        Some(Choice { postures, cost: known.squares - known.rhs.dot(&x) })
    }

    /// Fits and chooses in turns.
    fn settled(&self, mut postures: Vec<usize>) -> Option<Choice> {
        for _ in 0..TURNS {
            let known = self.told_by(&postures);
            let x = known.factor()?.solve(&known.rhs);
            let next: Vec<usize> = self.all.iter().map(|s| s.nearest(&x)).collect();
            if next == postures {
                return Some(Choice { postures, cost: known.squares - known.rhs.dot(&x) });
            }
            postures = next;
        }
        None
    }

    /// Every stop in the posture that all others predict best, in turns.
    fn descended(&self, mut postures: Vec<usize>) -> Option<Choice> {
        let mut known = self.told_by(&postures);
        for _ in 0..TURNS {
            let mut is_changed = false;
            for (stop, c) in self.all.iter().zip(&mut postures) {
                known.add(stop.candidates[*c].equations(), -1.0);
                let costs = stop.predicted(&known)?;
                let best = (0..costs.len()).min_by(|&a, &b| costs[a].total_cmp(&costs[b])).unwrap_or(*c);
                if costs[best] < costs[*c] {
                    *c = best;
                    is_changed = true;
                }
                known.add(stop.candidates[*c].equations(), 1.0);
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
            known.add(stop.candidates[*c].equations(), -1.0);
            let costs = stop.predicted(&known)?;
            if costs[0] <= costs[*c] + as_good {
                *c = 0;
            }
            known.add(stop.candidates[*c].equations(), 1.0);
        }
        Some(postures)
    }
}

/// Normal equations of the parameters.
#[derive(Clone)]
pub(super) struct Knowledge {
    information: DMatrix<f64>,
    pub rhs: DVector<f64>,
    pub squares: f64,
}

impl Knowledge {
    pub fn of_priors(prior: &DVector<f64>) -> Self {
        let n = prior.len();
        Self { information: DMatrix::from_diagonal(prior), rhs: DVector::zeros(n), squares: 0.0 }
    }

    /// Takes a posture of a stop in, or by a weight of -1 out again.
    pub fn add(&mut self, (g, e): (&DMatrix<f64>, &DVector<f64>), weight: f64) {
        self.information.gemm(weight, &g.transpose(), g, 1.0);
        self.rhs.gemv_tr(weight, g, e, 1.0);
        self.squares += weight * e.norm_squared();
    }

    pub fn factor(&self) -> Option<SymmetricFactor> {
        let mut n = self.information.clone();
        let held = HELD * n.diagonal().max();
        (0..n.nrows()).for_each(|k| n[(k, k)] += held);
        SymmetricFactor::new(&n).ok()
    }
}

impl Stop {
    fn nearest(&self, x: &DVector<f64>) -> usize {
        let costs: Vec<f64> = self.candidates.iter().map(|c| (&c.e - &c.g * x).norm_squared()).collect();
        (0..costs.len()).min_by(|&a, &b| costs[a].total_cmp(&costs[b])).unwrap_or(0)
    }

    /// What every posture adds to the cost of the other stops: with `r = e - G x` and `W = 1 + G N^-1 G'` by their `x` and `N`, `r' W^-1 r`.
    fn predicted(&self, others: &Knowledge) -> Option<Vec<f64>> {
        let factor = others.factor()?;
        self.predicted_by(&factor, &factor.solve(&others.rhs))
    }

    fn predicted_by(&self, factor: &SymmetricFactor, x: &DVector<f64>) -> Option<Vec<f64>> {
        let solved = factor.solve_many(&self.across);
        let cost = |(c, Candidate { g, e, .. }): (usize, &Candidate)| {
            let mut w = DMatrix::identity(e.len(), e.len());
            w.gemm(1.0, g, &solved.columns(c * e.len(), e.len()), 1.0);
            let r = e - g * x;
            Some(r.dot(&w.cholesky()?.solve(&r)))
        };
        self.candidates.iter().enumerate().map(cost).collect()
    }
}

/// What was seen at one stop says of its postures.
fn stop(compared: &Compared, series: &[MeasuredSeries], seen: &SeenAt) -> Option<Stop> {
    let Adjustment { problem, state } = &compared.adjustment;
    let rows = rows_of(problem, series, seen);
    let &(s, row) =
        rows.iter().find(|(s, row)| series[*s].postures.get(*row).is_some_and(|p| !p.is_empty())).or(rows.first())?;
    let own = series[s].stops[row].readings.clone()?;
    let others = series[s].postures.get(row).cloned().unwrap_or_default();
    let origins = state.robot.linear_origins();
    let of = |readings: Vec<f64>| {
        let (g, e) = compared.seen_at((state, &origins), seen, &readings)?;
        Some(Candidate { readings, g, e })
    };
    let candidates = std::iter::once(own).chain(others).map(of).collect::<Option<Vec<_>>>()?;
    let rows_of_g: Vec<_> = candidates.iter().flat_map(|c| c.g.row_iter()).collect();
    let across = DMatrix::from_rows(&rows_of_g).transpose();
    Some(Stop { rows, candidates, across })
}

/// Series and row of a stop, for every camera of its run.
fn rows_of(problem: &Problem, series: &[MeasuredSeries], seen: &SeenAt) -> Vec<(usize, usize)> {
    let of_image = |i: &usize| {
        let image = &problem.images[*i];
        Some((image.series, series[image.series].stops.iter().position(|s| s.image == image.name)?))
    };
    let of_body = |k: &usize| Some(problem.body_measurements[*k].read);
    let first = seen.images.iter().find_map(of_image).or_else(|| seen.bodies.iter().find_map(of_body));
    let Some((s, row)) = first else { return Vec::new() };
    let run = |s: usize| series[s].run.as_deref().unwrap_or(&series[s].name);
    let place = series[s].stops[row].row;
    let own = (0..series.len()).filter(|&other| run(other) == run(s));
    own.filter_map(|k| Some((k, series[k].stops.iter().position(|stop| stop.row == place)?))).collect()
}

/// A stop in another posture than that in which it was `read`, reached from the same stop before.
fn approached(read: &Posture, readings: &[f64]) -> Posture {
    let from_there = |approach: &Vec<f64>| {
        let before = read.readings.iter().zip(approach).map(|(q, a)| q - a);
        readings.iter().zip(before).map(|(q, before)| q - before).collect()
    };
    Posture { readings: readings.to_vec(), approach: read.approach.as_ref().map(from_there) }
}
