//! Controllers of Universal Robots compute in the frame `base`, which their descriptions have beside `base_link`, turned by half a turn.

use super::compensate_frames::SAME_ORIGIN;
use crate::diagnose::Weight;
use crate::error::Code;
use crate::geom::Pose;
use crate::output::corrections::FileFinding;
use crate::urdf::RobotDescription;

const NAME: &str = "base";

/// Poses of URScript in another frame than that, with what they are and how much that weighs; `None` where it is the base of the chain, or none of the description.
pub(super) fn controller_base(
    description: &RobotDescription,
    [base, tip]: [&str; 2],
    (weight, poses): (Weight, &str),
) -> Option<FileFinding> {
    let (_, base_from_controller) = description.fixed_base(NAME, tip).filter(|(link, _)| *link == base)?;
    let (rad, m) = base_from_controller.distance(&Pose::identity());
    let (deg, mm) = (rad.to_degrees(), 1e3 * m);
    let is_other = m > SAME_ORIGIN || rad > SAME_ORIGIN;
    let text = format!(
        "{poses} in {base}, and controllers of Universal Robots compute in {NAME}, which is turned by {deg:.0} deg from it and lies {mm:.0} mm away: give --base {NAME}"
    );
    let quantities = [("angle_deg", deg), ("distance_mm", mm)];
    is_other.then(|| FileFinding::new(Code::ControllerBase, weight, description.path.display(), quantities, text))
}
