//! What a measured work object says of the frame that its places are given in.

use nalgebra::Vector3;

use crate::assess::Limits;
use crate::diagnose::Weight;
use crate::error::Code;
use crate::frames::{FrameFit, Touches};
use crate::geom::Pose;
use crate::model::robot::{Posture, Robot};
use crate::output::corrections::FileFinding;

/// The places are said to stand in the base of the robot, and their frame does not.
pub fn other_frame(base: &str, (fit, name): (&FrameFit, &str), limits: &Limits, subject: &str) -> Option<FileFinding> {
    let work = fit.work.filter(|_| name == base)?;
    let (rad, m) = work.distance(&Pose::identity());
    let text = format!(
        "the places are said to stand in {}, and by the touches their frame lies {:.0} mm and {:.1} degrees from it: another frame; name it in [contact] frame",
        base,
        1e3 * m,
        rad.to_degrees()
    );
    let is_other = m > limits.same_tool_m || rad > limits.same_work_rad;
    let quantities = [("distance_mm", 1e3 * m), ("angle_deg", rad.to_degrees())];
    is_other.then(|| FileFinding::new(Code::FramesDiffer, Weight::Gate, subject, quantities, text))
}

/// Places of one plane that were all touched from its negative side: by mirrored coordinates the plane looks the other way, and nothing else
/// tells.
pub fn from_below(
    robot: &Robot,
    (fit, touches): (&FrameFit, &Touches),
    limits: &Limits,
    subject: &str,
) -> Option<FileFinding> {
    let work_from_base = fit.work?.inverse();
    let places: Vec<Vector3<f64>> = touches.placed().map(|(_, place)| place).collect();
    let first = places.first()?;
    let is_flat = places.iter().all(|place| (place.z - first.z).abs() < limits.flat_places_m);
    let height = |posture: &Posture| {
        let flange = work_from_base * robot.pose_at(posture, &vec![0.0; posture.readings.len()]);
        flange.translation.z - first.z
    };
    let is_below = touches.postures.iter().all(|posture| height(posture) < 0.0);
    let text =
        "the tool came from below the plane of the places (from negative z) at every touch: if that is not so, a coordinate of the places is mirrored"
            .to_owned();
    (is_flat && is_below).then(|| FileFinding::new(Code::TouchedFromBelow, Weight::Note, subject, [], text))
}
