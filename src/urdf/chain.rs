//! The kinematic chain from a base link to a tip link.

use nalgebra::Vector3;

use super::second_arm::BASE_FROM_BASE;
use crate::geom::Pose;

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
}

impl Joint {
    /// False for the motion of a joint that is passed upwards: the URDF states its origin with the entry behind it.
    pub fn states_origin(&self) -> bool {
        !(self.upwards && self.drive.is_some())
    }

    /// True for the joint between the bases of two arms, of whose origin nothing is known.
    pub fn is_between_bases(&self) -> bool {
        self.kind == JointKind::Fixed && self.name == BASE_FROM_BASE
    }
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
}

impl Chain {
    /// Number of entries that are passed upwards: they come first, and behind them lies the link above both base and tip.
    pub fn climbed(&self) -> usize {
        self.joints.iter().take_while(|j| j.upwards).count()
    }

    /// True where camera and plate are both carried: the base moves, too.
    pub fn base_moves(&self) -> bool {
        self.joints.iter().any(|j| !j.states_origin())
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
        }
    }
}
