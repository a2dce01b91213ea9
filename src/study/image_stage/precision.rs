//! Precision against the Cramer-Rao bound, and the honesty of the stated covariance.

use nalgebra::{DMatrix, Matrix2, Vector2, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use std::f64::consts::TAU;

use super::view::{Direction, exact_information, information, ring};
use crate::detect::circles::{self, Imaged, Measured, Predicted};
use crate::geom::Pose;
use crate::model::camera::{Camera, Lens};
use crate::model::circle::centroid_uv;
use crate::plan::plate_design::{INNER_SHARE, LARGE_RADIUS, LEAST_MINOR_AXIS_PX};
use crate::series::{Marker, Plate, PlateKind};
use crate::simulate::conditions::ImagingConditions;
use crate::simulate::render::render;

/// Conditions of one cell.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PrecisionCell {
    /// Longer semi-axis of the outer contours, px.
    pub radius_px: f64,
    /// Sigma of the point spread, px; the pixel's aperture comes on top.
    pub psf_sigma_px: f64,
    /// Contrast over noise of a pixel; infinite for the bias alone.
    pub contrast_to_noise: f64,
    /// Tilt of the plate, degrees.
    pub tilt_deg: f64,
}

/// What was reached in a cell, for discs or for annuli.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Precision {
    /// The conditions.
    pub cell: PrecisionCell,
    /// Annuli (with half the radius inside), else discs.
    pub annuli: bool,
    /// Markers in the pictures.
    pub wanted: usize,
    /// Markers measured.
    pub markers: usize,
    /// Annuli whose inner contour was measured for itself.
    pub inner: usize,
    /// Rms error per axis of the outer contours, px.
    pub rms_px: f64,
    /// Rms of the error in units of the formula `(n/C) sqrt(2 s / (sqrt(pi) r))`, generalised to any contour (`information`).
    pub to_formula: f64,
    /// Rms of the error in units of the exact bound: position from the blurred coverage, everything else known; the inner
    /// centre unknown where it is measured for itself.
    pub to_bound: f64,
    /// Rms of the error in units of the stated covariance.
    pub normalised: f64,
    /// The same for the inner contours; NaN without any.
    pub inner_normalised: f64,
    /// Largest mean of the error over the markers (column or row), px.
    pub bias_px: f64,
    /// Those of the markers that a second pass measured, in pictures in which nothing could be identified.
    pub second_pass: usize,
}

impl PrecisionCell {
    /// Whether `robotcal plate` designs plates for such a view: its smallest markers have at least this minor axis.
    pub fn is_designed_for(&self) -> bool {
        2.0 * self.radius_px * self.tilt_deg.to_radians().cos() >= LEAST_MINOR_AXIS_PX
    }
}

/// The cells of the study: all combinations of radius, blur, contrast and tilt.
pub fn precision_cells(radii: &[f64], blurs: &[f64], contrasts: &[f64], tilts: &[f64]) -> Vec<PrecisionCell> {
    let mut cells = Vec::new();
    for &radius_px in radii {
        for &psf_sigma_px in blurs {
            for &contrast_to_noise in contrasts {
                for &tilt_deg in tilts {
                    cells.push(PrecisionCell { radius_px, psf_sigma_px, contrast_to_noise, tilt_deg });
                }
            }
        }
    }
    cells
}

/// Markers of a picture along columns and rows.
const LATTICE: (u32, u32) = (8, 6);
/// Pitch over the outer radius: that of the large markers of the standard plate.
const PITCH: f64 = 1.0 / LARGE_RADIUS;
/// Smallest side of a picture, px: a real one is never the size of a few markers.
const SMALLEST_SIDE: u32 = 640;
const RADIUS_M: f64 = 0.005;
const FOCAL_PX: f64 = 2500.0;
/// Points of an outline.
const OUTLINE: usize = 128;

/// Renders and measures `pictures` of a cell; discs, then annuli.
pub fn precision(cell: PrecisionCell, pictures: u64, seed: u64) -> [Precision; 2] {
    let all: Vec<[Sums; 2]> =
        (0..pictures).into_par_iter().map(|k| picture(&cell, seed.wrapping_mul(1000) + k)).collect();
    [false, true].map(|annuli| {
        let mut sum = Sums::default();
        all.iter().for_each(|s| sum.add(&s[usize::from(annuli)]));
        let per_axis = |v: f64, n: usize| (v / (2.0 * n as f64)).sqrt();
        Precision {
            cell,
            annuli,
            wanted: sum.wanted,
            markers: sum.markers,
            inner: sum.inner,
            rms_px: per_axis(sum.square, sum.markers),
            to_formula: per_axis(sum.to_formula, sum.markers),
            to_bound: per_axis(sum.to_bound, sum.markers),
            normalised: per_axis(sum.normalised, sum.markers),
            inner_normalised: per_axis(sum.inner_normalised, sum.inner),
            bias_px: sum.mean.amax() / sum.markers as f64,
            second_pass: sum.second_pass,
        }
    })
}

#[derive(Debug, Default, Clone, Copy)]
struct Sums {
    wanted: usize,
    markers: usize,
    inner: usize,
    square: f64,
    to_formula: f64,
    to_bound: f64,
    normalised: f64,
    inner_normalised: f64,
    mean: Vector2<f64>,
    second_pass: usize,
}

impl Sums {
    fn add(&mut self, other: &Self) {
        self.wanted += other.wanted;
        self.markers += other.markers;
        self.inner += other.inner;
        self.square += other.square;
        self.to_formula += other.to_formula;
        self.to_bound += other.to_bound;
        self.normalised += other.normalised;
        self.inner_normalised += other.inner_normalised;
        self.mean += other.mean;
        self.second_pass += other.second_pass;
    }
}

/// Even noise of the given size on every pixel, at 16 bit: what the bound assumes.
fn conditions(cell: &PrecisionCell) -> ImagingConditions {
    let ideal = ImagingConditions { exposure: 0.8, ..ImagingConditions::ideal(cell.psf_sigma_px) };
    if !cell.contrast_to_noise.is_finite() {
        return ideal;
    }
    let contrast = ideal.exposure * (ideal.light_reflectance - ideal.dark_reflectance);
    // So many electrons that their own noise vanishes beside that of reading them.
    let full_well_e = 1e12;
    ImagingConditions { full_well_e, read_noise_e: contrast / cell.contrast_to_noise * full_well_e, ..ideal }
}

/// Discs and annuli of one size in an order that tells where they are.
fn plate(rng: &mut ChaCha8Rng) -> Plate {
    let mut plate = Plate::lattice(PlateKind::CodedCircles, LATTICE.0, LATTICE.1, PITCH * RADIUS_M, 1e-4);
    for m in &mut plate.markers {
        m.outer_radius_m = RADIUS_M;
        m.inner_radius_m = if rng.random_bool(0.5) { INNER_SHARE * RADIUS_M } else { 0.0 };
    }
    plate
}

fn picture(cell: &PrecisionCell, seed: u64) -> [Sums; 2] {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let plate = plate(&mut rng);
    let side = |n: u32| ((f64::from(n) * PITCH + 2.0) * cell.radius_px) as u32 + 24;
    let size = side(LATTICE.0.max(LATTICE.1)).max(SMALLEST_SIDE);
    let camera = Camera::pinhole(Lens::Brown, size, size, FOCAL_PX);
    let direction = Direction {
        distance_m: FOCAL_PX * RADIUS_M / cell.radius_px,
        tilt_rad: cell.tilt_deg.to_radians(),
        azimuth_rad: rng.random_range(0.0..TAU),
        roll_rad: rng.random_range(0.0..TAU),
        aim_m: [0, 1].map(|_| rng.random_range(-0.3..0.3) * RADIUS_M),
    };
    let pose = direction.camera_from_plate();
    let image = render(&plate, &camera, &pose, &conditions(cell), &mut rng);
    let options = circles::Options {
        largest_marker_px: Some(3.0 * cell.radius_px),
        smallest_semi_axis_px: 1.5,
        ..circles::Options::default()
    };
    let mut found = circles::detect(&image, &plate, &options).map(|d| d.found).unwrap_or_default();
    let again = found.is_empty();
    if again {
        found = circles::measure_predicted(&image, &predicted(&plate, &camera, &pose, &mut rng));
    }
    let mut sums = [Sums::default(); 2];
    for m in &plate.markers {
        let measured = found.iter().find(|f| f.marker == m.id).map(|f| &f.measured);
        let sum = &mut sums[usize::from(m.inner_radius_m > 0.0)];
        if judge(cell, m, &camera, &pose, measured, sum).is_some() {
            sum.second_pass += usize::from(again);
        }
    }
    sums
}

/// How far the map of a second pass is off: as a whole, and as much again at the outermost markers, px.
pub const MAP_OFF_PX: f64 = 0.3;

/// The markers where a pose would put them that is known from elsewhere: the true map, shifted by [`MAP_OFF_PX`] in a random
/// direction, with a random linear part on top that displaces the outermost markers by up to as much.
fn predicted(plate: &Plate, camera: &Camera, pose: &Pose, rng: &mut ChaCha8Rng) -> Vec<Predicted> {
    let image = |p: &Vector3<f64>| camera.project(&pose.transform(p));
    let Some(middle) = image(&Vector3::zeros()) else { return Vec::new() };
    let far = |m: &Marker| image(&m.position_m).map_or(0.0, |p| (p - middle).norm());
    let extent = plate.markers.iter().map(far).fold(1.0, f64::max);
    let angle = rng.random_range(0.0..TAU);
    let shift = Vector2::new(angle.cos(), angle.sin()) * MAP_OFF_PX;
    let linear = Matrix2::from_fn(|_, _| rng.random_range(-1.0_f64..1.0));
    let linear = linear * (MAP_OFF_PX / extent / linear.norm());
    let one = |m: &Marker| {
        let map = |[x, y]: [f64; 2]| {
            let p = image(&(m.position_m + Vector3::new(x, y, 0.0)))?;
            Some((p + shift + linear * (p - middle)).into())
        };
        Predicted::by_map(m, plate.pitch_m - m.outer_radius_m, map)
    };
    plate.markers.iter().filter_map(one).collect()
}

/// Adds what was measured of a marker; `None` where it is not wholly in the picture.
fn judge(
    cell: &PrecisionCell,
    m: &Marker,
    camera: &Camera,
    pose: &Pose,
    measured: Option<&Measured>,
    sums: &mut Sums,
) -> Option<()> {
    let blur = cell.psf_sigma_px.hypot((1.0_f64 / 12.0).sqrt());
    let circle = |radius_m: f64| ring(camera, pose, &m.position_m, radius_m, OUTLINE);
    let outline = circle(m.outer_radius_m).filter(|o| o.iter().all(|p| camera.contains(p, 6.0 + 3.0 * blur)))?;
    let truth = |radius_m: f64| centroid_uv(camera, pose, &m.position_m, radius_m);
    let outer = truth(m.outer_radius_m)?;
    sums.wanted += 1;
    let found = measured?;
    let error = Vector2::from(found.outer.ellipse.centre) - outer;
    let noise = if cell.contrast_to_noise.is_finite() { cell.contrast_to_noise } else { 1.0 };
    sums.markers += 1;
    sums.mean += error;
    sums.square += error.norm_squared();
    let quadratic = |w: Matrix2<f64>| (error.transpose() * w * error)[0];
    sums.to_formula += quadratic(information(&outline, blur, noise));
    let mut outlines = vec![outline];
    if m.inner_radius_m > 0.0 {
        outlines.push(circle(m.inner_radius_m)?);
    }
    let exact = exact_information(&outlines, cell.psf_sigma_px, noise)?;
    sums.to_bound += quadratic(of_outer(&exact, found.inner.is_some())?);
    sums.normalised += normalised(&found.outer, &outer);
    if let Some(inner) = found.inner {
        sums.inner += 1;
        sums.inner_normalised += normalised(&inner, &truth(m.inner_radius_m)?);
    }
    Some(())
}

/// Information on the outer centre: the inner one moves with it, or is free.
fn of_outer(exact: &DMatrix<f64>, inner_is_free: bool) -> Option<Matrix2<f64>> {
    let block = |i: usize, j: usize| exact.fixed_view::<2, 2>(i, j).into_owned();
    if exact.nrows() == 2 {
        Some(block(0, 0))
    } else if inner_is_free {
        Some(block(0, 0) - block(0, 2) * block(2, 2).try_inverse()? * block(2, 0))
    } else {
        Some(block(0, 0) + block(0, 2) + block(2, 0) + block(2, 2))
    }
}

/// Squared error in units of the stated covariance.
fn normalised(imaged: &Imaged, truth: &Vector2<f64>) -> f64 {
    let [uu, uv, vv] = imaged.covariance;
    let error = Vector2::from(imaged.ellipse.centre) - truth;
    Matrix2::new(uu, uv, uv, vv).try_inverse().map_or(f64::NAN, |w| (error.transpose() * w * error)[0])
}
