//! camera.yaml: ROS camera_info, for image_pipeline, camera_calibration_parsers and OpenCV.

use super::names::file_names;
use super::text::{list, quoted};
use crate::error::Result;
use crate::model::camera::{Camera, Lens};
use crate::recipe::Solution;

/// One file for each camera, as (file name, text).
///
/// # Errors
/// A lens that camera_info cannot express.
pub(super) fn cameras(solution: &Solution) -> Result<Vec<(String, String)>> {
    let names = &solution.problem.cameras;
    let texts = names.iter().zip(&solution.state.cameras).map(|(name, camera)| camera_yaml(name, camera));
    file_names("camera", "yaml", names).into_iter().zip(texts).map(|(file, text)| Ok((file, text?))).collect()
}

/// Text of one camera_info; pixel (0, 0) is the centre of the top-left pixel, as in OpenCV and ROS.
pub(super) fn camera_yaml(name: &str, camera: &Camera) -> Result<String> {
    let [fx, fy, cx, cy] = [0, 1, 2, 3].map(|k| camera.parameters[k]);
    // The order of OpenCV's five coefficients (k1, k2, t1, t2, k3) is that of the lens.
    let (model, coefficients) = match camera.lens {
        Lens::Brown => ("plumb_bob", camera.parameters[4..].to_vec()),
    };
    let matrix = |rows: usize, columns: usize, data: &[f64]| {
        format!("\n  rows: {rows}\n  cols: {columns}\n  data: {}\n", list(data.iter().copied()))
    };
    Ok(format!(
        "image_width: {}\nimage_height: {}\ncamera_name: {}\ncamera_matrix:{}distortion_model: {model}\n\
         distortion_coefficients:{}rectification_matrix:{}projection_matrix:{}",
        camera.width_px,
        camera.height_px,
        quoted(name),
        matrix(3, 3, &[fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0]),
        matrix(1, coefficients.len(), &coefficients),
        matrix(3, 3, &[1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]),
        matrix(3, 4, &[fx, 0.0, cx, 0.0, 0.0, fy, cy, 0.0, 0.0, 0.0, 1.0, 0.0]),
    ))
}
