//! The linearised fit stop by stop, and what a change of one body or of the zero of a joint at some stops would explain of it; for
//! [`super::pose_step`].

use std::collections::BTreeSet;
use std::ops::Range;
use std::rc::Rc;

use nalgebra::{DMatrix, DVector};

use super::candidates::{Candidate, Changed, Order, Shown, bracket, fixture};
use crate::assess::{RootInformation, StopInformation, log_chance};
use crate::linalg::{SymmetricFactor, product, symmetric_eigen};
use crate::model::joint_terms::Term;
use crate::problem::{Adjustment, Problem};
use crate::series::CameraMount;
use crate::solve::LinearProblem;

/// One stop.
pub struct Row {
    /// Index of its noise: series that several cameras took at the same stops are one.
    pub(super) group: usize,
    pub(super) shown: Rc<Vec<Shown>>,
    /// Root score.
    score: DVector<f64>,
    by_free: DMatrix<f64>,
    /// Derivatives by all columns.
    by_columns: Rc<DMatrix<f64>>,
}

impl Row {
    fn by(&self, columns: &Range<usize>) -> DMatrix<f64> {
        self.by_columns.columns_range(columns.clone()).into_owned()
    }

    /// What tells of a change.
    pub(super) fn of(&self, problem: &Problem, changed: Changed) -> impl Iterator<Item = Shown> {
        self.shown.iter().copied().filter(move |shown| shown.tells_of(problem, changed))
    }

    /// Squares of what the poses that were seen, or these parts of those of bodies, miss of the readings.
    fn squares(&self, problem: &Problem, part: Part) -> f64 {
        let mut columns = BTreeSet::new();
        for shown in self.shown.iter() {
            for own in shown.between(problem) {
                let all = own.columns(&problem.layout, &[]);
                let turns = all.end.min(all.start + 3);
                match (shown, own, part) {
                    (_, _, Part::Pose) => columns.extend(all),
                    (Shown::Measurement(_), Changed::Target(_), Part::Position) => columns.extend(all.start..turns),
                    (Shown::Measurement(_), Changed::Target(_), Part::Rotation) => columns.extend(turns..all.end),
                    _ => (),
                }
            }
        }
        squares_along(columns.into_iter().map(|c| self.by_columns.column(c).into_owned()), &self.score)
    }
}

/// Squares of a score in the space of some directions, of which some may be those of others together: two bodies seen in one image move alike.
fn squares_along(directions: impl Iterator<Item = DVector<f64>>, score: &DVector<f64>) -> f64 {
    let mut basis: Vec<DVector<f64>> = Vec::new();
    for mut own in directions {
        let least = LEFT * own.norm();
        // Once more for what rounding left.
        for _ in 0..2 {
            basis.iter().for_each(|unit| own.axpy(-unit.dot(&own), unit, 1.0));
        }
        let norm = own.norm();
        if norm > least {
            basis.push(own / norm);
        }
    }
    basis.iter().map(|unit| unit.dot(score).powi(2)).sum()
}

/// What of the poses that were seen is looked at: positions and rotations of a tracker have noise of their own.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Part {
    Pose,
    Position,
    Rotation,
}

/// A change between two parts of the stops.
#[derive(Debug, Clone)]
pub struct Step {
    pub(super) changed: Changed,
    pub(super) order: Order,
    /// Index of the noise of its stops.
    pub(super) group: usize,
    /// Rows of [`Linear`] that it moves, in this order, and by which part of it.
    moved: Vec<(usize, f64)>,
    /// What was measured there.
    pub(super) shown: Vec<Shown>,
    /// Twist of a body, m and rad, its translation alone where nothing tells its rotation, or offset of a reading, rad or m.
    pub(super) change: DVector<f64>,
    /// Its covariance by the joint noise that was estimated without it.
    pub(super) covariance: DMatrix<f64>,
    /// Fall of the cost, `D`.
    pub(super) fall: f64,
    /// How many directions of it are told.
    pub(super) told: usize,
    /// Share of the squares `R` that this and the other steps of its series explain.
    pub(super) share: f64,
    /// True where it, or one that was found after it, explains most of what was left.
    pub(super) explains_most: bool,
    /// Logarithm of the probability that noise alone explains so much, of one candidate.
    pub(super) log_chance: f64,
}

impl Step {
    /// Images that it moves.
    pub(super) fn images(&self) -> Vec<usize> {
        let image = |shown: &Shown| match *shown {
            Shown::Image { index, .. } => Some(index),
            Shown::Measurement(_) => None,
        };
        self.shown.iter().filter_map(image).collect()
    }

    /// Length of three components of the change from one on, and its sigma per axis.
    pub(super) fn size(&self, from: usize) -> (f64, f64) {
        let axes = from..(from + 3).min(self.change.len());
        let axes_count = axes.len() as f64;
        let variance: f64 = axes.clone().map(|k| self.covariance[(k, k)]).sum();
        let square: f64 = axes.map(|k| self.change[k].powi(2)).sum();
        (square.sqrt(), (variance / axes_count).sqrt())
    }

    /// True where it is beyond so many sigmas along each of three axes, whichever point its shift is stated for: `x' C^-1 x`. Not so where
    /// what was found after it took its place.
    pub(super) fn is_beyond(&self, sigmas: f64) -> bool {
        let squares = SymmetricFactor::new(&self.covariance).map(|factor| self.change.dot(&factor.solve(&self.change)));
        let axes = (self.change.len() as f64 / 3.0).max(1.0);
        squares.is_ok_and(|squares| squares > sigmas * sigmas * axes)
    }
}

/// How noise is counted.
#[derive(Debug, Clone, Copy)]
pub struct Chances {
    /// Number of stops that tell together as much as one whose errors are its own.
    pub(super) stops_for_one: f64,
    /// Share of the squares in the direction of a reading from which these count.
    pub(super) share: f64,
}

/// The fit, linearised.
pub struct Linear {
    pub(super) rows: Vec<Row>,
    information: DMatrix<f64>,
    /// Columns of the zeros of readings.
    pub(super) zeros: Vec<Option<usize>>,
    /// The columns that all targets together move, and all sockets, and by how much.
    together: Rc<[DMatrix<f64>; 2]>,
    /// Prior information on the errors of robot, mountings and placements, by free columns; zero elsewhere.
    of_errors: Rc<DMatrix<f64>>,
    /// What every free column is off by from the mean of its prior.
    errors: DVector<f64>,
}

/// What is known of the free columns beforehand.
struct Priors {
    /// Information on several columns together.
    together: DMatrix<f64>,
    /// All information on robot, mountings and placements.
    of_errors: DMatrix<f64>,
    /// What every column is off by from the mean of its prior.
    errors: DVector<f64>,
}

impl Priors {
    fn of(Adjustment { problem, state }: &Adjustment) -> Self {
        let layout = &problem.layout;
        let free: Vec<usize> = (0..layout.len()).filter(|c| layout.columns[*c].free).collect();
        let is_error = |place: usize| free[place] < layout.theta_len();
        let values = state.values(layout);
        let n = free.len();
        let mut together = DMatrix::zeros(n, n);
        for prior in problem.joint_priors() {
            let place = |c: &usize| free.binary_search(c).ok();
            for (i, row) in prior.columns.iter().enumerate() {
                for (k, column) in prior.columns.iter().enumerate() {
                    if let (Some(row), Some(column)) = (place(row), place(column)) {
                        together[(row, column)] += prior.information[(i, k)];
                    }
                }
            }
        }
        let of_errors = DMatrix::from_fn(n, n, |i, k| {
            let own = if i == k { layout.columns[free[i]].prior_sigma.powi(-2) } else { 0.0 };
            if is_error(i) && is_error(k) { own + together[(i, k)] } else { 0.0 }
        });
        let errors = DVector::from_fn(n, |k, _| values[free[k]] - layout.columns[free[k]].prior_mean);
        Self { together, of_errors, errors }
    }
}

impl Linear {
    pub(super) fn of(linear: LinearProblem) -> Self {
        let Adjustment { problem, state } = linear.adjustment;
        let lin = linear.lin;
        let StopInformation { stops: all, mut information, .. } = StopInformation::of(linear);
        let Priors { together: common, of_errors, errors } = Priors::of(linear.adjustment);
        // Without what is known of several columns together a change would free what the fit holds.
        information += common;
        let image = |k: usize| {
            let image = &problem.images[lin.images[k]];
            if state.joint_errors[image.stop].is_empty() || state.ties[lin.images[k]].is_free() {
                return None;
            }
            let camera_from_plate = lin.chains[k].pose;
            let carried = match image.mount {
                CameraMount::Hand => state.placements[image.placement] * camera_from_plate.inverse(),
                CameraMount::Fixed => state.mountings[image.mounting] * camera_from_plate,
            };
            Some(Shown::Image { index: lin.images[k], up: [0, 1, 2].map(|axis| carried.rotation[(2, axis)]) })
        };
        let row = |told: RootInformation| {
            let bodies = told.bodies.into_iter().map(Shown::Measurement);
            let shown: Vec<Shown> = told.places.filter_map(image).chain(bodies).collect();
            let (shown, by_columns) = (Rc::new(shown), Rc::new(told.by_root));
            let group = problem.stops[told.stop].series;
            (!shown.is_empty()).then_some(Row { group, shown, score: told.score, by_free: told.by_free, by_columns })
        };
        let robot = &state.robot;
        let zero = |reading: usize| {
            let mut terms = robot.terms.iter();
            let term = terms.position(|t| t.reading == reading && t.term == Term::Offset)?;
            Some(problem.layout.terms.start + term)
        };
        let zeros = (0..robot.chain.readings.len()).map(zero).collect();
        let together = Rc::new([bracket(linear.adjustment), fixture(linear.adjustment)]);
        let rows = all.into_iter().filter_map(row).collect();
        Self { rows, information, zeros, together, of_errors: Rc::new(of_errors), errors }
    }

    /// The columns that a change of several bodies together moves; none of a single one.
    fn together(&self, changed: Changed) -> Option<&DMatrix<f64>> {
        let [bracket, fixture] = self.together.as_ref();
        match changed {
            Changed::Bracket => Some(bracket),
            Changed::Fixture => Some(fixture),
            _ => None,
        }
    }

    /// How many parameters a change has.
    pub(super) fn parameters(&self, problem: &Problem, changed: Changed) -> usize {
        let own = || changed.columns(&problem.layout, &self.zeros).len();
        self.together(changed).map_or_else(own, DMatrix::ncols)
    }

    /// Derivatives of a row by a change.
    fn by(&self, row: usize, problem: &Problem, changed: Changed) -> DMatrix<f64> {
        let row = &self.rows[row];
        let own = || row.by(&changed.columns(&problem.layout, &self.zeros));
        self.together(changed).map_or_else(own, |moved| product(&row.by_columns, moved))
    }

    /// Squares `R` of what the poses that were seen miss of the readings, by the index of the noise.
    pub(super) fn squares(&self, problem: &Problem, part: Part) -> Vec<f64> {
        let mut of_groups = vec![0.0; problem.noise.joint.len()];
        self.rows.iter().for_each(|row| of_groups[row.group] += row.squares(problem, part));
        of_groups
    }

    /// Number of stops of a series.
    pub(super) fn stops(&self, group: usize) -> usize {
        self.rows.iter().filter(|row| row.group == group).count()
    }

    /// Squares `P` of the errors of robot, mountings and placements over their priors.
    fn prior_squares(&self) -> f64 {
        self.errors.dot(&(self.of_errors.as_ref() * &self.errors))
    }

    /// Squares `R + P`.
    fn all_squares(&self, problem: &Problem) -> f64 {
        self.squares(problem, Part::Pose).iter().sum::<f64>() + self.prior_squares()
    }

    /// Number of free columns.
    pub(super) fn columns(&self) -> usize {
        self.information.ncols()
    }

    /// Squares of what the misfit shows in the direction of a single reading, by the index of the noise and the reading: its own noise.
    pub(super) fn zero_squares(&self, groups: usize) -> Vec<Vec<f64>> {
        let mut all = vec![vec![0.0; self.zeros.len()]; groups];
        for row in &self.rows {
            for (reading, column) in self.zeros.iter().enumerate() {
                let by = column.map(|c| row.by_columns.column(c)).filter(|by| by.norm_squared() > 0.0);
                all[row.group][reading] += by.map_or(0.0, |by| by.dot(&row.score).powi(2) / by.norm_squared());
            }
        }
        all
    }

    /// The step that noise explains least. What it leaves of the squares is counted, not what it should leave: where a fall is none of them, it
    /// explains nothing. `stops_for_one` of them count once. The noise of one joint that has grown with the fault of its zero hides it from the
    /// squares of all: where a step explains this `share` of those in the direction of its reading, `of_zeros`, these count.
    pub(super) fn best(
        &self,
        problem: &Problem,
        tried: &[Candidate],
        of_zeros: &[Vec<f64>],
        chances: Chances,
    ) -> Option<Step> {
        let Chances { stops_for_one, share } = chances;
        let covariance = SymmetricFactor::new(&self.information).ok()?.inverse();
        let squares = self.all_squares(problem);
        let chance = |explained: f64, squares: f64, told| log_chance(explained, squares / stops_for_one, told);
        let mut best =
            self.least(problem, tried.iter(), &covariance, |fall| chance(fall.cost / squares, squares, fall.told))?;
        let (next, _) = self.with(problem, &best)?;
        best.log_chance = self.log_chance_of(problem, &next, best.told, chances);
        for (group, of_readings) in of_zeros.iter().enumerate() {
            for (reading, own) in of_readings.iter().enumerate() {
                let is_own = |c: &&Candidate| c.group == group && c.changed == Changed::Zero(reading);
                let tried = tried.iter().filter(is_own);
                let Some(mut step) = self.least(problem, tried, &covariance, |fall| -fall.cost) else { continue };
                if step.fall <= share * own {
                    continue;
                }
                let Some((next, _)) = self.with(problem, &step) else { continue };
                let left = next.zero_squares(of_zeros.len())[group][reading];
                step.log_chance = chance(1.0 - left / own, *own, 1);
                if step.log_chance < best.log_chance {
                    best = step;
                }
            }
        }
        Some(best)
    }

    /// Logarithm of the probability that noise alone leaves as little as is left `after` changes along so many directions.
    pub(super) fn log_chance_of(&self, problem: &Problem, after: &Self, told: usize, chances: Chances) -> f64 {
        let squares = self.all_squares(problem);
        log_chance(1.0 - after.all_squares(problem) / squares, squares / chances.stops_for_one, told)
    }

    /// The step that explains most.
    pub(super) fn most(&self, problem: &Problem, tried: &[Candidate]) -> Option<Step> {
        let covariance = SymmetricFactor::new(&self.information).ok()?.inverse();
        self.least(problem, tried.iter(), &covariance, |fall| -fall.cost)
    }

    /// The step of which `score` is least; where several are alike, the first.
    fn least<'a>(
        &self,
        problem: &Problem,
        tried: impl Iterator<Item = &'a Candidate>,
        covariance: &DMatrix<f64>,
        score: impl Fn(&Fall) -> f64,
    ) -> Option<Step> {
        let (coarse, ..) = self.least_of(problem, tried, covariance, &score)?;
        let finer = coarse.neighbours();
        let (candidate, log_chance, fall) = self.least_of(problem, finer.iter(), covariance, &score)?;
        let moved: Vec<(usize, f64)> = candidate.moved().collect();
        let shown = moved.iter().flat_map(|(r, _)| self.rows[*r].of(problem, candidate.changed)).collect();
        let Candidate { changed, order, group, .. } = *candidate;
        let Fall { cost, change, covariance, told } = fall;
        Some(Step {
            changed,
            order,
            group,
            moved,
            shown,
            change,
            covariance,
            fall: cost,
            told,
            share: 0.0,
            explains_most: false,
            log_chance,
        })
    }

    /// The candidate with the least score, this, and what it explains.
    fn least_of<'a>(
        &self,
        problem: &Problem,
        tried: impl Iterator<Item = &'a Candidate>,
        covariance: &DMatrix<f64>,
        score: impl Fn(&Fall) -> f64,
    ) -> Option<(&'a Candidate, f64, Fall)> {
        let mut best: Option<(&Candidate, f64, Fall)> = None;
        let mut sums = Sums::new(self.columns(), 0);
        let mut before: Option<&Candidate> = None;
        for candidate in tried {
            let changed = candidate.changed;
            let add = |sums: &mut Sums, r: usize, part: f64| {
                sums.add(&self.rows[r], &(self.by(r, problem, changed) * part));
            };
            // Behind a step are the rows behind the one before it, and those between both.
            if let Some(last) = before.filter(|b| Rc::ptr_eq(&b.rows, &candidate.rows) && b.from > candidate.from) {
                let between = &candidate.rows[candidate.from..last.from];
                between.iter().for_each(|r| add(&mut sums, *r, 1.0));
            } else {
                sums = Sums::new(self.columns(), self.parameters(problem, changed));
                candidate.moved().for_each(|(r, part)| add(&mut sums, r, part));
            }
            before = Some(candidate);
            let Some(fall) = sums.fall(covariance).filter(|fall| fall.told >= changed.least_told()) else { continue };
            let score = score(&fall);
            if best.as_ref().is_none_or(|(_, least, _)| score < *least) {
                best = Some((candidate, score, fall));
            }
        }
        best
    }

    /// With the change as more columns, at the optimum; and the way there.
    pub(super) fn with(&self, problem: &Problem, step: &Step) -> Option<(Self, DVector<f64>)> {
        let (n, more) = (self.columns(), self.parameters(problem, step.changed));
        let mut information = self.information.clone().resize(n + more, n + more, 0.0);
        let mut gradient = DVector::zeros(n + more);
        let mut derivatives = Vec::with_capacity(self.rows.len());
        for (r, row) in self.rows.iter().enumerate() {
            let mut by_free = row.by_free.clone().resize_horizontally(n + more, 0.0);
            if let Some((_, part)) = step.moved.iter().find(|(moved, _)| *moved == r) {
                let own = self.by(r, problem, step.changed) * *part;
                by_free.columns_mut(n, more).copy_from(&own);
                let coupling = by_free.tr_mul(&own);
                let mut right = information.columns_mut(n, more);
                right += &coupling;
                let mut below = information.view_mut((n, 0), (more, n));
                below += coupling.rows(0, n).transpose();
                let mut rest = gradient.rows_mut(n, more);
                rest += own.tr_mul(&row.score);
            }
            derivatives.push(by_free);
        }
        // Directions of the change that are not told stay where they are.
        (n..n + more).for_each(|k| information[(k, k)] *= 1.0 + LEFT);
        let step = SymmetricFactor::new(&information).ok()?.solve(&gradient);
        let rows = (self.rows.iter().zip(derivatives))
            .map(|(row, by_free)| Row {
                group: row.group,
                shown: row.shown.clone(),
                score: &row.score - &by_free * &step,
                by_free,
                by_columns: row.by_columns.clone(),
            })
            .collect();
        let (zeros, together, of_errors) = (self.zeros.clone(), self.together.clone(), self.of_errors.clone());
        let errors = DVector::from_fn(self.errors.len(), |k, _| self.errors[k] + step[k]);
        Some((Self { rows, information, zeros, together, of_errors, errors }, step))
    }
}

/// Sums over the stops that a change moves.
struct Sums {
    score: DVector<f64>,
    own: DMatrix<f64>,
    coupling: DMatrix<f64>,
}

/// Fall of the cost, what changed, its covariance, and how many directions of it are told.
struct Fall {
    cost: f64,
    change: DVector<f64>,
    covariance: DMatrix<f64>,
    told: usize,
}

/// Share of what a change moves by itself that must be left of a direction beside all columns: the pose of a plate that stands in one
/// series alone takes up the zero of the first joint to the last digit.
const LEFT: f64 = 1e-6;

impl Sums {
    fn new(columns: usize, parameters: usize) -> Self {
        Self {
            score: DVector::zeros(parameters),
            own: DMatrix::zeros(parameters, parameters),
            coupling: DMatrix::zeros(columns, parameters),
        }
    }

    fn add(&mut self, row: &Row, by: &DMatrix<f64>) {
        self.score += by.tr_mul(&row.score);
        self.own += by.tr_mul(by);
        self.coupling += row.by_free.tr_mul(by);
    }

    fn fall(&self, covariance: &DMatrix<f64>) -> Option<Fall> {
        let left = &self.own - self.coupling.tr_mul(&product(covariance, &self.coupling));
        let unit = self.own.diagonal().map(f64::sqrt);
        let inverse = unit.map(|u| if u > 0.0 { u.recip() } else { 0.0 });
        let (values, directions) = symmetric_eigen(&DMatrix::from_fn(left.nrows(), left.ncols(), |i, k| {
            left[(i, k)] * inverse[i] * inverse[k]
        }))?;
        let told = values.iter().filter(|v| **v > LEFT).count();
        let by_value = values.map(|v| if v > LEFT { v.recip() } else { 0.0 });
        let scaled = DMatrix::from_diagonal(&inverse) * directions;
        let covariance = &scaled * DMatrix::from_diagonal(&by_value) * scaled.transpose();
        let change = &covariance * &self.score;
        Some(Fall { cost: self.score.dot(&change), change, covariance, told })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::assess::Limits;

    fn along(directions: &[[f64; 3]], score: [f64; 3]) -> f64 {
        squares_along(directions.iter().map(|d| DVector::from_row_slice(d)), &DVector::from_row_slice(&score))
    }

    /// Two cameras that miss one plate in opposite directions: the plate tells nothing of it, and the cameras do not count twice with it.
    #[test]
    fn what_two_cameras_contradict_each_other_by_is_counted_once() {
        let plate = [1.0, 1.0, 0.0];
        let cameras = [[2.0, 0.0, 0.0], [0.0, 3.0, 0.0]];
        let score = [2.0, -2.0, 5.0];
        assert!(along(&[plate], score).abs() < 1e-12);
        assert!((along(&cameras, score) - 8.0).abs() < 1e-12);
        assert!((along(&[plate, cameras[0], cameras[1]], score) - 8.0).abs() < 1e-12);
        assert_eq!(along(&[[0.0; 3]], score), 0.0);
    }

    fn step(change: &[f64], sigmas: &[f64]) -> Step {
        let variances = DVector::from_row_slice(sigmas).map(|sigma| sigma * sigma);
        Step {
            changed: Changed::Instrument(0),
            order: Order::Time,
            group: 0,
            moved: Vec::new(),
            shown: Vec::new(),
            change: DVector::from_row_slice(change),
            covariance: DMatrix::from_diagonal(&variances),
            fall: 0.0,
            told: change.len(),
            share: 0.0,
            explains_most: false,
            log_chance: 0.0,
        }
    }

    /// Noise alone makes a shift along three axes of 1.6 sigmas.
    #[test]
    fn a_step_within_its_own_sigma_is_none() {
        let sigmas = [1.01e-3, 1.01e-3, 1.01e-3, 0.49e-3, 0.49e-3, 0.49e-3];
        let most = Limits::default().displaced_sigmas;
        assert!(!step(&[2.41e-3, 0.0, 0.0, 0.55e-3, 0.0, 0.0], &sigmas).is_beyond(most));
        assert!(step(&[2.41e-3, 0.0, 0.0, 0.0, 2e-3, 0.0], &sigmas).is_beyond(most));
        assert!(step(&[-1.5e-3], &[0.1e-3]).is_beyond(most) && !step(&[0.2e-3], &[0.1e-3]).is_beyond(most));
        // A tracker 3 m from what it sees: to turn it by 0.06 mrad shifts by 0.19 mm, and a shift by itself is known to a few hundredths.
        let mut far = step(&[0.3e-3, 0.0, 0.0, 0.0, 0.0, 0.0], &[0.19e-3, 0.19e-3, 0.19e-3, 0.06e-3, 0.06e-3, 0.06e-3]);
        far.covariance[(0, 4)] = 0.99 * 0.19e-3 * 0.06e-3;
        far.covariance[(4, 0)] = far.covariance[(0, 4)];
        assert!(far.is_beyond(most));
    }
}
