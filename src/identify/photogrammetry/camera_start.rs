//! What is known of the cameras before their images are looked at.

use crate::problem::{KnownCamera, MeasuredSeries};

/// What is known of a camera before its images are looked at.
#[derive(Debug, Clone, PartialEq)]
pub enum CameraStart {
    /// Nothing.
    Unknown,
    /// A focal length, px.
    Focal(f64),
    /// All of it: held, or to start from.
    Known(KnownCamera),
}

/// What is known of every camera, as the first series that states it has it.
pub(in crate::identify) fn camera_starts(cameras: &[String], series: &[MeasuredSeries]) -> Vec<CameraStart> {
    let of = |name: &String| {
        let mut own = series.iter().filter(|s| &s.camera == name);
        let known = own.clone().find_map(|s| s.known_camera.clone()).map(CameraStart::Known);
        known.or_else(|| own.find_map(|s| s.focal_px).map(CameraStart::Focal)).unwrap_or(CameraStart::Unknown)
    };
    cameras.iter().map(of).collect()
}
