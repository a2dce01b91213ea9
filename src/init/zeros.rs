//! Zeros of the joints that are far from those of the URDF, and an axis that counts the other way: from poses, before anything is fitted to pixels.
//!
//! With the readings taken as `s_r q_r + o_r`, the misfit of a stop is `r_j = log((X C_j)^-1 A_j(s, o) Z)` (rad, and m over 1 m). For every choice of at
//! most one reversed joint, X, Z and o are found by Levenberg-Marquardt on `sum_j rho(|r_j|)` (P. Huber, *Robust estimation of a location parameter*, 1964)
//! from the closed form of the hand-eye problem; o is held to a turn of 30 degrees, which decides what the stops do not: the offset of the first joint turns
//! the whole base, that of the last one the hand.

use nalgebra::{DMatrix, DVector, Matrix6, Vector6};

use super::hand_eye::{PosePair, shah};
use crate::geom::{Pose, adjoint, right_jacobian_se3};
use crate::linalg::SymmetricFactor;
use crate::linalg::median;
use crate::model::robot::{Posture, Robot};
use crate::series::CameraMount;

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
    let mut found: Vec<Zeros> = choices.filter_map(|reversed| Trial { robot, stops, reversed }.solved()).collect();
    found.sort_by(|a, b| a.left.total_cmp(&b.left));
    found
}

/// Stops with one choice of signs.
struct Trial<'a> {
    robot: &'a Robot,
    stops: &'a [SeenStop],
    reversed: Option<usize>,
}

/// X, Z and the offsets.
#[derive(Clone)]
struct Unknowns {
    camera: Pose,
    plate: Pose,
    offsets: Vec<f64>,
}

impl Trial<'_> {
    fn posture(&self, stop: &SeenStop, offsets: &[f64]) -> Posture {
        let sign = |r: usize| if self.reversed == Some(r) { -1.0 } else { 1.0 };
        let moved = stop.readings.iter().zip(offsets).enumerate().map(|(r, (q, o))| sign(r) * q + o);
        Posture::at(&moved.collect::<Vec<f64>>())
    }

    fn solved(&self) -> Option<Zeros> {
        let none = vec![0.0; self.robot.chain.readings.len()];
        let pair = |s: &SeenStop| {
            let tip = self.robot.pose_at(&self.posture(s, &none), &none);
            PosePair::of_flange(s.mount, tip, s.camera_from_plate)
        };
        let start = shah(&self.stops.iter().map(pair).collect::<Vec<_>>())?;
        let mut x = Unknowns { camera: start.camera, plate: start.plate, offsets: none };
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
        let left = median(self.stops.iter().map(|s| size(&self.misfit(s, &x).0))).unwrap_or(f64::INFINITY);
        Some(Zeros { offsets: x.offsets, reversed: self.reversed, left })
    }

    /// `log((X C)^-1 A Z)` and its derivative by the body twists of X and Z and the offsets.
    fn misfit(&self, stop: &SeenStop, x: &Unknowns) -> (Vector6<f64>, DMatrix<f64>) {
        let n = x.offsets.len();
        let kinematics = self.robot.kinematics(&self.posture(stop, &x.offsets), &vec![0.0; n]);
        let tip = kinematics.base_from_tip;
        let (chain, by_tip) = match stop.mount {
            CameraMount::Hand => {
                let there = tip.inverse() * x.plate;
                (there, -adjoint(&there.inverse()))
            }
            CameraMount::Fixed => (tip * x.plate, adjoint(&x.plate.inverse())),
        };
        let r = ((x.camera * stop.camera_from_plate).inverse() * chain).log();
        let inverse = |j: Matrix6<f64>| j.try_inverse().unwrap_or_else(Matrix6::identity);
        let (right, left) = (inverse(right_jacobian_se3(&r)), inverse(right_jacobian_se3(&-r)));
        let mut j = DMatrix::zeros(6, 12 + n);
        j.fixed_view_mut::<6, 6>(0, 0).copy_from(&-(left * adjoint(&stop.camera_from_plate.inverse())));
        j.fixed_view_mut::<6, 6>(0, 6).copy_from(&right);
        for (k, d) in kinematics.d_readings.iter().enumerate() {
            j.fixed_view_mut::<6, 1>(0, 12 + k).copy_from(&(right * (by_tip * d)));
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
        let n = 12 + x.offsets.len();
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
        }
    }
}

/// Rotation (rad) plus translation (m).
fn size(r: &Vector6<f64>) -> f64 {
    r.fixed_rows::<3>(0).norm() + r.fixed_rows::<3>(3).norm()
}
