//! How controllers write the rotation of a pose. To add one: a variant, its name, its columns and its matrix.

use nalgebra::{Matrix3, Vector3};
use serde::{Deserialize, Serialize};

use crate::geom::{exp_so3, matrix_from_rpy};

/// A convention for rotations in tables.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum RotationKind {
    /// Unit quaternion qx, qy, qz, qw.
    #[serde(rename = "quaternion")]
    Quaternion,
    /// Rotation vector, rad (Universal Robots).
    #[serde(rename = "rotvec_rad")]
    RotationVector,
    /// A, B, C in degrees about z, y', x'' (KUKA).
    #[serde(rename = "abc_deg")]
    Abc,
    /// Roll, pitch, yaw in rad about fixed axes x, y, z (URDF).
    #[serde(rename = "rpy_rad")]
    Rpy,
    /// W, P, R in degrees about fixed axes x, y, z (FANUC).
    #[serde(rename = "wpr_deg")]
    Wpr,
    /// O, A, T in degrees about z, y', z'' (Kawasaki; V+ of Adept and of older Staubli: yaw, pitch, roll).
    #[serde(rename = "zyz_deg")]
    Zyz,
    /// Rx, Ry, Rz in degrees about x, y', z'' (VAL3 of Staubli).
    #[serde(rename = "xyz_deg")]
    Xyz,
}

impl RotationKind {
    /// All conventions.
    pub const ALL: [Self; 7] =
        [Self::Quaternion, Self::RotationVector, Self::Abc, Self::Rpy, Self::Wpr, Self::Zyz, Self::Xyz];

    /// Name in the manifest.
    pub fn name(self) -> &'static str {
        match self {
            Self::Quaternion => "quaternion",
            Self::RotationVector => "rotvec_rad",
            Self::Abc => "abc_deg",
            Self::Rpy => "rpy_rad",
            Self::Wpr => "wpr_deg",
            Self::Zyz => "zyz_deg",
            Self::Xyz => "xyz_deg",
        }
    }

    /// Columns of the rotation.
    pub fn columns(self) -> &'static [&'static str] {
        match self {
            Self::Quaternion => &["qx", "qy", "qz", "qw"],
            Self::RotationVector | Self::Xyz => &["rx", "ry", "rz"],
            Self::Abc => &["a", "b", "c"],
            Self::Rpy => &["roll", "pitch", "yaw"],
            Self::Wpr => &["w", "p", "r"],
            Self::Zyz => &["o", "a", "t"],
        }
    }

    /// The rotation that the three numbers of a convention mean; `None` for a quaternion, which has four.
    pub fn of_three(self, [a, b, c]: [f64; 3]) -> Option<Matrix3<f64>> {
        let about = |axis: Vector3<f64>, deg: f64| exp_so3(&(axis * deg.to_radians()));
        match self {
            Self::Quaternion => None,
            Self::RotationVector => Some(exp_so3(&Vector3::new(a, b, c))),
            Self::Abc => Some(matrix_from_rpy([c, b, a].map(f64::to_radians))),
            Self::Rpy => Some(matrix_from_rpy([a, b, c])),
            Self::Wpr => Some(matrix_from_rpy([a, b, c].map(f64::to_radians))),
            Self::Zyz => Some(about(Vector3::z(), a) * about(Vector3::y(), b) * about(Vector3::z(), c)),
            Self::Xyz => Some(about(Vector3::x(), a) * about(Vector3::y(), b) * about(Vector3::z(), c)),
        }
    }
}
