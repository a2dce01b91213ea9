//! Cameras, plates and poses from images alone: the same as those of an identification, and true.

use std::path::Path;

use crate::outputs_support::robot;
use crate::outputs_support::truth_frame::{Alignment, least_eigenvalue};
use nalgebra::Vector3;
use robotcal::assess::Limits;
use robotcal::identify::{Options, RobotModel, identify, stand_alone};
use robotcal::output::restore::measured_series;
use robotcal::output::solution_json;
use robotcal::output::stand_alone_files::{StandAloneContext, stand_alone_files};
use robotcal::problem::{LensChoice, MeasuredSeries};
use robotcal::simulate::truth::Truth;

fn shipped() -> Vec<MeasuredSeries> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let bytes = std::fs::read(root.join("reports/kr6_small/solution.json")).unwrap();
    let mut series = measured_series(&solution_json::read(&bytes).unwrap()).unwrap();
    series.iter_mut().for_each(|s| s.lens_choice = LensChoice::Settled);
    series
}

#[test]
fn poses_without_a_robot_are_those_of_an_identification() {
    let series = shipped();
    let options = Options { model: RobotModel::Rigid, ..Options::default() };
    let identified = identify(robot().chain(None, None).unwrap(), &series, &options).unwrap().free_poses;
    let alone = stand_alone(&series, &Limits::default()).unwrap().free_poses;
    assert_eq!(alone.poses.len(), 24);
    for (a, b) in alone.poses.iter().zip(&identified.poses) {
        let (a, b) = (&a.as_ref().unwrap().in_frame, &b.as_ref().unwrap().in_frame);
        let (angle, distance) = a.plate_from_camera.distance(&b.plate_from_camera);
        assert!(angle < 1e-9 && distance < 1e-9, "{angle:e} {distance:e}");
        let off = (a.covariance - b.covariance).amax() / b.covariance.amax();
        assert!(off < 1e-6, "{off:e}");
    }
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
    let context = StandAloneContext {
        series: vec!["kr6_small".to_owned()],
        inputs: Vec::new(),
        command: String::new(),
        notices: Vec::new(),
    };
    let files = stand_alone_files(&found, &context).unwrap();
    let names: Vec<&str> = files.keys().map(String::as_str).collect();
    assert_eq!(names, ["camera.yaml", "plate.csv", "plate.toml", "poses.csv", "poses.json"]);
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
