//! Uncertainty of the flange, anywhere in the workspace.
//!
//! The pose of the flange is given relative to what stands still: the plate, or a fixed camera. No series can tell a constant
//! displacement of the flange (the last origin and the last offset against the hand-eye transform), so the flange is the one that
//! is right on average over the stops: with `J(q)` the derivative of its body twist, `J(q) - mean_j J(q_j)` counts.
//!
//! The robot is that of the exported files, corrected URDF and compensation.toml: local errors are left out.

use nalgebra::{DMatrix, DVector, Matrix6, Vector3};
use serde::{Deserialize, Serialize};

use super::limits::Limits;
use super::mean_square::MeanSquare;
use super::root_of_mean;
use super::statistics::extent;
use super::stops::halton_stops;
use super::used_stops::{still, stops};
use crate::geom::{Pose, adjoint};
use crate::linalg::{SymmetricFactor, dense};
use crate::model::robot::{Posture, Robot};
use crate::problem::{Adjustment, Layout};
use crate::solve::Spread;

/// Samples of the workspace: so many in the region of the stops, as many within all joint limits.
const SAMPLES: usize = 250;

/// Share of the information of base and tool that holds what the stops do not tell of them.
const HELD: f64 = 1e-9;

/// A flange pose with its uncertainty.
#[derive(Debug, Clone, PartialEq)]
pub struct PredictedFlange {
    /// Pose of the flange relative to the plate (or to a fixed camera).
    pub pose: Pose,
    /// Covariance of its body twist, m and rad, translation first.
    pub covariance: Matrix6<f64>,
    /// Names of joints outside the range of the stops.
    pub outside: Vec<String>,
}

impl PredictedFlange {
    /// Root of the summed variances of the three axes: position (m) and rotation (rad).
    pub fn sigmas(&self) -> [f64; 2] {
        [0, 3].map(|first| (first..first + 3).map(|k| self.covariance[(k, k)]).sum::<f64>().max(0.0).sqrt())
    }
}

/// A place of the workspace map.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct WorkspacePoint {
    /// Joint readings, rad or m.
    pub readings: Vec<f64>,
    /// Flange in the base frame, m.
    pub xyz_m: [f64; 3],
    /// Sigma of its position relative to the plate, root of the sum over three axes, m.
    pub sigma_m: f64,
    /// Sigma of its orientation, root of the sum over three axes, rad.
    pub sigma_rad: f64,
    /// True where every joint lies in the range of the stops.
    pub covered: bool,
}

/// Samples of everything within the joint limits.
pub(super) fn everywhere(robot: &Robot) -> Vec<Posture> {
    halton_stops(&robot.chain.ranges(), SAMPLES)
}

/// The part of [`FlangeModel::workspace`] that lies within all joint limits; the other fills the region of the stops with as many.
pub fn within_joint_limits(workspace: &[WorkspacePoint]) -> &[WorkspacePoint] {
    &workspace[workspace.len() / 2..]
}

/// What is needed to predict.
#[derive(Debug, Clone)]
pub struct FlangeModel<'a> {
    /// The robot whose derivatives count, without local errors, and what is exported of it, whose poses are stated.
    robot: Robot,
    exported: Robot,
    layout: &'a Layout,
    /// What stands still in the base frame, and its first column.
    still: Pose,
    still_column: usize,
    /// Of the dense columns.
    covariance: &'a DMatrix<f64>,
    /// What the tool (mean of `J` over the stops), and where asked for the base, take up: 6 x columns each, of body twists of flange and of base.
    fitted: [DMatrix<f64>; 2],
    base_is_fitted: bool,
    covered: Vec<(f64, f64)>,
    margin: f64,
}

impl<'a> FlangeModel<'a> {
    /// That of an adjustment and the covariance of its dense columns; `None` as of [`FlangeModel::new`].
    pub fn of(adjustment: &'a Adjustment, covariance: &'a DMatrix<f64>, limits: &Limits) -> Option<Self> {
        let Adjustment { problem, state } = adjustment;
        Self::new(&state.robot, &problem.layout, still(adjustment)?, covariance, &stops(problem), limits)
    }

    /// `still` is the plate (or the fixed camera) in the base frame with its first column; `None` without stops, or where nothing
    /// determines that pose.
    pub fn new(
        robot: &Robot,
        layout: &'a Layout,
        (still, still_column): (Pose, usize),
        covariance: &'a DMatrix<f64>,
        stops: &[Posture],
        limits: &Limits,
    ) -> Option<Self> {
        // The frame of a socket is parallel to the base.
        let known = (still_column..still_column + 3).all(|c| layout.columns[c].free && covariance[(c, c)] > 0.0);
        if stops.is_empty() || !known {
            return None;
        }
        let robot = robot.without_local_errors();
        let readings = robot.chain.readings.len();
        let range = |r: usize| extent(stops.iter().map(|s| s.readings[r]));
        let mut model = Self {
            exported: robot.as_exported(),
            robot,
            layout,
            still,
            still_column,
            covariance,
            fitted: [DMatrix::zeros(6, layout.theta_len()), DMatrix::zeros(6, layout.theta_len())],
            base_is_fitted: false,
            covered: (0..readings).map(range).collect(),
            margin: limits.covered_margin,
        };
        let sum = stops.iter().fold(model.fitted[0].clone(), |sum, s| sum + model.derivative(s).1);
        model.fitted[0] = sum / stops.len() as f64;
        // A tracker or a socket is gone after the calibration: right is what is right relative to the base that fits.
        let is_gone = layout.instruments.iter().any(|r| r.start == still_column);
        if is_gone { model.with_fitted_base(stops) } else { Some(model) }
    }

    /// Whether a fixed camera is what stands still.
    pub(super) fn is_relative_to_a_camera(&self) -> bool {
        self.layout.mountings.iter().any(|r| r.start == self.still_column)
    }

    /// The same relative to the base that fits the stops best, where nothing that stands still remains: least squares over
    /// tool and base, `J(q) = tool + Ad(pose(q)^-1) base`.
    pub(super) fn with_fitted_base(mut self, stops: &[Posture]) -> Option<Self> {
        let columns = self.layout.theta_len();
        let (mut n, mut rhs) = (DMatrix::zeros(12, 12), DMatrix::zeros(12, columns));
        for (pose, j) in stops.iter().map(|s| self.derivative(s)) {
            let mut a = DMatrix::identity(6, 12);
            a.fixed_view_mut::<6, 6>(0, 6).copy_from(&adjoint(&pose.inverse()));
            n += a.tr_mul(&a);
            rhs += a.tr_mul(&j);
        }
        let scale = n.diagonal().mean();
        (0..12).for_each(|k| n[(k, k)] += HELD * scale);
        let x = SymmetricFactor::new(&n).ok()?.solve_many(&rhs);
        self.base_is_fitted = true;
        self.fitted = [x.rows(0, 6).into_owned(), x.rows(6, 6).into_owned()];
        Some(self)
    }

    /// Pose relative to what stands still, and `J`, 6 x columns that act through the camera poses.
    fn derivative(&self, stop: &Posture) -> (Pose, DMatrix<f64>) {
        let kinematics = self.robot.kinematics_at(stop);
        let pose = self.still.inverse() * self.exported.base_from_tip_at(stop);
        let mut j = DMatrix::zeros(6, self.layout.theta_len());
        for (k, d) in kinematics.d_twists.iter().enumerate() {
            j.fixed_view_mut::<6, 6>(0, self.layout.twists.start + 6 * k).copy_from(d);
        }
        // Local errors, the last terms, are not in this robot.
        for (k, d) in kinematics.d_terms.iter().enumerate() {
            j.fixed_view_mut::<6, 1>(0, self.layout.terms.start + k).copy_from(d);
        }
        j.fixed_view_mut::<6, 6>(0, self.still_column).copy_from(&-adjoint(&pose.inverse()));
        (pose, j)
    }

    /// Flange at joint readings (rad or m), approach unknown.
    pub fn at(&self, readings: &[f64]) -> PredictedFlange {
        let (pose, j) = self.derivative(&Posture::at(readings));
        let covariance = self.propagated(&pose, &j, self.covariance);
        let outside = (self.covered.iter().zip(readings).zip(&self.robot.chain.readings))
            .filter(|(((low, high), q), _)| {
                let margin = self.margin * (high - low);
                **q < low - margin || **q > high + margin
            })
            .map(|(_, name)| name.clone())
            .collect();
        PredictedFlange { pose, covariance, outside }
    }

    /// `J` without what tool and base take up.
    fn fitted_out(&self, pose: &Pose, j: DMatrix<f64>) -> DMatrix<f64> {
        let [tool, base] = &self.fitted;
        let mut left = j - tool;
        if self.base_is_fitted {
            left -= dense(&adjoint(&pose.inverse())) * base;
        }
        left
    }

    fn propagated(&self, pose: &Pose, j: &DMatrix<f64>, covariance: &DMatrix<f64>) -> Matrix6<f64> {
        let j = self.fitted_out(pose, j.clone());
        let n = j.ncols();
        let c = &j * covariance.view((0, 0), (n, n)) * j.transpose();
        let c = Matrix6::from_column_slice(c.as_slice());
        (c + c.transpose()) * 0.5
    }

    /// Samples of the region of the stops.
    pub(super) fn region(&self) -> Vec<Posture> {
        halton_stops(&self.covered, SAMPLES)
    }

    /// Sigma of the position over samples, RMS of the length, m.
    pub(super) fn sigma_m(&self, samples: &[Posture]) -> f64 {
        let square = |s: &Posture| {
            let (pose, j) = self.derivative(s);
            let c = self.propagated(&pose, &j, self.covariance);
            (0..3).map(|k| c[(k, k)]).sum::<f64>().max(0.0)
        };
        root_of_mean(samples.iter().map(square))
    }

    /// How far a step of the columns that act through the camera poses moves the flange, and the stated sigma: lengths, RMS over the region of the stops, m.
    pub fn moved_m(&self, step: &DVector<f64>) -> [f64; 2] {
        let samples = self.region();
        let square = |s: &Posture| {
            let (pose, j) = self.derivative(s);
            (self.fitted_out(&pose, j) * step).rows(0, 3).norm_squared()
        };
        let moved = root_of_mean(samples.iter().map(square));
        [moved, self.sigma_m(&samples)]
    }

    /// 95 % interval of the root mean square of an error that is known up to the errors of the model: `known` gives, in the frame of
    /// the flange, what of it is known, m; `beside` is the mean square of what has nothing to do with the model, m^2.
    pub(super) fn interval_m(
        &self,
        samples: &[Posture],
        known: impl Fn(usize) -> Vector3<f64>,
        beside: Spread,
    ) -> [f64; 2] {
        let n = self.layout.theta_len();
        let mut sums = MeanSquare::new(n);
        for (k, sample) in samples.iter().enumerate() {
            let (pose, j) = self.derivative(sample);
            let j = self.fitted_out(&pose, j);
            sums.add(&j.fixed_rows::<3>(0).into_owned(), &known(k));
        }
        sums.interval_m(&self.covariance.view((0, 0), (n, n)).into_owned(), beside)
    }

    /// Samples of the region of the stops, then of everything within the joint limits.
    pub fn workspace(&self) -> Vec<WorkspacePoint> {
        let stops = self.region().into_iter().chain(everywhere(&self.robot));
        stops
            .map(|stop| {
                let found = self.at(&stop.readings);
                let [sigma_m, sigma_rad] = found.sigmas();
                WorkspacePoint {
                    xyz_m: self.exported.base_from_tip(&stop.readings).xyz(),
                    readings: stop.readings,
                    sigma_m,
                    sigma_rad,
                    covered: found.outside.is_empty(),
                }
            })
            .collect()
    }

    /// Ratio of the sigma of the flange's position by `other` to that by the covariance of this model, RMS over the stops' region.
    pub fn ratio_of(&self, other: &DMatrix<f64>) -> f64 {
        let (mut own_sum, mut other_sum) = (0.0, 0.0);
        for stop in halton_stops(&self.covered, SAMPLES) {
            let (pose, j) = self.derivative(&stop);
            let trace = |c: &Matrix6<f64>| (0..3).map(|k| c[(k, k)]).sum::<f64>();
            own_sum += trace(&self.propagated(&pose, &j, self.covariance));
            other_sum += trace(&self.propagated(&pose, &j, other));
        }
        (other_sum / f64::max(own_sum, f64::MIN_POSITIVE)).max(0.0).sqrt()
    }
}
