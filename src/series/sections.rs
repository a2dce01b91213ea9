//! Sections of `series.toml` on what is measured beside images.

use std::path::Path;

use serde::{Deserialize, Serialize};

use super::rotation_kind::RotationKind;
use super::toml_file::require_positive;
use crate::error::Result;

/// `[tracker]`: the device of points.csv and poses.csv; its frame is unknown.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TrackerSection {
    /// Series with the same name share the frame of the tracker; default the name of the series folder.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
    /// Standard deviation of a coordinate, m; a start, it is estimated.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sigma_m: Option<f64>,
    /// Standard deviation of a rotation about an axis, rad; a start, it is estimated.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sigma_rad: Option<f64>,
}

/// `[contact]`: what contacts.csv means.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ContactSection {
    /// Standard deviation of a contact per axis, m; a start, it is estimated.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sigma_m: Option<f64>,
    /// Frame of the coordinates in contacts.csv.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub frame: Option<String>,
}

/// `[[distance]]`: a measured distance between two contacts, two targets, or two plate markers.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DistanceSection {
    /// Names of both ends.
    pub between: [String; 2],
    /// Distance, m.
    pub distance_m: f64,
    /// Its standard deviation, m.
    pub sigma_m: f64,
}

impl DistanceSection {
    pub(super) fn check(&self, path: &Path) -> Result<()> {
        require_positive(path, "distance.distance_m", Some(self.distance_m))?;
        require_positive(path, "distance.sigma_m", Some(self.sigma_m))
    }
}

/// `[controller]`: what controller.csv means.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ControllerSection {
    /// How the controller writes rotations; there is no default.
    pub rotation: RotationKind,
    /// Joint angles at the first stop, roughly, in the order of the chain, deg (m of a prismatic joint): they tell the posture.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub first_stop_deg: Option<Vec<f64>>,
}

/// `[plate_mount]`.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PlateMountSection {
    /// Link that carries the plate.
    pub link: String,
}

/// `[robot_2]`: a second arm, which carries the plate.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SecondRobotSection {
    /// Its robot description, relative to the manifest.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub urdf: Option<String>,
    /// Its base link.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub base: Option<String>,
    /// Its tip link.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tip: Option<String>,
}
