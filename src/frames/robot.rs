//! The corrected robot as an identification left it: model, covariance, joint noise.

use nalgebra::{DMatrix, Vector6};

use crate::geom::Pose;
use crate::linalg::{product, symmetric_eigen};
use crate::model::robot::{Kinematics, Posture, Robot};
use crate::problem::Layout;

/// Relative size of an eigenvalue of the covariance that is rounding.
const ROUNDING: f64 = 1e-13;

/// A robot that was identified.
#[derive(Debug, Clone)]
pub struct KnownRobot {
    /// As solved for: derivatives are its. Without local errors.
    robot: Robot,
    /// As written in corrected URDF and compensation.toml: poses are its.
    exported: Robot,
    /// Columns of the solution that count: twists, joint terms, and those of a plate in the base.
    columns: Vec<usize>,
    /// Number of them that are twists.
    twists: usize,
    /// Number of them that are of the robot.
    own: usize,
    /// Covariance of these columns.
    covariance: DMatrix<f64>,
    /// `L` with `L L'` the covariance.
    factor: DMatrix<f64>,
    /// Joint noise, rad or m.
    pub joint_sigma: Vec<f64>,
    /// Stops of the identification.
    pub stops: Vec<Posture>,
}

impl KnownRobot {
    /// `covariance` is that of the columns of `layout`; `plate` is the first of the six columns of a plate in the base that counts, too.
    /// `None` where the covariance is not finite.
    pub fn new(
        robot: &Robot,
        layout: &Layout,
        covariance: &DMatrix<f64>,
        plate: Option<usize>,
        joint_sigma: Vec<f64>,
        stops: Vec<Posture>,
    ) -> Option<Self> {
        let robot = robot.without_local_errors();
        // Local errors are noise near single readings, not properties of the robot.
        let own: Vec<usize> = layout.twists.clone().chain(layout.terms.start..layout.locals.start).collect();
        let of_plate = plate.into_iter().flat_map(|first| first..first + 6);
        let columns: Vec<usize> = own.iter().copied().chain(of_plate).collect();
        let n = columns.len();
        let covariance = DMatrix::from_fn(n, n, |i, j| covariance[(columns[i], columns[j])]);
        let scale: Vec<f64> = covariance.diagonal().iter().map(|v| v.max(0.0).sqrt()).collect();
        let over = |s: f64| if s > 0.0 { 1.0 / s } else { 0.0 };
        let correlation = DMatrix::from_fn(n, n, |i, j| covariance[(i, j)] * over(scale[i]) * over(scale[j]));
        let (values, vectors) = symmetric_eigen(&correlation)?;
        let least = ROUNDING * values.iter().copied().fold(0.0, f64::max);
        let kept: Vec<usize> = (0..n).filter(|&k| values[k] > least).collect();
        let factor = DMatrix::from_fn(n, kept.len(), |i, k| scale[i] * vectors[(i, kept[k])] * values[kept[k]].sqrt());
        let (exported, twists) = (robot.as_exported(), layout.twists.len());
        Some(Self { robot, exported, columns, twists, own: own.len(), covariance, factor, joint_sigma, stops })
    }

    /// The robot as it is written, by which programs run.
    pub fn exported(&self) -> &Robot {
        &self.exported
    }

    /// Columns of the solution that `G` has.
    pub fn columns(&self) -> &[usize] {
        &self.columns
    }

    /// `C`, the covariance of these columns.
    pub fn covariance(&self) -> &DMatrix<f64> {
        &self.covariance
    }

    /// `L`.
    pub(super) fn factor(&self) -> &DMatrix<f64> {
        &self.factor
    }

    /// The first of the six columns of the plate.
    pub(super) fn plate_column(&self) -> Option<usize> {
        (self.columns.len() > self.own).then_some(self.own)
    }

    /// Pose of the tip as the written robot has it, and its derivatives as body twists.
    pub fn at(&self, stop: &Posture) -> (Pose, Kinematics) {
        let none = vec![0.0; stop.readings.len()];
        (self.exported.pose_at(stop, &none), self.robot.kinematics(stop, &none))
    }

    /// `[dF/dtheta]` as body twists of the tip, 6 x columns (zero for a plate).
    pub(super) fn d_theta(&self, kinematics: &Kinematics) -> DMatrix<f64> {
        let mut j = DMatrix::zeros(6, self.columns.len());
        for (k, d) in kinematics.d_twists.iter().enumerate() {
            j.fixed_view_mut::<6, 6>(0, 6 * k).copy_from(d);
        }
        for (k, d) in kinematics.d_terms.iter().enumerate() {
            j.fixed_view_mut::<6, 1>(0, self.twists + k).copy_from(d);
        }
        j
    }

    /// `[dF/dq]` in units of the joint noise, 6 x readings.
    pub(super) fn d_noise(&self, kinematics: &Kinematics) -> DMatrix<f64> {
        let columns: Vec<Vector6<f64>> =
            kinematics.d_readings.iter().zip(&self.joint_sigma).map(|(d, sigma)| d * *sigma).collect();
        let mut j = DMatrix::zeros(6, columns.len());
        columns.iter().enumerate().for_each(|(k, c)| j.set_column(k, c));
        j
    }

    /// `rows * L`.
    pub(super) fn in_units(&self, rows: &DMatrix<f64>) -> DMatrix<f64> {
        product(rows, &self.factor)
    }
}
