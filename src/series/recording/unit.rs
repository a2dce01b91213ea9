//! The unit of the angles in joint states.

use std::path::Path;

use super::motion::Posture;
use super::options::RecordingOptions;
use crate::error::{Code, Notice};
use crate::series::AngleUnit;
use crate::series::units::SMALL_DEG;

/// Faster than any joint of an arm turns, rad/s.
const FASTEST: f64 = 25.0;
/// Speed is taken over at least this time, ns.
const STRIDE_NS: i64 = 50_000_000;
/// Least number of strides that are too fast, and their least share of those in motion.
const LEAST_FAST: usize = 10;
const FAST_SHARE: f64 = 0.1;
/// Readings beyond a turn that are no more than this are stray ones: a robot that waits near zero for most of the time goes further for more.
const STRAY_SHARE: f64 = 0.01;

/// The unit of the readings: the one that is stated, but for degrees that are within a turn in radians but for stray readings.
pub(super) fn unit_of(postures: &[Posture], joints: &[String], options: &RecordingOptions) -> AngleUnit {
    let is_small = |p: &&Posture| turning(joints, options).all(|joint| p.positions[joint].abs() < SMALL_DEG);
    let is_beyond = || (postures.iter().filter(|p| !is_small(p)).count() as f64) > STRAY_SHARE * postures.len() as f64;
    match options.joint_unit {
        Some(AngleUnit::Deg) if is_beyond() => AngleUnit::Deg,
        _ => AngleUnit::Rad,
    }
}

/// By what the readings of each joint are multiplied to be in rad, or m.
pub(super) fn factors(unit: AngleUnit, joints: &[String], options: &RecordingOptions) -> Vec<f64> {
    joints.iter().map(|joint| if options.prismatic.contains(joint) { 1.0 } else { unit.in_rad() }).collect()
}

/// Joints that do not slide, as far as is known.
fn turning(joints: &[String], options: &RecordingOptions) -> impl Iterator<Item = usize> {
    (0..joints.len()).filter(|joint| !options.prismatic.contains(&joints[*joint]))
}

/// What says that readings which count as radians, and are not stated to be, are degrees: half of the joints are mostly more than a turn from zero, or turn faster than
/// any does.
pub(super) fn seem_degrees(
    recording: &Path,
    postures: &[Posture],
    joints: &[String],
    options: &RecordingOptions,
) -> Option<Notice> {
    if options.joint_unit == Some(AngleUnit::Rad) {
        return None;
    }
    let all: Vec<usize> = turning(joints, options).collect();
    let is_far = |joint: &&usize| {
        2 * postures.iter().filter(|p| p.positions[**joint].abs() > SMALL_DEG).count() > postures.len()
    };
    let far: Vec<&usize> = all.iter().filter(is_far).collect();
    let speeds = speeds(postures, &all);
    let moving = speeds.iter().filter(|speed| **speed > options.still_speed).count();
    let fast = speeds.iter().filter(|speed| **speed > FASTEST).count();
    let range = |joint: usize| {
        let values = postures.iter().map(|p| p.positions[joint]);
        (values.clone().fold(f64::INFINITY, f64::min), values.fold(f64::NEG_INFINITY, f64::max))
    };
    let why = if let Some(joint) = far.first().filter(|_| 2 * far.len() >= all.len()) {
        let (low, high) = range(**joint);
        format!("{} reads {low:.3} to {high:.3}, more than a turn as radians", joints[**joint])
    } else if fast >= LEAST_FAST && fast as f64 >= FAST_SHARE * moving as f64 {
        format!("joints turn faster than {FASTEST} rad/s")
    } else {
        return None;
    };
    let what = format!("its joint states count as radians and look like degrees: {why}");
    let remedy =
        "if they are degrees, write joint_unit = \"deg\" in the .toml of its name (of a series folder: in series.toml)";
    Some(Notice::new(Code::DegreesAsRadians, recording.display(), what, remedy))
}

/// Speeds of the joint that moves most, one after the other.
fn speeds(postures: &[Posture], joints: &[usize]) -> Vec<f64> {
    let mut speeds = Vec::new();
    let mut from = 0;
    for to in 1..postures.len() {
        let time_ns = postures[to].time_ns - postures[from].time_ns;
        if time_ns >= STRIDE_NS {
            let by = |joint: &usize| (postures[to].positions[*joint] - postures[from].positions[*joint]).abs();
            speeds.push(joints.iter().map(by).fold(0.0, f64::max) / (time_ns as f64 * 1e-9));
            from = to;
        }
    }
    speeds
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two joints at 100 Hz that move from stop to stop, multiplied by `factor`.
    fn recorded(factor: f64) -> Vec<Posture> {
        let position = |k: i64| 0.3 * (k / 100) as f64 + 0.003 * (k % 100).min(50) as f64;
        let at = |k: i64| Posture {
            time_ns: k * 10_000_000,
            positions: [1.0 + position(k), -1.2].map(|q| factor * q).to_vec(),
            oldest_ns: 0,
        };
        (0..600).map(at).collect()
    }

    #[test]
    fn degrees_are_told_by_their_size() {
        let joints = ["a".to_owned(), "b".to_owned()];
        let stated = |joint_unit| RecordingOptions { joint_unit, ..RecordingOptions::default() };
        let degrees = 1f64.to_degrees();
        let seems =
            |factor| seem_degrees(Path::new("run.mcap"), &recorded(factor), &joints, &stated(None)).map(|n| n.code);
        assert_eq!((seems(1.0), seems(degrees)), (None, Some(Code::DegreesAsRadians)));
        let unit = |factor, stated_unit| unit_of(&recorded(factor), &joints, &stated(stated_unit));
        assert_eq!(unit(degrees, Some(AngleUnit::Deg)), AngleUnit::Deg);
        assert_eq!(unit(1.0, Some(AngleUnit::Deg)), AngleUnit::Rad);
        assert_eq!(unit(degrees, None), AngleUnit::Rad);
        // Of a robot that waits near zero, a tenth of the readings tells; what is stated is not doubted.
        let mut waiting = vec![Posture { time_ns: 0, positions: vec![0.0; 2], oldest_ns: 0 }; 5400];
        waiting.extend(recorded(degrees));
        assert_eq!(unit_of(&waiting, &joints, &stated(Some(AngleUnit::Deg))), AngleUnit::Deg);
        let mut radians = recorded(1.0);
        radians[300].positions[0] = 57.0;
        assert_eq!(unit_of(&radians, &joints, &stated(Some(AngleUnit::Deg))), AngleUnit::Rad);
        let in_rad = stated(Some(AngleUnit::Rad));
        assert_eq!(seem_degrees(Path::new("run.mcap"), &recorded(degrees), &joints, &in_rad), None);
        let sliding = RecordingOptions { prismatic: vec!["b".to_owned()], ..RecordingOptions::default() };
        assert_eq!(factors(AngleUnit::Deg, &joints, &sliding), [1f64.to_radians(), 1.0]);
    }
}
