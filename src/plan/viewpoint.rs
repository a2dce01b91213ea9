//! From where a camera looks at a plate: distance, tilt, direction, roll and the place in the image.

use nalgebra::{Rotation3, Vector3};
use rand::{Rng, RngExt};
use std::f64::consts::{PI, TAU};

use crate::geom::Pose;
use crate::series::Plate;

/// The range of views to draw from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ViewRange {
    /// Nearest distance from camera to the point looked at, m.
    pub near_m: f64,
    /// Farthest distance, m.
    pub far_m: f64,
    /// Largest angle between line of sight and the plate's normal, rad.
    pub tilt_rad: f64,
    /// How far the point looked at may lie from the middle of the plate, as a share of the plate's half size.
    pub spread: f64,
    /// How far the optical axis may point beside it, rad.
    pub aside_rad: f64,
}

impl Default for ViewRange {
    /// 0.12 to 0.6 m, up to 50 degrees, all over the plate, all rolls.
    fn default() -> Self {
        Self { near_m: 0.12, far_m: 0.6, tilt_rad: 50_f64.to_radians(), spread: 0.8, aside_rad: 0.15 }
    }
}

/// A random view, `plate_from_camera`: log-uniform in distance, even over the cap of directions, every roll.
pub fn random_view(plate: &Plate, range: &ViewRange, rng: &mut impl Rng) -> Pose {
    let half = |n: u32| f64::from(n.max(1) - 1) / 2.0 * plate.pitch_m * range.spread;
    let mut around = |size: f64| if size > 0.0 { rng.random_range(-size..size) } else { 0.0 };
    let target = Vector3::new(around(half(plate.columns)), around(half(plate.rows)), 0.0);
    let [aside_x, aside_y] = [around(range.aside_rad), around(range.aside_rad)];
    let distance = range.near_m * (range.far_m / range.near_m).powf(rng.random());
    let cosine = 1.0 - (1.0 - range.tilt_rad.cos()) * rng.random::<f64>();
    let (azimuth, roll) = (rng.random_range(0.0..TAU), rng.random_range(0.0..TAU));
    let sine = (1.0 - cosine * cosine).max(0.0).sqrt();
    let direction = Vector3::new(sine * azimuth.cos(), sine * azimuth.sin(), cosine);
    // Looking straight down on the plate with its x to the right, then swung along the direction, rolled, turned aside.
    let down = Rotation3::from_axis_angle(&Vector3::x_axis(), PI);
    let swing = Rotation3::rotation_between(&Vector3::z(), &direction).unwrap_or_else(Rotation3::identity);
    let aside = Rotation3::from_euler_angles(aside_x, aside_y, 0.0);
    let rotation = swing * down * Rotation3::from_axis_angle(&Vector3::z_axis(), roll) * aside;
    Pose::new(*rotation.matrix(), target + direction * distance)
}
