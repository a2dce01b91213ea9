//! How the bases of two arms stand to each other, from what both read and the camera sees.

use super::between::{PoseTriple, solve_between};
use super::zeros::SeenStop;
use crate::geom::Pose;
use crate::model::robot::Robot;
use crate::series::CameraMount;
use crate::urdf::{FoundOrigin, Joint};

/// The joint between the bases of two arms that has no origin yet.
pub fn unplaced(robot: &Robot) -> Option<usize> {
    robot.chain.joints.iter().position(|j| j.is_between_bases() && j.origin == Pose::identity())
}

/// The joint between the bases of two arms whose origin was found.
pub fn found(robot: &Robot) -> Option<usize> {
    let is_found = |j: &Joint| j.is_between_bases() && matches!(j.found, Some(FoundOrigin::Pose));
    robot.chain.joints.iter().position(is_found)
}

/// The robot with the origin of this joint between its bases as these stops have it; `None` where they do not tell.
pub fn placed(robot: &Robot, joint: usize, stops: &[SeenStop]) -> Option<Robot> {
    let mount = stops.first()?.mount;
    let triple = |stop: &SeenStop| {
        let behind = robot.link_poses(&stop.readings);
        let tip = behind.last().copied().unwrap_or_else(Pose::identity);
        let second = joint.checked_sub(1).map_or_else(Pose::identity, |before| behind[before]);
        let first = behind[joint].inverse() * tip;
        let camera_from_plate = stop.camera_from_plate;
        match mount {
            CameraMount::Hand => PoseTriple { camera_from_plate, before: first.inverse(), after: second.inverse() },
            CameraMount::Fixed => PoseTriple { camera_from_plate, before: second, after: first },
        }
    };
    let (pose, _) = solve_between(&stops.iter().map(triple).collect::<Vec<_>>())?;
    let mut placed = robot.clone();
    let joint = &mut placed.chain.joints[joint];
    joint.origin = if mount == CameraMount::Hand { pose.inverse() } else { pose };
    joint.found = Some(FoundOrigin::Pose);
    Some(placed)
}
