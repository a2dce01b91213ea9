//! Scenes with known truth for the tests of the circle detector.
#![allow(dead_code)] // every test binary uses a part

use std::sync::LazyLock;

use nalgebra::{Vector2, Vector3};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use robotcal::detect::Picture;
use robotcal::detect::circles::CircleDetection;
use robotcal::geom::{Pose, matrix_from_rpy};
use robotcal::model::camera::{Camera, Lens};
use robotcal::plan::plate_design::{PlateRequest, design};
use robotcal::series::{Edge, Plate};
use robotcal::simulate::conditions::ImagingConditions;
use robotcal::simulate::render::render;

/// How the plate is looked at.
#[derive(Debug, Clone)]
pub struct View {
    pub size: [u32; 2],
    pub focal_px: f64,
    pub distortion: [f64; 5],
    pub distance_m: f64,
    pub tilt_deg: f64,
    pub azimuth_deg: f64,
    pub roll_deg: f64,
    /// Point of the plate on the optical axis, m.
    pub aim_m: [f64; 2],
    pub conditions: ImagingConditions,
}

impl Default for View {
    fn default() -> Self {
        Self {
            size: [1280, 1024],
            focal_px: 1100.0,
            distortion: [-0.08, 0.02, 0.0, 2e-4, -1e-4],
            distance_m: 0.5,
            tilt_deg: 0.0,
            azimuth_deg: 0.0,
            roll_deg: 0.0,
            aim_m: [0.0, 0.0],
            conditions: ImagingConditions::default(),
        }
    }
}

/// A plate in front of a camera.
pub struct Scene {
    pub plate: Plate,
    pub camera: Camera,
    pub camera_from_plate: Pose,
    pub conditions: ImagingConditions,
}

/// Raw values of a colour sensor taken for grey: of every four pixels a red and a blue one see less.
pub fn behind_mosaic(mut picture: Picture) -> Picture {
    for (k, value) in picture.pixels.iter_mut().enumerate() {
        *value *= match (k % picture.width % 2, k / picture.width % 2) {
            (0, 0) => 0.62,
            (1, 1) => 0.5,
            _ => 1.0,
        };
    }
    picture
}

pub fn standard_plate() -> Plate {
    // The search for its code takes two seconds.
    static PLATE: LazyLock<Plate> = LazyLock::new(|| design(&PlateRequest::default()).unwrap().plate);
    PLATE.clone()
}

/// `camera_from_plate` for a view: the aim on the axis at the distance, tilted about an axis in the image plane.
pub fn pose(view: &View) -> Pose {
    let facing = matrix_from_rpy([std::f64::consts::PI, 0.0, 0.0]);
    let about_z = |deg: f64| matrix_from_rpy([0.0, 0.0, deg.to_radians()]);
    let tilt = matrix_from_rpy([view.tilt_deg.to_radians(), 0.0, 0.0]);
    let rotation = about_z(view.azimuth_deg) * tilt * about_z(-view.azimuth_deg) * facing * about_z(view.roll_deg);
    let aim = rotation * Vector3::new(view.aim_m[0], view.aim_m[1], 0.0);
    Pose { rotation, translation: Vector3::new(0.0, 0.0, view.distance_m) - aim }
}

pub fn scene(view: &View) -> Scene {
    let mut camera = Camera::pinhole(Lens::Brown, view.size[0], view.size[1], view.focal_px);
    for (p, v) in camera.parameters[4..].iter_mut().zip([0, 1, 2, 3, 4].map(|k| view.distortion[k])) {
        *p = v;
    }
    Scene { plate: standard_plate(), camera, camera_from_plate: pose(view), conditions: view.conditions.clone() }
}

impl Scene {
    pub fn render(&self, seed: u64) -> Picture {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        render(&self.plate, &self.camera, &self.camera_from_plate, &self.conditions, &mut rng)
    }

    /// Image of a circle of a marker, sampled.
    pub fn ring(&self, marker: usize, edge: Edge, samples: usize) -> Option<Vec<Vector2<f64>>> {
        let m = &self.plate.markers[marker];
        let r = if edge == Edge::Outer { m.outer_radius_m } else { m.inner_radius_m };
        (0..samples)
            .map(|k| {
                let (s, c) = (k as f64 * std::f64::consts::TAU / samples as f64).sin_cos();
                self.camera
                    .project(&self.camera_from_plate.transform(&(m.position_m + Vector3::new(r * c, r * s, 0.0))))
            })
            .collect()
    }

    /// Area centroid of the image of a circle.
    pub fn centroid(&self, marker: usize, edge: Edge) -> Option<Vector2<f64>> {
        let ring = self.ring(marker, edge, 512)?;
        let origin = ring[0];
        let (mut area, mut sum) = (0.0, Vector2::zeros());
        for (p, q) in ring.iter().zip(ring.iter().cycle().skip(1)) {
            let (p, q) = (p - origin, q - origin);
            let cross = p.x * q.y - q.x * p.y;
            area += cross;
            sum += (p + q) * (cross / 3.0);
        }
        Some(origin + sum / area)
    }

    /// The marker's outer contour lies in the picture by a margin.
    pub fn visible(&self, marker: usize, margin_px: f64) -> bool {
        self.ring(marker, Edge::Outer, 32).is_some_and(|ring| ring.iter().all(|p| self.camera.contains(p, margin_px)))
    }

    /// Shortest diameter of the outer contour's image, px.
    pub fn minor_axis_px(&self, marker: usize) -> f64 {
        let Some(ring) = self.ring(marker, Edge::Outer, 64) else { return 0.0 };
        (0..32).map(|k| (ring[k] - ring[k + 32]).norm()).fold(f64::MAX, f64::min)
    }
}

/// What a detection is worth against the truth.
#[derive(Debug, Default)]
pub struct Errors {
    pub visible: usize,
    pub found: usize,
    pub wrong: usize,
    /// Error in u and v with the stated covariance, for every right observation.
    pub residuals: Vec<([f64; 2], [f64; 3], Edge, u32)>,
}

impl Errors {
    pub fn rms(&self) -> f64 {
        let n = 2.0 * self.residuals.len() as f64;
        (self.residuals.iter().map(|(e, ..)| e[0] * e[0] + e[1] * e[1]).sum::<f64>() / n).sqrt()
    }

    /// Mean of e' C^-1 e / 2: one when the covariance is honest.
    pub fn nees(&self) -> f64 {
        let one = |(e, [a, b, c], ..): &([f64; 2], [f64; 3], Edge, u32)| {
            (c * e[0] * e[0] - 2.0 * b * e[0] * e[1] + a * e[1] * e[1]) / (a * c - b * b) / 2.0
        };
        self.residuals.iter().map(one).sum::<f64>() / self.residuals.len() as f64
    }

    pub fn stated(&self) -> f64 {
        let n = 2.0 * self.residuals.len() as f64;
        (self.residuals.iter().map(|(_, c, ..)| c[0] + c[2]).sum::<f64>() / n).sqrt()
    }
}

pub fn errors(scene: &Scene, detection: &CircleDetection) -> Errors {
    let mut e = Errors::default();
    for marker in 0..scene.plate.markers.len() {
        e.visible += usize::from(scene.visible(marker, 3.0));
    }
    for o in &detection.observations {
        let index = scene.plate.index_of(o.marker).unwrap();
        let truth = scene.centroid(index, o.edge);
        let off = truth.map_or([f64::MAX; 2], |t| [o.uv[0] - t.x, o.uv[1] - t.y]);
        if off[0].hypot(off[1]) > 1.0 {
            e.wrong += 1;
            continue;
        }
        e.found += usize::from(o.edge == Edge::Outer && scene.visible(index, 3.0));
        e.residuals.push((off, o.covariance.unwrap(), o.edge, o.marker));
    }
    e
}

pub fn report(scene: &Scene, detection: &CircleDetection, e: &Errors) {
    let worst = e.residuals.iter().map(|(r, ..)| r[0].hypot(r[1])).fold(0.0, f64::max);
    println!(
        "visible {} found {} wrong {} rms {:.5} stated {:.5} nees {:.3} worst {:.4} blur {:.3} noise {:.3?} dropped {:?} io {:?}",
        e.visible,
        e.found,
        e.wrong,
        e.rms(),
        e.stated(),
        e.nees(),
        worst,
        detection.blur_px,
        detection.noise,
        detection.dropped_counts(),
        detection.inner_outer
    );
    let _ = scene;
}
