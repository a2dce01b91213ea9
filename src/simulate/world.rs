//! A robot with known errors that looks at a plate with known errors through a known camera.
//!
//! The poses are those that an operator would drive to with the nominal robot: random views of the plate, reached by inverse
//! kinematics of the nominal chain inside the joint limits, in every configuration of the arm. What the camera sees there
//! comes from the true robot, with joint noise of its own at every stop.

use std::collections::BTreeMap;

use nalgebra::{SVector, Vector3};
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

use super::conditions::ImagingConditions;
use super::observe::observe;
use super::placement::{self, Setup};
use super::render::render;
use super::request::WorldRequest;
use super::truth::{HeldOutRecord, TruePose, TrueStop, TrueTerm, Truth};
use crate::detect::Picture;
use crate::error::{Code, Error, Result};
use crate::geom::Pose;
use crate::model::joint_terms::{JointTerm, Term, USUAL_HARMONICS};
use crate::model::plate_modes::{PRIOR_SIGMA, basis, radius};
use crate::model::robot::{Posture, Robot};
use crate::series::{AngleUnit, CameraSection, Edge, ImageObservations, Manifest, Plate, SeriesStop, Stops};
use crate::urdf::JointKind;

/// Attempts at one more workable pose before the world is called impossible.
const ATTEMPTS: usize = 3000;

/// A series with everything known.
#[derive(Debug, Clone, PartialEq)]
pub struct SimulatedSeries {
    /// The manifest.
    pub manifest: Manifest,
    /// The plate as it is believed to be.
    pub plate: Plate,
    /// The plate as it is.
    pub true_plate: Plate,
    /// Readings of the stops.
    pub stops: Stops,
    /// What a perfect detector with pixel noise would report, in the order of the stops.
    pub observations: Vec<ImageObservations>,
    /// What was put in.
    pub truth: Truth,
}

/// Simulates a series; the same request gives the same series.
///
/// # Errors
/// When the robot cannot bring the plate into enough views.
pub fn series(request: &WorldRequest) -> Result<SimulatedSeries> {
    let mut rng = ChaCha8Rng::seed_from_u64(request.seed);
    let nominal = Robot::nominal(request.chain.clone());
    let actual = true_robot(request, &mut rng);
    let true_plate = true_plate(request, &mut rng);
    let setup = placement::set_up(request, &nominal, &mut rng)?;
    let mut world = World { request, nominal, actual, true_plate, setup, rng };
    let mut seen = Vec::with_capacity(request.images);
    let mut before: Option<Vec<f64>> = None;
    for k in 0..request.images {
        let view = world.next_view(k, before.as_deref())?;
        before = Some(view.readings.clone());
        seen.push(view);
    }
    let held_out = (0..request.held_out).map(|k| world.held_out(k)).collect::<Result<Vec<_>>>()?;
    Ok(world.into_series(seen, held_out))
}

/// Standard deviation of a joint quantity given for revolute joints.
fn scaled(value_rad: f64, kind: JointKind) -> f64 {
    if kind == JointKind::Prismatic { 0.1 * value_rad } else { value_rad }
}

fn normal(sigma: f64, rng: &mut impl Rng) -> f64 {
    sigma * rng.sample::<f64, _>(StandardNormal)
}

fn true_robot(request: &WorldRequest, rng: &mut impl Rng) -> Robot {
    let e = &request.errors;
    let mut robot = Robot::nominal(request.chain.clone());
    for (index, twist) in robot.twists.iter_mut().enumerate() {
        for k in 0..6 {
            let sigma = if k < 3 { e.translation_m } else { e.rotation_rad };
            let value = normal(sigma, rng);
            twist[k] = if request.chain.is_origin_of_moving(index) { value } else { 0.0 };
        }
    }
    for (reading, &kind) in request.chain.reading_kinds.iter().enumerate() {
        for term in Term::all(USUAL_HARMONICS).into_iter().filter(|t| t.is_drawn(&request.chain)) {
            let sigma = term.of_joint(e.terms.of(term), kind);
            let value = normal(sigma, rng);
            if sigma > 0.0 {
                robot.terms.push(JointTerm { reading, term, value });
            }
        }
    }
    robot
}

fn true_plate(request: &WorldRequest, rng: &mut impl Rng) -> Plate {
    let mut plate = request.plate.clone();
    if request.plate_modes {
        let half_diagonal = plate.markers.iter().map(|m| m.position_m.norm()).fold(0.0, f64::max);
        let modes = PRIOR_SIGMA.map(|sigma| normal(sigma, rng));
        for marker in &mut plate.markers {
            marker.position_m += basis(&marker.position_m, half_diagonal) * SVector::from(modes);
            marker.outer_radius_m = radius(marker.outer_radius_m, Edge::Outer, &modes).0;
            marker.inner_radius_m = radius(marker.inner_radius_m, Edge::Inner, &modes).0;
        }
    }
    for marker in &mut plate.markers {
        // Whole nanometres keep truth.toml short.
        marker.position_m += Vector3::from_fn(|_, _| (normal(request.marker_sigma_m, rng) * 1e9).round() / 1e9);
    }
    plate
}

/// One accepted stop.
struct AcceptedStop {
    readings: Vec<f64>,
    raw: Vec<f64>,
    noise: Vec<f64>,
    placement: usize,
    camera_from_plate: Pose,
    observations: ImageObservations,
}

struct World<'a> {
    request: &'a WorldRequest,
    nominal: Robot,
    actual: Robot,
    true_plate: Plate,
    setup: Setup,
    rng: ChaCha8Rng,
}

impl World<'_> {
    fn next_view(&mut self, index: usize, before: Option<&[f64]>) -> Result<AcceptedStop> {
        let request = self.request;
        let at = index % self.setup.plates.len();
        let kinds = &request.chain.reading_kinds;
        for _ in 0..ATTEMPTS {
            let given = request.postures.as_ref().and_then(|p| p.get(index).cloned());
            let is_given = given.is_some();
            let drawn = given.or_else(|| self.setup.random_posture(request, &self.nominal, at, &mut self.rng));
            let Some(wanted) = drawn else { continue };
            let (raw, readings) = as_written(&wanted, kinds, request.joint_unit);
            let approach = before.map(|b| readings.iter().zip(b).map(|(q, p)| q - p).collect());
            let noise: Vec<f64> =
                kinds.iter().map(|&k| normal(scaled(request.joint_noise_rad, k), &mut self.rng)).collect();
            let tip = self.actual.pose_at(&Posture { readings: readings.clone(), approach }, &noise);
            let camera_from_plate = self.setup.camera_from_plate(request.mount, &tip, at);
            let seen =
                observe(&self.true_plate, &request.camera, &camera_from_plate, request.pixel_sigma_px, &mut self.rng);
            let mut markers: Vec<u32> = seen.iter().map(|o| o.marker).collect();
            markers.dedup();
            if is_given || markers.len() >= request.least_markers {
                let observations = ImageObservations { image: image_name(index), observations: seen };
                return Ok(AcceptedStop { readings, raw, noise, placement: at, camera_from_plate, observations });
            }
        }
        Err(Error::new(
            Code::SimulationOutOfReach,
            format!("simulated stop {index}"),
            format!("no workable pose in {ATTEMPTS} attempts: none in reach shows {} markers", request.least_markers),
            "allow more distance, less tilt, fewer markers, or a plate that suits the robot's size",
        ))
    }

    fn held_out(&mut self, index: usize) -> Result<HeldOutRecord> {
        let at = index % self.setup.plates.len();
        let posture =
            (0..ATTEMPTS).find_map(|_| self.setup.random_posture(self.request, &self.nominal, at, &mut self.rng));
        let readings = posture.ok_or_else(|| {
            Error::new(
                Code::SimulationOutOfReach,
                "simulated joint vectors",
                "no view of the plate is in reach",
                "choose another plate or robot",
            )
        })?;
        let base_from_tip = TruePose::from(&self.actual.base_from_tip(&readings));
        Ok(HeldOutRecord { readings, base_from_tip })
    }

    fn into_series(self, seen: Vec<AcceptedStop>, held_out: Vec<HeldOutRecord>) -> SimulatedSeries {
        let request = self.request;
        let truth = self.truth(&seen, held_out);
        let stop = |s: &AcceptedStop| SeriesStop {
            image: s.observations.image.clone(),
            raw_readings: Some(s.raw.clone()),
            placement: placement_name(s.placement),
            ..SeriesStop::default()
        };
        let joints = request.chain.readings.clone();
        SimulatedSeries {
            manifest: manifest(request),
            plate: request.plate.clone(),
            stops: Stops { joints, stops: seen.iter().map(stop).collect(), ..Stops::default() },
            observations: seen.into_iter().map(|s| s.observations).collect(),
            true_plate: self.true_plate,
            truth,
        }
    }

    /// All that was put in.
    fn truth(&self, seen: &[AcceptedStop], held_out: Vec<HeldOutRecord>) -> Truth {
        let request = self.request;
        let chain = &request.chain;
        let record = |s: &AcceptedStop| TrueStop {
            image: s.observations.image.clone(),
            placement: placement_name(s.placement),
            joint_noise: s.noise.clone(),
            camera_from_plate: TruePose::from(&s.camera_from_plate),
        };
        Truth {
            format: 1,
            seed: request.seed,
            base: chain.base.clone(),
            tip: chain.tip.clone(),
            joints: chain.readings.clone(),
            camera_mount: request.mount,
            joint_noise_sigma: chain.reading_kinds.iter().map(|&k| scaled(request.joint_noise_rad, k)).collect(),
            pixel_sigma_px: Some(request.pixel_sigma_px),
            camera: request.camera.clone(),
            camera_pose: TruePose::from(&self.setup.camera),
            plate_poses: self.setup.plates.iter().enumerate().map(|(k, p)| (placement_name(k), p.into())).collect(),
            twists: twists_by_name(&self.actual),
            terms: terms_by_name(&self.actual),
            marker_errors_m: marker_errors(&request.plate, &self.true_plate),
            fault: None,
            stops: seen.iter().map(record).collect(),
            held_out,
        }
    }
}

fn placement_name(at: usize) -> String {
    format!("placement_{at}")
}

impl SimulatedSeries {
    /// Renders the picture of stop `index`; its noise depends on the seed and on the index only.
    pub fn render(&self, index: usize, conditions: &ImagingConditions) -> Picture {
        let mut rng = ChaCha8Rng::seed_from_u64(self.truth.seed);
        rng.set_stream(1 + index as u64);
        let pose = self.truth.stops[index].camera_from_plate.pose();
        render(&self.true_plate, &self.truth.camera, &pose, conditions, &mut rng)
    }
}

fn image_name(index: usize) -> String {
    format!("img_{index:03}.png")
}

/// Readings as a controller shows them (1e-5 degrees, 1e-6 rad or 1e-7 m), and the same in SI.
fn as_written(readings: &[f64], kinds: &[JointKind], unit: AngleUnit) -> (Vec<f64>, Vec<f64>) {
    let one = |(&q, &kind): (&f64, &JointKind)| match (kind, unit) {
        (JointKind::Prismatic, _) => ((q * 1e7).round() / 1e7, 1.0),
        (_, AngleUnit::Deg) => ((q / unit.in_rad() * 1e5).round() / 1e5, unit.in_rad()),
        (_, AngleUnit::Rad) => ((q * 1e6).round() / 1e6, 1.0),
    };
    let written: Vec<(f64, f64)> = readings.iter().zip(kinds).map(one).collect();
    (written.iter().map(|w| w.0).collect(), written.iter().map(|w| w.0 * w.1).collect())
}

fn twists_by_name(robot: &Robot) -> BTreeMap<String, [f64; 6]> {
    let moving = (0..robot.twists.len()).filter(|&k| robot.chain.is_origin_of_moving(k));
    moving.map(|k| (robot.chain.joints[k].name.clone(), robot.twists[k].into())).collect()
}

fn terms_by_name(robot: &Robot) -> Vec<TrueTerm> {
    let name = |reading: usize| robot.chain.readings[reading].clone();
    robot.terms.iter().map(|t| TrueTerm { joint: name(t.reading), term: t.term, value: t.value }).collect()
}

fn marker_errors(nominal: &Plate, actual: &Plate) -> Vec<[f64; 3]> {
    let pairs = nominal.markers.iter().zip(&actual.markers);
    pairs.map(|(n, a)| (a.position_m - n.position_m).map(|v| (v * 1e9).round() / 1e9).into()).collect()
}

fn manifest(request: &WorldRequest) -> Manifest {
    let size = CameraSection {
        width_px: Some(request.camera.width_px),
        height_px: Some(request.camera.height_px),
        ..CameraSection::default()
    };
    Manifest {
        joint_unit: Some(request.joint_unit),
        base: Some(request.chain.base.clone()),
        tip: Some(request.chain.tip.clone()),
        cameras: size.into(),
        ..Manifest::plain(request.mount, "plate.toml")
    }
}
