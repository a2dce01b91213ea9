//! Cameras, plates and poses from images alone: the same as those of an identification, and true.

use std::path::Path;

use crate::outputs_support::truth_frame::{Alignment, least_eigenvalue};
use crate::outputs_support::{context, robot};
use crate::robots::made_with;
use nalgebra::{Matrix6, Vector3};
use rayon::prelude::*;
use robotcal::Code;
use robotcal::assess::Limits;
use robotcal::geom::Pose;
use robotcal::identify::{Options, OtherBody, RobotModel, compare_poses, identify, stand_alone};
use robotcal::output::restore::measured_series;
use robotcal::output::stand_alone_files::{StandAloneContext, stand_alone_files};
use robotcal::output::{files, solution_json};
use robotcal::plan::plate_design::{PlateRequest, design};
use robotcal::problem::{ImageRejection, LensChoice, MeasuredSeries, Problem};
use robotcal::series::{Plate, PlateKind};
use robotcal::simulate::truth::Truth;
use robotcal::simulate::{SimulatedSeries, WorldRequest, series as simulate};
use robotcal::study::measured;

fn shipped() -> Vec<MeasuredSeries> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let bytes = std::fs::read(root.join("reports/kr6_small/solution.json")).unwrap();
    let mut series = measured_series(&solution_json::read(&bytes).unwrap()).unwrap();
    series.iter_mut().for_each(|s| s.lens_choice = LensChoice::Settled);
    series
}

pub(super) fn of_poses(series: &str) -> StandAloneContext {
    StandAloneContext {
        series: vec![series.to_owned()],
        inputs: Vec::new(),
        command: String::new(),
        limits: Limits::default(),
        notices: Vec::new(),
        against: None,
    }
}

#[test]
fn poses_without_a_robot_are_those_of_an_identification() {
    let series = shipped();
    let options = Options { model: RobotModel::Rigid, ..Options::default() };
    let robot = robot();
    let solution = identify(robot.chain(None, None).unwrap(), &series, &options).unwrap();
    let found = stand_alone(&series, &Limits::default()).unwrap();
    let (identified, alone) = (&solution.free_poses, &found.free_poses);
    assert_eq!(alone.poses.len(), 24);
    for (a, b) in alone.poses.iter().zip(&identified.poses) {
        let (a, b) = (&a.as_ref().unwrap().in_frame, &b.as_ref().unwrap().in_frame);
        let (angle, distance) = a.plate_from_camera.distance(&b.plate_from_camera);
        assert!(angle < 1e-9 && distance < 1e-9, "{angle:e} {distance:e}");
        let off = (a.covariance - b.covariance).amax() / b.covariance.amax();
        assert!(off < 1e-6, "{off:e}");
    }
    let written = files(&solution, &context(&robot)).unwrap();
    let of_poses = stand_alone_files(&found, &of_poses("run1")).unwrap();
    assert_eq!(written["poses_covariance.npy"], of_poses["poses_covariance.npy"]);
    let order = |file: &[u8]| serde_json::from_slice::<serde_json::Value>(file).unwrap()["covariance_together"].clone();
    assert_eq!(order(&written["solution.json"]), order(&of_poses["poses.json"]));
    assert_eq!(order(&written["solution.json"]).as_array().unwrap().len(), 24);
}

#[test]
fn poses_without_a_robot_are_as_far_off_as_stated() {
    let series = shipped();
    let found = stand_alone(&series, &Limits::default()).unwrap();
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let truth = Truth::read(&root.join("datasets/kr6_small/truth.toml")).unwrap();
    let nominal: Vec<Vector3<f64>> = series[0].plate.markers.iter().map(|m| m.position_m).collect();
    let errors = truth.marker_errors_m.iter().map(|e| Vector3::from(*e));
    let actual: Vec<Vector3<f64>> = nominal.iter().zip(errors).map(|(n, e)| n + e).collect();
    let frame = Alignment::of(&nominal, &actual);
    let mut squares = Vec::new();
    for (image, pose) in found.fit.problem.images.iter().zip(&found.free_poses.poses) {
        let placed = &pose.as_ref().unwrap().in_frame;
        let stop = truth.stops.iter().find(|s| s.image == image.name).unwrap();
        let expected = frame.camera(&stop.camera_from_plate.pose().inverse());
        let error = (expected.inverse() * placed.plate_from_camera).log();
        assert!(least_eigenvalue(&placed.covariance) > 0.0);
        squares.push((error.transpose() * placed.covariance.try_inverse().unwrap() * error)[0] / 6.0);
    }
    let mean = squares.iter().sum::<f64>() / squares.len() as f64;
    println!("normalised error squared of {} poses: {mean}", squares.len());
    // Camera and markers are common to the 24 poses: their mean is known to a third.
    assert!((0.5..2.0).contains(&mean), "{mean}");
    let sigmas = found.sigmas();
    assert!(sigmas.iter().all(|s| s.position_m > 0.0 && s.position_m < 1e-4 && s.rotation_rad < 1e-4));
}

#[test]
fn files_of_poses_without_a_robot_are_complete() {
    let series = shipped();
    let found = stand_alone(&series, &Limits::default()).unwrap();
    let files = stand_alone_files(&found, &of_poses("kr6_small")).unwrap();
    let names: Vec<&str> = files.keys().map(String::as_str).collect();
    let expected = [
        "camera.yaml",
        "observations.csv",
        "plate.csv",
        "plate.toml",
        "poses.csv",
        "poses.json",
        "poses_covariance.npy",
        "report.html",
    ];
    assert_eq!(names, expected);
    let record: serde_json::Value = serde_json::from_slice(&files["poses.json"]).unwrap();
    assert_eq!(record["images"].as_array().unwrap().len(), 24);
    let fx = &record["cameras"][0]["parameters"]["fx"];
    assert!(fx["sigma"].as_f64().unwrap() > 0.0 && fx["value"].as_f64().unwrap() > 1000.0, "{fx}");
    let rows = csv::Reader::from_reader(files["poses.csv"].as_slice()).into_records().count();
    assert_eq!(rows, 24);
    let sigma = |k: usize| record["images"][k]["position_sigma_m"].as_f64().unwrap();
    let pose = found.free_poses.poses[3].as_ref().unwrap();
    let c = &pose.in_frame.covariance;
    assert_eq!(sigma(3), ((c[(0, 0)] + c[(1, 1)] + c[(2, 2)]) / 3.0).sqrt());
}

#[test]
fn the_covariance_of_all_poses_together_has_that_of_each_on_its_diagonal() {
    let found = stand_alone(&shipped(), &Limits::default()).unwrap();
    let (images, together) = found.covariance_together().unwrap().unwrap();
    assert_eq!((images.len(), together.shape()), (24, (144, 144)));
    let mut correlated = 0.0f64;
    for (k, &image) in images.iter().enumerate() {
        let own = &found.free_poses.poses[image].as_ref().unwrap().in_frame.covariance;
        let block = together.view((6 * k, 6 * k), (6, 6));
        let unit = own.diagonal().map(f64::sqrt);
        for i in 0..6 {
            for j in 0..6 {
                let off = (block[(i, j)] - own[(i, j)]) / unit[i] / unit[j];
                assert!(off.abs() < 1e-4, "{image} {i} {j}: {off:e}");
            }
        }
        let other = (k + 1) % images.len();
        let between = together.view((6 * k, 6 * other), (6, 6));
        correlated = correlated.max((0..6).map(|i| between[(i, i)].abs() / own[(i, i)]).fold(0.0, f64::max));
    }
    // Camera and plate are common to all of them.
    assert!(correlated > 0.05, "{correlated}");
}

#[test]
fn poses_are_compared_after_the_common_frames() {
    let found = stand_alone(&shipped(), &Limits::default()).unwrap();
    let frame = Pose::from_xyz_rpy([1.0, -2.0, 0.5], [0.3, 2.0, -0.4]);
    let body = Pose::from_xyz_rpy([0.05, 0.02, -0.1], [0.1, -0.2, 0.3]);
    let poses = |body: Pose| -> Vec<(String, Pose)> {
        let all = found.fit.problem.images.iter().zip(&found.free_poses.poses);
        all.filter_map(|(i, p)| Some((i.name.clone(), frame * p.as_ref()?.in_frame.plate_from_camera * body))).collect()
    };
    let same = compare_poses(&found, &poses(Pose::identity()), OtherBody::Camera, "same").unwrap();
    assert!(same.rms.iter().all(|r| *r < 1e-9) && same.differences.len() == 24, "{:?}", same.rms);
    let other = compare_poses(&found, &poses(body), OtherBody::Unknown, "body").unwrap();
    assert!(other.rms.iter().all(|r| *r < 1e-8), "{:?}", other.rms);
    assert!(other.relative_scale.abs() < 1e-6);
    assert!(compare_poses(&found, &poses(body)[..2], OtherBody::Camera, "few").is_err());
}

/// As a viewer that turns a picture by half a turn leaves it.
#[test]
fn an_image_that_contradicts_the_others_is_left_out() {
    let made = world(48, 14, 0.02, true, 3);
    let chain = robot().chain(None, None).unwrap();
    let seen = measured(&made, &chain);
    let (width, height) = (f64::from(seen.width_px) - 1.0, f64::from(seen.height_px) - 1.0);
    for turned in [4, 9] {
        let mut series = seen.clone();
        series.stops[turned].observations.iter_mut().for_each(|o| {
            let turned = (width - o.uv[0], height - o.uv[1]);
            (o.uv[0], o.uv[1]) = turned;
        });
        let rejected = |problem: &Problem| -> Vec<(usize, Code)> {
            let codes = problem.images.iter().map(|i| i.rejected.as_ref().map(ImageRejection::code));
            codes.enumerate().filter_map(|(k, code)| Some((k, code?))).collect()
        };
        let alone = stand_alone(&[series.clone()], &Limits::default()).unwrap();
        let options = Options { model: RobotModel::Rigid, ..Options::default() };
        let solution = identify(chain.clone(), &[series], &options).unwrap();
        assert_eq!(rejected(&alone.fit.problem), [(turned, Code::ImageContradictory)]);
        assert_eq!(rejected(&solution.fit.problem), [(turned, Code::ImageContradictory)]);
        let truth: Vec<(String, Pose)> =
            (made.truth.stops.iter()).map(|s| (s.image.clone(), s.camera_from_plate.pose().inverse())).collect();
        let [distance_m, _] = compare_poses(&alone, &truth, OtherBody::Camera, "truth").unwrap().rms;
        assert!(distance_m < 1e-4, "{distance_m}");
    }
}

/// A world of 48 circles seen 24 to 30 times, or of the 504-marker plate; with markers off by 0.1 mm and by the modes, or all as stated.
fn world(markers: usize, images: usize, pixel_sigma_px: f64, errors: bool, seed: u64) -> SimulatedSeries {
    let chain = robot().chain(None, None).unwrap();
    let mut plate = match markers {
        504 => design(&PlateRequest::default()).unwrap().plate,
        _ => {
            let mut plate = Plate::lattice(PlateKind::Points, 8, 6, 0.038, 1e-4);
            plate.markers.iter_mut().for_each(|m| m.outer_radius_m = 0.01);
            plate
        }
    };
    let marker_sigma_m = if errors { 1e-4 } else { 0.0 };
    plate.markers.iter_mut().for_each(|m| m.sigma_m = marker_sigma_m);
    let wanted = WorldRequest {
        images,
        pixel_sigma_px,
        marker_sigma_m,
        plate_modes: errors,
        held_out: 1,
        seed,
        ..WorldRequest::typical(chain, plate)
    };
    simulate(&wanted).unwrap()
}

/// Poses of a world beside the true ones in the frame of the nominal markers: normalised error squared, and RMS per axis after the common frame.
fn judged(made: &SimulatedSeries) -> Option<(f64, [f64; 2])> {
    let chain = robot().chain(None, None).unwrap();
    let found = stand_alone(&[measured(made, &chain)], &Limits::default()).ok()?;
    let at = |plate: &Plate| plate.markers.iter().map(|m| m.position_m).collect::<Vec<Vector3<f64>>>();
    let frame = Alignment::of(&at(&made.plate), &at(&made.true_plate));
    let (mut sum, mut count) = (0.0, 0);
    for (image, pose) in found.fit.problem.images.iter().zip(&found.free_poses.poses) {
        let placed = &pose.as_ref()?.in_frame;
        let stop = made.truth.stops.iter().find(|s| s.image == image.name)?;
        let expected = frame.camera(&stop.camera_from_plate.pose().inverse());
        let error = (expected.inverse() * placed.plate_from_camera).log();
        let unit = placed.covariance.diagonal().map(f64::sqrt);
        let scaled = Matrix6::from_fn(|i, k| placed.covariance[(i, k)] / unit[i] / unit[k]);
        let error = error.component_div(&unit);
        sum += error.dot(&scaled.cholesky()?.solve(&error)) / 6.0;
        count += 1;
    }
    let truth: Vec<(String, Pose)> =
        made.truth.stops.iter().map(|s| (s.image.clone(), s.camera_from_plate.pose().inverse())).collect();
    let compared = compare_poses(&found, &truth, OtherBody::Camera, "truth").ok()?;
    Some((sum / f64::from(count), compared.rms))
}

#[test]
#[ignore = "many minutes; its figures stand in reports/poses.md; WORLDS worlds a line"]
fn study_of_stand_alone_poses() {
    println!("{}", made_with());
    let worlds: u64 = std::env::var("WORLDS").map_or(20, |n| n.parse().unwrap());
    println!(
        "| markers | images | image noise px | plate | worlds | normalised error squared | mm per axis | arcmin per axis |\n|---|---|---|---|---|---|---|---|"
    );
    let small = [0.003, 0.01, 0.03, 0.1].map(|px| (48, 0, px));
    for (markers, images, noise) in small.into_iter().chain([(504, 100, 0.05)]) {
        for errors in [true, false] {
            let count = if markers == 504 { worlds.div_ceil(10) } else { worlds };
            let one = |seed: u64| {
                let images = if images == 0 { 24 + (seed % 7) as usize } else { images };
                judged(&world(markers, images, noise, errors, seed))
            };
            let all: Vec<(f64, [f64; 2])> = (1..=count).into_par_iter().filter_map(one).collect();
            let n = all.len() as f64;
            let mean = all.iter().map(|a| a.0).sum::<f64>() / n;
            let spread = (all.iter().map(|a| (a.0 - mean).powi(2)).sum::<f64>() / (n - 1.0)).sqrt();
            let rms = |k: usize| (all.iter().map(|a| a.1[k].powi(2)).sum::<f64>() / n).sqrt();
            println!(
                "| {markers} | {} | {noise} | {} | {} | {mean:.3} (+-{:.3}) | {:.4} | {:.3} |",
                if images == 0 { "24 to 30".to_owned() } else { images.to_string() },
                if errors { "off by 0.1 mm and modes" } else { "as stated" },
                all.len(),
                2.576 * spread / n.sqrt(),
                1e3 * rms(0),
                60.0 * rms(1).to_degrees()
            );
        }
    }
}
