//! What joint vectors alone can tell of a robot, before any image is looked at.
//!
//! Every stop is taken to give the pose of the tip in an unknown base frame and through an unknown tip frame, to
//! [`POSE_SIGMA_M`] and [`POSE_SIGMA_RAD`], with joint noise [`JOINT_SIGMA`]. Parameters are in units of their prior sigmas.

use nalgebra::{DMatrix, DVector, Matrix6};

use crate::geom::adjoint;
use crate::linalg::{SymmetricFactor, dense, product, symmetric_eigen};
use crate::model::robot::{Posture, Robot};
use crate::problem::Layout;
use crate::urdf::JointKind;

/// Sigma of the position of a camera pose, m per axis.
pub const POSE_SIGMA_M: f64 = 1e-4;
/// Sigma of its rotation, rad per axis.
pub const POSE_SIGMA_RAD: f64 = 1e-4;
/// Sigma of a joint, rad (a tenth of it in m for a prismatic joint).
pub const JOINT_SIGMA: f64 = 5e-5;

/// Base and tip frame.
const FRAMES: usize = 12;

/// Stops of the ideal series.
const IDEAL_STOPS: usize = 150;

/// Free columns of the robot's own parameters.
pub fn robot_columns(layout: &Layout) -> Vec<usize> {
    layout.robot().filter(|&c| layout.columns[c].free).collect()
}

/// What stops tell of the robot.
#[derive(Debug, Clone)]
pub struct StopsKnowledge {
    /// The columns of the layout that rows and columns below stand for.
    pub columns: Vec<usize>,
    /// Their prior sigmas.
    pub scale: Vec<f64>,
    /// Information of the data alone, in units of the prior, base and tip frame eliminated.
    pub information: DMatrix<f64>,
    /// Posterior covariance in units of the prior; base and tip frame are the last twelve.
    pub covariance: DMatrix<f64>,
}

impl StopsKnowledge {
    /// Knowledge from `stops`; `None` where readings are not finite.
    pub fn new(robot: &Robot, layout: &Layout, stops: &[Posture]) -> Option<Self> {
        let columns = robot_columns(layout);
        let scale: Vec<f64> = columns.iter().map(|&c| layout.columns[c].prior_sigma).collect();
        let n = columns.len();
        let mut known = Self { columns, scale, information: DMatrix::zeros(n, n), covariance: DMatrix::zeros(0, 0) };
        let mut all = DMatrix::zeros(n + FRAMES, n + FRAMES);
        for stop in stops {
            let (j, noise) = known.measurement(robot, layout, stop);
            let wj = dense(&noise.try_inverse()?) * &j;
            all += product(&j.transpose(), &wj);
        }
        // Frames may be anywhere: a prior of 1 m and 1 rad says nothing beside the stops.
        let frames = all.view((n, n), (FRAMES, FRAMES)) + DMatrix::identity(FRAMES, FRAMES);
        let cross = all.view((0, n), (n, FRAMES)).into_owned();
        let solved = SymmetricFactor::new(&frames).ok()?.solve_many(&cross.transpose());
        let information = all.view((0, 0), (n, n)) - product(&cross, &solved);
        known.information = (&information + information.transpose()) * 0.5;
        for k in 0..n + FRAMES {
            all[(k, k)] += 1.0;
        }
        known.covariance = SymmetricFactor::new(&all).ok()?.inverse();
        Some(known)
    }

    /// Jacobian of the pose of the tip as a body twist (6 x parameters and frames) in units of the priors, and its noise.
    pub fn measurement(&self, robot: &Robot, layout: &Layout, stop: &Posture) -> (DMatrix<f64>, Matrix6<f64>) {
        let readings = stop.readings.len();
        let kinematics = robot.kinematics(stop, &vec![0.0; readings]);
        let n = self.columns.len();
        let mut j = DMatrix::zeros(6, n + FRAMES);
        for (k, (&c, scale)) in self.columns.iter().zip(&self.scale).enumerate() {
            j.column_mut(k).copy_from(&(layout.derivative(&kinematics, c) * *scale));
        }
        j.fixed_view_mut::<6, 6>(0, n).copy_from(&Matrix6::identity());
        j.fixed_view_mut::<6, 6>(0, n + 6).copy_from(&adjoint(&kinematics.base_from_tip.inverse()));
        let mut noise = Matrix6::from_diagonal_element(POSE_SIGMA_M.powi(2));
        for k in 3..6 {
            noise[(k, k)] = POSE_SIGMA_RAD.powi(2);
        }
        for (d, kind) in kinematics.d_readings.iter().zip(&robot.chain.reading_kinds) {
            let sigma = if *kind == JointKind::Prismatic { 0.1 * JOINT_SIGMA } else { JOINT_SIGMA };
            noise += d * d.transpose() * sigma.powi(2);
        }
        (j, noise)
    }

    /// Directions (columns, orthonormal, in units of the priors) of which the stops say less than this share.
    pub fn unknown(&self, least_share: f64) -> DMatrix<f64> {
        let Some((values, vectors)) = symmetric_eigen(&self.information) else {
            return DMatrix::zeros(self.scale.len(), 0);
        };
        let least = information_of_share(least_share);
        let count = values.iter().filter(|v| **v < least).count();
        vectors.columns(0, count).into_owned()
    }
}

/// Information in units of that of the prior by which data remove this share of the prior variance.
pub fn information_of_share(share: f64) -> f64 {
    share / (1.0 - share)
}

/// Points that fill a cube evenly (Halton, *On the efficiency of certain quasi-random sequences*, 1960): `index` from 1.
fn halton(mut index: usize, base: usize) -> f64 {
    let (mut value, mut digit) = (0.0, 1.0);
    while index > 0 {
        digit /= base as f64;
        value += digit * (index % base) as f64;
        index /= base;
    }
    value
}

const PRIMES: [usize; 12] = [2, 3, 5, 7, 11, 13, 17, 19, 23, 29, 31, 37];

/// Stops that fill the whole range of all joints, reached from all sides.
pub fn ideal_stops(robot: &Robot) -> Vec<Posture> {
    halton_stops(&robot.chain.ranges(), IDEAL_STOPS)
}

/// Stops that fill ranges (rad or m) of all readings evenly.
pub(super) fn halton_stops(ranges: &[(f64, f64)], count: usize) -> Vec<Posture> {
    let readings = ranges.len();
    let point = |index: usize, r: usize| halton(index + 7 * (r / PRIMES.len()), PRIMES[r % PRIMES.len()]);
    (1..=count)
        .map(|k| {
            let at = |r: usize| {
                let (low, high) = ranges[r];
                low + (high - low) * point(k, r)
            };
            let approach = (0..readings).map(|r| point(k + 311, r) - 0.5).collect();
            Posture { readings: (0..readings).map(at).collect(), approach: Some(approach) }
        })
        .collect()
}

/// Directions that no series can tell: base and tip against the poses of plate and camera, and parameters that do the same.
#[derive(Debug, Clone)]
pub struct Structural {
    /// Free columns of the robot.
    pub columns: Vec<usize>,
    /// Orthonormal directions in units of the priors, one per column.
    pub directions: DMatrix<f64>,
    /// Information of the ideal series.
    pub information: DMatrix<f64>,
    /// Share of the prior variance that data must remove to count as telling.
    pub least_share: f64,
}

/// What even stops over the whole range of every joint do not tell: less than this share of the prior variance is removed.
pub fn structural(robot: &Robot, layout: &Layout, least_share: f64) -> Structural {
    let columns = robot_columns(layout);
    let n = columns.len();
    let (directions, information) = match StopsKnowledge::new(robot, layout, &ideal_stops(robot)) {
        Some(known) => (known.unknown(least_share), known.information),
        None => (DMatrix::identity(n, n), DMatrix::zeros(n, n)),
    };
    Structural { columns, directions, information, least_share }
}

impl Structural {
    /// Share of each parameter that lies in these directions, 0 to 1.
    pub fn shares(&self) -> Vec<f64> {
        self.directions.row_iter().map(|r| r.norm_squared()).collect()
    }

    /// A vector without its part in these directions.
    pub fn removed_from(&self, v: &DVector<f64>) -> DVector<f64> {
        v - &self.directions * (self.directions.transpose() * v)
    }
}

/// Columns of a largest set of parameters that a series can tell apart: pivots of a Cholesky factorisation of the information.
pub fn minimal_set(robot: &Robot, layout: &Layout, structural: &Structural) -> Vec<usize> {
    debug_assert_eq!(robot.twists.len() * 6, layout.twists.len());
    let mut left = structural.information.clone();
    let least = information_of_share(structural.least_share);
    let mut kept = Vec::new();
    let wanted = structural.columns.len() - structural.directions.ncols();
    while kept.len() < wanted {
        let (pivot, value) = left.diagonal().argmax();
        if value < least {
            break;
        }
        let column = left.column(pivot).into_owned();
        left -= &column * column.transpose() / value;
        left.row_mut(pivot).fill(0.0);
        left.column_mut(pivot).fill(0.0);
        kept.push(structural.columns[pivot]);
    }
    kept
}
