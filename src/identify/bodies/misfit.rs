//! How well what an instrument saw of a body fits the readings.

use super::points_start::{PointAt, agreeing, once_a_posture, usual_distance};
use crate::geom::Pose;
use crate::init::{PosePair, hand_eye_misfit};
use crate::model::robot::Robot;
use crate::problem::{BodyMeasurement, BodySeen, Problem};

/// Poses from which the closed forms follow.
pub(super) const FEWEST_POSES: usize = 3;

/// What an instrument saw of a body, and the readings at its stop.
pub(super) struct BodyAtStop {
    /// The instrument, by its index.
    pub instrument: usize,
    /// The stop, by its index.
    pub stop: usize,
    /// What it saw.
    pub seen: BodySeen,
    /// Readings, rad or m.
    pub readings: Vec<f64>,
}

impl BodyAtStop {
    /// A measurement; `None` off the robot.
    pub fn of(problem: &Problem, measured: &BodyMeasurement) -> Option<Self> {
        let BodyMeasurement { instrument, stop, seen, .. } = *measured;
        let readings = problem.stops[stop].posture.as_ref()?.readings.clone();
        Some(Self { instrument, stop, seen, readings })
    }

    /// The same at other readings.
    pub fn at(&self, readings: Vec<f64>) -> Self {
        Self { readings, ..*self }
    }
}

/// Median misfit of the poses (rad + m), or of the points (m), with readings.
pub(super) fn usual_misfit(robot: &Robot, seen: &[BodyAtStop]) -> f64 {
    let tips: Vec<Pose> = seen.iter().map(|s| robot.base_from_tip(&s.readings)).collect();
    let pair = |(seen, tip): (&BodyAtStop, &Pose)| match seen.seen {
        BodySeen::Pose(pose) => Some(PosePair { camera_from_plate: pose, chain: *tip }),
        BodySeen::Point(_) => None,
    };
    let pairs: Vec<PosePair> = seen.iter().zip(&tips).filter_map(pair).collect();
    if pairs.len() >= FEWEST_POSES {
        return hand_eye_misfit(&pairs);
    }
    let points = once_a_posture(&seen.iter().map(|s| s.seen.position()).zip(tips).collect::<Vec<PointAt>>());
    agreeing(&points).map_or(f64::INFINITY, |placed| usual_distance(&points, &placed))
}
