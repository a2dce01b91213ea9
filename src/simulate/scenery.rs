//! What is in the picture besides the markers: the sheet's border, things around it, things before it.

use nalgebra::{Vector2, Vector3};
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::f64::consts::TAU;

use super::conditions::{ImagingConditions, Occluder};
use super::psf::Psf;
use super::raster::{PixelRect, Plane, Rasteriser};
use crate::geom::Pose;
use crate::model::camera::Camera;
use crate::plan::plate_design::Sheet;
use crate::series::Plate;

/// Reflectance of the surroundings, row by row over `rect`; blurred.
pub fn ground(
    plate: &Plate,
    camera: &Camera,
    camera_from_plate: &Pose,
    conditions: &ImagingConditions,
    rect: &PixelRect,
) -> Vec<f32> {
    let sheet = Sheet::fitting(plate);
    if is_all_sheet(&sheet, camera, camera_from_plate, rect) {
        return vec![conditions.light_reflectance as f32; rect.width * rect.height];
    }
    let psf = Psf::gaussian(conditions.psf_sigma_px);
    // Painted beyond the border, so that the blur finds there what the lens would.
    let wide = rect.grown(psf.reach());
    let mut values = vec![conditions.table_reflectance as f32; wide.width * wide.height];
    let mut canvas = Canvas { values: &mut values, rect: wide, raster: Rasteriser::default() };
    let imager = Imager::new(camera, camera_from_plate);
    for thing in clutter(&sheet, conditions) {
        canvas.paint(&imager.image(&thing.outline), thing.reflectance);
    }
    canvas.paint(&imager.image(&sheet_outline(&sheet)), conditions.light_reflectance);
    psf.blur(&mut values, wide.width);
    let inner = values.chunks_exact(wide.width).skip(psf.reach()).take(rect.height);
    inner.flat_map(|line| &line[psf.reach()..psf.reach() + rect.width]).copied().collect()
}

/// Paints what hangs before the plate over `light`, seen under the illumination at each pixel.
pub fn occlude(
    light: &mut [f32],
    conditions: &ImagingConditions,
    rect: &PixelRect,
    illumination: impl Fn(Vector2<f64>) -> f64,
) {
    let psf = Psf::gaussian(conditions.psf_sigma_px);
    let mut raster = Rasteriser::default();
    for occluder in &conditions.occluders {
        let outline = with_sense(occluder.outline_px.iter().map(|&p| p.into()).collect());
        let Some(patch) = raster.cover(&[outline], &psf, &Plane::one(), rect) else { continue };
        let Some(common) = patch.rect.intersection(rect) else { continue };
        for y in common.y..common.y + common.height as i32 {
            for x in common.x..common.x + common.width as i32 {
                let cover = patch.values[index(&patch.rect, x, y)];
                let here = &mut light[index(rect, x, y)];
                let own =
                    conditions.exposure * occluder.reflectance * illumination(Vector2::new(f64::from(x), f64::from(y)));
                *here += cover * (own as f32 - *here);
            }
        }
    }
}

fn index(rect: &PixelRect, x: i32, y: i32) -> usize {
    (y - rect.y) as usize * rect.width + (x - rect.x) as usize
}

/// A cable that hangs across the picture: a curved band of `width_px`.
pub fn cable(size: [u32; 2], width_px: f64, rng: &mut impl Rng) -> Occluder {
    let (w, h) = (f64::from(size[0]), f64::from(size[1]));
    let (start, end) = (rng.random_range(0.0..w), rng.random_range(0.0..w));
    let sway = rng.random_range(-0.15..0.15) * w;
    let middle = |t: f64| Vector2::new(start + (end - start) * t + sway * (t * TAU).sin(), (1.4 * t - 0.2) * h);
    let steps = 40;
    let side = |sign: f64| {
        move |k: usize| {
            let t = k as f64 / f64::from(steps);
            let along = (middle(t + 1e-3) - middle(t - 1e-3)).normalize();
            let p = middle(t) + Vector2::new(-along.y, along.x) * (sign * width_px / 2.0);
            [p.x, p.y]
        }
    };
    let outline_px = (0..=steps as usize).map(side(1.0)).chain((0..=steps as usize).rev().map(side(-1.0))).collect();
    Occluder { outline_px, reflectance: 0.03 }
}

/// Two fingers of a gripper that reach into the picture from above.
pub fn gripper(size: [u32; 2], reach_px: f64) -> [Occluder; 2] {
    let (w, reach) = (f64::from(size[0]), reach_px);
    [0.25, 0.65].map(|at| {
        let (left, right) = (at * w, (at + 0.1) * w);
        let outline_px = vec![[left, -50.0], [right, -50.0], [right - 0.02 * w, reach], [left + 0.02 * w, reach]];
        Occluder { outline_px, reflectance: 0.45 }
    })
}

struct Thing {
    outline: Vec<Vector3<f64>>,
    reflectance: f64,
}

/// Discs, bars and odd polygons around the sheet, some of the size of markers.
fn clutter(sheet: &Sheet, conditions: &ImagingConditions) -> Vec<Thing> {
    let mut rng = ChaCha8Rng::seed_from_u64(conditions.clutter_seed);
    let half = [sheet.width_m / 2.0, sheet.height_m / 2.0];
    let mut things = Vec::new();
    while things.len() < conditions.clutter as usize {
        let at = [0, 1].map(|i: usize| rng.random_range(-2.0 * half[i]..2.0 * half[i]));
        let size = 0.004 * 20_f64.powf(rng.random());
        let corners = if rng.random_bool(0.4) { 40 } else { rng.random_range(3..7) };
        let stretch = if corners == 40 { 1.0 } else { rng.random_range(1.0..4.0) };
        let (turn, reflectance) = (rng.random_range(0.0..TAU), rng.random_range(0.03..0.9));
        let (sin, cos) = turn.sin_cos();
        let corner = |k: usize| {
            let (s, c) = (TAU * k as f64 / corners as f64).sin_cos();
            let (x, y) = (size * stretch * c, size * s);
            Vector3::new(at[0] + cos * x - sin * y, at[1] + sin * x + cos * y, -0.01)
        };
        if (0..2).any(|i| at[i].abs() > half[i] + size * stretch) {
            things.push(Thing { outline: (0..corners as usize).map(corner).collect(), reflectance });
        }
    }
    things
}

fn sheet_outline(sheet: &Sheet) -> Vec<Vector3<f64>> {
    let (w, h) = (sheet.width_m / 2.0, sheet.height_m / 2.0);
    [(-w, -h), (w, -h), (w, h), (-w, h)].map(|(x, y)| Vector3::new(x, y, 0.0)).to_vec()
}

/// Images outlines of any size: what lies behind the camera or beyond the lens is cut off in space.
struct Imager<'a> {
    camera: &'a Camera,
    camera_from_plate: &'a Pose,
    /// Largest distance from the axis on the plane z = 1 that the lens images.
    field: f64,
}

/// Sides of the cone that outlines are cut with.
const CONE_SIDES: usize = 24;
/// Widest field that is considered, on the plane z = 1.
const WIDEST_FIELD: f64 = 4.0;

impl<'a> Imager<'a> {
    fn new(camera: &'a Camera, camera_from_plate: &'a Pose) -> Self {
        let has_image = |r: f64| camera.project(&Vector3::new(r, 0.0, 1.0)).is_some();
        let (mut low, mut high) = (0.0, WIDEST_FIELD);
        for _ in 0..40 {
            let middle = (low + high) / 2.0;
            if has_image(middle) { low = middle } else { high = middle }
        }
        Self { camera, camera_from_plate, field: 0.999 * low }
    }

    fn image(&self, outline: &[Vector3<f64>]) -> Vec<Vector2<f64>> {
        let in_camera: Vec<_> = outline.iter().map(|x| self.camera_from_plate.transform(x)).collect();
        let seen = (0..CONE_SIDES).fold(in_camera, |polygon, side| self.cut(&polygon, side));
        // Straight edges become curves in the image.
        let pieces = if seen.len() > 20 { 3 } else { 32 };
        let along = |k: usize| {
            let (a, b) = (seen[k], seen[(k + 1) % seen.len()]);
            (0..pieces).map(move |i| a + (b - a) * (f64::from(i) / f64::from(pieces)))
        };
        with_sense((0..seen.len()).flat_map(along).filter_map(|x| self.camera.project(&x)).collect())
    }

    /// Cuts a polygon with one side of the cone (Sutherland and Hodgman).
    fn cut(&self, polygon: &[Vector3<f64>], side: usize) -> Vec<Vector3<f64>> {
        let step = TAU / CONE_SIDES as f64;
        let (sin, cos) = (side as f64 * step).sin_cos();
        let inwards = Vector3::new(-cos, -sin, self.field * (step / 2.0).cos());
        // A little in front of the camera, so that no corner ends in its centre.
        let depth = |x: &Vector3<f64>| inwards.dot(x) - 1e-6;
        let mut kept = Vec::with_capacity(polygon.len() + 2);
        for (k, a) in polygon.iter().enumerate() {
            let b = &polygon[(k + 1) % polygon.len()];
            let (da, db) = (depth(a), depth(b));
            if da >= 0.0 {
                kept.push(*a);
            }
            if (da >= 0.0) != (db >= 0.0) {
                kept.push(a + (b - a) * (da / (da - db)));
            }
        }
        kept
    }
}

/// The outline in the sense that counts as covered.
pub(super) fn with_sense(mut outline: Vec<Vector2<f64>>) -> Vec<Vector2<f64>> {
    if signed_area(&outline) < 0.0 {
        outline.reverse();
    }
    outline
}

/// Area of a closed outline; negative where the rasteriser would count it as a hole.
fn signed_area(outline: &[Vector2<f64>]) -> f64 {
    let mut before = outline.last().copied().unwrap_or_default();
    let mut sum = 0.0;
    for &p in outline {
        sum += (p.y - before.y) * (p.x + before.x) / 2.0;
        before = p;
    }
    -sum
}

/// True when every pixel of `rect` looks onto the sheet.
fn is_all_sheet(sheet: &Sheet, camera: &Camera, camera_from_plate: &Pose, rect: &PixelRect) -> bool {
    let plate_from_camera = camera_from_plate.inverse();
    let on_sheet = |u: f64, v: f64| {
        let Some(ray) = camera.ray(&Vector2::new(u, v)) else { return false };
        let direction = plate_from_camera.rotation * ray;
        let origin = plate_from_camera.translation;
        let t = -origin.z / direction.z;
        let hit = origin + direction * t;
        t > 0.0 && hit.x.abs() < sheet.width_m / 2.0 - 0.004 && hit.y.abs() < sheet.height_m / 2.0 - 0.004
    };
    let (x0, y0) = (f64::from(rect.x), f64::from(rect.y));
    let (w, h) = (rect.width as f64, rect.height as f64);
    (0..=8).all(|k| {
        let t = f64::from(k) / 8.0;
        [(x0 + t * w, y0), (x0 + t * w, y0 + h), (x0, y0 + t * h), (x0 + w, y0 + t * h)]
            .iter()
            .all(|&(u, v)| on_sheet(u, v))
    })
}

struct Canvas<'a> {
    values: &'a mut [f32],
    rect: PixelRect,
    raster: Rasteriser,
}

impl Canvas<'_> {
    fn paint(&mut self, outline: &[Vector2<f64>], reflectance: f64) {
        if outline.len() < 3 {
            return;
        }
        let Some(patch) = self.raster.cover(&[outline.to_vec()], &Psf::gaussian(0.0), &Plane::one(), &self.rect) else {
            return;
        };
        let Some(common) = patch.rect.intersection(&self.rect) else { return };
        for y in common.y..common.y + common.height as i32 {
            for x in common.x..common.x + common.width as i32 {
                let cover = patch.values[index(&patch.rect, x, y)].clamp(0.0, 1.0);
                let here = &mut self.values[index(&self.rect, x, y)];
                *here += cover * (reflectance as f32 - *here);
            }
        }
    }
}
