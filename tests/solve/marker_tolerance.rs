//! How far the markers are off is, on request, a variance component beside image noise and joint noise, where the data tell it.

use crate::robots::kr6_urdf;
use robotcal::Code;
use robotcal::identify::{MarkerTolerance, Options, RobotModel, Solution, identify};
use robotcal::series::{Plate, PlateKind};
use robotcal::simulate::{WorldRequest, series};
use robotcal::study::measured;

const STATED_M: f64 = 0.1e-3;
const JOINT_NOISE_RAD: f64 = 0.05e-3;

/// Robot, camera and a plate whose markers are off by `marker_sigma_m`, where `STATED_M` is stated.
fn identified((columns, rows): (u32, u32), marker_sigma_m: f64, seed: u64) -> Solution {
    println!("seed {seed}");
    let urdf = kr6_urdf();
    let chain = robotcal::urdf::read(&urdf).unwrap().chain(None, Some("link_6")).unwrap();
    let plate = Plate::lattice(PlateKind::Points, columns, rows, 0.27 / f64::from(columns - 1), STATED_M);
    let wanted = WorldRequest {
        images: 20,
        joint_noise_rad: JOINT_NOISE_RAD,
        marker_sigma_m,
        least_markers: (columns * rows / 2) as usize,
        held_out: 1,
        seed,
        ..WorldRequest::typical(chain.clone(), plate)
    };
    let world = series(&wanted).unwrap();
    let options =
        Options { model: RobotModel::Rigid, marker_tolerance: MarkerTolerance::Estimated, ..Options::default() };
    identify(chain.clone(), &[measured(&world, &chain)], &options).unwrap()
}

#[test]
fn the_tolerance_of_the_markers_is_found_beside_image_and_joint_noise() {
    let s = identified((12, 9), 0.05e-3, 1);
    // 108 markers have 324 coordinates, of which a frame and six modes are not told: 1 / sqrt(2 * 311) = 4 %; four sigmas.
    let found = s.fit.problem.noise.marker[0] * STATED_M;
    assert!((found / 0.05e-3 - 1.0).abs() < 0.16, "markers are off by {found:e} m");
    // 120 latents, each told in part; and 4000 coordinates of images of 0.02 px, where 0.1 px is stated.
    let noise = (s.fit.problem.joint_sigma(0).iter().map(|v| v * v).sum::<f64>() / 6.0).sqrt();
    assert!((noise / JOINT_NOISE_RAD - 1.0).abs() < 0.5, "joint noise {noise:e} rad");
    let image =
        s.fit.problem.noise.pixel_factor[0] * s.fit.problem.images[0].observations[0].information[(0, 0)].powf(-0.5);
    assert!((image / 0.02 - 1.0).abs() < 0.06, "image noise {image} px");
}

#[test]
fn markers_that_are_where_they_should_be_are_found_to_be() {
    let s = identified((12, 9), 0.0, 2);
    // A marker seen in 20 images is told to 0.02 px / 1100 px * 0.5 m / sqrt(20) = 2 um in the plane and some 6 um across.
    let found = s.fit.problem.noise.marker[0] * STATED_M;
    assert!(found < 6e-6, "markers are off by {found:e} m");
}

#[test]
fn markers_within_the_tolerance_that_is_found_are_not_off() {
    let s = identified((12, 9), 1e-3, 4);
    let found = s.fit.problem.noise.marker[0] * STATED_M;
    assert!((found / 1e-3 - 1.0).abs() < 0.16, "markers are off by {found:e} m");
    assert!(!s.findings.iter().any(|f| f.code() == Code::MarkerOff), "{:?}", s.findings);
}

#[test]
fn few_markers_do_not_tell_how_far_they_are_off() {
    let s = identified((4, 4), 0.05e-3, 3);
    assert_eq!(s.fit.problem.noise.marker, [1.0]);
}
