//! camera.yaml: ROS camera_info, for image_pipeline, camera_calibration_parsers and OpenCV.

use crate::error::{Code, Error, Result};
use crate::model::camera::{Camera, Lens};
use crate::output::camera_formats::ros;
use crate::output::names::file_names;
use crate::output::text::list;
#[cfg(feature = "mcap")]
use crate::series::CameraInfo;

/// One file for each camera that sees between two depths (m), as (file name, text); none for a lens that no model of ROS comes near to, which
/// a finding names.
pub fn cameras(names: &[String], cameras: &[Camera], depths_m: &[[f64; 2]]) -> Vec<(String, String)> {
    let cameras = names.iter().zip(cameras).zip(depths_m);
    let texts = cameras.map(|((name, camera), depths)| camera_yaml(name, camera, depths).ok());
    file_names("camera", "yaml", names).into_iter().zip(texts).filter_map(|(file, text)| Some((file, text?))).collect()
}

/// Name in ROS of the lens of a camera that ROS has.
fn ros_name(camera: &Camera) -> &'static str {
    camera.lens.ros_name().unwrap_or_default()
}

/// Text of one camera_info; pixel (0, 0) is the centre of the top-left pixel, as in OpenCV and ROS.
///
/// A lens that ROS has no model for is fitted by one that it has, and the text says what that costs.
///
/// # Errors
/// A lens that no model of ROS comes near to.
pub(super) fn camera_yaml(name: &str, camera: &Camera, depths_m: &[f64; 2]) -> Result<String> {
    let (camera, remark) = in_ros(name, camera, depths_m)?;
    Ok(remark + &ros::text(name, &camera))
}

/// The camera as ROS can say it, and what that loses, in words.
fn in_ros(name: &str, camera: &Camera, depths_m: &[f64; 2]) -> Result<(Camera, String)> {
    if camera.lens.is_in_ros() {
        return Ok((camera.clone(), String::new()));
    }
    let lens = camera.lens.name();
    let fit = camera.in_ros(depths_m).ok_or_else(|| {
        Error::new(
            Code::CameraFileImpossible,
            format!("camera {name}"),
            format!("no camera model of ROS comes near to its {lens} lens"),
            "identify with --camera brown or rational",
        )
    })?;
    let remark = format!(
        "# NOT THE IDENTIFIED LENS ({lens}, see solution.json), for which ROS has no model, but the nearest {}:\n\
         # loss {:.3} px RMS over the image, at most {:.3} px, for points {:.3} to {:.3} m away.\n{}",
        ros_name(&fit.camera),
        fit.rms_px,
        fit.worst_px,
        depths_m[0],
        depths_m[1],
        for_opencv(camera)
    );
    Ok((fit.camera, remark))
}

/// The lens itself where OpenCV has it and ROS has not, as comments: `cv::projectPoints` takes these twelve coefficients.
fn for_opencv(camera: &Camera) -> String {
    if camera.lens != Lens::ThinPrism {
        return String::new();
    }
    let p = &camera.parameters;
    let coefficients = p[4..9].iter().chain(&[0.0; 3]).chain(&p[9..13]);
    format!(
        "# The lens itself in OpenCV: fx, fy, cx, cy = {},\n# distCoeffs (k1 k2 p1 p2 k3 k4 k5 k6 s1 s2 s3 s4) = {}\n",
        list(p[..4].iter().copied()),
        list(coefficients.copied())
    )
}

/// The camera as a message of ROS, for points between two depths (m).
///
/// # Errors
/// A lens that no model of ROS comes near to.
#[cfg(feature = "mcap")]
pub(super) fn camera_info(name: &str, camera: &Camera, depths_m: &[f64; 2]) -> Result<CameraInfo> {
    let (camera, _) = in_ros(name, camera, depths_m)?;
    let p = &camera.parameters;
    Ok(CameraInfo {
        width_px: camera.width_px,
        height_px: camera.height_px,
        distortion_model: ros_name(&camera).into(),
        distortion: p[4..].to_vec(),
        intrinsics: Some([p[0], p[1], p[2], p[3]]),
    })
}
