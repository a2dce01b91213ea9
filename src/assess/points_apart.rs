//! Measured points that do not belong with the others: single ones, or all from some row on.

use nalgebra::{DMatrix, DVector, Matrix3, Matrix3xX, Matrix6, Vector3, Vector6};

use super::Limits;
use super::points::{Derivatives, MeasuredPoint, PointFit, by_frame_and_reflector, fit_points, freedom, held_weakly};
use super::statistics::log_chance;
use super::usual_errors::usual_errors;
use crate::linalg::{SymmetricFactor, median};
use crate::model::joint_terms::Term;
use crate::model::robot::Robot;

/// Points that miss by far more than the others.
#[derive(Debug, Clone, PartialEq)]
pub struct OddPoints {
    /// Their indices.
    pub points: Vec<usize>,
    /// How far each is from where the others put it, m.
    pub off_m: Vec<f64>,
    /// The fit of the others.
    pub without: PointFit,
    /// Those of them that no error of a robot explains: wrong points, or wrong readings.
    pub wrong: Vec<usize>,
}

impl OddPoints {
    /// True where leaving them out explains more than `displaced_share` of the squares that a step leaves.
    pub fn explain(&self, moved: &DeviceMoved, limits: &Limits) -> bool {
        (self.without.rms_m / moved.rms_m).powi(2) < 1.0 - limits.displaced_share
    }
}

/// Points that are more than `set_aside_factor` times what is usual, and more than `displaced_m`, from where the others put them, with the fit of
/// these: least squares over what is left, the farthest left out first, until it is the same. `None` where there is none, or more than a fifth. Usual is the median of the others
/// together with what the model is stated to miss at the point, m (`stated_m`, of every point; empty where nothing is stated).
pub fn odd_points(robot: &Robot, points: &[MeasuredPoint], stated_m: &[f64], limits: &Limits) -> Option<OddPoints> {
    let beside = |odd: &[usize]| Beside::these(robot, points, odd, (stated_m, limits));
    let mut odd: Vec<usize> = Vec::new();
    let mut fit = beside(&odd)?;
    // Of few points one draws the fit along, and makes much usual: it may be seen only once it is left out.
    if fit.beyond.is_empty() {
        odd.push(fit.farthest()?);
        let left_out = beside(&odd)?;
        let squares = [&fit, &left_out].map(|beside| beside.without.squares());
        if !left_out.beyond.contains(&odd[0]) || !is_no_chance(squares, points.len(), limits) {
            return None;
        }
        fit = left_out;
    }
    // They only grow in number, and only fall then, so that it ends.
    loop {
        let all = fit.with_the_farthest(&odd);
        if all.len() * limits.touches_for_one_left_out > points.len() {
            return None;
        }
        if all == odd {
            break;
        }
        fit = beside(&all)?;
        odd = all;
    }
    while let Some((fewer, of_fewer)) = fit.without_the_good(&odd, beside) {
        (odd, fit) = (fewer, of_fewer);
    }
    if odd.is_empty() {
        return None;
    }
    let off_m = odd.iter().map(|k| fit.off_m[*k]).collect();
    let wrong = wrong_points(robot, points, (&odd, &fit.without), limits).unwrap_or_default();
    Some(OddPoints { points: odd, off_m, without: fit.without, wrong })
}

/// True where squares that a point leaves in and left out are no chance, of so many points of which each could be the one.
fn is_no_chance([with, without]: [f64; 2], points: usize, limits: &Limits) -> bool {
    let most = limits.displaced_false_alarms.ln() - (points as f64).ln();
    log_chance((with - without) / with, freedom(points), POINT) <= most
}

/// Share of what the farthest is off below which a point may only be drawn along by it.
const DRAWN_ALONG: f64 = 0.8;
/// The same of markers: size and shape of a plate are drawn along with them.
pub const MARKERS_DRAWN_ALONG: f64 = 0.5;

/// Those that no other draws along, each with what it is off, by their share of what the farthest is off.
pub fn farthest<T>(off: impl Iterator<Item = (T, f64)> + Clone, drawn_along: f64) -> impl Iterator<Item = T> {
    let most = off.clone().map(|(_, off)| off).fold(0.0, f64::max);
    off.filter(move |(_, off)| *off > drawn_along * most).map(|(of, _)| of)
}

/// All points beside the fit of some.
struct Beside {
    without: PointFit,
    /// How far each is from where it puts them, m.
    off_m: Vec<f64>,
    /// Those that are farther than is usual.
    beyond: Vec<usize>,
}

impl Beside {
    /// The fit of all but these.
    fn these(
        robot: &Robot,
        points: &[MeasuredPoint],
        left_out: &[usize],
        (stated_m, limits): (&[f64], &Limits),
    ) -> Option<Self> {
        let kept: Vec<MeasuredPoint> =
            points.iter().enumerate().filter(|(k, _)| !left_out.contains(k)).map(|(_, p)| p.clone()).collect();
        let without = fit_points(robot, &kept)?;
        let usual = median(without.residuals_m.iter().map(Vector3::norm).collect::<Vec<_>>())?;
        let bound = |k: usize| {
            let usual = usual.hypot(stated_m.get(k).copied().unwrap_or_default());
            (limits.set_aside_factor * usual).max(limits.displaced_m)
        };
        let off_m: Vec<f64> = points.iter().map(|p| without.residual_m(robot, p).norm()).collect();
        let beyond = (0..points.len()).filter(|k| off_m[*k] > bound(*k)).collect();
        Some(Self { without, off_m, beyond })
    }

    /// The point that is farthest off.
    fn farthest(&self) -> Option<usize> {
        (0..self.off_m.len()).max_by(|a, b| self.off_m[*a].total_cmp(&self.off_m[*b]))
    }

    /// What was left out, and of the others beyond those that no other draws along by far more than they are off.
    fn with_the_farthest(&self, left_out: &[usize]) -> Vec<usize> {
        let kept = self.beyond.iter().filter(|k| !left_out.contains(k)).map(|k| (*k, self.off_m[*k]));
        let mut all: Vec<usize> = left_out.iter().copied().chain(farthest(kept, DRAWN_ALONG)).collect();
        all.sort_unstable();
        all
    }

    /// Those of the points that were left out which are beyond, with the fit of all others: what it finds good was drawn along by what is not.
    /// `None` where they are all, and where the fit finds one of the others beyond again.
    fn without_the_good(
        &self,
        left_out: &[usize],
        beside: impl Fn(&[usize]) -> Option<Self>,
    ) -> Option<(Vec<usize>, Self)> {
        let fewer: Vec<usize> = left_out.iter().copied().filter(|k| self.beyond.contains(k)).collect();
        if fewer == left_out {
            return None;
        }
        let fit = beside(&fewer)?;
        fit.beyond.iter().all(|k| fewer.contains(k)).then_some((fewer, fit))
    }
}

/// Those of some points that are not where the others, with the errors that robots have, let them be: the residual of a point is predicted from those of
/// the others, and what it misses by is no chance beside what they scatter by, nor beside the noise of readings and points.
fn wrong_points(
    robot: &Robot,
    points: &[MeasuredPoint],
    (odd, without): (&[usize], &PointFit),
    limits: &Limits,
) -> Option<Vec<usize>> {
    let residuals_m = points.iter().map(|p| without.residual_m(robot, p)).collect();
    let of_all = PointFit { residuals_m, ..without.clone() };
    let (rows, residuals) = beside_usual_errors(robot, points, &of_all, limits)?;
    let is_kept = |k: &usize| !odd.contains(k);
    let kept: Vec<usize> = (0..points.len()).filter(is_kept).collect();
    let others =
        SteppedFit::new(kept.iter().map(|k| rows[*k].clone()).collect(), kept.iter().map(|k| residuals[*k]).collect())?;
    let freedom = freedom(kept.len());
    let squares = others.squares.max(freedom);
    let most = limits.displaced_false_alarms.ln() - (points.len() as f64).ln();
    let is_wrong = |k: &usize| {
        others
            .missed_by(&rows[*k], &residuals[*k])
            .is_some_and(|missed| log_chance(missed / (missed + squares), freedom + POINT as f64, POINT) <= most)
    };
    Some(odd.iter().copied().filter(is_wrong).collect())
}

/// Coordinates of a point.
const POINT: usize = 3;

/// A device, or a base of the robot, that stands elsewhere from some point on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DeviceMoved {
    /// First point after it.
    pub first: usize,
    /// How far the points behind it are displaced, RMS, m.
    pub by_m: f64,
    /// What the points leave with a frame before it and one behind it, RMS, m.
    pub rms_m: f64,
    /// Whether it is no error of the robot.
    pub cause: StepCause,
}

/// What a step in points comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum StepCause {
    /// The device, or the base: no errors of links, joints and gears as robots have them explain it.
    Device,
    /// Such errors explain it as well, as where the postures before it are others than those behind it.
    DeviceOrRobot,
}

/// The device elsewhere from some point on by more than `displaced_m`, where that explains more than `displaced_share` of the squares of the
/// residuals, and chance does not.
///
/// The fit is linear in a second frame: with `A` the derivatives by it of the points behind the step, what the parameters of the fit take
/// up projected out, the squares fall by `g' J^-1 g`, `g = A' r`, `J = A' A`. It is asked for beside the errors that robots have, with their
/// priors and the noise of readings and points (generalised least squares, of which the size of all sigmas is left open); what is found beside
/// frame and reflector alone may be the robot.
pub fn device_moved(robot: &Robot, points: &[MeasuredPoint], fit: &PointFit, limits: &Limits) -> Option<DeviceMoved> {
    let by = |p: &MeasuredPoint| {
        by_frame_and_reflector(&fit.device_from_base, &robot.base_from_tip(&p.readings), &fit.tip_point_m)
    };
    let by_frame: Vec<Rows> = points.iter().map(|p| Rows::from_column_slice(by(p).as_slice())).collect();
    let alone = SteppedFit::new(by_frame.clone(), fit.residuals_m.clone())?;
    let beside_errors = || {
        let (rows, residuals) = beside_usual_errors(robot, points, fit, limits)?;
        SteppedFit::new(rows, residuals)?.credible_step(freedom(points.len()), limits)
    };
    let (step, cause) = match beside_errors() {
        Some(step) => (step, StepCause::Device),
        None => (alone.credible_step(0.0, limits)?, StepCause::DeviceOrRobot),
    };
    let Step { first, change, .. } = step;
    let displaced: f64 = by_frame[first..].iter().map(|d| (d.fixed_columns::<6>(0) * change).norm_squared()).sum();
    let by_m = (displaced / (points.len() - first) as f64).sqrt();
    let fall = alone.steps(limits.displaced_images).into_iter().find(|s| s.first == first).map_or(0.0, |s| s.fall);
    let rms_m = ((alone.squares - fall).max(0.0) / points.len() as f64).sqrt();
    (by_m > limits.displaced_m).then_some(DeviceMoved { first, by_m, rms_m, cause })
}

/// Derivatives of a point by frame (6), reflector (3), and what else is fitted, in its sigmas.
type Rows = Matrix3xX<f64>;

/// Derivatives and residuals of points in units of their noise, those by the errors of a robot among them; `None` where there is no noise. Harmonics
/// may be as large as an error can be of this robot at all: a joint that is mounted off its axis, or whose bearing is worn, is one robot in many, and
/// what it does follows its reading.
fn beside_usual_errors(
    robot: &Robot,
    points: &[MeasuredPoint],
    fit: &PointFit,
    limits: &Limits,
) -> Option<(Vec<Rows>, Vec<Vector3<f64>>)> {
    let (full, mut sigmas) = usual_errors(robot);
    let first = sigmas.len().saturating_sub(full.terms.len());
    for (sigma, term) in sigmas[first..].iter_mut().zip(&full.terms) {
        let is_harmonic = matches!(term.term, Term::Cosine(_) | Term::Sine(_));
        *sigma *= if is_harmonic { limits.far_beyond_tolerance } else { 1.0 };
    }
    let joint_sigma = vec![limits.joint_error_sigma; robot.chain.readings.len()];
    let (mut all, mut residuals) = (Vec::new(), Vec::new());
    for (point, residual) in points.iter().zip(&fit.residuals_m) {
        let Derivatives { by_model, by_noise, fitted } = fit.derivatives_at(&full, point, &joint_sigma);
        let mut rows = Rows::zeros(9 + sigmas.len());
        rows.columns_mut(0, 9).copy_from(&fitted);
        for (k, sigma) in sigmas.iter().enumerate() {
            rows.column_mut(9 + k).copy_from(&(by_model.column(k) * *sigma));
        }
        let noise = Matrix3::from_column_slice((&by_noise * by_noise.transpose()).as_slice());
        let root = (noise + Matrix3::identity() * limits.displaced_m.powi(2)).cholesky()?.l();
        all.push(root.solve_lower_triangular(&rows)?);
        residuals.push(root.solve_lower_triangular(residual)?);
    }
    Some((all, residuals))
}

/// A step of the frame from a point on.
struct Step {
    first: usize,
    /// By how much it lessens the squares.
    fall: f64,
    change: Vector6<f64>,
}

/// Least squares over frame, reflector and errors with unit priors, to which a second frame may be added.
struct SteppedFit {
    by: Vec<Rows>,
    residuals: Vec<Vector3<f64>>,
    normal: SymmetricFactor,
    found: DVector<f64>,
    /// Those of the residuals, and of the errors in their sigmas.
    squares: f64,
}

impl SteppedFit {
    fn new(by: Vec<Rows>, residuals: Vec<Vector3<f64>>) -> Option<Self> {
        let columns = by.first()?.ncols();
        let (mut normal, mut score) = (DMatrix::zeros(columns, columns), DVector::zeros(columns));
        (9..columns).for_each(|k| normal[(k, k)] = 1.0);
        for (d, r) in by.iter().zip(&residuals) {
            normal.gemm_tr(1.0, d, d, 1.0);
            score.gemv_tr(1.0, d, r, 1.0);
        }
        let normal = SymmetricFactor::new(&held_weakly(normal)).ok()?;
        let found = normal.solve(&score);
        let residuals: Vec<Vector3<f64>> = by.iter().zip(residuals).map(|(d, r)| r - d * &found).collect();
        let of_errors = found.rows(9, columns - 9).norm_squared();
        let squares = residuals.iter().map(Vector3::norm_squared).sum::<f64>() + of_errors;
        Some(Self { by, residuals, normal, found, squares })
    }

    /// Square of what a point that is not among these misses by, in units of its noise and of the uncertainty of its prediction.
    fn missed_by(&self, rows: &Rows, residual: &Vector3<f64>) -> Option<f64> {
        let missed = residual - rows * &self.found;
        let by = DMatrix::from_column_slice(POINT, rows.ncols(), rows.as_slice());
        let predicted = &by * self.normal.solve_many(&by.transpose());
        let covariance = Matrix3::identity() + Matrix3::from_column_slice(predicted.as_slice());
        Some(missed.dot(&covariance.cholesky()?.solve(&missed)))
    }

    /// Every step with so many points before it and behind it, the last one first.
    fn steps(&self, least: usize) -> Vec<Step> {
        let (mut behind, mut score) = (DMatrix::zeros(6, self.by.first().map_or(0, Rows::ncols)), Vector6::zeros());
        let mut all = Vec::new();
        for first in (least..self.by.len()).rev() {
            let of_frame = self.by[first].fixed_columns::<6>(0).into_owned();
            behind.gemm_tr(1.0, &of_frame, &self.by[first], 1.0);
            score += of_frame.tr_mul(&self.residuals[first]);
            if self.by.len() - first < least {
                continue;
            }
            let taken = &behind * self.normal.solve_many(&behind.transpose());
            let own = behind.columns(0, 6) - taken;
            let factor = Matrix6::from_column_slice(own.as_slice()).cholesky();
            let Some(change) = factor.map(|factor| factor.solve(&score)) else { continue };
            all.push(Step { first, fall: score.dot(&change), change });
        }
        all
    }

    /// The best of them, where it is credible: against at least so much of squares as noise leaves.
    fn credible_step(&self, least: f64, limits: &Limits) -> Option<Step> {
        let best = self.steps(limits.displaced_images).into_iter().max_by(|a, b| a.fall.total_cmp(&b.fall))?;
        let share = best.fall / self.squares.max(least);
        let chance = log_chance(share, freedom(self.by.len()), 6) + (self.by.len() as f64).ln();
        (share > limits.displaced_share && chance <= limits.displaced_false_alarms.ln()).then_some(best)
    }
}
