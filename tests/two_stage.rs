//! The second stage with the full covariance of the first is the joint fit.

#![allow(clippy::unwrap_used, clippy::panic)]

mod support;

use nalgebra::Vector3;
use robotcal::model::joint_terms::{JointTerm, Term};
use robotcal::problem::{Layout, Problem, Slack, State};
use robotcal::recipe::{Estimator, JointNoise, PoseStage, estimate_all, fit_poses, linear_step};
use robotcal::series::CameraMount;
use robotcal::solve::{Settings, Status, covariance, linearise_all, solve};
use support::small::{Dice, Request, problem};

fn hard(state: &State) -> State {
    State { slack: vec![Slack::None; state.slack.len()], ..state.clone() }
}

fn solved(problem: &Problem, start: State) -> State {
    let outcome = solve(problem, start, &Settings { iterations: 200, decrement: 1e-9 });
    assert_eq!(outcome.status, Status::Converged);
    outcome.state
}

#[test]
fn full_covariance_relinearised_at_the_hard_joint_solution_is_the_hard_joint_fit() {
    for (seed, mount) in [(71, CameraMount::Hand), (72, CameraMount::Fixed), (73, CameraMount::Hand)] {
        let mut dice = Dice::new(seed);
        let request = Request { images: 8, mount, joint_noise: 0.0, ..Request::default() };
        let (mut problem, state) = problem(&mut dice, &request);
        // A gross error keeps Huber's weights in play, a fixed column the bookkeeping.
        problem.images[2].observations[3].uv.y += 2.0;
        problem.layout.set_free(false, |n| n.ends_with("joint_2/origin.rz"));
        let joint = solved(&problem, hard(&state));
        let stage = PoseStage::linearised(&problem, &joint).unwrap();
        let (step, two_stage) = linear_step(&problem, &stage, &joint, 0.0).unwrap();
        let lin = linearise_all(&problem, &joint).unwrap();
        let one_stage = covariance(&problem, &joint, &lin).unwrap();
        let offset = stage.offset.amax();
        assert!(offset > 1e-6, "the poses of the joint fit are not the free poses: {offset:e}");
        for (c, column) in problem.layout.columns.iter().enumerate().take(problem.layout.theta_len()) {
            assert!(step[c].abs() < 1e-9, "{}: step {:e}", column.name, step[c]);
            if !column.free {
                assert_eq!(step[c], 0.0);
                continue;
            }
            let sigma = one_stage.sigma(c);
            assert!(step[c].abs() < 1e-6 * sigma, "{}: step of {:e} sigma", column.name, step[c] / sigma);
            // Rounding times the condition of two different routes to the same Schur complement.
            let ratio = two_stage[(c, c)].sqrt() / sigma;
            assert!((ratio - 1.0).abs() < 1e-6, "{}: sigma ratio {ratio}", column.name);
        }
    }
}

#[test]
fn full_covariance_relinearised_at_the_joint_solution_is_the_joint_fit() {
    // The same with joint noise of known size: the latents are eliminated in another order, nothing else.
    let mut dice = Dice::new(74);
    let sigma = 3e-4;
    let (mut problem, state) = problem(&mut dice, &Request { images: 8, joint_noise: sigma, ..Request::default() });
    problem.noise.joint = vec![vec![sigma; 6]];
    let joint = solved(&problem, state);
    // The stage is linearised where the joint fit ended, joint noise of each stop included ...
    let stage = PoseStage::linearised(&problem, &joint).unwrap();
    // ... and the charts start where the readings alone would put the camera: a second-order difference (0.3 mrad squared).
    let (step, two_stage) = linear_step(&problem, &stage, &joint, sigma).unwrap();
    let lin = linearise_all(&problem, &joint).unwrap();
    let one_stage = covariance(&problem, &joint, &lin).unwrap();
    for (c, column) in problem.layout.columns.iter().enumerate().take(problem.layout.theta_len()) {
        let s = one_stage.sigma(c);
        assert!(step[c].abs() < 0.01 * s, "{}: step of {:e} sigma", column.name, step[c] / s);
        assert!((two_stage[(c, c)].sqrt() / s - 1.0).abs() < 0.01, "{}", column.name);
    }
}

#[test]
fn estimators_find_the_truth_within_their_sigma_where_their_noise_model_is_true() {
    let mut dice = Dice::new(75);
    let request = Request { images: 25, lattice: (5, 4), joint_noise: 2e-4, deviation: 5e-4, ..Request::default() };
    let (problem, truth) = problem(&mut dice, &request);
    let mut start = truth.clone();
    start.robot.twists.iter_mut().for_each(|t| t.fill(0.0));
    start.robot.terms.iter_mut().for_each(|t| t.value = 0.0);
    start.plates[0].corrections.iter_mut().for_each(|c| *c = Vector3::zeros());
    let truth_values = truth.values(&problem.layout);
    for (estimator, found) in estimate_all(&problem, &start) {
        let found = found.unwrap_or_else(|| panic!("{} has no solution", estimator.title()));
        let values = found.state.values(&problem.layout);
        // Mean squared error of robot columns over sigma; robot columns are many and correlated, so a loose bound.
        let columns = problem.layout.twists.start..problem.layout.terms.end;
        let n = columns.len() as f64;
        let mean: f64 =
            columns.map(|c| (values[c] - truth_values[c]).powi(2) / found.covariance[(c, c)]).sum::<f64>() / n;
        println!(
            "{} {}: mean squared error over sigma {mean:.2}; components {:?}",
            estimator.letter(),
            estimator.title(),
            found.components
        );
        // The joint noise that two ways of writing down the same model find; relative sigma 1 / sqrt(2 * 25 * 6) = 6 %, four of
        // them. C is no such model: what all poses share counts there in every pose anew, and takes the joint noise up.
        if matches!(estimator, Estimator::FullAndRepeatability | Estimator::Joint) {
            assert!(mean < 2.0, "{}: {mean}", estimator.title());
            let common = (found.components.iter().map(|s| s * s).sum::<f64>() / 6.0).sqrt();
            assert!((common / 2e-4).ln().abs() < 0.24, "{}: joint noise {common:e}", estimator.title());
        }
    }
    let stage = PoseStage::adjusted(&problem, &start).unwrap();
    assert!(fit_poses(&problem, &stage, &start, Estimator::Joint, JointNoise::Estimated).is_none());
}

#[test]
fn every_estimator_has_a_solution_where_joints_came_back_to_readings() {
    let mut dice = Dice::new(76);
    let (mut problem, mut state) = problem(&mut dice, &Request { images: 12, ..Request::default() });
    for image in &problem.images {
        let reading = image.stop.as_ref().unwrap().readings[0];
        state.robot.terms.push(JointTerm { reading: 0, term: Term::local(reading), value: 0.0 });
    }
    let (mountings, placements, cameras) = (&problem.mountings, &problem.placements, &problem.cameras);
    problem.layout = Layout::new(&state, mountings, placements, cameras, &["plate".to_owned()]);
    assert_eq!(problem.layout.locals.len(), 12);
    problem.noise.local = vec![1e-3, 0.0, 0.0, 0.0, 0.0, 0.0];
    for (estimator, found) in estimate_all(&problem, &state) {
        assert!(found.is_some(), "{}", estimator.title());
    }
}
