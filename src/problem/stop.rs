//! A stop, and what ties the images that were taken at it to its joint readings.

use nalgebra::Vector6;

use crate::geom::Pose;
use crate::model::robot::Posture;

/// Components of an apparent displacement where several cameras tell it from the errors of the joints; one camera tells of the first two, the
/// tilt.
const DISPLACEMENTS: usize = 6;

/// Index, among the sizes of a series, of the size that a component of an apparent displacement has: tilt about x and y of the plate (rad),
/// spin about its normal (rad), shift across the optical axis and along it (m).
pub const SIZE_OF_DISPLACEMENT: [usize; DISPLACEMENTS] = [0, 0, 1, 2, 2, 3];

/// Number of sizes that apparent displacements have, where all components are told.
pub const DISPLACEMENT_SIZES: usize = 4;

/// Number of components of an apparent displacement that one camera tells.
const TILT: usize = 2;

/// One standstill of the robot: what was read there, with one latent error of every reading.
#[derive(Debug, Clone, PartialEq)]
pub struct Stop {
    /// Index of its series, where those that several cameras took at the same stops count as one: that of its noise.
    pub series: usize,
    /// Joint readings; `None` off the robot.
    pub posture: Option<Posture>,
    /// Share of the local variance of each reading that the local errors cover here; empty where there are none.
    pub local_share: Vec<f64>,
}

impl Stop {
    /// Number of readings; none off the robot.
    pub fn readings(&self) -> usize {
        self.posture.as_ref().map_or(0, |p| p.readings.len())
    }
}

/// What ties the camera pose of an image to the stop at which it was taken.
#[derive(Debug, Clone, PartialEq)]
pub enum Tie {
    /// It is as the robot says.
    Rigid,
    /// The robot, and an apparent displacement of the plate: what smooth errors of an image (lens, focus, air) do to the pose that it
    /// shows. Turns about the x and y axes of the plate, rad; where several cameras saw the same stops, about its z axis, rad, and
    /// shifts along the axes of the camera, m.
    Displaced(Vec<f64>),
    /// Nothing: a free camera pose (`camera_from_plate`).
    Free(Pose),
}

impl Tie {
    /// Displaced by nothing; with all components where stops seen by several cameras tell of them.
    pub fn upright(with_all: bool) -> Self {
        Self::Displaced(vec![0.0; if with_all { DISPLACEMENTS } else { TILT }])
    }

    /// The apparent displacement; empty where there is none.
    pub fn displacement(&self) -> &[f64] {
        if let Self::Displaced(values) = self { values } else { &[] }
    }

    /// Number of unknowns.
    pub fn len(&self) -> usize {
        match self {
            Self::Rigid => 0,
            Self::Displaced(values) => values.len(),
            Self::Free(_) => 6,
        }
    }

    /// True where there is no unknown.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// True for a camera pose that no robot holds.
    pub fn is_free(&self) -> bool {
        matches!(self, Self::Free(_))
    }

    /// The free camera pose (`camera_from_plate`).
    pub fn free_pose(&self) -> Option<&Pose> {
        match self {
            Self::Free(pose) => Some(pose),
            _ => None,
        }
    }

    pub(super) fn moved(&self, step: &[f64]) -> Self {
        match self {
            Self::Rigid => Self::Rigid,
            Self::Displaced(values) => Self::Displaced(values.iter().zip(step).map(|(v, s)| v + s).collect()),
            Self::Free(pose) => Self::Free(pose.perturbed(&Vector6::from_column_slice(step))),
        }
    }
}

/// Where an image was taken from: the readings of its stop with their latent errors, and its tie to them.
#[derive(Debug, Clone, Copy)]
pub struct TakenFrom<'a> {
    /// Joint readings; `None` off the robot.
    pub posture: Option<&'a Posture>,
    /// Latent errors of the readings, rad or m; empty where the readings count as exact.
    pub joint_errors: &'a [f64],
    /// Tie of the image.
    pub tie: &'a Tie,
}

impl<'a> TakenFrom<'a> {
    /// A posture that is as it was read.
    pub fn exact(posture: &'a Posture) -> Self {
        Self::rigid(posture, &[])
    }

    /// A posture with these errors, rad or m; with zeros it is as it was read, and its errors are among the unknowns.
    pub fn rigid(posture: &'a Posture, joint_errors: &'a [f64]) -> Self {
        Self { posture: Some(posture), joint_errors, tie: &Tie::Rigid }
    }

    /// Number of joint errors that the pose depends on.
    pub fn joints(&self) -> usize {
        if self.tie.is_free() { 0 } else { self.joint_errors.len() }
    }

    /// Number of unknowns that the pose depends on: joint errors, then the tie.
    pub fn unknowns(&self) -> usize {
        self.joints() + self.tie.len()
    }

    /// The errors of all readings, zero where they count as exact.
    pub(super) fn errors(&self) -> Vec<f64> {
        match self.joint_errors {
            [] => vec![0.0; self.posture.map_or(0, |p| p.readings.len())],
            errors => errors.to_vec(),
        }
    }
}
