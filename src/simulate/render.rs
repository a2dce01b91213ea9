//! What a camera records of a plate.
//!
//! Each marker is an outline in space, sampled, projected through the whole camera model and filled with exact area coverage
//! ([`super::raster`]); the illumination falls on the scene before the lens blurs it, which matters at the level of 0.003 px.

use nalgebra::{Vector2, Vector3, Vector6};
use rand_chacha::ChaCha8Rng;
use std::f64::consts::{PI, TAU};

use super::conditions::{ImagingConditions, bell};
use super::psf::Psf;
use super::raster::{Patch, PixelRect, Plane, Rasteriser};
use super::{scenery, sensor};
use crate::detect::Picture;
use crate::error::{Code, Error, Result};
use crate::geom::Pose;
use crate::model::camera::Camera;
use crate::series::{Ink, Marker, Plate, Region, regions};

/// Largest distance between a sampled outline and the true one, px.
const OUTLINE_TOLERANCE_PX: f64 = 0.004;
/// Samples along the longest side of a dark polygon, such as a chessboard's square.
const SIDE_SAMPLES: usize = 16;
/// The same along a module of a tag.
const MODULE_SAMPLES: usize = 4;

/// Refuses plates whose print cannot be drawn: a picture without it would be one of another plate.
///
/// # Errors
/// ChArUco boards whose markers are not stated; tags that no dictionary has; dots without a radius; points, which no print is described for.
pub fn check_drawable(plate: &Plate) -> Result<()> {
    let (what, remedy) = match plate.kind.print().ink {
        Ink::Squares => return Ok(()),
        Ink::Tags | Ink::SquaresAndDots => return regions(plate).map(|_| ()),
        Ink::SquaresAndTags if plate.aruco.is_some() => return regions(plate).map(|_| ()),
        Ink::SquaresAndTags => (
            "the markers of the ChArUco board are not stated",
            "give dictionary and side_m under [aruco] in plate.toml, or --observations",
        ),
        Ink::Circles | Ink::Unknown if plate.markers.iter().all(|m| m.outer_radius_m > 0.0) => return Ok(()),
        Ink::Circles | Ink::Unknown => (
            "dots without a radius cannot be drawn",
            "give radius_m or a table of markers with radii, or --observations",
        ),
    };
    Err(Error::new(Code::PlateImpossible, "plate.toml", what, remedy))
}

/// Renders the whole picture of `plate` seen by `camera` at `camera_from_plate`.
pub fn render(
    plate: &Plate,
    camera: &Camera,
    camera_from_plate: &Pose,
    conditions: &ImagingConditions,
    rng: &mut ChaCha8Rng,
) -> Picture {
    let whole = PixelRect { x: 0, y: 0, width: camera.width_px as usize, height: camera.height_px as usize };
    render_window(plate, camera, camera_from_plate, conditions, &whole, rng)
}

/// Renders the pixels of `window` only; apart from the noise they are those of the whole picture.
pub fn render_window(
    plate: &Plate,
    camera: &Camera,
    camera_from_plate: &Pose,
    conditions: &ImagingConditions,
    window: &PixelRect,
    rng: &mut ChaCha8Rng,
) -> Picture {
    let view = View { camera, conditions, window, centre: image_centre(camera) };
    let mut light = scenery::ground(plate, camera, camera_from_plate, conditions, window);
    let mut cover = vec![0.0; light.len()];
    let instants = view.instants(camera_from_plate, plate);
    for pose in &instants {
        view.add_marks(plate, pose, 1.0 / instants.len() as f32, &mut cover);
    }
    view.illuminate(&mut light, &cover);
    scenery::occlude(&mut light, conditions, window, |uv| conditions.illumination(uv, view.centre));
    view.add_glare(&mut light);
    sensor::expose(&mut light, window, [camera.width_px, camera.height_px], conditions, rng);
    Picture { width: window.width, height: window.height, pixels: light, full_scale: conditions.full_scale() as f32 }
}

fn image_centre(camera: &Camera) -> Vector2<f64> {
    Vector2::new(f64::from(camera.width_px) - 1.0, f64::from(camera.height_px) - 1.0) / 2.0
}

struct View<'a> {
    camera: &'a Camera,
    conditions: &'a ImagingConditions,
    window: &'a PixelRect,
    centre: Vector2<f64>,
}

impl View<'_> {
    /// The camera poses during the exposure: one, or enough of them that the image moves by less than half a pixel between two.
    fn instants(&self, camera_from_plate: &Pose, plate: &Plate) -> Vec<Pose> {
        let twist = Vector6::from(self.conditions.motion);
        let at = |t: f64| &Pose::exp(&(twist * -t)) * camera_from_plate;
        let half = Vector2::new(f64::from(plate.columns), f64::from(plate.rows)) * (plate.pitch_m / 2.0);
        let corners = [(0.0, 0.0), (-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)];
        let moved = |&(x, y): &(f64, f64)| {
            let point = Vector3::new(x * half.x, y * half.y, 0.0);
            let image = |t: f64| self.camera.project(&at(t).transform(&point));
            Some((image(0.5)? - image(-0.5)?).norm())
        };
        let largest = corners.iter().filter_map(moved).fold(0.0, f64::max);
        let count = ((largest * 2.0).ceil() as usize).clamp(1, 64);
        (0..count).map(|k| at((k as f64 + 0.5) / count as f64 - 0.5)).collect()
    }

    /// Adds the dark area that every pixel sees, relative to the illumination there.
    fn add_marks(&self, plate: &Plate, camera_from_plate: &Pose, weight: f32, cover: &mut [f32]) {
        if camera_from_plate.inverse().translation.z <= 0.0 {
            return; // The back of the plate is blank.
        }
        let mut raster = Rasteriser::default();
        let mut last: Option<(f64, Psf)> = None;
        let regions = regions(plate).unwrap_or_default();
        let marks = Marks { plate, camera: self.camera, camera_from_plate, regions };
        for mark in 0..marks.count() {
            let Some((outlines, depth_m)) = marks.outlines(mark) else { continue };
            let Some(bounds) = PixelRect::around(outlines.iter().flatten(), 8) else { continue };
            if bounds.intersection(self.window).is_none() {
                continue;
            }
            let at = Vector2::new(
                f64::from(bounds.x) + bounds.width as f64 / 2.0,
                f64::from(bounds.y) + bounds.height as f64 / 2.0,
            );
            let sigma = self.conditions.blur_px(depth_m);
            let psf = match last.take() {
                Some((s, psf)) if s == sigma && self.conditions.coma_px == 0.0 => psf,
                _ => self.psf_at(sigma, at),
            };
            let plane = self.illumination_plane(at);
            if let Some(patch) = raster.cover(&outlines, &psf, &plane, self.window) {
                self.add_patch(&patch, &plane, weight, cover);
            }
            last = Some((sigma, psf));
        }
    }

    fn psf_at(&self, sigma_px: f64, at: Vector2<f64>) -> Psf {
        let field = (at - self.centre) / self.centre.norm();
        Psf::comatic(sigma_px, field * self.conditions.coma_px)
    }

    fn illumination_plane(&self, at: Vector2<f64>) -> Plane {
        let value = |dx: f64, dy: f64| self.conditions.illumination(at + Vector2::new(dx, dy), self.centre);
        let slope = Vector2::new(value(0.5, 0.0) - value(-0.5, 0.0), value(0.0, 0.5) - value(0.0, -0.5));
        Plane { at, value: value(0.0, 0.0), slope }
    }

    fn add_patch(&self, patch: &Patch, plane: &Plane, weight: f32, cover: &mut [f32]) {
        let Some(common) = patch.rect.intersection(self.window) else { return };
        for y in common.y..common.y + common.height as i32 {
            let from = (y - patch.rect.y) as usize * patch.rect.width + (common.x - patch.rect.x) as usize;
            let to = (y - self.window.y) as usize * self.window.width + (common.x - self.window.x) as usize;
            let line = &patch.values[from..from + common.width];
            let start = plane.at(f64::from(common.x), f64::from(y)) as f32;
            let step = plane.slope.x as f32;
            for (k, (c, p)) in cover[to..to + common.width].iter_mut().zip(line).enumerate() {
                *c += weight * p / (start + step * k as f32).max(1e-6);
            }
        }
    }

    /// Reflectance of ground and markers under the illumination, as a share of full scale.
    fn illuminate(&self, ground: &mut [f32], cover: &[f32]) {
        let c = self.conditions;
        let dark = (c.dark_reflectance / c.light_reflectance) as f32;
        let width = self.window.width;
        for ((row, line), cover) in ground.chunks_exact_mut(width).enumerate().zip(cover.chunks_exact(width)) {
            let v = f64::from(self.window.y) + row as f64;
            for (k, (value, cover)) in line.iter_mut().zip(cover).enumerate() {
                let uv = Vector2::new(f64::from(self.window.x) + k as f64, v);
                let light = (c.exposure * c.illumination(uv, self.centre)) as f32;
                *value *= light * (1.0 - (1.0 - dark) * cover);
            }
        }
    }

    fn add_glare(&self, light: &mut [f32]) {
        let width = self.window.width;
        for glare in &self.conditions.glare {
            for (k, value) in light.iter_mut().enumerate() {
                let u = f64::from(self.window.x) + (k % width) as f64;
                let v = f64::from(self.window.y) + (k / width) as f64;
                *value += (glare.strength * bell(Vector2::new(u, v), glare.at_px, glare.radius_px)) as f32;
            }
        }
    }
}

/// The dark figures on a plate.
struct Marks<'a> {
    plate: &'a Plate,
    camera: &'a Camera,
    camera_from_plate: &'a Pose,
    /// Of tags.
    regions: Vec<Region>,
}

impl Marks<'_> {
    fn is_chessboard(&self) -> bool {
        self.plate.kind.print().ink == Ink::Squares
    }

    fn count(&self) -> usize {
        if !self.regions.is_empty() {
            self.regions.len()
        } else if self.is_chessboard() {
            ((self.plate.columns + 1) * (self.plate.rows + 1)) as usize
        } else {
            self.plate.markers.len()
        }
    }

    /// The imaged outlines of a figure and its depth; `None` when it is light or has no whole image.
    fn outlines(&self, mark: usize) -> Option<(Vec<Vec<Vector2<f64>>>, f64)> {
        match self.regions.get(mark) {
            Some(region) => self.region(region),
            None if self.is_chessboard() => self.square(mark),
            None => self.circles(&self.plate.markers[mark]),
        }
    }

    /// A dark polygon with the light ones in it.
    fn region(&self, region: &Region) -> Option<(Vec<Vec<Vector2<f64>>>, f64)> {
        let (dark, light) = region.split_first()?;
        let image = |loop_m: &Vec<[f64; 2]>, samples: usize| {
            let points: Vec<Vector3<f64>> = loop_m.iter().map(|[x, y]| Vector3::new(*x, *y, 0.0)).collect();
            self.polygon(&points, samples).map(scenery::with_sense)
        };
        let mut outlines = vec![image(dark, SIDE_SAMPLES)?];
        for hole in light {
            let mut outline = image(hole, MODULE_SAMPLES)?;
            outline.reverse();
            outlines.push(outline);
        }
        let middle =
            dark.iter().fold(Vector3::zeros(), |sum, [x, y]| sum + Vector3::new(*x, *y, 0.0)) / dark.len() as f64;
        Some((outlines, self.camera_from_plate.transform(&middle).z))
    }

    /// The image of a polygon with so many samples along its longest side, and fewer along shorter ones.
    fn polygon(&self, corners: &[Vector3<f64>], samples: usize) -> Option<Vec<Vector2<f64>>> {
        let mut outline = Vec::with_capacity(corners.len() * samples);
        let sides = || corners.iter().zip(corners.iter().cycle().skip(1));
        let longest = sides().map(|(a, b)| (b - a).norm()).fold(0.0, f64::max);
        for (a, b) in sides() {
            let samples = (samples as f64 * (b - a).norm() / longest - 1e-6).ceil() as usize;
            for i in 0..samples {
                let x = a + (b - a) * (i as f64 / samples as f64);
                outline.push(self.camera.project(&self.camera_from_plate.transform(&x))?);
            }
        }
        Some(outline)
    }

    fn circles(&self, marker: &Marker) -> Option<(Vec<Vec<Vector2<f64>>>, f64)> {
        let depth_m = self.camera_from_plate.transform(&marker.position_m).z;
        if marker.outer_radius_m <= 0.0 || depth_m <= marker.outer_radius_m {
            return None;
        }
        let outer = scenery::with_sense(self.circle(marker, marker.outer_radius_m, depth_m)?);
        let mut outlines = vec![outer];
        if marker.inner_radius_m > 0.0 {
            let mut inner = scenery::with_sense(self.circle(marker, marker.inner_radius_m, depth_m)?);
            inner.reverse();
            outlines.push(inner);
        }
        Some((outlines, depth_m))
    }

    /// A circle as a polygon of the same area.
    fn circle(&self, marker: &Marker, radius_m: f64, depth_m: f64) -> Option<Vec<Vector2<f64>>> {
        let radius_px = self.camera.parameters[0].abs() * radius_m / depth_m;
        let count = ((PI * (radius_px / (2.0 * OUTLINE_TOLERANCE_PX)).sqrt()).ceil() as usize).clamp(24, 720);
        let step = TAU / count as f64;
        let radius_m = radius_m * (step / step.sin()).sqrt();
        let sample = |k: usize| {
            let (sin, cos) = (k as f64 * step).sin_cos();
            let x = marker.position_m + Vector3::new(radius_m * cos, radius_m * sin, 0.0);
            self.camera.project(&self.camera_from_plate.transform(&x))
        };
        (0..count).map(sample).collect()
    }

    /// Square `mark` of a chessboard of squares around the inner corners; the one at the top-left is dark.
    fn square(&self, mark: usize) -> Option<(Vec<Vec<Vector2<f64>>>, f64)> {
        let across = self.plate.columns as usize + 1;
        let (row, column) = (mark / across, mark % across);
        if (row + column) % 2 == 1 {
            return None;
        }
        let corner = |r: usize, c: usize| {
            let x = (c as f64 - (self.plate.columns as f64 + 1.0) / 2.0) * self.plate.pitch_m;
            let y = ((self.plate.rows as f64 + 1.0) / 2.0 - r as f64) * self.plate.pitch_m;
            Vector3::new(x, y, 0.0)
        };
        let corners =
            [corner(row, column), corner(row, column + 1), corner(row + 1, column + 1), corner(row + 1, column)];
        let outline = self.polygon(&corners, SIDE_SAMPLES)?;
        let middle = self.camera_from_plate.transform(&((corners[0] + corners[2]) / 2.0));
        Some((vec![scenery::with_sense(outline)], middle.z))
    }
}
