//! Random views of a plate as a workshop gives them, and which markers can fairly be expected in each.

use nalgebra::Vector2;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::f64::consts::TAU;

use super::view::{Direction, ring};
use crate::detect::Picture;
use crate::geom::Pose;
use crate::model::camera::{Camera, Lens};
use crate::plan::plate_design::LEAST_MINOR_AXIS_PX;
use crate::series::{Marker, Plate};
use crate::simulate::conditions::{Glare, ImagingConditions, Spot, bell};
use crate::simulate::render::render;
use crate::simulate::scenery::{cable, gripper};

/// Fewest and most markers that would fill the picture; the most are twice those of the plate, which is then seen whole.
const MARKERS: [f64; 2] = [20.0, 1000.0];
/// From that many on the picture is larger, so that the markers are not too small.
const MANY: f64 = 300.0;
const LARGEST_TILT_DEG: f64 = 60.0;
/// Fewest markers wholly visible in a view that counts.
const LEAST_VISIBLE: usize = 20;
/// Distance of a wholly visible contour from the border and from things before it, px; for the latter, that of the blur comes on top.
const CLEAR_PX: f64 = 2.0;
/// Paper brighter than this share of full scale may saturate with its noise.
const NEAR_SATURATION: f64 = 0.95;
const RING_POINTS: usize = 32;

/// A view with known truth.
#[derive(Debug, Clone)]
pub(super) struct RandomView {
    pub camera: Camera,
    pub camera_from_plate: Pose,
    pub conditions: ImagingConditions,
    pub tilt_deg: f64,
    /// Indices of the markers that are wholly visible and large enough.
    pub visible: Vec<usize>,
}

impl RandomView {
    /// The view of a seed; drawn again until enough markers are visible.
    pub fn of(plate: &Plate, rng: &mut ChaCha8Rng) -> Self {
        loop {
            let mut view = Self::draw(plate, rng);
            view.visible = (0..plate.markers.len()).filter(|&k| view.shows(&plate.markers[k])).collect();
            if view.visible.len() >= LEAST_VISIBLE {
                return view;
            }
        }
    }

    fn draw(plate: &Plate, rng: &mut ChaCha8Rng) -> Self {
        let markers = MARKERS[0] * (MARKERS[1] / MARKERS[0]).powf(rng.random());
        let width = if markers < MANY { rng.random_range(420..860_u32) } else { rng.random_range(860..1180) };
        let size = [width, (f64::from(width) * rng.random_range(0.66..0.85)) as u32];
        let field = rng.random_range(25_f64..75.0).to_radians();
        let focal_px = f64::from(width) / 2.0 / (field / 2.0).tan();
        let mut camera = Camera::pinhole(Lens::Brown, size[0], size[1], focal_px);
        let distortion = [rng.random_range(-0.15..0.05), rng.random_range(-0.02..0.02), 0.0];
        let decentring = [0, 1].map(|_| rng.random_range(-1e-3..1e-3));
        for (p, v) in camera.parameters[4..].iter_mut().zip(distortion.into_iter().chain(decentring)) {
            *p = v;
        }
        // Even over the cap of directions.
        let cosine = 1.0 - (1.0 - LARGEST_TILT_DEG.to_radians().cos()) * rng.random::<f64>();
        let pitch_px = (f64::from(size[0] * size[1]) / (markers * cosine)).sqrt();
        let half = |n: u32| f64::from(n) / 2.0 * plate.pitch_m;
        // The more of the plate is to be seen, the nearer to its middle.
        let spread = 0.8 * (1.0 - markers / MARKERS[1]);
        let mut around = |reach: f64| rng.random_range(-1.0..1.0) * spread * reach;
        let aim_m = [around(half(plate.columns)), around(half(plate.rows))];
        let direction = Direction {
            distance_m: focal_px * plate.pitch_m / pitch_px,
            tilt_rad: cosine.acos(),
            azimuth_rad: rng.random_range(0.0..TAU),
            roll_rad: rng.random_range(0.0..TAU),
            aim_m,
        };
        let camera_from_plate = direction.camera_from_plate();
        let conditions = conditions(size, direction.distance_m, focal_px, rng);
        Self { camera, camera_from_plate, conditions, tilt_deg: cosine.acos().to_degrees(), visible: Vec::new() }
    }

    /// The picture; `seed` is that of its noise.
    pub fn picture(&self, plate: &Plate, seed: u64) -> Picture {
        let mut noise = ChaCha8Rng::seed_from_u64(seed);
        noise.set_stream(1);
        render(plate, &self.camera, &self.camera_from_plate, &self.conditions, &mut noise)
    }

    /// Names of what disturbs the view.
    pub fn disturbances(&self) -> Vec<&'static str> {
        let c = &self.conditions;
        let list = [
            ("things before it", !c.occluders.is_empty()),
            ("glare", !c.glare.is_empty()),
            ("clutter", c.clutter > 0),
            ("motion", c.motion != [0.0; 6]),
            ("coma", c.coma_px > 0.0),
        ];
        list.into_iter().filter(|(_, there)| *there).map(|(name, _)| name).collect()
    }

    /// The whole outer contour is in the picture, nothing lies before it, it is not saturated, and large enough.
    fn shows(&self, marker: &Marker) -> bool {
        let outline =
            |radius: f64| ring(&self.camera, &self.camera_from_plate, &marker.position_m, radius, RING_POINTS);
        let Some(outer) = outline(marker.outer_radius_m) else { return false };
        let half = RING_POINTS / 2;
        let minor = (0..half).map(|k| (outer[k] - outer[k + half]).norm()).fold(f64::MAX, f64::min);
        let away = CLEAR_PX + 2.0 * (self.conditions.psf_sigma_px + self.conditions.coma_px);
        minor >= LEAST_MINOR_AXIS_PX
            && outer.iter().all(|p| self.camera.contains(p, CLEAR_PX))
            && outer.iter().all(|p| self.paper(p) < NEAR_SATURATION)
            && !self.conditions.occluders.iter().any(|o| touches(&o.outline_px, &outer, away))
    }

    /// Image of one pitch at a marker in the direction in which it is shorter, px.
    pub fn shorter_pitch_px(&self, plate: &Plate, marker: usize) -> f64 {
        let across =
            ring(&self.camera, &self.camera_from_plate, &plate.markers[marker].position_m, plate.pitch_m / 2.0, 16);
        across.map_or(0.0, |r| (0..8).map(|k| (r[k] - r[k + 8]).norm()).fold(f64::MAX, f64::min))
    }

    /// Signal of the paper at a pixel as a share of full scale.
    fn paper(&self, uv: &Vector2<f64>) -> f64 {
        let c = &self.conditions;
        let middle = Vector2::new(f64::from(self.camera.width_px) - 1.0, f64::from(self.camera.height_px) - 1.0) / 2.0;
        let glare: f64 = c.glare.iter().map(|g| g.strength * bell(*uv, g.at_px, g.radius_px)).sum();
        let corner = (uv - middle).norm_squared() / middle.norm_squared();
        (c.exposure * c.light_reflectance * c.illumination(*uv, middle) + glare) * (1.0 - c.vignetting * corner)
    }
}

/// A polygon comes nearer than `away` to a contour or lies over it.
fn touches(polygon: &[[f64; 2]], contour: &[Vector2<f64>], away: f64) -> bool {
    let sides = || (0..polygon.len()).map(|k| (polygon[k], polygon[(k + 1) % polygon.len()]));
    let near = |p: &Vector2<f64>| {
        sides().any(|(a, b)| {
            let (a, b) = (Vector2::from(a), Vector2::from(b));
            let along = b - a;
            let t = ((p - a).dot(&along) / along.norm_squared().max(1e-12)).clamp(0.0, 1.0);
            (p - a - along * t).norm() < away
        })
    };
    let inside = |p: &Vector2<f64>| {
        let crossings = sides()
            .filter(|(a, b)| (a[1] > p.y) != (b[1] > p.y) && p.x < (b[0] - a[0]) * (p.y - a[1]) / (b[1] - a[1]) + a[0]);
        crossings.count() % 2 == 1
    };
    // A thin thing may lie within the contour without touching it.
    let middle = contour.iter().sum::<Vector2<f64>>() / contour.len() as f64;
    let reach = contour.iter().map(|p| (p - middle).norm()).fold(0.0, f64::max);
    let within = |v: &[f64; 2]| (Vector2::from(*v) - middle).norm() < reach + away;
    contour.iter().chain([&middle]).any(|p| near(p) || inside(p)) || polygon.iter().any(within)
}

/// Light, lens, sensor and surroundings of a view.
fn conditions(size: [u32; 2], distance_m: f64, focal_px: f64, rng: &mut ChaCha8Rng) -> ImagingConditions {
    let [w, h] = size.map(f64::from);
    let place = |rng: &mut ChaCha8Rng| [rng.random_range(0.0..w), rng.random_range(0.0..h)];
    let slope = 0.4 / w;
    let mut c = ImagingConditions {
        bits: if rng.random_bool(0.8) { 8 } else { 12 },
        exposure: rng.random_range(0.3..0.9),
        psf_sigma_px: rng.random_range(0.5..1.2),
        vignetting: rng.random_range(0.0..0.4),
        gradient_per_px: [0, 1].map(|_| rng.random_range(-slope..slope)),
        full_well_e: rng.random_range(4_000.0..30_000.0),
        read_noise_e: rng.random_range(4.0..25.0),
        dark_sigma_e: 0.0,
        gain_sigma: 0.0,
        table_reflectance: rng.random_range(0.05..0.9),
        clutter: if rng.random_bool(0.7) { rng.random_range(20..150) } else { 0 },
        clutter_seed: rng.random(),
        ..ImagingConditions::default()
    };
    if rng.random_bool(0.1) {
        c.coma_px = rng.random_range(0.3..1.0);
    }
    if rng.random_bool(0.3) {
        let at_px = place(rng);
        c.spot = Some(Spot { at_px, radius_px: rng.random_range(0.1..0.4) * w, strength: rng.random_range(0.1..0.5) });
    }
    if rng.random_bool(0.4) {
        let glare = |rng: &mut ChaCha8Rng| Glare {
            at_px: place(rng),
            radius_px: rng.random_range(0.01..0.12) * w,
            strength: rng.random_range(0.2..2.0),
        };
        c.glare = (0..rng.random_range(1..4)).map(|_| glare(rng)).collect();
    }
    if rng.random_bool(0.5) {
        c.occluders.extend((0..rng.random_range(1..4)).map(|_| {
            let width = rng.random_range(0.006..0.06) * w;
            cable(size, width, rng)
        }));
    }
    if rng.random_bool(0.2) {
        c.occluders.extend(gripper(size, rng.random_range(0.1..0.5) * h));
    }
    if rng.random_bool(0.1) {
        // At most about a pixel of motion across the line of sight.
        let sideways = distance_m / focal_px;
        c.motion = [sideways, sideways, 0.0, 0.0, 0.0, 0.5 / w].map(|v| v * rng.random_range(-1.0..1.0));
    }
    c
}
