//! Poses in solution.json.

use serde::{Deserialize, Serialize};

use crate::geom::Pose;

/// A pose `parent_from_child`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct PoseRecord {
    /// Translation, m.
    pub xyz_m: [f64; 3],
    /// Rotation, qx qy qz qw.
    pub quat_xyzw: [f64; 4],
}

impl From<&Pose> for PoseRecord {
    fn from(pose: &Pose) -> Self {
        Self { xyz_m: pose.xyz(), quat_xyzw: pose.quaternion_xyzw() }
    }
}

impl From<&PoseRecord> for Pose {
    fn from(record: &PoseRecord) -> Self {
        Self::from_xyz_quaternion(record.xyz_m, record.quat_xyzw)
    }
}

/// A mounting or placement.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PlacedRecord {
    /// Name.
    pub name: String,
    /// Pose.
    pub pose: PoseRecord,
    /// Covariance of its body twist, 36 numbers; none where no image of the robot determines it.
    pub covariance: Option<Vec<f64>>,
}
