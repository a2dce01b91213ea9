//! From where a camera looks at a plate: distance, tilt, direction, roll and the place in the image.

use nalgebra::{Rotation3, Vector3};
use rand::{Rng, RngExt};
use rand_distr::StandardNormal;
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

/// A view by what a photographer would set.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Viewpoint {
    /// The point looked at, in the plate frame, m.
    pub target_m: [f64; 2],
    /// Where the optical axis points beside it, about the camera's x and y, rad.
    pub aside_rad: [f64; 2],
    /// Distance from camera to that point, m.
    pub distance_m: f64,
    /// Angle between line of sight and the plate's normal, rad.
    pub tilt_rad: f64,
    /// Direction of the tilt about the plate's normal, rad.
    pub azimuth_rad: f64,
    /// Turn about the optical axis, rad.
    pub roll_rad: f64,
}

impl ViewRange {
    /// How far the point looked at may lie from the middle of the plate, m.
    fn half_size_m(&self, plate: &Plate) -> [f64; 2] {
        [plate.columns, plate.rows].map(|n| f64::from(n.max(1) - 1) / 2.0 * plate.pitch_m * self.spread)
    }
}

impl Viewpoint {
    /// A random view: log-uniform in distance, even over the cap of directions, every roll.
    pub fn random(plate: &Plate, range: &ViewRange, rng: &mut impl Rng) -> Self {
        let mut around = |size: f64| if size > 0.0 { rng.random_range(-size..size) } else { 0.0 };
        let target_m = range.half_size_m(plate).map(&mut around);
        let aside_rad = [range.aside_rad; 2].map(&mut around);
        let distance_m = range.near_m * (range.far_m / range.near_m).powf(rng.random());
        let cosine = 1.0 - (1.0 - range.tilt_rad.cos()) * rng.random::<f64>();
        let (azimuth_rad, roll_rad) = (rng.random_range(0.0..TAU), rng.random_range(0.0..TAU));
        Self { target_m, aside_rad, distance_m, tilt_rad: cosine.acos(), azimuth_rad, roll_rad }
    }

    /// A view near this one and inside the range; `size` is the standard deviation of every setting as a share of its range.
    pub fn near(&self, size: f64, plate: &Plate, range: &ViewRange, rng: &mut impl Rng) -> Self {
        let mut step = |width: f64| size * width * rng.sample::<f64, _>(StandardNormal);
        let half = range.half_size_m(plate);
        let shifted = |at: f64, by: f64, most: f64| (at + by).clamp(-most, most);
        let target_m = [0, 1].map(|k| shifted(self.target_m[k], step(2.0 * half[k]), half[k]));
        let aside_rad = self.aside_rad.map(|at| shifted(at, step(2.0 * range.aside_rad), range.aside_rad));
        let stretch = step((range.far_m / range.near_m).ln()).exp();
        Self {
            target_m,
            aside_rad,
            distance_m: (self.distance_m * stretch).clamp(range.near_m, range.far_m),
            tilt_rad: (self.tilt_rad + step(range.tilt_rad)).abs().min(range.tilt_rad),
            azimuth_rad: self.azimuth_rad + step(TAU),
            roll_rad: self.roll_rad + step(TAU),
        }
    }

    /// The pose of the camera.
    pub fn plate_from_camera(&self) -> Pose {
        let (sine, cosine) = self.tilt_rad.sin_cos();
        let direction = Vector3::new(sine * self.azimuth_rad.cos(), sine * self.azimuth_rad.sin(), cosine);
        // Looking straight down on the plate with its x to the right, then swung along the direction, rolled, turned aside.
        let down = Rotation3::from_axis_angle(&Vector3::x_axis(), PI);
        let swing = Rotation3::rotation_between(&Vector3::z(), &direction).unwrap_or_else(Rotation3::identity);
        let aside = Rotation3::from_euler_angles(self.aside_rad[0], self.aside_rad[1], 0.0);
        let rotation = swing * down * Rotation3::from_axis_angle(&Vector3::z_axis(), self.roll_rad) * aside;
        let target = Vector3::new(self.target_m[0], self.target_m[1], 0.0);
        Pose::new(*rotation.matrix(), target + direction * self.distance_m)
    }
}
