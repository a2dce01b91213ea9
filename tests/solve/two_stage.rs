//! The second stage with the full covariance of the first is the joint fit.

use std::collections::BTreeSet;

use crate::support::small::{Dice, Request, hold, problem, series};
use nalgebra::Vector3;
use robotcal::assess::{Limits, folds, regions};
use robotcal::identify::{
    Estimator, JointNoise, Options, PoseStage, RobotModel, beside_two_stages, compare, estimate_all, fit_poses,
    identify, linear_step,
};
use robotcal::model::joint_terms::{JointTerm, Term};
use robotcal::problem::{Adjustment, Layout, Names, Problem, State};
use robotcal::series::CameraMount;
use robotcal::solve::{Covariance, Settings, Status, solve};

fn hard(state: &State) -> State {
    State { joint_errors: vec![Vec::new(); state.joint_errors.len()], ..state.clone() }
}

fn covariance(adjustment: &Adjustment) -> Covariance {
    adjustment.linear(&adjustment.linearise().unwrap()).covariance().unwrap()
}

fn solved(problem: &Problem, start: State) -> Adjustment {
    let start = Adjustment { problem: problem.clone(), state: start };
    let outcome = solve(start, &Settings::new(200, 1e-9));
    assert_eq!(outcome.status, Status::Converged);
    outcome.adjustment
}

#[test]
fn full_covariance_relinearised_at_the_hard_joint_solution_is_the_hard_joint_fit() {
    for (seed, mount) in [(71, CameraMount::Hand), (72, CameraMount::Fixed), (73, CameraMount::Hand)] {
        let mut dice = Dice::new(seed);
        let request = Request { images: 8, mount, joint_noise: 0.0, ..Request::default() };
        let (mut problem, state) = problem(&mut dice, &request);
        // A gross error keeps Huber's weights in play, a fixed column the bookkeeping.
        problem.images[2].observations[3].uv.y += 2.0;
        hold(&mut problem.layout, |n| n.ends_with("joint_2/origin.rz"));
        let joint = solved(&problem, hard(&state));
        let stage = PoseStage::linearised(&joint).unwrap();
        let (step, two_stage) = linear_step(&joint, &stage, 0.0).unwrap();
        let one_stage = covariance(&joint);
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
    let sigma = 1e-4;
    let (mut problem, state) = problem(&mut dice, &Request { images: 8, joint_noise: sigma, ..Request::default() });
    problem.noise.joint = vec![vec![sigma; 6]];
    let joint = solved(&problem, state);
    // The stage is linearised where the joint fit ended, joint noise of each stop included ...
    let stage = PoseStage::linearised(&joint).unwrap();
    // ... and the charts start where the readings alone would put the camera: a second-order difference (0.1 mrad squared).
    let (step, two_stage) = linear_step(&joint, &stage, sigma).unwrap();
    let one_stage = covariance(&joint);
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
    let start = Adjustment { problem: problem.clone(), state: start };
    for (estimator, found) in estimate_all(&start) {
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
    let stage = PoseStage::adjusted(&start).unwrap();
    assert!(fit_poses(&start, &stage, Estimator::Joint, JointNoise::Estimated).is_none());
}

#[test]
fn every_estimator_has_a_solution_where_joints_came_back_to_readings() {
    let mut dice = Dice::new(76);
    let (mut problem, mut state) = problem(&mut dice, &Request { images: 12, ..Request::default() });
    for stop in &problem.stops {
        let reading = stop.posture.as_ref().unwrap().readings[0];
        state.robot.terms.push(JointTerm { reading: 0, term: Term::local(reading), value: 0.0 });
    }
    let (mountings, placements, cameras) = (&problem.mountings, &problem.placements, &problem.cameras);
    let plates = ["plate".to_owned()];
    problem.layout =
        Layout::new(&state, &Names { mountings, placements, cameras, plates: &plates, ..Names::default() });
    assert_eq!(problem.layout.locals.len(), 12);
    problem.noise.local = vec![1e-3, 0.0, 0.0, 0.0, 0.0, 0.0];
    for (estimator, found) in estimate_all(&Adjustment { problem, state }) {
        assert!(found.is_some(), "{}", estimator.title());
    }
}

/// Images in postures of `of_posture` stops each, which share the readings of the first three joints.
fn in_postures(images: usize, of_posture: usize) -> Adjustment {
    let mut dice = Dice::new(77);
    let (mut problem, state) = problem(&mut dice, &Request { images, ..Request::default() });
    for (i, stop) in problem.stops.iter_mut().enumerate() {
        let stop = stop.posture.as_mut().unwrap();
        let posture = (i / of_posture) as f64;
        // Visited from side to side, so that neighbours in time are none in space.
        let swing = 0.3 * posture * if (i / of_posture).is_multiple_of(2) { 1.0 } else { -1.0 };
        stop.readings[..3].copy_from_slice(&[swing, 0.1 + 0.01 * posture, 0.4 + 0.01 * posture]);
    }
    Adjustment { problem, state }
}

fn sets(folds: &[Vec<usize>]) -> BTreeSet<BTreeSet<usize>> {
    folds.iter().map(|fold| fold.iter().copied().collect()).collect()
}

#[test]
fn regions_hold_whole_postures_out_and_are_not_the_folds_by_image() {
    let seen = in_postures(24, 4);
    let limits = Limits::default();
    let (by_image, by_region) = (folds(&seen.problem, &limits).unwrap(), regions(&seen, &limits).unwrap());
    assert_eq!((by_image.len(), by_region.len()), (6, 3));
    assert_ne!(sets(&by_image), sets(&by_region));
    let mut all: Vec<usize> = by_region.concat();
    all.sort_unstable();
    assert_eq!(all, (0..24).collect::<Vec<_>>());
    for posture in 0..6 {
        let first = 4 * posture;
        let holding: Vec<_> = by_region.iter().filter(|r| (first..first + 4).any(|i| r.contains(&i))).collect();
        assert_eq!(holding.len(), 1, "posture {posture} is split");
    }
    // Regions follow each other along the workspace: of the swings 0, -0.3, 0.6, -0.9, 1.2, -1.5 two neighbours each.
    let postures: BTreeSet<BTreeSet<usize>> = by_region.iter().map(|r| r.iter().map(|i| i / 4).collect()).collect();
    assert_eq!(postures, [[3, 5], [0, 1], [2, 4]].map(BTreeSet::from).into());
    let few = in_postures(20, 4);
    assert!(folds(&few.problem, &limits).is_some() && regions(&few, &limits).is_none());
}

#[test]
fn identify_and_compare_answer_the_same_question_alike_and_a_two_stage_result_stands_by_itself() {
    let mut dice = Dice::new(78);
    let (problem, truth) =
        problem(&mut dice, &Request { images: 18, lattice: (5, 4), joint_noise: 3e-4, ..Request::default() });
    let (chain, measured) = (truth.robot.chain.clone(), [series(&problem)]);
    let options = Options { model: RobotModel::Rigid, ..Options::default() };
    let joint = identify(chain.clone(), &measured, &options).unwrap();
    let beside = beside_two_stages(&joint).unwrap();
    let compared = compare(&joint, None, |_, _| ()).unwrap();
    for row in &beside.rows {
        let same = compared.rows.iter().find(|r| r.estimator == row.estimator).unwrap();
        assert_eq!(row.by_image, same.by_image, "{}", row.estimator.title());
    }
    let joint_row = beside.rows.iter().find(|r| r.estimator == Estimator::Joint).unwrap();
    assert!((joint_row.by_image.unwrap().rms_mm / joint.accuracy.calibrated.rms_mm - 1.0).abs() < 1e-9);
    for estimator in [Estimator::Blocks, Estimator::FullAndRepeatability] {
        let staged = identify(chain.clone(), &measured, &Options { estimator, ..options.clone() }).unwrap();
        assert_eq!(staged.estimator, estimator);
        // Its accuracy is the one that the joint fit's report states of it, and its robot that of the estimator.
        let row = beside.rows.iter().find(|r| r.estimator == estimator).unwrap();
        assert!((row.by_image.unwrap().rms_mm / staged.accuracy.calibrated.rms_mm - 1.0).abs() < 1e-9);
        let stage = PoseStage::adjusted(&joint.fit).unwrap();
        let found = fit_poses(&joint.fit, &stage, estimator, JointNoise::Estimated).unwrap();
        assert_eq!(found.state.robot, staged.fit.state.robot);
        for c in staged.fit.problem.layout.robot().filter(|&c| staged.fit.problem.layout.columns[c].free) {
            let (own, of_fit) = (staged.fit.covariance.sigma(c), found.covariance[(c, c)].sqrt());
            // What is not known of the size of the plate comes on top where poses count as independent.
            let same = match estimator {
                Estimator::FullAndRepeatability => (own / of_fit - 1.0).abs() < 0.3,
                _ => own >= of_fit * (1.0 - 1e-9),
            };
            assert!(own > 0.0 && same || staged.uncertainty.larger_stated, "{own} {of_fit}");
        }
        let again = beside_two_stages(&staged).unwrap();
        assert_eq!(again.rows, beside.rows);
    }
}
