//! A camera before a plate, looked at from a direction.

use nalgebra::{DMatrix, Matrix2, Vector2, Vector3};
use std::f64::consts::{PI, TAU};

use crate::geom::{Pose, matrix_from_rpy};
use crate::model::camera::Camera;
use crate::simulate::psf::Psf;
use crate::simulate::raster::{PixelRect, Plane, Rasteriser};

/// From where the plate is seen.
#[derive(Debug, Clone, Copy)]
pub(super) struct Direction {
    pub distance_m: f64,
    /// Angle between the optical axis and the plate's normal.
    pub tilt_rad: f64,
    /// Direction in the image of the axis of the tilt.
    pub azimuth_rad: f64,
    /// Turn of the plate in its plane.
    pub roll_rad: f64,
    /// Point of the plate on the optical axis, m.
    pub aim_m: [f64; 2],
}

impl Direction {
    pub fn camera_from_plate(&self) -> Pose {
        let about_x = |a: f64| matrix_from_rpy([a, 0.0, 0.0]);
        let about_z = |a: f64| matrix_from_rpy([0.0, 0.0, a]);
        let tilt = about_z(self.azimuth_rad) * about_x(self.tilt_rad) * about_z(-self.azimuth_rad);
        let rotation = tilt * about_x(PI) * about_z(self.roll_rad);
        let aim = rotation * Vector3::new(self.aim_m[0], self.aim_m[1], 0.0);
        Pose { rotation, translation: Vector3::new(0.0, 0.0, self.distance_m) - aim }
    }
}

/// Image of a circle parallel to the plate, sampled; `None` where the lens does not image all of it.
pub(super) fn ring(
    camera: &Camera,
    camera_from_plate: &Pose,
    centre: &Vector3<f64>,
    radius_m: f64,
    samples: usize,
) -> Option<Vec<Vector2<f64>>> {
    let sample = |k: usize| {
        let (sin, cos) = (k as f64 * TAU / samples as f64).sin_cos();
        camera.project(&camera_from_plate.transform(&(centre + Vector3::new(cos, sin, 0.0) * radius_m)))
    };
    (0..samples).map(sample).collect()
}

/// Exact information on the positions of outlines (outer, then inner), 1/px^2, with everything else known: `(C/n)^2` times the
/// Gram matrix of the derivatives of the blurred coverage, by central differences. `None` for outlines without an image.
pub(super) fn exact_information(
    outlines: &[Vec<Vector2<f64>>],
    psf_sigma_px: f64,
    contrast_to_noise: f64,
) -> Option<DMatrix<f64>> {
    const STEP_PX: f64 = 0.05;
    let psf = Psf::gaussian(psf_sigma_px);
    let frame = PixelRect::around(outlines.iter().flatten(), psf.reach() + 2)?;
    let mut raster = Rasteriser::default();
    let mut columns: Vec<Vec<f64>> = Vec::new();
    for outline in outlines {
        for axis in [Vector2::x(), Vector2::y()] {
            let mut side = |sign: f64| {
                let moved: Vec<Vector2<f64>> = outline.iter().map(|p| p + axis * (sign * STEP_PX)).collect();
                let patch = raster.cover(&[moved], &psf, &Plane::one(), &frame)?;
                let mut values = vec![0.0; frame.width * frame.height];
                for (k, v) in patch.values.iter().enumerate() {
                    let x = patch.rect.x - frame.x + (k % patch.rect.width) as i32;
                    let y = patch.rect.y - frame.y + (k / patch.rect.width) as i32;
                    let inside = (0..frame.width as i32).contains(&x) && (0..frame.height as i32).contains(&y);
                    if inside {
                        values[y as usize * frame.width + x as usize] = f64::from(*v);
                    }
                }
                Some(values)
            };
            let (plus, minus) = (side(1.0)?, side(-1.0)?);
            columns.push(plus.iter().zip(&minus).map(|(p, m)| (p - m) / (2.0 * STEP_PX)).collect());
        }
    }
    let dot = |i: usize, j: usize| columns[i].iter().zip(&columns[j]).map(|(a, b)| a * b).sum::<f64>();
    // the hole of an annulus is light: its coverage counts negative
    let sign = |i: usize, j: usize| if (i < 2) == (j < 2) { 1.0 } else { -1.0 };
    Some(DMatrix::from_fn(columns.len(), columns.len(), |i, j| sign(i, j) * dot(i, j) * contrast_to_noise.powi(2)))
}

/// Information on the position of a contour, 1/px^2: `(C/n)^2 / (2 sqrt(pi) s)` times the integral of `n n'` along it,
/// with everything but the position known. For a circle its inverse is the bound `(n/C)^2 2 s / (sqrt(pi) r)` per axis.
pub(super) fn information(ring: &[Vector2<f64>], blur_px: f64, contrast_to_noise: f64) -> Matrix2<f64> {
    let mut sum = Matrix2::zeros();
    for (p, q) in ring.iter().zip(ring.iter().cycle().skip(1)) {
        let step = q - p;
        let normal = Vector2::new(step.y, -step.x);
        sum += normal * normal.transpose() / step.norm().max(1e-12);
    }
    sum * (contrast_to_noise.powi(2) / (2.0 * PI.sqrt() * blur_px))
}
