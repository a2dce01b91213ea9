//! Touched places that lie further apart, or closer, than the robot of the solution has them: all their distances are off by the same ratio.

use crate::assess::Limits;
use crate::frames::{Given, KnownRobot, TouchPlace, Touches, fit};

/// Change of the size by which the first parabola is laid, and parabolas; the others are as wide as the size is uncertain, so that the same touches
/// are left out along them.
const FIRST_STEP: f64 = 3e-3;
const ROUNDS: usize = 3;

/// The ratio, less one, by which touched places lie further apart than the robot has them, with its sigma.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TouchSize {
    /// Larger is positive.
    pub off: f64,
    /// By the stated sigmas and the covariance of the solution.
    pub sigma: f64,
}

/// The size that fits best: the sum of the squares of all residuals in their sigmas is a parabola over it. `None` where it has no minimum, or no place
/// is known.
pub fn size_of_places(robot: &KnownRobot, touches: &Touches, given: &Given, limits: &Limits) -> Option<TouchSize> {
    if touches.frame.is_none() || given.plate.is_some() {
        return None;
    }
    let squares = |off: f64| {
        let found = fit(robot, &of_size(touches, off), given, limits).ok()?.as_stated;
        Some(found.size.powi(2) * found.freedom as f64)
    };
    let mut found = TouchSize { off: 0.0, sigma: f64::INFINITY };
    for _ in 0..ROUNDS {
        let step = found.sigma.min(FIRST_STEP);
        let [below, here, above] = [-step, 0.0, step].map(|change| squares(found.off + change));
        let (below, here, above) = (below?, here?, above?);
        let curvature = (above - 2.0 * here + below) / step.powi(2);
        if curvature <= 0.0 || curvature.is_nan() {
            return None;
        }
        found =
            TouchSize { off: found.off - (above - below) / (2.0 * step * curvature), sigma: (2.0 / curvature).sqrt() };
    }
    Some(found)
}

/// Touches whose places lie closer by a ratio.
pub fn of_size(touches: &Touches, off: f64) -> Touches {
    let mut undone = touches.clone();
    for touch in &mut undone.all {
        match &mut touch.seen {
            TouchPlace::Point(place) => *place /= 1.0 + off,
            TouchPlace::Pose(pose) => pose.translation /= 1.0 + off,
            TouchPlace::Unknown(_) => (),
        }
    }
    undone
}
