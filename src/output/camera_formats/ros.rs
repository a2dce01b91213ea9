//! `camera_info` of ROS, as `camera_calibration_parsers` reads and writes it; also the message itself, as `ros2 topic echo` prints it.

use std::path::Path;

use serde::Deserialize;

use super::distortion;
use super::model::{ReadCamera, Sayable, camera_of, unknown_model};
use super::yaml::{Calibration, parse, pinhole};
use crate::error::{Code, Error, Result};
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

/// `sensor_msgs/CameraInfo`; ROS 1 prints capital letters.
#[derive(Deserialize)]
struct Message {
    width: u32,
    height: u32,
    distortion_model: String,
    #[serde(alias = "D")]
    d: Vec<f64>,
    #[serde(alias = "K")]
    k: Vec<f64>,
    #[serde(default)]
    binning_x: u32,
    #[serde(default)]
    binning_y: u32,
    #[serde(default)]
    roi: Region,
}

/// What part of the sensor the images show; zeros stand for all of it.
#[derive(Deserialize, Default, PartialEq)]
struct Region {
    x_offset: u32,
    y_offset: u32,
    height: u32,
    width: u32,
}

/// True for the text of a message.
pub(super) fn is_message(text: &str) -> bool {
    let begins = |keys: [&str; 2]| text.lines().any(|l| keys.iter().any(|key| l.starts_with(key)));
    begins(["distortion_model:", "distortion_model :"]) && begins(["k:", "K:"]) && begins(["d:", "D:"])
}

/// The first message of a text.
fn read_message(path: &Path, text: &str) -> Result<ReadCamera> {
    let first = text.trim_start_matches("---\n").split("\n---").next().unwrap_or_default();
    let message: Message = parse(path, first, "give one message as `ros2 topic echo --once` prints it")?;
    let size = [message.width, message.height];
    let whole = Region { width: size[0], height: size[1], ..Region::default() };
    if message.binning_x.max(message.binning_y) > 1 || ![Region::default(), whole].contains(&message.roi) {
        let what = "its images are binned or cut out, and its matrix is that of the whole sensor";
        let remedy = "calibrate without binning and region of interest, or leave the file out";
        return Err(Error::new(Code::SettingRange, path.display(), what, remedy));
    }
    with_model(path, Some(&message.distortion_model), (None, size, pinhole(path, &message.k)?), &message.d)
}

pub(super) fn read(path: &Path, text: &str) -> Result<ReadCamera> {
    if is_message(text) {
        return read_message(path, text);
    }
    let remedy = "give a camera_info with image_width, camera_matrix, distortion_model and distortion_coefficients";
    let file: Calibration = parse(path, text, remedy)?;
    let size = [file.image_width, file.image_height];
    let pinhole = pinhole(path, &file.camera_matrix.data)?;
    with_model(
        path,
        file.distortion_model.as_deref(),
        (file.camera_name, size, pinhole),
        &file.distortion_coefficients.data,
    )
}

/// The camera of a distortion model as ROS names it.
pub(super) fn with_model(
    path: &Path,
    model: Option<&str>,
    (name, size, pinhole): (Option<String>, [u32; 2], [f64; 4]),
    d: &[f64],
) -> Result<ReadCamera> {
    match model {
        Some("plumb_bob" | "radtan" | "rational_polynomial" | "") | None => {
            distortion::read(path, name, size, pinhole, d)
        }
        Some("equidistant" | "fisheye") => {
            let camera = camera_of(path, Lens::Fisheye, size, pinhole, d)?;
            Ok(ReadCamera { name, camera, loss_px: None })
        }
        Some(other) => Err(unknown_model(path, other, "plumb_bob, rational_polynomial, equidistant")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MESSAGE: &str = "header:\n  frame_id: cam\nheight: 720\nwidth: 960\ndistortion_model: plumb_bob\nd:\n- -0.1\n- 0.02\n- 0.0005\n- -0.0003\n- 0.001\n\
        k:\n- 900.0\n- 0.0\n- 479.5\n- 0.0\n- 902.0\n- 359.5\n- 0.0\n- 0.0\n- 1.0\nr: [1, 0, 0, 0, 1, 0, 0, 0, 1]\np: [900.0, 0, 479.5, 0, 0, 902.0, 359.5, 0, 0, 0, 1, 0]\n\
        binning_x: 0\nbinning_y: 0\nroi:\n  x_offset: 0\n  y_offset: 0\n  height: 0\n  width: 0\n  do_rectify: false\n---\n";

    #[test]
    fn a_message_as_ros_prints_it_is_a_camera() {
        let old =
            MESSAGE.replace("\nd:", "\nD:").replace("\nk:", "\nK:").replace("\nr:", "\nR:").replace("\np:", "\nP:");
        for text in [MESSAGE.to_owned(), MESSAGE.repeat(2), old] {
            assert!(is_message(&text));
            let camera = read(Path::new("a.yaml"), &text).unwrap().camera;
            assert_eq!((camera.lens, camera.width_px, camera.height_px), (Lens::Brown, 960, 720));
            assert_eq!(camera.parameters, [900.0, 902.0, 479.5, 359.5, -0.1, 0.02, 0.0005, -0.0003, 0.001]);
        }
        for (whole, part) in [("binning_x: 0", "binning_x: 2"), ("x_offset: 0", "x_offset: 8")] {
            let refused = read(Path::new("a.yaml"), &MESSAGE.replace(whole, part)).unwrap_err();
            assert_eq!(refused.code, Code::SettingRange, "{part}");
        }
    }
}
