//! What images that do not fit their readings agree on.
//!
//! An image shows the tip at `B` (`Z C^-1 X^-1` of a camera in the hand, `X C Z^-1` of a fixed one, as in [`crate::init::HandEye`]), its readings
//! put it at `A`. Where one reading alone is off by `d`, `B A^-1 = exp(d s)`, `s` the twist of its joint in the base, however large `d` is.

use nalgebra::Vector3;

use crate::assess::Limits;
use crate::geom::{Pose, exp_so3, log_so3};
use crate::init::{HandEye, SeenStop};
use crate::model::robot::Robot;
use crate::series::{CameraMount, spread};
use crate::urdf::JointKind;

/// What is another at some stops.
#[derive(Debug, Clone, PartialEq)]
pub enum Moved {
    /// The zero of a joint.
    Zero {
        /// Name of the joint.
        joint: String,
        /// How it moves.
        kind: JointKind,
        /// By how much, rad or m.
        offset: f64,
        /// A body that may have been turned in its place.
        or: Option<&'static str>,
    },
    /// The plate, by so much.
    Plate {
        /// m.
        distance_m: f64,
        /// rad.
        angle_rad: f64,
    },
    /// The camera on its mount, by so much.
    Camera {
        /// m.
        distance_m: f64,
        /// rad.
        angle_rad: f64,
    },
    /// The ids of the markers, counted from the other end: the plate would stand where it does, turned by half a turn about its centre.
    Ids {
        /// How far its centre would be from its place, m.
        distance_m: f64,
    },
    /// The pictures, about the optical axis: the camera would sit where it does, turned by quarter turns.
    Images {
        /// By how much they are turned, clockwise, rad.
        turn_rad: f64,
        /// How far the camera would be from its place, m.
        distance_m: f64,
    },
    /// The readings, by another amount at each stop.
    Readings {
        /// Name of the joint; none where it is all of them.
        joint: Option<String>,
        /// True where all of them are the same.
        stand_still: bool,
    },
}

impl Moved {
    const fn unknowns(&self) -> f64 {
        match self {
            Self::Plate { .. } | Self::Camera { .. } | Self::Images { .. } | Self::Ids { .. } => 6.0,
            _ => 1.0,
        }
    }

    const fn body(&self) -> Option<&'static str> {
        match self {
            Self::Plate { .. } | Self::Ids { .. } => Some("the plate"),
            Self::Camera { .. } | Self::Images { .. } => Some("the camera"),
            _ => None,
        }
    }
}

/// Stops that agree, by their index, and on what.
#[derive(Debug, Clone, PartialEq)]
pub struct Agreement {
    /// What.
    pub moved: Moved,
    /// The stops, ascending.
    pub members: Vec<usize>,
    /// Mean misfit that is left, rad + m.
    pub spread: f64,
}

/// What most of some stops agree on, beside where the others say that camera and plate are; `None` where too few do.
pub fn agreement(robot: &Robot, others: &HandEye, seen: &[SeenStop], limits: &Limits) -> Option<Agreement> {
    let stops: Vec<Stop> = seen.iter().map(|stop| Stop::new(robot, others, stop)).collect();
    let readings = match robot.chain.pose_coordinates() {
        Some(_) => 0..0,
        None => 0..robot.chain.readings.len(),
    };
    let zeros = readings.clone().filter_map(|joint| zero(robot, &stops, joint, limits));
    let plate = place(&stops, &others.plate, |stop| stop.plate, limits, |old, new| plate_moved(old, new, limits));
    let camera = place(&stops, &others.camera, |stop| stop.camera, limits, |old, new| camera_moved(old, new, limits));
    let all: Vec<Agreement> = zeros.chain(plate).chain(camera).collect();
    let most = all.iter().map(|a| a.members.len()).max().unwrap_or(0);
    let weighed = |a: &Agreement| a.moved.unknowns() * a.spread;
    let or = all.iter().filter(|a| a.members.len() == most).find_map(|a| a.moved.body());
    let best = all.into_iter().filter(|a| a.members.len() == most);
    let mut best = best.min_by(|a, b| weighed(a).total_cmp(&weighed(b)));
    if let Some(Agreement { moved: Moved::Zero { or: own, .. }, .. }) = &mut best {
        *own = or;
    }
    // An amount of its own for every stop fits more easily.
    let wrong = readings.filter_map(|joint| wrong_readings(robot, &stops, joint, limits));
    let wrong = wrong.chain(copied(&stops, limits)).filter(|a| a.members.len() > most);
    wrong.max_by_key(|a| a.members.len()).or(best)
}

/// A stop with what its image shows.
struct Stop<'a> {
    seen: &'a SeenStop,
    /// Tip in the base by the image.
    by_image: Pose,
    /// Rotation and translation by which its readings miss that, rad + m.
    misfit: f64,
    /// Where it would have the plate, and the camera.
    plate: Pose,
    camera: Pose,
}

impl<'a> Stop<'a> {
    fn new(robot: &Robot, HandEye { camera, plate }: &HandEye, seen: &'a SeenStop) -> Self {
        let tip = match seen.mount {
            CameraMount::Hand => *plate * seen.camera_from_plate.inverse() * camera.inverse(),
            CameraMount::Fixed => *camera * seen.camera_from_plate * plate.inverse(),
        };
        let chain = seen.pair(robot).chain;
        Self {
            seen,
            by_image: tip,
            misfit: tip.misfit(&robot.base_from_tip(&seen.readings)),
            plate: chain.inverse() * (*camera * seen.camera_from_plate),
            camera: (chain * *plate) * seen.camera_from_plate.inverse(),
        }
    }

    /// Its misfit with a reading that is off by so much.
    fn misfit_with(&self, robot: &Robot, joint: usize, offset: f64) -> f64 {
        self.by_image.misfit(&robot.base_from_tip(&self.readings_with(joint, offset)))
    }

    fn readings_with(&self, joint: usize, offset: f64) -> Vec<f64> {
        let mut readings = self.seen.readings.clone();
        readings[joint] += offset;
        readings
    }

    /// By how much a reading is off, if it alone is; `None` where it does not move the tip.
    fn offset(&self, robot: &Robot, joint: usize) -> Option<f64> {
        let back = robot.base_from_tip(&self.seen.readings).inverse();
        let by_offset = |offset: f64| robot.base_from_tip(&self.readings_with(joint, offset)) * back;
        let (step, whole) = (by_offset(STEP), self.by_image * back);
        let (turn, shift) = (log_so3(&step.rotation) / STEP, step.translation / STEP);
        let along = |by: Vector3<f64>, whole: Vector3<f64>| by.dot(&whole) / by.norm_squared();
        match turn.norm() > f64::EPSILON.sqrt() {
            true => Some(along(turn, log_so3(&whole.rotation))),
            false if shift.norm() > f64::EPSILON.sqrt() => Some(along(shift, whole.translation)),
            false => None,
        }
    }
}

/// Step of a difference quotient, rad or m.
const STEP: f64 = 1e-6;

/// Stops that are enough to propose what all agree on.
const CANDIDATES: usize = 100;

fn some<'a, 'b>(stops: &'a [Stop<'b>]) -> impl Iterator<Item = &'a Stop<'b>> {
    spread(stops.len(), CANDIDATES).map(|k| &stops[k])
}

/// What may be left of a misfit of stops that agree.
fn bound(misfit: f64, limits: &Limits) -> f64 {
    (limits.moved_agreement * misfit).min(limits.set_aside_floor)
}

/// Of these candidates the one that most stops agree with, of several the one with the least misfit: where they leave, by stop, less than the
/// `bound` of that stop and candidate.
fn common<T: Copy>(
    candidates: impl Iterator<Item = T>,
    stops: &[Stop],
    left: impl Fn(T, &Stop) -> f64,
    bound: impl Fn(T, &Stop) -> f64,
    fewest: usize,
) -> Option<(T, Vec<usize>, f64)> {
    let mut best: Option<(T, Vec<usize>, f64)> = None;
    for candidate in candidates {
        let misfits = stops.iter().map(|stop| (left(candidate, stop), bound(candidate, stop))).enumerate();
        let (members, misfits): (Vec<usize>, Vec<f64>) =
            misfits.filter(|(_, (left, bound))| left < bound).map(|(k, (left, _))| (k, left)).unzip();
        let spread = misfits.iter().sum::<f64>() / (members.len().max(2) - 1) as f64;
        let more = best.as_ref().is_none_or(|(_, m, s)| (members.len(), -spread) > (m.len(), -s));
        if members.len() >= fewest && more {
            best = Some((candidate, members, spread));
        }
    }
    best
}

fn zero(robot: &Robot, stops: &[Stop], joint: usize, limits: &Limits) -> Option<Agreement> {
    let (offset, members, spread) = common(
        some(stops).filter_map(|stop| stop.offset(robot, joint)),
        stops,
        |offset, stop| stop.misfit_with(robot, joint, offset),
        |_, stop| bound(stop.misfit, limits),
        limits.moved_images,
    )?;
    let (name, kind) = (robot.chain.readings[joint].clone(), robot.chain.reading_kinds[joint]);
    Some(Agreement { moved: Moved::Zero { joint: name, kind, offset, or: None }, members, spread })
}

fn wrong_readings(robot: &Robot, stops: &[Stop], joint: usize, limits: &Limits) -> Option<Agreement> {
    let left = |stop: &Stop| stop.misfit_with(robot, joint, stop.offset(robot, joint).unwrap_or(0.0));
    let ((), members, spread) = common(
        std::iter::once(()),
        stops,
        |(), stop| left(stop),
        |(), stop| bound(stop.misfit, limits),
        limits.moved_images,
    )?;
    let own = |k: &usize| stops[*k].seen.readings[joint];
    let stand_still = members.iter().all(|k| own(k) == own(&members[0]));
    Some(Agreement {
        moved: Moved::Readings { joint: Some(robot.chain.readings[joint].clone()), stand_still },
        members,
        spread,
    })
}

/// Stops with the same readings whose images differ.
fn copied(stops: &[Stop], limits: &Limits) -> Option<Agreement> {
    let same = |stop: &Stop| -> Vec<usize> {
        (0..stops.len()).filter(|k| stops[*k].seen.readings == stop.seen.readings).collect()
    };
    let members = some(stops).map(same).max_by_key(Vec::len)?;
    let first = &stops[members[0]].by_image;
    let differ = members.iter().filter(|k| first.misfit(&stops[**k].by_image) > limits.set_aside_floor).count();
    let spread = members.iter().map(|k| stops[*k].misfit).sum::<f64>() / members.len() as f64;
    let moved = Moved::Readings { joint: None, stand_still: true };
    (differ + 1 >= limits.moved_images).then_some(Agreement { moved, members, spread })
}

/// A grid whose ids are counted from the other end seems turned by half a turn about its centre, and stays there.
fn plate_moved(old: &Pose, new: &Pose, limits: &Limits) -> Moved {
    let (angle_rad, distance_m) = old.distance(new);
    let half_turn = Pose::new(exp_so3(&Vector3::new(0.0, 0.0, std::f64::consts::PI)), Vector3::zeros());
    match new.misfit(&(*old * half_turn)) < limits.set_aside_floor {
        true => Moved::Ids { distance_m },
        false => Moved::Plate { distance_m, angle_rad },
    }
}

fn camera_moved(old: &Pose, new: &Pose, limits: &Limits) -> Moved {
    let (angle_rad, distance_m) = old.distance(new);
    match turned_pictures(&(old.inverse() * *new), limits) {
        Some(turn_rad) => Moved::Images { turn_rad, distance_m },
        None => Moved::Camera { distance_m, angle_rad },
    }
}

/// By how much pictures are turned, clockwise, where a camera moved by `by` in its own frame: one that shows the scene turned by T about its axis
/// seems turned by the inverse of T.
fn turned_pictures(by: &Pose, limits: &Limits) -> Option<f64> {
    let turn = |quarters: f64| quarters * std::f64::consts::FRAC_PI_2;
    let is_turned = |quarters: &f64| {
        let picture = exp_so3(&Vector3::new(0.0, 0.0, turn(*quarters)));
        log_so3(&(by.rotation * picture)).norm() < limits.turned_image_rad
    };
    let quarters = [2.0, 1.0, -1.0].into_iter().find(is_turned)?;
    (by.translation.norm() < limits.turned_image_m).then(|| turn(quarters))
}

/// The place of a body that most stops agree on, near enough beside how far it is from the `old` one.
fn place(
    stops: &[Stop],
    old: &Pose,
    of: impl Fn(&Stop) -> Pose,
    limits: &Limits,
    moved: impl Fn(&Pose, &Pose) -> Moved,
) -> Option<Agreement> {
    let (place, members, spread) = common(
        some(stops).map(&of),
        stops,
        |candidate, stop| candidate.misfit(&of(stop)),
        |candidate, _| bound(old.misfit(&candidate), limits),
        limits.moved_images,
    )?;
    Some(Agreement { moved: moved(old, &place), members, spread })
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector6;

    #[test]
    fn a_plate_that_seems_turned_by_half_a_turn_about_its_centre_has_ids_from_the_other_end() {
        let limits = Limits::default();
        let plate = Pose::from_xyz_rpy([0.5, 0.1, 0.2], [0.1, -0.2, 0.7]);
        let moved = |x_m: f64, yaw: f64| {
            plate_moved(&plate, &(plate * Pose::from_xyz_rpy([x_m, 0.0, 0.0], [0.0, 0.0, yaw])), &limits)
        };
        let half = std::f64::consts::PI;
        assert!(matches!(moved(1e-4, half - 1e-3), Moved::Ids { distance_m } if (distance_m - 1e-4).abs() < 1e-9));
        for other in [moved(0.05, half), moved(0.0, half - 0.1), moved(0.0, 0.5 * half), moved(1e-4, 0.0)] {
            assert!(matches!(other, Moved::Plate { .. }), "{other:?}");
        }
    }

    #[test]
    fn a_camera_that_seems_turned_about_its_axis_alone_has_turned_pictures() {
        let limits = Limits::default();
        let turned = |angle: f64, x_m: f64, tilt: f64| {
            let by = Pose::exp(&Vector6::new(0.0, 0.0, 0.0, 0.0, 0.0, angle));
            let beside = Pose::exp(&Vector6::new(x_m, 0.0, 0.0, tilt, 0.0, 0.0));
            turned_pictures(&(by * beside), &limits)
        };
        let quarter = std::f64::consts::FRAC_PI_2;
        for (angle, of_picture) in [(-quarter, quarter), (quarter, -quarter), (2.0 * quarter, 2.0 * quarter)] {
            assert!((turned(angle, 1e-3, 0.02).unwrap() - of_picture).abs() < 1e-12);
        }
        for (angle, x_m, tilt) in
            [(2.0 * quarter, 0.03, 0.0), (2.0 * quarter, 0.0, 0.2), (1.0, 0.0, 0.0), (0.0, 0.0, 0.0)]
        {
            assert_eq!(turned(angle, x_m, tilt), None);
        }
    }
}
