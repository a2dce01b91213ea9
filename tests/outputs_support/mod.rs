//! A small simulated calibration, solved: what the tests of the outputs start from.

#[allow(dead_code)]
pub mod truth_frame;

use std::path::Path;
use std::sync::{Mutex, OnceLock};

use crate::robots::kr6_urdf;
use nalgebra::{Vector2, Vector3, Vector6};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal, Uniform};
use robotcal::geom::{Pose, exp_so3};
use robotcal::identify::{Options, RobotModel, Solution, identify};
use robotcal::model::camera::{Camera, Lens};
use robotcal::model::robot::Robot;
use robotcal::output::{Context, Offsets, Poses};
use robotcal::problem::{MeasuredSeries, MeasuredStop};
use robotcal::series::{CameraMount, Edge, InputFile, Observation, Plate, PlateKind, ScaleBar};
use robotcal::urdf::RobotDescription;

pub const SEED: u64 = 20;

struct Normal(ChaCha8Rng);

impl Normal {
    fn draw(&mut self, sigma: f64) -> f64 {
        let x: f64 = StandardNormal.sample(&mut self.0);
        x * sigma
    }
}

pub fn robot() -> RobotDescription {
    let path = kr6_urdf();
    robotcal::urdf::read(&path).unwrap()
}

pub fn context(robot: &RobotDescription) -> Context<'_> {
    Context {
        robot,
        robot_name: &robot.name,
        series: vec!["run1".into()],
        inputs: vec![InputFile::of_bytes(Path::new("run1/series.toml"), b"format = 1")],
        options: vec![("joint noise".into(), "estimated".into())],
        command: "robotcal identify --urdf kuka.urdf --series run1/".into(),
        offsets: Offsets::Folded,
        poses: Poses::Written,
    }
}

/// Poses that show the plate: the camera in the hand over a plate on the table, or the plate in the hand before a camera.
pub struct Scene {
    pub camera: Pose,
    pub plate: Pose,
    pub middle: [f64; 6],
}

pub fn scene(mount: CameraMount, nominal: &Robot) -> Scene {
    let middle = [0.1, -1.6, 1.9, 0.2, 1.2, 0.3];
    let facing = Pose::new(exp_so3(&Vector3::new(std::f64::consts::PI, 0.0, 0.0)), Vector3::new(0.0, 0.0, 0.35));
    let held = Pose::from_xyz_rpy([0.04, -0.05, 0.06], [0.05, -0.2, 0.4]);
    let tip = nominal.base_from_tip(&middle);
    match mount {
        CameraMount::Hand => Scene { camera: held, plate: tip * held * facing, middle },
        CameraMount::Fixed => Scene { camera: tip * held * facing.inverse(), plate: held, middle },
    }
}

/// Stops: with 24 what is latent at the stops (6 each) is no more unknowns than the 48 markers, with 26 they are, so that the solver
/// eliminates markers in the one case and what is latent in the other.
fn stops(mount: CameraMount) -> usize {
    match mount {
        CameraMount::Hand => 24,
        CameraMount::Fixed => 26,
    }
}

/// A series of a robot with 0.3 mm, 1 mrad, 3 mrad errors; 0.05 px, 0.02 mrad of noise; a plate of 48 points.
pub fn series(mount: CameraMount, description: &RobotDescription) -> MeasuredSeries {
    series_in_postures(mount, description, 1)
}

/// As [`series`] with the camera in the hand; the plate stands in two places by turns, and the distance of two of its markers was measured.
#[allow(dead_code)]
pub fn series_with_bar_in_two_places(description: &RobotDescription) -> MeasuredSeries {
    let mut series = series_where(CameraMount::Hand, description, 1, |stop| match stop % 2 {
        0 => Pose::identity(),
        _ => Pose::from_xyz_rpy([0.03, -0.05, 0.04], [0.2, -0.1, 0.7]),
    });
    for (k, stop) in series.stops.iter_mut().enumerate() {
        stop.placement = format!("placement_{}", k % 2);
    }
    series.plate.scale = Some(ScaleBar { from: 0, to: 47, distance_m: 0.25812, sigma_m: 1e-5 });
    series
}

/// As [`series`], the first three joints at the same readings, and off by the same, in so many stops one after the other.
pub fn series_in_postures(mount: CameraMount, description: &RobotDescription, stops_each: usize) -> MeasuredSeries {
    series_where(mount, description, stops_each, |_| Pose::identity())
}

/// As [`series_in_postures`], the plate moved by a pose of its own at every stop.
fn series_where(
    mount: CameraMount,
    description: &RobotDescription,
    stops_each: usize,
    moved_plate: impl Fn(usize) -> Pose,
) -> MeasuredSeries {
    let mut noise = Normal(ChaCha8Rng::seed_from_u64(SEED));
    println!("seed {SEED}");
    let chain = description.chain(None, None).unwrap();
    let nominal = Robot::nominal(chain.clone());
    let mut truth = RobotModel::Rigid.robot(chain.clone());
    for (twist, joint) in truth.twists.iter_mut().zip(&chain.joints) {
        if joint.drive.is_some() {
            *twist = Vector6::from_fn(|i, _| noise.draw(if i < 3 { 3e-4 } else { 1e-3 }));
        }
    }
    truth.terms.iter_mut().for_each(|t| t.value = noise.draw(3e-3));
    let plate = Plate::lattice(PlateKind::Points, 8, 6, 0.03, 1e-4);
    let printed: Vec<Vector3<f64>> =
        plate.markers.iter().map(|m| m.position_m + Vector3::from_fn(|_, _| noise.draw(5e-5))).collect();
    let mut camera = Camera::pinhole(Lens::Brown, 1280, 1024, 1100.0);
    camera.parameters = vec![1103.0, 1101.0, 645.0, 508.0, -0.15, 0.03, 8e-4, -5e-4, 0.0];
    let scene = scene(mount, &nominal);
    let mut rng = ChaCha8Rng::seed_from_u64(SEED + 1);
    let range = Uniform::new(-1.0, 1.0).unwrap();
    let wanted = stops(mount);
    let mut stops: Vec<MeasuredStop> = Vec::new();
    while stops.len() < wanted {
        let reach = [0.5, 0.5, 0.5, 1.2, 0.8, 2.5];
        let mut q: Vec<f64> = (0..6).map(|i| scene.middle[i] + reach[i] * range.sample(&mut rng)).collect();
        let before = stops.last().and_then(|s: &MeasuredStop| s.readings.as_ref());
        if let Some(before) = before.filter(|_| !stops.len().is_multiple_of(stops_each)) {
            q[..3].copy_from_slice(&before[..3]);
        }
        let posture = (stops.len() / stops_each) as f64;
        let local =
            |i: usize| if stops_each > 1 && i < 3 { 4e-4 * (3.0 * posture + 5.0 * i as f64).sin() } else { 0.0 };
        let moved: Vec<f64> = q.iter().enumerate().map(|(i, v)| v + noise.draw(2e-5) + local(i)).collect();
        let plate_at = scene.plate * moved_plate(stops.len());
        let pose = mount.camera_from_plate(&scene.camera, &truth.base_from_tip(&moved), &plate_at);
        let distance = pose.translation.norm();
        if pose.rotation.column(2).dot(&pose.translation) > -0.6 * distance || !(0.15..0.6).contains(&distance) {
            continue;
        }
        let see = |(marker, x): (&robotcal::series::Marker, &Vector3<f64>)| {
            let uv = camera.project(&pose.transform(x)).filter(|uv| camera.contains(uv, 8.0))?;
            Some((marker.id, uv))
        };
        let seen: Vec<(u32, Vector2<f64>)> = plate.markers.iter().zip(&printed).filter_map(see).collect();
        if seen.len() < 20 {
            continue;
        }
        let observation = |(marker, uv): (u32, Vector2<f64>)| Observation {
            marker,
            edge: Edge::Outer,
            uv: [uv.x + noise.draw(0.05), uv.y + noise.draw(0.05)],
            covariance: Some([0.0025, 0.0, 0.0025]),
        };
        stops.push(MeasuredStop {
            row: stops.len(),
            image: format!("im{:03}.png", stops.len()),
            readings: Some(q),
            placement: "placement_0".into(),
            observations: seen.into_iter().map(observation).collect(),
            left_out: None,
        });
    }
    MeasuredSeries {
        has_images: true,
        camera: "front".into(),
        mounting: "run1".into(),
        mount,
        width_px: 1280,
        height_px: 1024,
        plate,
        plate_name: "/somewhere/run1/plate.toml".into(),
        ..MeasuredSeries::without_images("run1", true, stops)
    }
}

/// The solution of [`series`], found once for all tests.
#[allow(dead_code)]
pub fn solved(mount: CameraMount, model: RobotModel) -> Solution {
    type Found = ((CameraMount, RobotModel), &'static OnceLock<Solution>);
    static ALL: Mutex<Vec<Found>> = Mutex::new(Vec::new());
    let own = {
        let mut all = ALL.lock().unwrap();
        let known = all.iter().find(|(of, _)| *of == (mount, model)).map(|(_, found)| *found);
        known.unwrap_or_else(|| {
            all.push(((mount, model), Box::leak(Box::default())));
            all[all.len() - 1].1
        })
    };
    let find = || {
        let description = robot();
        let chain = description.chain(None, None).unwrap();
        identify(chain, &[series(mount, &description)], &Options { model, ..Options::default() }).unwrap()
    };
    own.get_or_init(find).clone()
}
