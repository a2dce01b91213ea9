//! Zeros of the joints that are far from those of the URDF, and an axis that counts the other way: from poses, before anything is fitted to pixels.
//!
//! With the readings taken as `s_r q_r + o_r`, the misfit of a stop is `r_j = log((X C_j)^-1 A_j(s, o) Z)` (rad, and m over 1 m). For every choice of at
//! most one reversed joint, X, Z and o are found by Levenberg-Marquardt on `sum_j rho(|r_j|)` (P. Huber, *Robust estimation of a location parameter*, 1964)
//! from the closed form of the hand-eye problem; o is held to a turn of 30 degrees, which decides what the stops do not: the offset of the first joint turns
//! the whole base, that of the last one the hand.
//!
//! In the same way a reading `q_k` is taken as `q_k + o_k + f q_j`: with `k = j` a joint that moves by `1 + f` times its reading, else one that another
//! moves with it. Errors of the origins are as large as what a ratio that is off by a percent leaves in doubt: of the pair that leaves least, `f` is found once
//! more beside twists `xi` of all origins with their priors, by generalised least-squares steps `(A / s^2 + P) d = b / s^2 - P x`, whose size
//! `s^2 = sum r^2 / (n - tr((A / s^2 + P)^-1 A / s^2))` is found with them.

use nalgebra::{DMatrix, DVector, Matrix6, Vector6};
use rayon::prelude::*;

use super::hand_eye::{PosePair, shah};
use crate::geom::{Pose, adjoint, right_jacobian_se3};
use crate::linalg::SymmetricFactor;
use crate::linalg::median;
use crate::model::robot::{Posture, Robot};
use crate::series::{CameraMount, spread};

/// A stop at which the camera saw the plate.
#[derive(Debug, Clone, PartialEq)]
pub struct SeenStop {
    /// Readings, rad or m.
    pub readings: Vec<f64>,
    /// Where the camera is.
    pub mount: CameraMount,
    /// `camera_from_plate` measured in the image.
    pub camera_from_plate: Pose,
}

impl SeenStop {
    /// What it says with a robot.
    pub fn pair(&self, robot: &Robot) -> PosePair {
        PosePair::of_stop(robot, self.mount, &self.readings, self.camera_from_plate)
    }
}

/// Zeros that bring readings and images together.
#[derive(Debug, Clone, PartialEq)]
pub struct Zeros {
    /// Added to every reading, after its sign, rad or m.
    pub offsets: Vec<f64>,
    /// Reading that counts the other way.
    pub reversed: Option<usize>,
    /// Median misfit that is left, rad + m.
    pub left: f64,
}

/// A reading to which a part of a reading is added, which brings readings and images together.
#[derive(Debug, Clone, PartialEq)]
pub struct Slope {
    /// The reading that is wrong, and the one of which a part is added to it: itself where its ratio is wrong.
    pub readings: [usize; 2],
    /// The part, and its standard deviation.
    pub part: (f64, f64),
    /// Median misfit that is left, rad + m.
    pub left: f64,
    /// Robust mean square of what is left, in units of its own.
    pub square: f64,
}

/// What the slopes of readings explain.
#[derive(Debug, Clone, PartialEq)]
pub struct Slopes {
    /// Robust mean square of the misfits with other zeros alone, in units of its own.
    pub square: f64,
    /// Every pair of readings of one kind, that which leaves least first.
    pub tried: Vec<Slope>,
    /// Stops that told it.
    pub stops: usize,
}

/// Parts of a reading from which the iteration starts where they fit better: a unit that is wrong by a factor of a half to three.
const PARTS: std::ops::RangeInclusive<i32> = -24..=40;
const PART: f64 = 0.05;

/// Usual errors of an origin, m and rad; stops whose misfit is so many times the median take no part beside them; and rounds of their size.
const ORIGIN: [f64; 2] = [1e-3, 2e-3];
const FAR: f64 = 6.0;
const ROUNDS: usize = 30;

/// Relative error that all camera poses may have in common: scale of the plate and of the image.
const COMMON: f64 = 1e-4;

/// Stops that tell the slope of a reading well enough.
const MOST_STOPS: usize = 200;

/// Steps of the iteration, and the factor between its dampings.
const STEPS: usize = 60;
const DAMPING: f64 = 10.0;
/// Sizes of a misfit and of an offset that are usual, rad (or m).
const MISFIT: f64 = 0.02;
const OFFSET: f64 = 0.5;
/// Relative decrease of the cost at which the iteration ends.
const SETTLED: f64 = 1e-7;

/// The choices of a reversed joint, best first; empty where no closed form has a solution.
pub fn solve_zeros(robot: &Robot, stops: &[SeenStop]) -> Vec<Zeros> {
    let choices = std::iter::once(None).chain((0..robot.chain.readings.len()).map(Some));
    let mut found: Vec<Zeros> =
        choices.filter_map(|reversed| Trial { robot, stops, reversed, slope: None }.zeros()).collect();
    found.sort_by(|a, b| a.left.total_cmp(&b.left));
    found
}

/// Slopes of single readings; `None` where no closed form has a solution.
pub fn solve_slopes(robot: &Robot, stops: &[SeenStop]) -> Option<Slopes> {
    let some: Vec<SeenStop> = spread(stops.len(), MOST_STOPS).map(|k| stops[k].clone()).collect();
    let (stops, kinds) = (some.as_slice(), &robot.chain.reading_kinds);
    let moves = |r: &usize| stops.windows(2).any(|two| two[0].readings.get(*r) != two[1].readings.get(*r));
    let moving: Vec<usize> = (0..kinds.len()).filter(moves).collect();
    let pairs =
        moving.iter().flat_map(|&k| moving.iter().map(move |&j| [k, j])).filter(|[k, j]| kinds[*k] == kinds[*j]);
    let pairs: Vec<[usize; 2]> = pairs.collect();
    let trial = |slope| Trial { robot, stops, reversed: None, slope };
    let without = trial(None);
    let square = without.square(&without.solved(0.0)?);
    let mut found: Vec<(Slope, Unknowns)> =
        pairs.into_par_iter().filter_map(|pair| trial(Some(pair)).slope(pair)).collect();
    found.sort_by(|a, b| a.0.square.total_cmp(&b.0.square));
    if let Some((best, x)) = found.first_mut() {
        best.part = trial(Some(best.readings)).beside_origins(x).unwrap_or(best.part);
    }
    let tried = found.into_iter().map(|(slope, _)| slope).collect();
    Some(Slopes { square, tried, stops: stops.len() })
}

/// Stops with one choice of signs.
struct Trial<'a> {
    robot: &'a Robot,
    stops: &'a [SeenStop],
    reversed: Option<usize>,
    /// The reading that has a slope, and by which reading.
    slope: Option<[usize; 2]>,
}

/// X, Z, the offsets and the slope.
#[derive(Clone)]
struct Unknowns {
    camera: Pose,
    plate: Pose,
    offsets: Vec<f64>,
    part: f64,
}

impl Trial<'_> {
    fn posture(&self, stop: &SeenStop, offsets: &[f64], part: f64) -> Posture {
        let sign = |r: usize| if self.reversed == Some(r) { -1.0 } else { 1.0 };
        let moved = stop.readings.iter().zip(offsets).enumerate().map(|(r, (q, o))| sign(r) * q + o);
        let mut moved: Vec<f64> = moved.collect();
        if let Some([k, j]) = self.slope {
            moved[k] += part * stop.readings[j];
        }
        Posture::at(&moved)
    }

    fn pairs(&self, part: f64) -> Vec<PosePair> {
        let none = vec![0.0; self.robot.chain.readings.len()];
        let pair = |s: &SeenStop| {
            let tip = self.robot.pose_at(&self.posture(s, &none, part), &none);
            PosePair::of_flange(s.mount, tip, s.camera_from_plate)
        };
        self.stops.iter().map(pair).collect()
    }

    fn zeros(&self) -> Option<Zeros> {
        let x = self.solved(0.0)?;
        let left = self.left(&x);
        Some(Zeros { offsets: x.offsets, reversed: self.reversed, left })
    }

    fn left(&self, x: &Unknowns) -> f64 {
        median(self.stops.iter().map(|s| size(&self.misfit(s, x).0))).unwrap_or(f64::INFINITY)
    }

    /// Twice the robust cost by what is left of its degrees of freedom.
    fn square(&self, x: &Unknowns) -> f64 {
        let free = (6 * self.stops.len()).saturating_sub(self.unknowns(x)).max(1);
        2.0 * self.cost(x) / free as f64
    }

    fn slope(&self, readings: [usize; 2]) -> Option<(Slope, Unknowns)> {
        let closed = |part: f64| {
            let pairs = self.pairs(part);
            shah(&pairs).map_or(f64::INFINITY, |start| start.median_error(&pairs))
        };
        let parts = PARTS.map(|k| f64::from(k) * PART);
        let start = parts.map(|part| (closed(part), part)).min_by(|a, b| a.0.total_cmp(&b.0))?.1;
        let x = self.solved(start)?;
        let (normal, _) = self.normal(&x);
        let square = self.square(&x);
        let last = normal.nrows() - 1;
        let variance = SymmetricFactor::new(&normal).ok()?.inverse()[(last, last)];
        let part = (x.part, (square * variance).sqrt());
        Some((Slope { readings, part, left: self.left(&x), square }, x))
    }

    /// The slope and its standard deviation beside errors of all origins, from where other zeros alone lead.
    fn beside_origins(&self, x: &Unknowns) -> Option<(f64, f64)> {
        let usual = self.left(x);
        let own: Vec<&SeenStop> = self.stops.iter().filter(|s| size(&self.misfit(s, x).0) <= FAR * usual).collect();
        let values = 6.0 * own.len() as f64;
        let (mut robot, mut x) = (self.robot.clone(), x.clone());
        let first = self.unknowns(&x);
        let count = first + 6 * robot.twists.len();
        let mut prior = DVector::zeros(count);
        (12..first - 1).for_each(|k| prior[k] = OFFSET.powi(-2));
        (first..count).for_each(|k| prior[k] = ORIGIN[(k - first) / 3 % 2].powi(-2));
        let (mut variance, mut told) = (None, None);
        for _ in 0..ROUNDS {
            let trial = Trial { robot: &robot, ..*self };
            let (mut a, mut b, mut square) = (DMatrix::zeros(count, count), DVector::zeros(count), 0.0);
            for (r, j) in own.iter().map(|stop| trial.misfit_by_origins(stop, &x)) {
                a += j.tr_mul(&j);
                b -= j.tr_mul(&r);
                square += r.norm_squared();
            }
            let usual = *variance.get_or_insert(square / values);
            let mut held = DVector::zeros(count);
            x.offsets.iter().enumerate().for_each(|(k, offset)| held[12 + k] = *offset);
            robot.twists.iter().enumerate().for_each(|(k, xi)| held.rows_mut(first + 6 * k, 6).copy_from(xi));
            let information = &a / usual + DMatrix::from_diagonal(&prior);
            let factor = SymmetricFactor::new(&information).ok()?;
            let step = factor.solve(&(&b / usual - prior.component_mul(&held)));
            let inverse = factor.inverse();
            let taken = inverse.component_mul(&a).sum() / usual;
            let left = square - 2.0 * step.dot(&b) + step.dot(&(&a * &step));
            variance = Some((left.max(0.0) / (values - taken).max(1.0)).max(f64::EPSILON.powi(2)));
            x = x.moved(&step.rows(0, first).into_owned());
            let twists = robot.twists.iter_mut().enumerate();
            twists.for_each(|(k, xi)| *xi += step.fixed_rows::<6>(first + 6 * k));
            told = Some((x.part, inverse[(first - 1, first - 1)].sqrt().hypot(COMMON)));
        }
        told
    }

    /// As [`Self::misfit`], with the derivatives by the twists of all origins behind the others.
    fn misfit_by_origins(&self, stop: &SeenStop, x: &Unknowns) -> (Vector6<f64>, DMatrix<f64>) {
        let (r, j) = self.misfit(stop, x);
        let kinematics = self.robot.kinematics(&self.posture(stop, &x.offsets, x.part), &vec![0.0; x.offsets.len()]);
        let by_tip = by_tip(stop, &kinematics.base_from_tip, &x.plate);
        let right = right_jacobian_se3(&r).try_inverse().unwrap_or_else(Matrix6::identity);
        let own = j.ncols();
        let mut all = j.resize_horizontally(own + 6 * kinematics.d_twists.len(), 0.0);
        for (k, d) in kinematics.d_twists.iter().enumerate() {
            all.fixed_view_mut::<6, 6>(0, own + 6 * k).copy_from(&(right * (by_tip * d)));
        }
        (r, all)
    }

    fn unknowns(&self, x: &Unknowns) -> usize {
        12 + x.offsets.len() + usize::from(self.slope.is_some())
    }

    fn solved(&self, part: f64) -> Option<Unknowns> {
        let offsets = vec![0.0; self.robot.chain.readings.len()];
        let start = shah(&self.pairs(part))?;
        let mut x = Unknowns { camera: start.camera, plate: start.plate, offsets, part };
        let (mut damping, mut cost) = (1e-3, self.cost(&x));
        for _ in 0..STEPS {
            let (n, b) = self.normal(&x);
            let mut next = None;
            while damping < 1e8 {
                let mut damped = n.clone();
                (0..n.nrows()).for_each(|k| damped[(k, k)] *= 1.0 + damping);
                let step = SymmetricFactor::new(&damped).ok()?.solve(&b);
                let trial = x.moved(&step);
                let tried = self.cost(&trial);
                if tried < cost {
                    next = Some((trial, tried));
                    damping /= DAMPING;
                    break;
                }
                damping *= DAMPING;
            }
            let Some((moved, lower)) = next else { break };
            let is_settled = cost - lower < SETTLED * cost;
            (x, cost) = (moved, lower);
            if is_settled {
                break;
            }
        }
        Some(x)
    }

    /// `log((X C)^-1 A Z)` and its derivative by the body twists of X and Z, the offsets and the slope.
    fn misfit(&self, stop: &SeenStop, x: &Unknowns) -> (Vector6<f64>, DMatrix<f64>) {
        let n = x.offsets.len();
        let kinematics = self.robot.kinematics(&self.posture(stop, &x.offsets, x.part), &vec![0.0; n]);
        let tip = kinematics.base_from_tip;
        let by_tip = by_tip(stop, &tip, &x.plate);
        let chain = match stop.mount {
            CameraMount::Hand => tip.inverse() * x.plate,
            CameraMount::Fixed => tip * x.plate,
        };
        let r = ((x.camera * stop.camera_from_plate).inverse() * chain).log();
        let inverse = |j: Matrix6<f64>| j.try_inverse().unwrap_or_else(Matrix6::identity);
        let (right, left) = (inverse(right_jacobian_se3(&r)), inverse(right_jacobian_se3(&-r)));
        let mut j = DMatrix::zeros(6, self.unknowns(x));
        j.fixed_view_mut::<6, 6>(0, 0).copy_from(&-(left * adjoint(&stop.camera_from_plate.inverse())));
        j.fixed_view_mut::<6, 6>(0, 6).copy_from(&right);
        for (k, d) in kinematics.d_readings.iter().enumerate() {
            j.fixed_view_mut::<6, 1>(0, 12 + k).copy_from(&(right * (by_tip * d)));
        }
        if let Some([k, by]) = self.slope {
            let column = j.column(12 + k) * stop.readings[by];
            j.column_mut(12 + n).copy_from(&column);
        }
        (r, j)
    }

    fn cost(&self, x: &Unknowns) -> f64 {
        let misfits = self.stops.iter().map(|s| {
            let length = self.misfit(s, x).0.norm() / MISFIT;
            if length <= 1.0 { 0.5 * length * length } else { length - 0.5 }
        });
        misfits.sum::<f64>() + x.offsets.iter().map(|o| 0.5 * (o / OFFSET).powi(2)).sum::<f64>()
    }

    fn normal(&self, x: &Unknowns) -> (DMatrix<f64>, DVector<f64>) {
        let n = self.unknowns(x);
        let (mut normal, mut rhs) = (DMatrix::zeros(n, n), DVector::zeros(n));
        for stop in self.stops {
            let (r, j) = self.misfit(stop, x);
            let weight = (MISFIT / r.norm().max(MISFIT)) / (MISFIT * MISFIT);
            normal += weight * j.tr_mul(&j);
            rhs -= weight * j.tr_mul(&r);
        }
        for (k, o) in x.offsets.iter().enumerate() {
            normal[(12 + k, 12 + k)] += 1.0 / (OFFSET * OFFSET);
            rhs[12 + k] -= o / (OFFSET * OFFSET);
        }
        (normal, rhs)
    }
}

impl Unknowns {
    fn moved(&self, step: &DVector<f64>) -> Self {
        let twist = |first: usize| step.fixed_rows::<6>(first).into_owned();
        Self {
            camera: self.camera.perturbed(&twist(0)),
            plate: self.plate.perturbed(&twist(6)),
            offsets: self.offsets.iter().zip(step.rows(12, self.offsets.len()).iter()).map(|(o, d)| o + d).collect(),
            part: self.part + step.get(12 + self.offsets.len()).copied().unwrap_or(0.0),
        }
    }
}

/// By how much the plate before the camera's mount moves with a twist of the tip.
fn by_tip(stop: &SeenStop, tip: &Pose, plate: &Pose) -> Matrix6<f64> {
    match stop.mount {
        CameraMount::Hand => -adjoint(&(tip.inverse() * *plate).inverse()),
        CameraMount::Fixed => adjoint(&plate.inverse()),
    }
}

/// Rotation (rad) plus translation (m).
fn size(r: &Vector6<f64>) -> f64 {
    r.fixed_rows::<3>(0).norm() + r.fixed_rows::<3>(3).norm()
}
