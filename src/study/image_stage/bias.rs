//! Bias of the measured centroids where simpler measurements fail: noise-free pictures of the standard plate.

use nalgebra::Vector2;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use std::collections::BTreeSet;

use super::view::{Direction, ring};
use crate::detect::circles::{self, Drift, InnerOuter};
use crate::error::Result;
use crate::model::camera::{Camera, Lens};
use crate::model::circle::centroid_uv;
use crate::plan::plate_design::LEAST_MINOR_AXIS_PX;
use crate::series::{Edge, Plate};
use crate::simulate::conditions::ImagingConditions;
use crate::simulate::render::render;

/// Why a simple measurement would be wrong.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum BiasCause {
    /// Light with a gradient.
    Gradient {
        /// Change as a share of the light in the middle, 1/px.
        per_px: f64,
        /// Direction in the image, degrees.
        direction_deg: f64,
    },
    /// The outer fifth of the field of a wide-angle lens.
    WideAngle {
        /// First coefficient of the radial distortion.
        k1: f64,
        /// Field of view across the picture's width, degrees.
        field_deg: f64,
    },
    /// Perspective from close by.
    Close {
        /// Distance of the plate, m.
        distance_m: f64,
        /// Angle between the optical axis and the plate's normal, degrees.
        tilt_deg: f64,
    },
    /// A point spread with a one-sided tail.
    Coma {
        /// Its length in the corner of the picture, px.
        corner_px: f64,
    },
}

/// One picture of the study.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BiasCase {
    /// Why a simple measurement would be wrong.
    pub cause: BiasCause,
    /// Sigma of the point spread, px.
    pub psf_sigma_px: f64,
    /// Semi-axis of a large marker before the lens's middle, px (decides the distance where the case does not).
    pub radius_px: f64,
}

/// What was measured in a case.
#[derive(Debug, Clone, PartialEq)]
pub struct Bias {
    /// The case.
    pub case: BiasCase,
    /// Contours judged (outer and inner) of markers with a minor axis of at least [`LEAST_MINOR_AXIS_PX`].
    pub contours: usize,
    /// Markers measured.
    pub markers: usize,
    /// Markers to be measured: large enough and wholly in the judged part of the picture.
    pub wanted: usize,
    /// Rms distance of the measured from the true centroid, px.
    pub rms_px: f64,
    /// Largest distance, px.
    pub largest_px: f64,
    /// Largest distance of the projected centre from the true centroid, px: the error of who takes one for the other.
    pub projected_centre_px: f64,
    /// Mean difference of inner and outer centres that geometry does not explain.
    pub inner_outer: Option<InnerOuter>,
    /// What lopsided edges say about the displacement of the centres.
    pub lopsided: Option<Drift>,
    /// The same in a picture with noise, where a case shows coma: contrast over noise of [`COMA_CONTRAST_TO_NOISE`].
    pub lopsided_in_noise: Option<Drift>,
}

/// Contrast over noise of the second picture of a case with coma.
pub const COMA_CONTRAST_TO_NOISE: f64 = 100.0;

/// The cases that a measurement must stand, for every blur.
pub fn bias_cases(blurs: &[f64]) -> Vec<BiasCase> {
    let mut cases = Vec::new();
    for &psf_sigma_px in blurs {
        let mut add = |cause, radius_px| cases.push(BiasCase { cause, psf_sigma_px, radius_px });
        for (radius_px, direction_deg) in [(5.0, 20.0), (8.0, 75.0), (12.0, 200.0)] {
            add(BiasCause::Gradient { per_px: 0.005, direction_deg }, radius_px);
        }
        for radius_px in [10.0, 14.0, 24.0] {
            add(BiasCause::WideAngle { k1: -0.12, field_deg: 75.0 }, radius_px);
        }
        add(BiasCause::Close { distance_m: 0.12, tilt_deg: 50.0 }, 0.0);
        for corner_px in [1.0, 2.0, 4.0] {
            add(BiasCause::Coma { corner_px }, 9.0);
        }
    }
    cases
}

/// Focal length of the camera of all cases (75 degrees across 1280 columns), px.
fn focal_px(width: u32, field_deg: f64) -> f64 {
    f64::from(width) / 2.0 / (field_deg.to_radians() / 2.0).tan()
}

/// Side of the picture under a gradient, px: at its ends the light is down to a fifth.
const GRADIENT_SIDE: u32 = 300;
/// Points of an outline.
const OUTLINE: usize = 64;
/// Radius of a large marker of the standard plate, m.
const LARGE_M: f64 = 0.0054;

impl BiasCase {
    fn scene(&self) -> (Camera, Direction, ImagingConditions) {
        let mut conditions = ImagingConditions::ideal(self.psf_sigma_px);
        let (width, height) = match self.cause {
            BiasCause::Gradient { .. } => (GRADIENT_SIDE, GRADIENT_SIDE),
            _ => (1280, 1024),
        };
        let field_deg = if let BiasCause::WideAngle { field_deg, .. } = self.cause { field_deg } else { 75.0 };
        let mut camera = Camera::pinhole(Lens::Brown, width, height, focal_px(1280, field_deg));
        let mut direction = Direction {
            distance_m: camera.parameters[0] * LARGE_M / self.radius_px.max(1.0),
            tilt_rad: 0.0,
            azimuth_rad: 0.6,
            roll_rad: 0.3,
            aim_m: [0.0031, -0.0047],
        };
        match self.cause {
            BiasCause::Gradient { per_px, direction_deg } => {
                let (sin, cos) = direction_deg.to_radians().sin_cos();
                conditions.gradient_per_px = [per_px * cos, per_px * sin];
                conditions.exposure = 0.5;
            }
            BiasCause::WideAngle { k1, .. } => {
                camera.parameters[4] = k1;
                direction.tilt_rad = 0.2;
                // the plate's corner on the axis, and the plate towards a corner of the picture
                (direction.roll_rad, direction.aim_m) = (0.1, [0.2, -0.12]);
            }
            BiasCause::Close { distance_m, tilt_deg } => {
                (direction.distance_m, direction.tilt_rad) = (distance_m, tilt_deg.to_radians());
            }
            BiasCause::Coma { corner_px } => conditions.coma_px = corner_px,
        }
        (camera, direction, conditions)
    }

    /// Whether a marker with this outline counts: it lies in the picture with its blur, is large enough, and is in the
    /// corner of a wide-angle lens, or where the local gradient is at most twice the nominal.
    fn is_judged(&self, outline: &[Vector2<f64>], camera: &Camera, conditions: &ImagingConditions) -> bool {
        let middle = Vector2::new(f64::from(camera.width_px) - 1.0, f64::from(camera.height_px) - 1.0) / 2.0;
        let at = outline.iter().sum::<Vector2<f64>>() / outline.len() as f64;
        let placed = match self.cause {
            BiasCause::WideAngle { .. } => (at - middle).norm() > 0.8 * middle.norm(),
            BiasCause::Gradient { .. } => conditions.illumination(at, middle) > 0.5,
            _ => true,
        };
        let half = outline.len() / 2;
        let minor = (0..half).map(|k| (outline[k] - outline[k + half]).norm()).fold(f64::MAX, f64::min);
        let margin = 3.0 * self.psf_sigma_px + 1.0;
        placed && minor >= LEAST_MINOR_AXIS_PX && outline.iter().all(|p| camera.contains(p, margin))
    }
}

/// Renders and measures a case.
///
/// # Errors
/// The plate is not found.
pub fn bias(case: &BiasCase, plate: &Plate) -> Result<Bias> {
    let (camera, direction, conditions) = case.scene();
    let pose = direction.camera_from_plate();
    let detect = |conditions: &ImagingConditions| {
        let picture = render(plate, &camera, &pose, conditions, &mut ChaCha8Rng::seed_from_u64(0));
        circles::detect(&picture, plate, &circles::Options::default())
    };
    let found = detect(&conditions)?;
    let lopsided_in_noise = match case.cause {
        BiasCause::Coma { .. } => detect(&conditions.clone().with_contrast_to_noise(COMA_CONTRAST_TO_NOISE))?.lopsided,
        _ => None,
    };
    let truth = |marker: u32, edge: Edge| -> Option<[Vector2<f64>; 2]> {
        let m = &plate.markers[plate.index_of(marker)?];
        let radius = if edge == Edge::Outer { m.outer_radius_m } else { m.inner_radius_m };
        Some([centroid_uv(&camera, &pose, &m.position_m, radius)?, camera.project(&pose.transform(&m.position_m))?])
    };
    let mut result = Bias {
        case: *case,
        contours: 0,
        markers: 0,
        wanted: 0,
        rms_px: 0.0,
        largest_px: 0.0,
        projected_centre_px: 0.0,
        inner_outer: found.inner_outer,
        lopsided: found.lopsided,
        lopsided_in_noise,
    };
    let judged: BTreeSet<u32> = plate
        .markers
        .iter()
        .filter(|m| {
            let outline = ring(&camera, &pose, &m.position_m, m.outer_radius_m, OUTLINE);
            outline.is_some_and(|o| case.is_judged(&o, &camera, &conditions))
        })
        .map(|m| m.id)
        .collect();
    result.wanted = judged.len();
    for o in found.observations.iter().filter(|o| judged.contains(&o.marker)) {
        let Some([centroid, centre]) = truth(o.marker, o.edge) else { continue };
        let off = (Vector2::from(o.uv) - centroid).norm();
        result.contours += 1;
        result.markers += usize::from(o.edge == Edge::Outer);
        result.rms_px += off * off;
        result.largest_px = result.largest_px.max(off);
        result.projected_centre_px = result.projected_centre_px.max((centre - centroid).norm());
    }
    result.rms_px = (result.rms_px / result.contours as f64).sqrt();
    Ok(result)
}
