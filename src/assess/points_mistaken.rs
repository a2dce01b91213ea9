//! Mistakes in measured points and their joint readings: a sign, two joints exchanged, left-handed axes, rows of the one beside those of the other.

use super::Limits;
use super::points::{MeasuredPoint, fit_points};
use crate::model::robot::Robot;

/// What is wrong; joints by the index of their reading.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ReadingMistake {
    /// One has the other sign.
    Reversed(usize),
    /// Two stand in each other's place.
    Exchanged(usize, usize),
    /// One axis of the points counts the other way: which one, frames that are fitted do not tell.
    Mirrored,
    /// Every point has the readings of the row above it (true), or below.
    Shifted(bool),
}

impl ReadingMistake {
    fn undone(self, points: &[MeasuredPoint]) -> Vec<MeasuredPoint> {
        let with_readings_of = |(point, other): (&MeasuredPoint, &MeasuredPoint)| MeasuredPoint {
            readings: other.readings.clone(),
            ..point.clone()
        };
        let next = points.iter().skip(1);
        let mut undone = match self {
            Self::Shifted(true) => return points.iter().zip(next).map(with_readings_of).collect(),
            Self::Shifted(false) => return next.zip(points).map(with_readings_of).collect(),
            _ => points.to_vec(),
        };
        for MeasuredPoint { readings, position_m } in &mut undone {
            match self {
                Self::Reversed(joint) => readings[joint] = -readings[joint],
                Self::Exchanged(a, b) => readings.swap(a, b),
                Self::Mirrored => position_m.x = -position_m.x,
                Self::Shifted(_) => {}
            }
        }
        undone
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
    let others = [ReadingMistake::Mirrored, ReadingMistake::Shifted(true), ReadingMistake::Shifted(false)];
    let tried = (0..joints).map(ReadingMistake::Reversed).chain(exchanged).chain(others);
    let left = |mistake: ReadingMistake| Some((mistake, fit_points(robot, &mistake.undone(points))?.rms_m));
    let best = tried.filter_map(left).min_by(|a, b| a.1.total_cmp(&b.1))?;
    Some(best).filter(|(_, left)| *left < limits.mistake_explains * rms_m)
}
