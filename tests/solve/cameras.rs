//! Several cameras at the same stops: one latent joint error a stop, whoever saw it.

use nalgebra::{DVector, Vector3};
use robotcal::Code;
use robotcal::diagnose::Subject;
use robotcal::geom::{Pose, exp_so3};
use robotcal::identify::{JointNoise, Options, Selection, Solution, identify};
use robotcal::model::camera::{Camera, Lens};
use robotcal::model::robot::Robot;
use robotcal::output::{self, restore, solution_json};
use robotcal::problem::{BodySeen, InstrumentKind, MeasuredSeries, MeasuredStop, PlateShape, SeenBody};
use robotcal::series::{CameraMount, Edge, Observation, Plate, PlateKind};

use crate::outputs_support::{context, robot, scene};
use crate::said::assert_says;
use crate::support::small::Dice;

pub const JOINT_SIGMA: f64 = 3e-4;
const PIXEL_SIGMA: f64 = 0.05;

fn displaced(pose: &Pose, [tilt, spin, across, along]: [f64; 4], dice: &mut Dice) -> Pose {
    if [tilt, spin, across, along] == [0.0; 4] {
        return *pose;
    }
    let turn = Vector3::new(dice.normal(tilt), dice.normal(tilt), dice.normal(spin));
    let shift = Vector3::new(dice.normal(across), dice.normal(across), dice.normal(along));
    let turned = *pose * Pose::new(exp_so3(&turn), Vector3::zeros());
    Pose::new(turned.rotation, turned.translation + shift)
}

/// What was measured at the same stops, and what the joints were off by at each of them.
pub struct Seen {
    pub series: Vec<MeasuredSeries>,
    pub joint_errors: Vec<Vec<f64>>,
}

/// Readings of a stop, and what they are off by, rad.
#[derive(Clone)]
pub struct Taken {
    pub readings: Vec<f64>,
    pub errors: Vec<f64>,
}

impl Taken {
    pub fn near(middle: &[f64; 6], dice: &mut Dice) -> Self {
        let reach = [0.3, 0.3, 0.3, 1.0, 0.7, 1.5];
        let readings = (0..6).map(|i| middle[i] + dice.between(-reach[i], reach[i])).collect();
        Self { readings, errors: (0..6).map(|_| dice.normal(JOINT_SIGMA)).collect() }
    }
}

/// A camera and its plate; each further fixed camera looks from another side.
fn placed(mounts: &[CameraMount], nominal: &Robot, k: usize) -> (Pose, Pose) {
    let own = scene(mounts[k], nominal);
    let twin = mounts[..k].iter().filter(|m| **m == mounts[k]).count() as f64;
    let aside = Pose::new(exp_so3(&Vector3::new(0.0, 0.5 * twin, 0.0)), Vector3::zeros());
    match mounts[k] {
        CameraMount::Hand => {
            (own.camera * Pose::from_xyz_rpy([0.02 * twin, 0.0, 0.0], [0.0, 0.0, 0.3 * twin]), own.plate)
        }
        CameraMount::Fixed => {
            let held = nominal.base_from_tip(&own.middle) * own.plate;
            (held * aside * held.inverse() * own.camera, own.plate)
        }
    }
}

pub fn seen(mounts: &[CameraMount], wanted: usize, seed: u64) -> Seen {
    seen_displaced(mounts, wanted, seed, [0.0; 4])
}

/// The same, where the pose that an image shows is off by itself: tilt, spin (rad), shift across the optical axis and along it (m).
fn seen_displaced(mounts: &[CameraMount], wanted: usize, seed: u64, sizes: [f64; 4]) -> Seen {
    let nominal = Robot::nominal(robot().chain(None, None).unwrap());
    let middle = scene(mounts[0], &nominal).middle;
    let plates = vec![PlateShape::nominal(&plate()); mounts.len()];
    seen_at((mounts, &plates), wanted, &mut Dice::new(seed), sizes, |_, dice| Some(Taken::near(&middle, dice)))
}

pub fn plate() -> Plate {
    Plate::lattice(PlateKind::Points, 8, 6, 0.03, 1e-6)
}

/// The same, where the plates are as printed and the stops are taken as `at` says of each; without cameras, what was taken alone.
pub fn seen_at(
    (mounts, printed): (&[CameraMount], &[PlateShape]),
    wanted: usize,
    dice: &mut Dice,
    sizes: [f64; 4],
    mut at: impl FnMut(usize, &mut Dice) -> Option<Taken>,
) -> Seen {
    let nominal = Robot::nominal(robot().chain(None, None).unwrap());
    let plate = plate();
    let mut camera = Camera::pinhole(Lens::Brown, 1280, 1024, 1100.0);
    camera.parameters = vec![1103.0, 1101.0, 645.0, 508.0, -0.15, 0.03, 8e-4, -5e-4, 0.0];
    let cameras: Vec<(Pose, Pose)> = (0..mounts.len()).map(|k| placed(mounts, &nominal, k)).collect();
    let (mut stops, mut joint_errors) = (vec![Vec::new(); mounts.len()], Vec::new());
    while joint_errors.len() < wanted {
        let Some(Taken { readings, errors }) = at(joint_errors.len(), dice) else { continue };
        let moved: Vec<f64> = readings.iter().zip(&errors).map(|(q, e)| q + e).collect();
        let tip = nominal.base_from_tip(&moved);
        let poses: Vec<Pose> =
            cameras.iter().zip(mounts).map(|((c, p), mount)| mount.camera_from_plate(c, &tip, p)).collect();
        let poses: Vec<Pose> = poses.into_iter().map(|pose| displaced(&pose, sizes, dice)).collect();
        let faces = |p: &Pose| p.rotation.column(2).dot(&p.translation) < -0.5 * p.translation.norm();
        let shows = |p: &Pose| faces(p) && (0.12..0.9).contains(&p.translation.norm());
        let views: Vec<Vec<Observation>> = poses
            .iter()
            .zip(printed)
            .map(|(pose, printed)| {
                let see = |(k, m): (usize, &robotcal::series::Marker)| {
                    let uv =
                        camera.project(&pose.transform(&printed.position(k))).filter(|uv| camera.contains(uv, 8.0))?;
                    let uv = [uv.x + dice.normal(PIXEL_SIGMA), uv.y + dice.normal(PIXEL_SIGMA)];
                    let variance = PIXEL_SIGMA * PIXEL_SIGMA;
                    Some(Observation {
                        marker: m.id,
                        edge: Edge::Outer,
                        uv,
                        covariance: Some([variance, 0.0, variance]),
                    })
                };
                if shows(pose) { plate.markers.iter().enumerate().filter_map(see).collect() } else { Vec::new() }
            })
            .collect();
        if !views.is_empty() && views.iter().all(|v| v.len() < 20) {
            continue;
        }
        let row = joint_errors.len();
        joint_errors.push(errors);
        for (k, observations) in views.into_iter().enumerate().filter(|(_, v)| v.len() >= 20) {
            stops[k].push(MeasuredStop {
                row,
                image: format!("cam{k}_{row:03}.png"),
                readings: Some(readings.clone()),
                placement: format!("{:?}", mounts[k]),
                observations: observations.into(),
                left_out: None,
            });
        }
    }
    let series = |(k, stops): (usize, Vec<MeasuredStop>)| MeasuredSeries {
        run: Some("run".into()),
        camera: format!("cam{k}"),
        mounting: format!("run cam{k}"),
        mount: mounts[k],
        width_px: 1280,
        height_px: 1024,
        plate: plate.clone(),
        plate_name: format!("plate {:?}", mounts[k]),
        has_images: true,
        ..MeasuredSeries::without_images(&format!("run cam{k}"), true, stops)
    };
    Seen { series: stops.into_iter().enumerate().map(series).collect(), joint_errors }
}

/// Cameras, plates, bodies and joint noise are estimated, the robot is as it is.
pub fn solved(seen: &Seen) -> Solution {
    solved_with(seen, JointNoise::Estimated)
}

/// The same, where the size of the joint noise may be known.
pub fn solved_with(seen: &Seen, joint_noise: JointNoise) -> Solution {
    let selection = Selection { fix: vec!["robot".into()], ..Selection::default() };
    let options =
        Options { joint_noise, model: robotcal::identify::RobotModel::Rigid, selection, ..Options::default() };
    identify(robot().chain(None, None).unwrap(), &seen.series, &options).unwrap()
}

/// Errors of the latent joint errors in units of their covariance: the mean of their squares is 1 where this is right.
pub fn normalised(seen: &Seen, solution: &Solution) -> f64 {
    let fit = &solution.fit;
    let (mut sum, mut count) = (0.0, 0.0);
    for stop in fit.linear().stops() {
        let errors = &fit.state.joint_errors[stop.index];
        let n = errors.len();
        let off = DVector::from_fn(n, |k, _| errors[k] - seen.joint_errors[stop.index][k]);
        let covariance = fit.covariance.latents(std::slice::from_ref(&stop))[0].view((0, 0), (n, n)).into_owned();
        sum += off.dot(&(covariance.try_inverse().unwrap() * &off));
        count += n as f64;
    }
    sum / count
}

const MIXTURES: [&[CameraMount]; 3] = [
    &[CameraMount::Fixed, CameraMount::Fixed],
    &[CameraMount::Hand, CameraMount::Hand],
    &[CameraMount::Hand, CameraMount::Fixed],
];

#[test]
fn images_of_a_stop_share_its_joint_errors() {
    for (mounts, seed) in MIXTURES.into_iter().zip(40..) {
        let seen = seen(mounts, 30, seed);
        let solution = solved(&seen);
        let problem = &solution.fit.problem;
        let images: usize = seen.series.iter().map(|s| s.stops.len()).sum();
        assert_eq!((problem.stops.len(), problem.images.len()), (30, images), "{mounts:?}");
        assert!(problem.images.windows(2).all(|w| w[1].stop == w[0].stop || w[1].stop == w[0].stop + 1));
        assert_eq!(problem.noise.joint.len(), 1);
        // 30 stops: the standard deviation of an estimated standard deviation is an eighth, and six of them are within a half.
        for sigma in problem.joint_sigma(0) {
            assert!((0.5..1.6).contains(&(sigma / JOINT_SIGMA)), "{mounts:?}: {sigma}");
        }
        let nees = normalised(&seen, &solution);
        assert!((0.6..1.6).contains(&nees), "{mounts:?}: {nees}");
    }
}

/// The images of one camera given to the other, and one camera that is mounted as the other is.
#[test]
fn cameras_in_each_others_place_are_named() {
    let right = seen(&[CameraMount::Hand, CameraMount::Fixed], 24, 31).series;
    let chain = robot().chain(None, None).unwrap();
    let said = |series: &[MeasuredSeries]| identify(chain.clone(), series, &Options::default()).unwrap_err();
    let mut exchanged = right.clone();
    let (mut in_hand, mut fixed) = (right[0].stops.clone(), right[1].stops.clone());
    in_hand.iter_mut().for_each(|stop| stop.placement.clone_from(&fixed[0].placement));
    fixed.iter_mut().for_each(|stop| stop.placement.clone_from(&right[0].stops[0].placement));
    (exchanged[0].stops, exchanged[1].stops) = (fixed, in_hand);
    assert_says(&said(&exchanged), Code::CameraMountWrong, &["cam0", "cam1", "images.csv"]);
    let mut both_in_hand = right.clone();
    both_in_hand[1].mount = CameraMount::Hand;
    assert_says(&said(&both_in_hand), Code::CameraMountWrong, &["[[camera]]", "cam1"]);
}

#[test]
fn a_record_keeps_which_images_are_of_one_stop() {
    let seen = seen(MIXTURES[2], 24, 60);
    let solution = solved(&seen);
    let description = robot();
    let mut context = context(&description);
    context.series = seen.series.iter().map(|s| s.name.clone()).collect();
    let files = output::files(&solution, &context).unwrap();
    let record = solution_json::read(&files["solution.json"]).unwrap();
    let again = restore::measured_series(&record).unwrap();
    for (was, is) in seen.series.iter().zip(&again) {
        assert_eq!((&was.run, &was.name, was.mount), (&is.run, &is.name, is.mount));
        let rows = |s: &MeasuredSeries| s.stops.iter().map(|s| (s.row, s.image.clone())).collect::<Vec<_>>();
        assert_eq!(rows(was), rows(is));
    }
}

/// A tracker that saw a ball at the stops of a camera knows of the same joint errors.
#[test]
fn what_a_tracker_measured_at_the_stops_of_a_camera_shares_its_joint_errors() {
    let mut seen = seen(&MIXTURES[0][..1], 30, 61);
    let nominal = Robot::nominal(robot().chain(None, None).unwrap());
    let mut dice = Dice::new(62);
    let sigma_m = 2e-5;
    let ball = Vector3::new(0.03, -0.02, 0.1);
    let point = |(stop, own): (usize, &MeasuredStop)| {
        let readings = own.readings.as_ref().unwrap();
        let moved: Vec<f64> = readings.iter().zip(&seen.joint_errors[own.row]).map(|(q, e)| q + e).collect();
        let place = nominal.base_from_tip(&moved).transform(&ball);
        SeenBody {
            stop,
            instrument: "tracker".into(),
            kind: InstrumentKind::Tracker,
            body: "ball".into(),
            seen: BodySeen::Point(place + Vector3::from_fn(|_, _| dice.normal(sigma_m))),
            sigma_m,
            sigma_rad: 1e-4,
        }
    };
    let bodies: Vec<SeenBody> = seen.series[0].stops.iter().enumerate().map(point).collect();
    let stops = seen.series[0].stops.iter().map(|stop| MeasuredStop {
        observations: Vec::new().into(),
        image: format!("stop {}", stop.row),
        ..stop.clone()
    });
    let space = MeasuredSeries::without_images("run", true, stops.collect());
    seen.series.push(MeasuredSeries { run: Some("run".into()), bodies, ..space });
    let solution = solved(&seen);
    let problem = &solution.fit.problem;
    assert_eq!((problem.stops.len(), problem.images.len(), problem.body_measurements.len()), (30, 30, 30));
    let nees = normalised(&seen, &solution);
    assert!((0.6..1.6).contains(&nees), "{nees}");
    let description = robot();
    let mut context = context(&description);
    context.series = seen.series.iter().map(|s| s.name.clone()).collect();
    let files = output::files(&solution, &context).unwrap();
    let again = restore::measured_series(&solution_json::read(&files["solution.json"]).unwrap()).unwrap();
    let (was, is) = (&seen.series[1], &again[1]);
    assert_eq!((&was.run, &was.name, was.bodies.len()), (&is.run, &is.name, is.bodies.len()));
    let rows = |s: &MeasuredSeries| s.stops.iter().map(|s| s.row).collect::<Vec<_>>();
    assert_eq!(rows(was), rows(is));
}

#[test]
fn what_single_images_are_off_by_is_no_joint_noise() {
    let sizes = [1e-3, 5e-4, 3e-4, 6e-4];
    let (mut squares, mut of_joints) = ([0.0; 4], 0.0);
    let worlds = 6;
    for seed in 0..worlds {
        let solution = solved(&seen_displaced(&[CameraMount::Fixed; 2], 40, seed, sizes));
        let noise = &solution.fit.problem.noise;
        assert_eq!(noise.displacement_sizes(), sizes.len());
        squares.iter_mut().zip(&noise.displacement).for_each(|(sum, size)| *sum += size * size / worlds as f64);
        of_joints += noise.joint[0].iter().map(|s| s * s).sum::<f64>() / (6 * worlds) as f64;
    }
    for (found, size) in squares.iter().zip(sizes) {
        assert!((0.75..1.25).contains(&(found.sqrt() / size)), "{} {size}", found.sqrt());
    }
    assert!((0.75..1.25).contains(&(of_joints.sqrt() / JOINT_SIGMA)), "{}", of_joints.sqrt());
}

/// What they contradict each other by is taken up by their images, one by one: no other check sees it.
#[test]
fn cameras_that_contradict_each_other_are_named() {
    let told = |across: f64, along: f64| {
        let solution = solved(&seen_displaced(&[CameraMount::Hand; 2], 30, 3, [1e-5, 1e-5, across, along]));
        let found = solution.findings.iter().find(|f| f.code() == Code::CamerasContradict);
        found.map(|f| (f.fails(), f.subjects().len()))
    };
    assert_eq!(told(2e-5, 5e-5), None);
    assert_eq!(told(3.5e-4, 5e-5), Some((false, 4)));
    assert_eq!(told(1.5e-3, 5e-5), Some((true, 4)));
    assert_eq!(told(2e-5, 3e-3), Some((true, 4)));
}

/// A series of one camera beside them has their sizes, and no stop that tells it.
#[test]
fn a_camera_that_shares_no_stop_contradicts_none() {
    let mut seen = seen_displaced(&[CameraMount::Hand; 2], 30, 3, [1e-5, 1e-5, 1.5e-3, 5e-5]);
    let alone = seen_displaced(&[CameraMount::Hand], 20, 4, [0.0; 4]).series.remove(0);
    seen.series.push(MeasuredSeries {
        run: Some("alone".into()),
        name: "alone".into(),
        camera: "own".into(),
        mounting: "own".into(),
        ..alone
    });
    let solution = solved(&seen);
    let found = solution.findings.iter().filter(|f| f.code() == Code::CamerasContradict);
    let found: Vec<_> = found.map(|f| (f.fails(), f.subjects())).collect();
    let series = ["run cam0", "run cam1"].map(|name| Subject::Series(name.into()));
    let cameras = ["cam0", "cam1"].map(|name| Subject::Camera(name.into()));
    assert_eq!(found, [(true, [series, cameras].concat())]);
}

/// Mean of the squared normalised errors over many worlds, with its 99 % interval, for every mixture of two cameras.
#[test]
#[ignore = "minutes: 200 worlds of each mixture of cameras"]
fn the_stated_size_of_joint_errors_is_right() {
    for mounts in MIXTURES {
        // A camera that saw a stop or two has no hand-eye transform.
        let shows_enough = |seen: &Seen| seen.series.iter().all(|s| s.stops.len() >= 8);
        let worlds = (1000..).map(|seed| seen(mounts, 30, seed)).filter(shows_enough).take(200);
        let all: Vec<f64> = worlds.map(|seen| normalised(&seen, &solved(&seen))).collect();
        let n = all.len() as f64;
        let mean = all.iter().sum::<f64>() / n;
        let sigma = (all.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0)).sqrt();
        println!("{mounts:?}: {mean:.4} +- {:.4} (99 %)", 2.576 * sigma / n.sqrt());
        assert!((mean - 1.0).abs() < 2.576 * sigma / n.sqrt(), "{mounts:?}: {mean}");
    }
}
