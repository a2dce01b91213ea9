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
    let is_other = m > limits.same_base_m || rad > limits.same_work_rad;
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
        let flange = work_from_base * robot.base_from_tip_at(posture);
        flange.translation.z - first.z
    };
    let is_below = touches.postures.iter().all(|posture| height(posture) < 0.0);
    let text =
        "the tool came from below the plane of the places (from negative z) at every touch: if that is not so, a coordinate of the places is mirrored"
            .to_owned();
    (is_flat && is_below).then(|| FileFinding::new(Code::TouchedFromBelow, Weight::Note, subject, [], text))
}

/// The frame in which the work object is stated moves against the link that carries the robot.
pub fn carried(robot: &Robot, work: Option<&str>, subject: &str) -> Option<FileFinding> {
    let work = work.filter(|_| robot.chain.base_moves())?;
    let base = &robot.chain.base;
    let text = format!(
        "{work} is stated in {base}, which joints of the robot move: it goes with {base}, as a work object on a positioner does, and stands in frames.json and in the URDF alone: frames of a controller stand still. One that stands still is found by touches in a solution whose base stands still (identify --base)"
    );
    Some(FileFinding::new(Code::WorkCarried, Weight::Note, subject, [], text))
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::carried;
    use crate::error::Code;
    use crate::model::robot::Robot;
    use crate::urdf::RobotDescription;

    #[test]
    fn a_work_object_on_a_link_that_moves_is_carried() {
        let joint = |name: &str, parent: &str, child: &str| {
            format!(
                r#"<link name="{child}"/><joint name="{name}" type="revolute"><parent link="{parent}"/><child link="{child}"/><origin xyz="0.3 0 0.2"/>
                <axis xyz="0 0 1"/><limit lower="-3" upper="3" effort="0" velocity="1"/></joint>"#
            )
        };
        let arm = joint("a1", "foot", "upper") + &joint("a2", "upper", "tool") + &joint("turn", "foot", "table");
        let text = format!(r#"<robot name="cell"><link name="foot"/>{arm}</robot>"#);
        let cell = RobotDescription::from_text(Path::new("cell.urdf"), text).unwrap();
        let robot = |base| Robot::nominal(cell.chain(Some(base), Some("tool")).unwrap());
        let found = carried(&robot("table"), Some("work"), "solution.json").unwrap();
        assert_eq!(found.code, Code::WorkCarried);
        assert_eq!(carried(&robot("foot"), Some("work"), "solution.json"), None);
        assert_eq!(carried(&robot("table"), None, "solution.json"), None);
    }
}
