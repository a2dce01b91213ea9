//! Mistakes in the joint readings of measured points: a sign, or two joints exchanged.

use super::Limits;
use super::points::{MeasuredPoint, fit_points};
use crate::model::robot::Robot;

/// What is wrong with the readings; joints by the index of their reading.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ReadingMistake {
    /// One has the other sign.
    Reversed(usize),
    /// Two stand in each other's place.
    Exchanged(usize, usize),
}

impl ReadingMistake {
    fn undone(self, points: &[MeasuredPoint]) -> Vec<MeasuredPoint> {
        let mut points = points.to_vec();
        for MeasuredPoint { readings, .. } in &mut points {
            match self {
                Self::Reversed(joint) => readings[joint] = -readings[joint],
                Self::Exchanged(a, b) => readings.swap(a, b),
            }
        }
        points
    }
}

/// The mistake without which points leave least, with the RMS (m) that they leave then, where that is less than `mistake_explains` times `rms_m`.
pub fn reading_mistake(
    robot: &Robot,
    points: &[MeasuredPoint],
    rms_m: f64,
    limits: &Limits,
) -> Option<(ReadingMistake, f64)> {
    let joints = robot.chain.readings.len();
    let exchanged = (0..joints).flat_map(|a| (a + 1..joints).map(move |b| ReadingMistake::Exchanged(a, b)));
    let tried = (0..joints).map(ReadingMistake::Reversed).chain(exchanged);
    let left = |mistake: ReadingMistake| Some((mistake, fit_points(robot, &mistake.undone(points))?.rms_m));
    let best = tried.filter_map(left).min_by(|a, b| a.1.total_cmp(&b.1))?;
    Some(best).filter(|(_, left)| *left < limits.mistake_explains * rms_m)
}
