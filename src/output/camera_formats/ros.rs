//! `camera_info` of ROS, as `camera_calibration_parsers` reads and writes it.

use std::path::Path;

use super::distortion;
use super::model::{ReadCamera, Sayable, camera_of, unknown_model};
use super::yaml::{Calibration, parse};
use crate::error::Result;
use crate::model::camera::{Camera, Lens};
use crate::output::text::{list, quoted};

pub(super) const SAYABLE: &[Sayable] =
    &[Sayable::whole(Lens::Brown), Sayable::whole(Lens::Rational), Sayable::whole(Lens::Fisheye)];

/// Text of a camera whose lens ROS has; the coefficients of these lenses stand in the order of OpenCV.
pub(in crate::output) fn text(name: &str, camera: &Camera) -> String {
    let [fx, fy, cx, cy] = [0, 1, 2, 3].map(|k| camera.parameters[k]);
    let coefficients = &camera.parameters[4..];
    let matrix = |rows: usize, columns: usize, data: &[f64]| {
        format!("\n  rows: {rows}\n  cols: {columns}\n  data: {}\n", list(data.iter().copied()))
    };
    format!(
        "image_width: {}\nimage_height: {}\ncamera_name: {}\ncamera_matrix:{}distortion_model: {}\n\
         distortion_coefficients:{}rectification_matrix:{}projection_matrix:{}",
        camera.width_px,
        camera.height_px,
        quoted(name),
        matrix(3, 3, &[fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0]),
        camera.lens.ros_name().unwrap_or_default(),
        matrix(1, coefficients.len(), coefficients),
        matrix(3, 3, &[1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]),
        matrix(3, 4, &[fx, 0.0, cx, 0.0, 0.0, fy, cy, 0.0, 0.0, 0.0, 1.0, 0.0]),
    )
}

pub(super) fn read(path: &Path, text: &str) -> Result<ReadCamera> {
    let remedy = "give a camera_info with image_width, camera_matrix, distortion_model and distortion_coefficients";
    let file: Calibration = parse(path, text, remedy)?;
    let (size, pinhole, d) =
        ([file.image_width, file.image_height], file.pinhole(path)?, &file.distortion_coefficients.data);
    match file.distortion_model.as_deref() {
        Some("plumb_bob" | "rational_polynomial" | "") | None => {
            distortion::read(path, file.camera_name, size, pinhole, d)
        }
        Some("equidistant" | "fisheye") => {
            let camera = camera_of(path, Lens::Fisheye, size, pinhole, d)?;
            Ok(ReadCamera { name: file.camera_name, camera, loss_px: None })
        }
        Some(other) => Err(unknown_model(path, other, "plumb_bob, rational_polynomial, equidistant")),
    }
}
