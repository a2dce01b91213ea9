//! Zeros of the joints elsewhere than those of the robot description, where readings and images fit with these and then only.

use crate::assess::Limits;
use crate::fit::FreePoses;
use crate::identify::mistakes::suspects::{best_scale, directions_alone, left_by_scale};
use crate::init::{PosePair, SeenStop, Zeros, hand_eye_misfit, shah, solve_slopes, solve_zeros};
use crate::model::robot::Robot;
use crate::problem::Adjustment;
use crate::urdf::Chain;

/// A chain whose readings and images belong together, and did not before.
pub(in crate::identify) struct OtherZeros {
    /// With these zeros.
    pub chain: Chain,
    /// Median misfit as described, rad + m.
    pub as_described: f64,
}

/// Gives joints other zeros, and one of them the other direction, where readings and images fit then and only then.
pub(super) fn place_zeros(adjustment: &mut Adjustment, free: &FreePoses, limits: &Limits) {
    if let Some(found) = other_zeros(adjustment, free, limits) {
        adjustment.state.robot.chain = found.chain;
    }
}

/// Other zeros of the joints, and the other direction of one of them, where readings and images fit then and only then. A single mistake without
/// other zeros is left to be named.
pub(in crate::identify) fn other_zeros(
    adjustment: &Adjustment,
    free: &FreePoses,
    limits: &Limits,
) -> Option<OtherZeros> {
    let robot = &adjustment.state.robot;
    let is_found = robot.chain.joints.iter().any(|j| j.found.is_some());
    if is_found || robot.chain.base_moves() || robot.chain.pose_coordinates().is_some() {
        return None;
    }
    let stops = free.most_seen_stops(&adjustment.problem, adjustment.problem.used().map(|(i, _)| i));
    if stops.len() < limits.zeros_images {
        return None;
    }
    let pairs: Vec<PosePair> = stops.iter().map(|stop| stop.pair(robot)).collect();
    let as_described = suspicious_misfit(&pairs, limits)?;
    let best = zeros_told(robot, &stops, (&pairs, as_described), limits)?;
    let mut chain = robot.chain.clone();
    for (reading, &offset) in best.offsets.iter().enumerate() {
        chain = chain.with_zero(reading, offset, best.reversed == Some(reading))?;
    }
    Some(OtherZeros { chain, as_described })
}

/// Median misfit as described, rad + m, where something is wrong.
fn suspicious_misfit(pairs: &[PosePair], limits: &Limits) -> Option<f64> {
    // The closed form of all images is enough to see that nothing is wrong.
    let of_all = shah(pairs).map_or(f64::INFINITY, |s| s.median_error(pairs));
    if of_all < limits.suspicious_misfit {
        return None;
    }
    let of_samples = hand_eye_misfit(pairs);
    if of_samples < limits.suspicious_misfit { None } else { Some(of_samples) }
}

/// The zeros with which readings and images fit, where no others and nothing else explain what they miss by.
fn zeros_told(
    robot: &Robot,
    stops: &[SeenStop],
    (pairs, as_described): (&[PosePair], f64),
    limits: &Limits,
) -> Option<Zeros> {
    // A joint that stands upside down with all behind it is the same arm with zeros half a turn off.
    let is_plausible = |z: &Zeros| z.offsets.iter().all(|o| o.abs() < limits.zeros_most_rad);
    let mut tried = solve_zeros(robot, stops).into_iter().filter(is_plausible);
    let best = tried.next()?;
    let otherwise = tried.next().map_or(f64::INFINITY, |next| next.left).min(as_described);
    let is_far = best.offsets.iter().any(|o| o.abs() > limits.zeros_off_rad);
    let explains = best.left < limits.zeros_explain && best.left < limits.zeros_explain_share * otherwise;
    // What is a matter of no fit and of no other size: zeros that leave nothing suspicious. Those of parallel joints whose sum vanishes turn nothing, and look
    // like links or a plate of another size.
    let by_scale = || best_scale(pairs).and_then(|scale| left_by_scale(pairs, scale)).unwrap_or(f64::INFINITY);
    let are_clear = || {
        let explain_all = best.left < limits.mistake_explains * as_described;
        best.left < limits.suspicious_misfit
            && (explain_all || directions_alone(pairs, limits).is_some())
            && best.left < limits.zeros_explain_share * by_scale()
    };
    // Others are a matter of the fit as long as it starts.
    let is_needed = best.reversed.is_some() || as_described > limits.hand_eye_spread || are_clear();
    // A reading that is wrong by a ratio looks like other zeros, as far as it stays on one side of its own.
    let by_ratio = || {
        let tried = solve_slopes(robot, stops).and_then(|slopes| slopes.tried.into_iter().next());
        tried.is_some_and(|slope| slope.left < limits.zeros_explain_share * best.left)
    };
    (is_far && explains && is_needed && !by_ratio()).then_some(best)
}
