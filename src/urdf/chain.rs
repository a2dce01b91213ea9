//! The kinematic chain from a base link to a tip link.

use nalgebra::Vector3;

use super::second_arm::BASE_FROM_BASE;
use crate::geom::{Pose, exp_so3};

/// How a joint moves.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum JointKind {
    /// Does not move.
    Fixed,
    /// Rotates about its axis (URDF revolute or continuous), rad.
    Revolute,
    /// Slides along its axis, m.
    Prismatic,
}

impl JointKind {
    /// Unit of its readings, and of their thousandth.
    pub const fn units(self) -> [&'static str; 2] {
        if matches!(self, Self::Prismatic) { ["m", "mm"] } else { ["rad", "mrad"] }
    }
}

/// Where the position of a moving joint comes from: `multiplier * reading + offset`.
///
/// A joint with a reading of its own has multiplier 1 and offset 0; a mimic joint takes those of URDF.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Drive {
    /// Index in [`Chain::readings`].
    pub reading: usize,
    /// Factor on the reading.
    pub multiplier: f64,
    /// Added after the factor, rad or m.
    pub offset: f64,
}

/// An origin of which the URDF was found to say nothing, or something else, before the fit.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FoundOrigin {
    /// Of the joint between two bases, or of one behind a joint that counts the other way.
    Pose,
    /// Of a joint whose zero is elsewhere.
    Zero {
        /// What the readings lack after their sign, rad or m.
        offset: f64,
        /// True where the joint counts the other way.
        is_reversed: bool,
    },
}

/// One joint of the chain.
#[derive(Debug, Clone, PartialEq)]
pub struct Joint {
    /// URDF name.
    pub name: String,
    /// How it moves.
    pub kind: JointKind,
    /// Nominal `parent_from_joint` at zero position (`joint_from_parent` where `upwards`).
    pub origin: Pose,
    /// Unit axis in the joint frame; zero for a fixed joint.
    pub axis: Vector3<f64>,
    /// Lower and upper limit (rad or m) where the URDF states them (never for continuous joints).
    pub limits: Option<(f64, f64)>,
    /// What drives it; `None` for a fixed joint.
    pub drive: Option<Drive>,
    /// True where the chain passes it from child to parent: it lies between the base and the first link that is above both base and tip.
    /// One that moves stands twice then: its motion about the opposite axis, at an identity, and behind it its origin as a fixed joint.
    pub upwards: bool,
    /// What was found of the origin before the fit, where it is not as in the URDF.
    pub found: Option<FoundOrigin>,
}

impl Joint {
    /// False for the motion of a joint that is passed upwards: the URDF states its origin with the entry behind it.
    pub fn states_origin(&self) -> bool {
        !(self.upwards && self.drive.is_some())
    }

    /// How its child stands to its origin at a position, rad or m.
    pub fn motion(&self, position: f64) -> Pose {
        match self.kind {
            JointKind::Fixed => Pose::identity(),
            JointKind::Revolute => Pose::new(exp_so3(&(self.axis * position)), Vector3::zeros()),
            JointKind::Prismatic => Pose::new(nalgebra::Matrix3::identity(), self.axis * position),
        }
    }

    /// True for the joint between the bases of two arms, of whose origin nothing is known.
    pub fn is_between_bases(&self) -> bool {
        self.kind == JointKind::Fixed && self.name == BASE_FROM_BASE
    }
}

/// Half a turn about an axis across the given one.
fn half_turn_across(axis: &Vector3<f64>) -> Pose {
    let across = axis.cross(&if axis.x.abs() < 0.9 { Vector3::x() } else { Vector3::y() }).normalize();
    Pose::new(2.0 * across * across.transpose() - nalgebra::Matrix3::identity(), Vector3::zeros())
}

/// A mass that a joint of the chain carries rigidly with its child link.
#[derive(Debug, Clone, PartialEq)]
pub struct CarriedMass {
    /// Link whose mass it is.
    pub link: String,
    /// Index in [`Chain::joints`] of the last joint above it; all joints up to there bear it.
    pub joint: usize,
    /// Mass, kg.
    pub mass_kg: f64,
    /// Centre of mass in the child frame of that joint, m; joints beside the chain stand at zero.
    pub centre_m: Vector3<f64>,
}

/// All joints from `base` to `tip`, in order.
#[derive(Debug, Clone, PartialEq)]
pub struct Chain {
    /// Name of the robot.
    pub robot: String,
    /// Base link.
    pub base: String,
    /// Tip link.
    pub tip: String,
    /// Joints in order from base to tip.
    pub joints: Vec<Joint>,
    /// Names of the joints whose readings the chain needs, in chain order.
    pub readings: Vec<String>,
    /// How the joint of each reading moves (fixes its unit: rad or m), same length as `readings`.
    /// Kept apart from `joints` because a mimic joint may be driven from outside the chain.
    pub reading_kinds: Vec<JointKind>,
    /// What the joints carry, where the URDF states it.
    pub masses: Vec<CarriedMass>,
    /// Names of the joints of the description that move and whose readings the chain does not need.
    pub beside: Vec<String>,
    /// Those of them behind the tip, as the fingers of a gripper: they move nothing of the chain, nor what it is measured against.
    pub behind_tip: Vec<String>,
}

impl Chain {
    /// Names of joints beside the chain that may move what it stands on, or what it is measured against.
    pub fn beside_arm(&self) -> impl Iterator<Item = &String> {
        self.beside.iter().filter(|joint| !self.behind_tip.contains(joint))
    }

    /// Number of entries that are passed upwards: they come first, and behind them lies the link above both base and tip.
    pub fn climbed(&self) -> usize {
        self.joints.iter().take_while(|j| j.upwards).count()
    }

    /// Length of the arm: the sum of all origins behind the first moving joint, m; where joints carry the base, behind the link that carries them
    /// and the arm.
    pub fn arm_length_m(&self) -> f64 {
        let joints = self.joints.iter().skip(self.climbed()).skip_while(|j| j.kind == JointKind::Fixed).skip(1);
        joints.map(|j| j.origin.translation.norm()).sum()
    }

    /// Where the link stands that carries the first moving joint, `base_from_foot`: what is fixed before it is no part of the arm. One that is only
    /// turned about the vertical looks as the base does. `None` where it stands as the base does, and where the base moves.
    pub fn base_from_foot(&self) -> Option<Pose> {
        let fixed = self.joints.iter().take_while(|j| j.kind == JointKind::Fixed).count();
        if fixed == self.joints.len() || self.base_moves() {
            return None;
        }
        let mut foot = self.joints[..fixed].iter().fold(Pose::identity(), |pose, j| pose * j.origin);
        let is_upright = 1.0 - foot.rotation[(2, 2)] < f64::EPSILON.sqrt();
        if is_upright {
            foot.rotation.fill_with_identity();
        }
        (!is_upright || foot.translation.norm() > 0.0).then_some(foot)
    }

    /// True where camera and plate are both carried: the base moves, too.
    pub fn base_moves(&self) -> bool {
        self.carrying_base().next().is_some()
    }

    /// Entries of the joints that carry the base.
    pub fn carrying_base(&self) -> impl Iterator<Item = &Joint> {
        self.joints.iter().filter(|j| !j.states_origin())
    }

    /// The chain with another zero of a reading, which may count the other way: `m (s q + o) + c` in the place of `m q + c`. A reversed joint is turned
    /// about and back, `P Motion(q) P^-1` with half a turn `P` about an axis across; behind the last joint that is a matter of the hand. `None` where the base moves.
    pub fn with_zero(mut self, reading: usize, offset: f64, is_reversed: bool) -> Option<Self> {
        if self.base_moves() {
            return None;
        }
        let driven = |j: &Joint| j.drive.filter(|d| d.reading == reading);
        for k in 0..self.joints.len() {
            let Some(drive) = driven(&self.joints[k]) else { continue };
            let joint = &mut self.joints[k];
            let shift = drive.multiplier * offset + if is_reversed { 2.0 * drive.offset } else { 0.0 };
            joint.found = Some(FoundOrigin::Zero { offset, is_reversed });
            if !is_reversed {
                joint.origin = joint.origin * joint.motion(shift);
                continue;
            }
            let about = half_turn_across(&joint.axis);
            joint.origin = joint.origin * about;
            let behind = about.inverse() * joint.motion(shift);
            if let Some(next) = self.joints.get_mut(k + 1) {
                next.origin = behind * next.origin;
                next.found = next.found.or(Some(FoundOrigin::Pose));
            }
        }
        Some(self)
    }

    /// The zero of a reading that was found before the fit and stands in the origins: what the readings lack in the direction in which they
    /// count, rad or m; none behind which nothing lies that it could turn.
    pub fn found_zero(&self, reading: usize) -> f64 {
        let of = |(k, joint): (usize, &Joint)| match joint.found {
            Some(FoundOrigin::Zero { offset, is_reversed }) if joint.drive.is_some_and(|d| d.reading == reading) => {
                match is_reversed {
                    true => self.joints.get(k + 1).map(|_| -offset),
                    false => Some(offset),
                }
            }
            _ => None,
        };
        self.joints.iter().enumerate().find_map(of).unwrap_or(0.0)
    }

    /// True for the entry with the origin of a joint that moves.
    pub fn is_origin_of_moving(&self, index: usize) -> bool {
        let joint = &self.joints[index];
        joint.states_origin() && self.joints.iter().any(|j| j.name == joint.name && j.drive.is_some())
    }

    /// Index of the entry with the origin that the URDF states for a joint.
    pub fn origin_of(&self, name: &str) -> Option<usize> {
        self.joints.iter().position(|j| j.name == name && j.states_origin())
    }

    /// No robot at all: base and tip are one.
    pub fn empty() -> Self {
        let [robot, base, tip] = [const { String::new() }; 3];
        Self {
            robot,
            base,
            tip,
            joints: Vec::new(),
            readings: Vec::new(),
            reading_kinds: Vec::new(),
            masses: Vec::new(),
            beside: Vec::new(),
            behind_tip: Vec::new(),
        }
    }
}
