//! Points of a device of another size than the robot: all their distances are too long or too short alike.

use nalgebra::Vector3;

use super::Limits;
use super::points::{MeasuredPoint, PointFit, fit_points};
use crate::model::robot::Robot;

/// Change of the size by which residuals are differentiated.
const STEP: f64 = 1e-4;
/// Steps to the size that leaves least: residuals are nearly linear in it.
const STEPS: usize = 3;

/// By how much points lie further apart than the robot has them, relative, and the RMS that they leave with that, m.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SizeOfPoints {
    /// Larger is positive.
    pub off: f64,
    /// With the size that fits best, m.
    pub left_m: f64,
}

/// The size with which points fit best, where they leave less than `mistake_explains` of what they leave as they are.
pub fn size_of_points(
    robot: &Robot,
    points: &[MeasuredPoint],
    fit: &PointFit,
    limits: &Limits,
) -> Option<SizeOfPoints> {
    let of_size = |off: f64| {
        let smaller = |p: &MeasuredPoint| MeasuredPoint { position_m: p.position_m / (1.0 + off), ..p.clone() };
        fit_points(robot, &points.iter().map(smaller).collect::<Vec<_>>())
    };
    let (mut off, mut best) = (0.0, fit.clone());
    for _ in 0..STEPS {
        let by_size: Vec<Vector3<f64>> =
            of_size(off + STEP)?.residuals_m.iter().zip(&best.residuals_m).map(|(a, b)| (a - b) / STEP).collect();
        let slope = by_size.iter().map(Vector3::norm_squared).sum::<f64>();
        let along = by_size.iter().zip(&best.residuals_m).map(|(d, r)| d.dot(r)).sum::<f64>();
        off -= along / slope.max(f64::MIN_POSITIVE);
        best = of_size(off)?;
    }
    let found = SizeOfPoints { off, left_m: best.rms_m };
    Some(found).filter(|found| found.left_m < limits.mistake_explains * fit.rms_m)
}
