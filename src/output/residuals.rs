//! Residuals of every observation at the estimates, used or not.

use nalgebra::Vector2;

use crate::geom::Pose;
use crate::identify::Solution;
use crate::problem::predict;

/// Where each image was taken from, as the estimates say: with its joint noise for images in use, from the readings alone
/// for those left out, `None` where there is neither.
pub(super) fn poses(solution: &Solution) -> Vec<Option<Pose>> {
    let images = 0..solution.fit.problem.images.len();
    let mut poses: Vec<Option<Pose>> = images.map(|i| solution.fit.camera_by_readings(i)).collect();
    for (&i, chain) in solution.fit.linearised.images.iter().zip(&solution.fit.linearised.chains) {
        poses[i] = Some(chain.pose);
    }
    poses
}

/// Measured minus predicted, px, of every observation of an image; `None` where nothing can be predicted, as of a marker that wrong readings
/// put beside the camera.
pub(super) fn residuals(solution: &Solution, image: usize, pose: Option<&Pose>) -> Vec<Option<Vector2<f64>>> {
    let i = &solution.fit.problem.images[image];
    let predicted = |o| predict(i, &solution.fit.state, pose?, o).filter(|p| p.uv.iter().all(|px| px.is_finite()));
    let residual = |o| predicted(o).map(|p| o.uv - p.uv);
    i.observations.iter().map(residual).collect()
}
