//! `cv::FileStorage` in YAML, with the keys of OpenCV's calibration sample.

use std::path::Path;

use super::distortion;
use super::model::{ReadCamera, Sayable, camera_of};
use super::yaml::{Calibration, parse, pinhole};
use crate::error::Result;
use crate::model::camera::{Camera, Lens};
use crate::output::text::list;

pub(super) const SAYABLE: &[Sayable] = &[
    Sayable::whole(Lens::Brown),
    Sayable::whole(Lens::Rational),
    Sayable::whole(Lens::ThinPrism),
    Sayable::whole(Lens::Fisheye),
];

/// The coefficients as OpenCV takes them.
pub(super) fn coefficients(camera: &Camera) -> Vec<f64> {
    let k = &camera.parameters[4..camera.parametric()];
    match camera.lens {
        Lens::ThinPrism => [&k[..5], &[0.0; 3], &k[5..]].concat(),
        _ => k.to_vec(),
    }
}

pub(super) fn text(camera: &Camera) -> String {
    let [fx, fy, cx, cy] = [0, 1, 2, 3].map(|k| camera.parameters[k]);
    let d = coefficients(camera);
    let fisheye = if camera.lens == Lens::Fisheye { "fisheye_model: 1\n" } else { "" };
    let matrix = |rows: usize, columns: usize, data: &[f64]| {
        let data = list(data.iter().copied());
        format!(" !!opencv-matrix\n   rows: {rows}\n   cols: {columns}\n   dt: d\n   data: {data}\n")
    };
    format!(
        "%YAML:1.0\n---\nimage_width: {}\nimage_height: {}\n{fisheye}camera_matrix:{}distortion_coefficients:{}",
        camera.width_px,
        camera.height_px,
        matrix(3, 3, &[fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0]),
        matrix(d.len(), 1, &d),
    )
}

pub(super) fn read(path: &Path, text: &str) -> Result<ReadCamera> {
    let remedy = "give image_width, image_height, camera_matrix and distortion_coefficients, as OpenCV's calibration sample writes them";
    let file: Calibration = parse(path, text, remedy)?;
    let (size, pinhole, d) = (
        [file.image_width, file.image_height],
        pinhole(path, &file.camera_matrix.data)?,
        &file.distortion_coefficients.data,
    );
    if file.fisheye_model != 0 {
        let camera = camera_of(path, Lens::Fisheye, size, pinhole, d)?;
        return Ok(ReadCamera { name: file.camera_name, camera, loss_px: None });
    }
    distortion::read(path, file.camera_name, size, pinhole, d)
}
