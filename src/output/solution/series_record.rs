//! A series in solution.json.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::model::camera::Lens;
use crate::problem::{KnownCamera, LensChoice};
use crate::series::CameraMount;

fn yes() -> bool {
    true
}

/// A series, apart from its images.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SeriesRecord {
    /// Name.
    pub name: String,
    /// Series with the same camera share intrinsics.
    pub camera: String,
    /// Series with the same mounting share the hand-eye transform.
    pub mounting: String,
    /// Where the camera is.
    pub camera_mount: CameraMount,
    /// Columns of the images.
    pub width_px: u32,
    /// Rows.
    pub height_px: u32,
    /// Focal length as stated, px.
    pub focal_px: Option<f64>,
    /// The camera, where a file of it was given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub known_camera: Option<KnownCamera>,
    /// Lens model.
    pub lens: Lens,
    /// Whether the evidence decided on it.
    #[serde(default)]
    pub lens_choice: LensChoice,
    /// True where an observation of a circle is the centroid of its image, false for its imaged centre.
    pub centroid: bool,
    /// Index of its plate.
    pub plate: usize,
    /// False for a series without images: what it says of camera and plate is not used.
    #[serde(default = "yes", skip_serializing_if = "Clone::clone")]
    pub has_images: bool,
    /// True where the images stand in the order of visiting.
    pub order_known: bool,
    /// Name of its stops, where other cameras saw them, too.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub run: Option<String>,
    /// Where readings were computed from poses of a controller: the other readings, by image, with which the robot of the URDF reaches them.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub other_postures: BTreeMap<String, Vec<Vec<f64>>>,
    /// What scatters from stop to stop in it; absent in files that know it per camera only.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub noise: Option<StopNoise>,
}

/// What scatters from stop to stop in a series.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct StopNoise {
    /// Joint noise of each reading, rad or m.
    pub joint: Vec<f64>,
    /// 95 % interval of each of them; empty where the data do not tell it. The upper end is absent where it is not told.
    pub joint_interval: Vec<[Option<f64>; 2]>,
    /// Apparent tilt of the plate in each image, rad; 0 where it is not part of the model.
    pub apparent_tilt_rad: f64,
    /// The rest of the apparent displacement of the plate in each image; absent where no two cameras saw the same stops.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub apparent_shift: Option<ApparentShift>,
}

/// Apparent displacement of the plate beside its tilt.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ApparentShift {
    /// About its normal, rad.
    pub spin_rad: f64,
    /// Across the optical axis, along each of two directions, m.
    pub across_m: f64,
    /// Along the optical axis, m.
    pub along_m: f64,
}
