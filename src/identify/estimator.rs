//! The estimators: the joint fit, and those in two stages.

use serde::{Deserialize, Serialize};

/// The estimators that are compared.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Estimator {
    /// Two stages; one variance for positions and one for rotations, from the data.
    Isotropic,
    /// Two stages; the 6x6 covariance of every pose, with a common factor from the data.
    Blocks,
    /// Two stages; the 6x6 covariance of every pose, and joint noise from the data.
    BlocksAndRepeatability,
    /// Two stages; the covariance of all poses together, and joint noise from the data.
    FullAndRepeatability,
    /// Joint fit; readings exact.
    HardJoint,
    /// Joint fit; joint noise from the data.
    #[default]
    Joint,
}

impl Estimator {
    /// All, in the order A to F.
    pub const ALL: [Self; 6] = [
        Self::Isotropic,
        Self::Blocks,
        Self::BlocksAndRepeatability,
        Self::FullAndRepeatability,
        Self::HardJoint,
        Self::Joint,
    ];

    /// True where the camera poses are found first, and the robot from them.
    pub fn is_two_stage(self) -> bool {
        !matches!(self, Self::HardJoint | Self::Joint)
    }

    /// True where joint noise is part of the model.
    pub fn has_joint_noise(self) -> bool {
        matches!(self, Self::BlocksAndRepeatability | Self::FullAndRepeatability | Self::Joint)
    }

    /// Letter in tables.
    pub fn letter(self) -> char {
        match self {
            Self::Isotropic => 'A',
            Self::Blocks => 'B',
            Self::BlocksAndRepeatability => 'C',
            Self::FullAndRepeatability => 'D',
            Self::HardJoint => 'E',
            Self::Joint => 'F',
        }
    }

    /// What it is, for tables.
    pub fn title(self) -> &'static str {
        match self {
            Self::Isotropic => "two-stage, isotropic weights",
            Self::Blocks => "two-stage, 6x6 covariance of each pose",
            Self::BlocksAndRepeatability => "two-stage, 6x6 covariances and joint noise",
            Self::FullAndRepeatability => "two-stage, full covariance and joint noise",
            Self::HardJoint => "joint, readings exact",
            Self::Joint => "joint, with joint noise",
        }
    }
}
