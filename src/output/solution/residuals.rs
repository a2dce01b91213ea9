//! Residuals of every observation at the estimates, used or not.

use nalgebra::Vector2;

use crate::geom::Pose;
use crate::problem::{Adjustment, predict};
use crate::solve::Fit;

/// Where each image was taken from, as the estimates say: with its joint noise for images in use, from the readings alone
/// for those left out, `None` where there is neither.
pub fn poses(fit: &Fit) -> Vec<Option<Pose>> {
    let images = 0..fit.problem.images.len();
    let mut poses: Vec<Option<Pose>> = images.map(|i| fit.camera_by_readings(i)).collect();
    for (&i, chain) in fit.linearised.images.iter().zip(&fit.linearised.chains) {
        poses[i] = Some(chain.pose);
    }
    poses
}

/// Measured minus predicted, px, of every observation of an image; `None` where nothing can be predicted, as of a marker that wrong readings
/// put beside the camera.
pub fn residuals(
    Adjustment { problem, state }: &Adjustment,
    image: usize,
    pose: Option<&Pose>,
) -> Vec<Option<Vector2<f64>>> {
    let i = &problem.images[image];
    let predicted = |o| predict(i, state, pose?, o).filter(|p| p.uv.iter().all(|px| px.is_finite()));
    let residual = |o| predicted(o).map(|p| o.uv - p.uv);
    i.observations.iter().map(residual).collect()
}
