//! Robots with and without errors beyond rigid geometry: the extended model helps where they are, and costs nothing where they are not.

use crate::robots::kr6;
use robotcal::assess::flange_error_m;
use robotcal::geom::Pose;
use robotcal::identify::{Options, RobotModel, Selection, StatedPrior, identify};
use robotcal::linalg::median;
use robotcal::model::joint_terms::TermKind;
use robotcal::model::robot::Robot;
use robotcal::problem::{FamilyKind, MeasuredSeries, OriginPrior};
use robotcal::series::{Plate, PlateKind};
use robotcal::simulate::{RobotErrors, SimulatedSeries, WorldRequest, series};
use robotcal::study::measured;

fn world(errors: RobotErrors, seed: u64) -> SimulatedSeries {
    let plate = Plate::lattice(PlateKind::Points, 8, 6, 0.03, 0.03e-3);
    let request = WorldRequest { images: 40, held_out: 60, errors, seed, ..WorldRequest::typical(kr6(), plate) };
    series(&request).unwrap()
}

/// RMS error of the flange over readings that no image was taken at, mm; and what the evidence said.
fn error_mm(world: &SimulatedSeries, seen: &MeasuredSeries, model: RobotModel) -> (f64, String) {
    let options = Options { model, ..Options::default() };
    let s = identify(kr6(), std::slice::from_ref(seen), &options).unwrap();
    let poses: Vec<(Vec<f64>, Pose)> =
        world.truth.held_out.iter().map(|h| (h.readings.clone(), h.base_from_tip.pose())).collect();
    let evidences: Vec<String> = s.evidences.iter().map(|e| format!("{:?} {:.1}", e.model, e.log_evidence)).collect();
    (1e3 * flange_error_m(&s.fit.state.robot, &s.fit.state.placements[0], &poses).unwrap(), evidences.join(", "))
}

fn ratios(errors: RobotErrors, seeds: std::ops::RangeInclusive<u64>) -> Vec<f64> {
    let of = |seed: u64| {
        let world = world(errors, seed);
        let seen = measured(&world, &kr6());
        let (rigid, _) = error_mm(&world, &seen, RobotModel::Rigid);
        let (extended, evidences) = error_mm(&world, &seen, RobotModel::Auto);
        let ratio = extended / rigid;
        println!("seed {seed}: rigid {rigid:.4} mm, extended {extended:.4} mm, ratio {ratio:.3}; {evidences}");
        ratio
    };
    seeds.map(of).collect()
}

/// Worlds of each kind; more by `SEEDS`.
fn seeds() -> u64 {
    std::env::var("SEEDS").ok().and_then(|s| s.parse().ok()).unwrap_or(3)
}

#[test]
fn terms_that_are_absent_cost_nothing() {
    let all = ratios(RobotErrors::default(), 1..=seeds());
    let mean = all.iter().map(|r| r.ln()).sum::<f64>() / all.len() as f64;
    println!("absent: geometric mean {:.4}, median {:.4}", mean.exp(), median(&all).unwrap());
    assert!(mean.exp() < 1.02, "{all:?}");
}

#[test]
fn terms_that_are_present_are_found() {
    let all = ratios(RobotErrors::full(), 1..=seeds());
    println!("present: {all:?}");
    assert!(all.iter().all(|r| *r < 1.0 / 3.0), "{all:?}");
}

/// Of a robot whose origins are off by a quarter of what robots usually are, by as much, and by three times as much.
#[test]
fn how_far_origins_are_off_is_told_by_the_robot_itself() {
    let factor = |errors: RobotErrors, selection: Selection| {
        let seen = measured(&world(errors, 3), &kr6());
        let options = Options { model: RobotModel::Rigid, selection, ..Options::default() };
        identify(kr6(), &[seen], &options).unwrap().fit.adjustment.problem
    };
    let usual = OriginPrior::default();
    let times = |f: f64| RobotErrors {
        translation_m: f * usual.translation_m,
        rotation_rad: f * usual.rotation_rad,
        ..RobotErrors::default()
    };
    for (made, low, high) in [(0.25, 0.2, 0.55), (1.0, 0.7, 1.4), (3.0, 1.8, 4.2)] {
        let found = factor(times(made), Selection::default()).twist_factor();
        println!("{made} times: {found:.3}");
        assert!((low..high).contains(&found), "{made} times as made, {found} as found");
    }
    // What is stated by the user holds.
    let stated = StatedPrior { sigma_m: Some(0.4e-3), ..StatedPrior::default() };
    let prior = ["x", "y", "z"].map(|axis| (format!("*.origin.{axis}"), stated)).into();
    let problem = factor(times(0.25), Selection { prior, ..Selection::default() });
    for c in problem.layout.twists.clone() {
        let column = &problem.layout.columns[c];
        let expected = if column.unit == "m" { 0.4e-3 } else { problem.twist_factor() * usual.rotation_rad };
        assert!((column.prior_sigma / expected - 1.0).abs() < 1e-9, "{}: {}", column.name, column.prior_sigma);
    }
}

/// Readings at which an arm whose second and third joint sag by this much under a weight at the tip, most of it stretched out, stands as without
/// sag at these.
fn read_with_sag(q: &[f64], sag_rad: f64) -> Vec<f64> {
    let robot = Robot::nominal(kr6());
    let height_m = |q: &[f64]| robot.base_from_tip(q).translation.z;
    let lever_m = |joint: usize| {
        let mut moved = q.to_vec();
        moved[joint] += 1e-4;
        (height_m(&moved) - height_m(q)) / 1e-4
    };
    // The weight pulls against what lifts it, at a lever of nearly a metre.
    let mut read = q.to_vec();
    [1, 2].into_iter().for_each(|joint| read[joint] += sag_rad * lever_m(joint));
    read
}

/// Where two joints sag the model has their gravity, whatever else it has to pay for, and states what it is off by.
#[test]
fn sag_of_the_joints_that_carry_the_arm_is_taken_for_no_gear() {
    let errors = |seed: u64| {
        let mut world = world(RobotErrors::default(), seed);
        let mut seen = measured(&world, &kr6());
        seen.stops.truncate(20);
        for readings in seen.stops.iter_mut().filter_map(|stop| stop.readings.as_mut()) {
            *readings = read_with_sag(readings, 0.5e-3);
        }
        world.truth.held_out.iter_mut().for_each(|h| h.readings = read_with_sag(&h.readings, 0.5e-3));
        let solution = identify(kr6(), &[seen], &Options::default()).unwrap();
        let poses: Vec<(Vec<f64>, Pose)> =
            world.truth.held_out.iter().map(|h| (h.readings.clone(), h.base_from_tip.pose())).collect();
        let state = &solution.fit.state;
        let found = flange_error_m(&state.robot, &state.placements[0], &poses).unwrap();
        let stated = solution.uncertainty.flange.unwrap().model_m;
        println!("seed {seed}: {:.3} mm, stated {:.3}; {:?}", 1e3 * found, 1e3 * stated, solution.evidences);
        let models: Vec<RobotModel> = solution.evidences.iter().map(|e| e.model).collect();
        assert_eq!(models, RobotModel::CHOICES);
        let has = |kind: TermKind| state.robot.terms.iter().any(|t| t.term.kind() == kind);
        assert!(has(TermKind::Gravity) && !has(TermKind::Gear) && !has(TermKind::Backlash), "seed {seed}");
        (found, stated)
    };
    let all: Vec<(f64, f64)> = (1..=seeds()).map(errors).collect();
    let squares = |of: fn(&(f64, f64)) -> f64| all.iter().map(|both| of(both).powi(2)).sum::<f64>();
    let ratio = (squares(|both| both.0) / squares(|both| both.1)).sqrt();
    assert!(ratio < 1.5, "{all:?}");
}

/// Of an arm that does not sag, of one that sags as usual, and of one that sags ten times as much: what is stated of the flange covers its error.
#[test]
fn how_much_an_arm_sags_is_told_by_the_robot_itself() {
    for (times, low, high) in [(0.0, 1.0, 1.01), (1.0, 1.0, 1.6), (10.0, 4.0, 16.0)] {
        for seed in 1..=2 {
            let errors = RobotErrors::full().with(TermKind::Gravity, times * 0.3e-3);
            let world = world(errors, seed);
            let options = Options { model: RobotModel::Full, ..Options::default() };
            let s = identify(kr6(), &[measured(&world, &kr6())], &options).unwrap();
            let factor = s.fit.problem.families.iter().find(|f| f.kind == FamilyKind::Gravity).unwrap().factor;
            let poses: Vec<(Vec<f64>, Pose)> =
                world.truth.held_out.iter().map(|h| (h.readings.clone(), h.base_from_tip.pose())).collect();
            let error_m = flange_error_m(&s.fit.state.robot, &s.fit.state.placements[0], &poses).unwrap();
            let stated_m = s.uncertainty.flange.unwrap().model_m;
            println!(
                "{times} times, seed {seed}: factor {factor:.3}, {:.4} of {:.4} mm",
                1e3 * error_m,
                1e3 * stated_m
            );
            assert!((low..high).contains(&factor), "{times} times as made, {factor} as found");
            assert!(error_m < 2.0 * stated_m, "{error_m} m, and {stated_m} are stated");
        }
    }
}
