//! Frame of an instrument and body on the tip from what was seen at some tips, points or poses, and how far each is from it.

use super::misfit::FEWEST_POSES;
use super::points_start::{FEWEST_POINTS, Placed, PointAt, agreeing_in_part};
use crate::geom::Pose;
use crate::init::{PosePair, solve_hand_eye};
use crate::problem::BodySeen;

/// What was seen of a body, with the pose of the tip.
pub(in crate::identify) type SeenFrom = (BodySeen, Pose);

/// The pairs of those that are poses.
pub(super) fn pairs(seen: &[SeenFrom]) -> Vec<PosePair> {
    let pair = |(seen, tip): &SeenFrom| match seen {
        BodySeen::Pose(pose) => Some(PosePair { camera_from_plate: *pose, chain: *tip }),
        BodySeen::Point(_) => None,
    };
    seen.iter().filter_map(pair).collect()
}

/// All as points.
pub(super) fn points(seen: &[SeenFrom]) -> Vec<PointAt> {
    seen.iter().map(|(seen, tip)| (seen.position(), *tip)).collect()
}

/// What most of these fit, or of points a part of them where most do not fit to `bound`, m; `None` where they are too few or determine nothing.
pub(in crate::identify) fn placed(seen: &[SeenFrom], bound: f64) -> Option<Placed> {
    let pairs = pairs(seen);
    if pairs.len() >= FEWEST_POSES {
        return solve_hand_eye(&pairs).into_iter().next().map(|s| (s.solution.camera, s.solution.plate));
    }
    Some(points(seen))
        .filter(|points| points.len() >= FEWEST_POINTS)
        .and_then(|points| agreeing_in_part(&points, bound))
}

/// How far a body is from where the tip carries it: m of a point, rad + m of a pose.
pub(in crate::identify) fn missed((seen, tip): &SeenFrom, (frame, body): &Placed) -> f64 {
    match seen {
        BodySeen::Point(at) => (frame.transform(at) - tip.transform(&body.translation)).norm(),
        BodySeen::Pose(pose) => (*frame * *pose).misfit(&(*tip * *body)),
    }
}
