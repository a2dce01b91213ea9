//! YAML of other programs.

use std::path::Path;

use serde::Deserialize;
use serde::de::DeserializeOwned;

use crate::error::{Code, Error, Result};

/// A matrix as OpenCV and ROS write it.
#[derive(Deserialize)]
pub(super) struct Numbers {
    pub data: Vec<f64>,
}

/// Pinhole matrix, distortion and size: OpenCV and ROS have the same keys.
#[derive(Deserialize)]
pub(super) struct Calibration {
    // Capitals: the sample of OpenCV 2.
    #[serde(alias = "image_Width")]
    pub image_width: u32,
    #[serde(alias = "image_Height")]
    pub image_height: u32,
    pub camera_name: Option<String>,
    pub distortion_model: Option<String>,
    /// The calibration sample of OpenCV says so of a Kannala-Brandt lens.
    #[serde(default)]
    pub fisheye_model: u8,
    #[serde(alias = "cameraMatrix", alias = "Camera_Matrix")]
    pub camera_matrix: Numbers,
    #[serde(alias = "distCoeffs", alias = "distortionCoefficients", alias = "Distortion_Coefficients")]
    pub distortion_coefficients: Numbers,
}

/// fx, fy, cx, cy of a pinhole matrix.
pub(super) fn pinhole(path: &Path, matrix: &[f64]) -> Result<[f64; 4]> {
    match matrix[..] {
        [fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0] => Ok([fx, fy, cx, cy]),
        _ => {
            let what = "the camera matrix is not [fx, 0, cx, 0, fy, cy, 0, 0, 1]";
            let remedy = "a skew is not part of the models of this program";
            Err(Error::new(Code::SettingRange, path.display(), what, remedy))
        }
    }
}

/// A value from YAML, with what only OpenCV writes taken out: directive, tags of matrices.
pub(super) fn parse<T: DeserializeOwned>(path: &Path, text: &str, remedy: &str) -> Result<T> {
    let plain: String = text
        .lines()
        .map(|l| if l.starts_with('%') || l == "---" { "" } else { l })
        .map(|l| l.replace("!!opencv-matrix", "") + "\n")
        .collect();
    serde_saphyr::from_str(&plain).map_err(|e| Error::new(Code::SettingSyntax, path.display(), e, remedy))
}
