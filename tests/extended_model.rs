//! Gear, harmonic and sag errors: the extended robot model against the rigid one, at positions that neither has seen.

#![allow(clippy::unwrap_used)]

use std::path::Path;

use robotcal::assess::flange_error_m;
use robotcal::geom::Pose;
use robotcal::plan::plate_design::{PlateRequest, design};
use robotcal::recipe::{Options, RobotModel, identify, measured};
use robotcal::simulate::{RobotErrors, SimulatedSeries, WorldRequest, series};
use robotcal::urdf::{Chain, read};

fn chain() -> Chain {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("robots/kuka_kr6_r900/kuka_kr6_r900.urdf");
    read(&path).unwrap().chain(Some("base_link"), Some("tool0")).unwrap()
}

fn world(errors: RobotErrors, seed: u64) -> SimulatedSeries {
    let plate = design(&PlateRequest { markers: Some(80), ..PlateRequest::default() }).unwrap().plate;
    let request = WorldRequest {
        errors,
        images: 60,
        placements: 2,
        joint_noise_rad: 0.01e-3,
        held_out: 60,
        seed,
        ..WorldRequest::typical(chain(), plate)
    };
    series(&request).unwrap()
}

/// RMS error of the flange relative to the plate at the held-out positions, m.
fn held_out_m(made: &SimulatedSeries, model: RobotModel) -> f64 {
    let options = Options { model, ..Options::default() };
    let solution = identify(chain(), &[measured(made, &chain())], &options).unwrap();
    let truth: Vec<(Vec<f64>, Pose)> = held_out(made);
    flange_error_m(&solution.state.robot, &solution.state.placements[0], &truth).unwrap()
}

fn held_out(made: &SimulatedSeries) -> Vec<(Vec<f64>, Pose)> {
    made.truth.held_out.iter().map(|h| (h.readings.clone(), h.base_from_tip.pose())).collect()
}

/// RMS over several worlds: one alone may be lucky.
fn rms(errors: RobotErrors, model: RobotModel) -> f64 {
    let seeds = [1u64, 2, 3];
    let squares: f64 = seeds.iter().map(|s| held_out_m(&world(errors, *s), model).powi(2)).sum();
    (squares / seeds.len() as f64).sqrt()
}

#[test]
fn gear_harmonic_and_sag_errors_need_the_extended_model() {
    let errors = RobotErrors { gear: 5e-4, harmonic_rad: 0.2e-3, gravity_rad: 0.4e-3, ..RobotErrors::default() };
    let (rigid, full) = (rms(errors, RobotModel::Rigid), rms(errors, RobotModel::Full));
    println!("present: rigid {:.4} mm, full {:.4} mm, {:.2} times", 1e3 * rigid, 1e3 * full, rigid / full);
    assert!(rigid > 3.0 * full, "{rigid} {full}");
}

#[test]
fn without_such_errors_the_extended_model_does_no_harm() {
    let errors = RobotErrors::default();
    let (rigid, full) = (rms(errors, RobotModel::Rigid), rms(errors, RobotModel::Full));
    println!("absent: rigid {:.4} mm, full {:.4} mm, {:+.1} %", 1e3 * rigid, 1e3 * full, 100.0 * (full / rigid - 1.0));
    assert!(full < 1.02 * rigid, "{rigid} {full}");
}
