//! Covariance of predicted camera poses at any joint vectors: what the result is worth where no image was taken.

use nalgebra::{DMatrix, Matrix6};

use crate::geom::{Pose, adjoint};
use crate::model::robot::Posture;
use crate::problem::{Image, Problem, TakenFrom};
use crate::solve::Fit;

/// Which camera looks at which plate.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct View {
    /// Index of the series (for its joint noise).
    pub series: usize,
    /// Index of the mounting.
    pub mounting: usize,
    /// Index of the placement.
    pub placement: usize,
    /// True for a camera in the hand.
    pub mount: crate::series::CameraMount,
}

/// A camera pose that the calibrated model predicts.
#[derive(Debug, Clone, PartialEq)]
pub struct PredictedPose {
    /// `plate_from_camera` for readings without noise.
    pub plate_from_camera: Pose,
    /// Covariance of its body twist [rho, phi] from the uncertainty of the model alone, m and rad.
    pub model: Matrix6<f64>,
    /// Covariance that the joint noise of a single stop adds.
    pub joint_noise: Matrix6<f64>,
}

impl PredictedPose {
    /// Standard deviation of the position, root of the mean over the axes, from the model alone, m.
    pub fn position_sigma_m(&self) -> f64 {
        ((0..3).map(|k| self.model[(k, k)]).sum::<f64>() / 3.0).max(0.0).sqrt()
    }
}

impl View {
    /// The view of the first image on the robot; `None` where there is none.
    pub fn first(problem: &Problem) -> Option<Self> {
        let first = (0..problem.images.len()).find(|&i| problem.on_robot(i))?;
        let image = &problem.images[first];
        let Image { series, mounting, placement, mount, .. } = *image;
        Some(Self { series, mounting, placement, mount })
    }
}

/// Pose and covariance at `readings` (rad or m, in the order of the chain), approach unknown.
///
/// First-order propagation of the joint covariance of robot, mounting and placement: `G cov G'`, turned into the plate frame.
pub fn predict_pose(fit: &Fit, view: View, readings: &[f64]) -> Option<PredictedPose> {
    let layout = &fit.problem.layout;
    let image = Image {
        name: String::new(),
        series: view.series,
        stop: 0,
        camera: 0,
        mounting: view.mounting,
        placement: view.placement,
        plate: 0,
        mount: view.mount,
        observations: Vec::new().into(),
        rejected: None,
    };
    let (posture, exact) = (Posture::at(readings), vec![0.0; readings.len()]);
    let chain = fit.state.chained(layout, &image, TakenFrom::rigid(&posture, &exact))?;
    let theta = layout.theta_len();
    let of_theta = fit.covariance.reduced.view((0, 0), (theta, theta));
    let model = &chain.d_theta * of_theta * chain.d_theta.transpose();
    let noise = nalgebra::DVector::from_vec(fit.problem.joint_sigma(fit.problem.noise_of(view.series))).map(|s| s * s);
    let noise = &chain.d_latent * DMatrix::from_diagonal(&noise) * chain.d_latent.transpose();
    // A body twist d of camera_from_plate is the body twist -Ad d of its inverse.
    let turned = |c: DMatrix<f64>| {
        let ad = adjoint(&chain.pose);
        let c = ad * Matrix6::from_column_slice(c.as_slice()) * ad.transpose();
        (c + c.transpose()) * 0.5
    };
    Some(PredictedPose { plate_from_camera: chain.pose.inverse(), model: turned(model), joint_noise: turned(noise) })
}
