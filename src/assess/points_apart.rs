//! Measured points that do not belong with the others: single ones, or all from some row on.

use nalgebra::{SMatrix, SVector, Vector3};

use super::Limits;
use super::points::{MeasuredPoint, PointFit, by_frame_and_reflector, fit_points};
use super::statistics::log_chance;
use crate::linalg::median;
use crate::model::robot::Robot;

/// Points that miss by far more than the others.
#[derive(Debug, Clone, PartialEq)]
pub struct OddPoints {
    /// Their indices.
    pub points: Vec<usize>,
    /// How far each is from where the others put it, m.
    pub off_m: Vec<f64>,
    /// The fit of the others.
    pub without: PointFit,
}

/// Points that are more than `set_aside_factor` times the median, and more than `displaced_m`, from where the others put them, with the fit of
/// these: least squares over what is left, until it is the same. `None` where there is none, or more than a fifth.
pub fn odd_points(robot: &Robot, points: &[MeasuredPoint], limits: &Limits) -> Option<OddPoints> {
    let mut odd: Vec<usize> = Vec::new();
    loop {
        let kept: Vec<MeasuredPoint> =
            points.iter().enumerate().filter(|(k, _)| !odd.contains(k)).map(|(_, p)| p.clone()).collect();
        let without = fit_points(robot, &kept)?;
        let usual = median(without.residuals_m.iter().map(Vector3::norm).collect::<Vec<_>>())?;
        let bound = (limits.set_aside_factor * usual).max(limits.displaced_m);
        let off_m: Vec<f64> = points.iter().map(|p| without.residual_m(robot, p).norm()).collect();
        let found: Vec<usize> = (0..points.len()).filter(|k| off_m[*k] > bound).collect();
        if found.len() * limits.touches_for_one_left_out > points.len() {
            return None;
        }
        // They only grow in number, so that it ends.
        let all: Vec<usize> = (0..points.len()).filter(|k| odd.contains(k) || found.contains(k)).collect();
        if all == odd {
            let off_m = odd.iter().map(|k| off_m[*k]).collect();
            return (!odd.is_empty()).then_some(OddPoints { points: odd, off_m, without });
        }
        odd = all;
    }
}

/// A device, or a base of the robot, that stands elsewhere from some point on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DeviceMoved {
    /// First point after it.
    pub first: usize,
    /// How far the points behind it are displaced, RMS, m.
    pub by_m: f64,
    /// What the points leave with a frame before it and one behind it, RMS, m.
    pub rms_m: f64,
}

/// The device elsewhere from some point on by more than `displaced_m`, where that explains more than `displaced_share` of the squares of the
/// residuals, and chance does not.
///
/// The fit is linear in a second frame: with `A` the derivatives by it of the points behind the step, what those by frame and reflector take
/// up projected out, the squares fall by `g' J^-1 g`, `g = A' r`, `J = A' A`.
pub fn device_moved(robot: &Robot, points: &[MeasuredPoint], fit: &PointFit, limits: &Limits) -> Option<DeviceMoved> {
    let by = |p: &MeasuredPoint| {
        by_frame_and_reflector(&fit.device_from_base, &robot.base_from_tip(&p.readings), &fit.tip_point_m)
    };
    let derivatives: Vec<SMatrix<f64, 3, 9>> = points.iter().map(by).collect();
    let normal = derivatives.iter().map(|d| d.transpose() * d).sum::<SMatrix<f64, 9, 9>>().cholesky()?;
    let squares: f64 = fit.residuals_m.iter().map(Vector3::norm_squared).sum();
    let (mut behind, mut score) = (SMatrix::<f64, 9, 9>::zeros(), SVector::<f64, 9>::zeros());
    let mut best: Option<(f64, usize, SVector<f64, 6>)> = None;
    let least = limits.displaced_images;
    for first in (least..points.len()).rev() {
        let d = &derivatives[first];
        behind += d.transpose() * d;
        score += d.transpose() * fit.residuals_m[first];
        if points.len() - first < least {
            continue;
        }
        let with_fitted = behind.fixed_rows::<6>(0).into_owned();
        let own = behind.fixed_view::<6, 6>(0, 0) - with_fitted * normal.solve(&with_fitted.transpose());
        let score = score.fixed_rows::<6>(0).into_owned();
        let Some(change) = own.cholesky().map(|factor| factor.solve(&score)) else { continue };
        let fall = score.dot(&change);
        if best.as_ref().is_none_or(|(most, ..)| fall > *most) {
            best = Some((fall, first, change));
        }
    }
    let (fall, first, change) = best?;
    let share = fall / squares;
    let left = (3 * points.len()).saturating_sub(9) as f64;
    let chance = log_chance(share, left, 6) + (points.len() as f64).ln();
    if share <= limits.displaced_share || chance > limits.displaced_false_alarms.ln() {
        return None;
    }
    let displaced: f64 = derivatives[first..].iter().map(|d| (d.fixed_columns::<6>(0) * change).norm_squared()).sum();
    let by_m = (displaced / (points.len() - first) as f64).sqrt();
    let rms_m = ((squares - fall).max(0.0) / points.len() as f64).sqrt();
    (by_m > limits.displaced_m).then_some(DeviceMoved { first, by_m, rms_m })
}
