//! A calibrated model against known truth.

use nalgebra::Vector3;

use super::points::{MeasuredPoint, fit_points};
use crate::geom::Pose;
use crate::model::robot::Robot;

/// RMS error of the flange's position relative to the plate, m, over held-out readings.
///
/// Plate frame and tool frame are gauge: the rigid motion of the plate and the point on the flange that fit best are taken out
/// (nine numbers), as a tracker would. `poses` holds readings and the true `base_from_tip`; `None` for too few of them.
pub fn flange_error_m(robot: &Robot, base_from_plate: &Pose, poses: &[(Vec<f64>, Pose)]) -> Option<f64> {
    let plate_from_base = base_from_plate.inverse();
    let points: Vec<MeasuredPoint> = poses
        .iter()
        .map(|(readings, tip)| MeasuredPoint {
            position_m: (plate_from_base * *tip).translation,
            readings: readings.clone(),
        })
        .collect();
    fit_points(robot, &points).map(|fit| fit.rms_m)
}

/// Errors of predicted positions of the camera in the plate frame, m, nothing aligned: `(predicted, true)` `plate_from_camera`.
pub fn camera_errors_m(poses: &[(Pose, Pose)]) -> Vec<Vector3<f64>> {
    poses.iter().map(|(predicted, truth)| predicted.translation - truth.translation).collect()
}
