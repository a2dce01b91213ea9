//! What is held out is predicted by fits that have converged.

use crate::support::small::{Dice, Request, problem, series};
use robotcal::assess::{Limits, hold_out};
use robotcal::identify::{Options, identify};
use robotcal::linalg::SymmetricFactor;
use robotcal::solve::{
    ComponentOptions, Elimination, LinearisedAdjustment, Parts, Settings, Status, System, estimate_components,
    estimate_components_from_above, solve,
};

#[test]
fn held_out_errors_are_those_of_fits_to_the_last_digit() {
    let mut dice = Dice::new(81);
    let (problem, truth) =
        problem(&mut dice, &Request { images: 18, lattice: (5, 4), joint_noise: 3e-4, ..Request::default() });
    let solution = identify(truth.robot.chain, &[series(&problem)], &Options::default()).unwrap();
    let to_the_end = |left: LinearisedAdjustment| {
        let outcome = solve(left.adjustment, &Settings::new(300, 1e-7));
        assert_eq!(outcome.status, Status::Converged);
        Some(outcome.adjustment.state)
    };
    let (honest, _) = hold_out(solution.fit.linear(), &to_the_end, &Limits::default()).unwrap();
    for (stated, honest) in
        [(solution.accuracy.calibrated, honest.calibrated), (solution.accuracy.nominal, honest.nominal)]
    {
        for (stated, honest) in [(stated.rms_mm, honest.rms_mm), (stated.rms_px, honest.rms_px)] {
            // The last steps were below a tenth of a standard deviation, of which a prediction has a few in all.
            assert!((stated / honest - 1.0).abs() < 0.02, "{stated} {honest}");
        }
    }
}

#[test]
fn what_is_left_of_a_linearisation_is_the_linearisation_of_what_is_left() {
    let mut dice = Dice::new(82);
    let (problem, truth) = problem(&mut dice, &Request { images: 12, lattice: (5, 4), ..Request::default() });
    let solution = identify(truth.robot.chain, &[series(&problem)], &Options::default()).unwrap();
    let left = solution.fit.linear().without_images(&[3, 7, 8]);
    let again = LinearisedAdjustment::of(left.adjustment.clone()).unwrap();
    assert_eq!(left.linearised.images, again.linearised.images);
    assert_eq!(left.linearised.stops, again.linearised.stops);
    assert!((left.linearised.cost / again.linearised.cost - 1.0).abs() < 1e-12);
    let [step, of_again] = [left, again].map(|at| at.settled(&Settings::new(30, 1e-6)));
    assert_eq!(step.robot.twists, of_again.robot.twists);
}

/// Images that are in no set belong to what is left, too.
#[test]
fn the_system_without_some_images_is_the_sum_of_what_the_others_tell() {
    let mut dice = Dice::new(84);
    let (problem, truth) = problem(&mut dice, &Request { images: 30, lattice: (5, 4), ..Request::default() });
    let solution = identify(truth.robot.chain, &[series(&problem)], &Options::default()).unwrap();
    let whole = solution.fit.linear();
    let sets: Vec<Vec<usize>> = (0..4).map(|k| whole.lin.images.iter().copied().skip(k).step_by(5).collect()).collect();
    let parts = Parts::of(whole, &sets).unwrap();
    for (k, set) in sets.iter().enumerate() {
        let left = whole.without_images(set);
        let (linear, mut steps) = (left.linear(), Vec::new());
        let systems = [parts.without(k, linear).unwrap(), System::with(Elimination::Stops, linear, 0.0)];
        let sigma: Vec<f64> = systems[1].information.diagonal().iter().map(|d| d.sqrt().recip()).collect();
        for system in &systems {
            let x = SymmetricFactor::new(&system.information).unwrap().solve(&system.rhs);
            steps.push(system.step(linear, &x));
        }
        let [sum, own] = &systems;
        for (i, j) in (0..sigma.len()).flat_map(|i| (0..sigma.len()).map(move |j| (i, j))) {
            let off = (sum.information[(i, j)] - own.information[(i, j)]) * sigma[i] * sigma[j];
            assert!(off.abs() < 1e-9, "{k}: {i} {j} {off:e}");
        }
        let [a, b] = [&steps[0], &steps[1]];
        let latents =
            a.joint_errors.iter().chain(&a.ties).flatten().zip(b.joint_errors.iter().chain(&b.ties).flatten());
        let dense = a.dense.iter().zip(b.dense.iter()).zip(&sigma).map(|((a, b), sigma)| (a - b) / sigma);
        assert!(latents.clone().count() >= 6 * linear.lin.stops.len());
        assert!(latents.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max) < 1e-11);
        assert!(dense.map(f64::abs).fold(0.0, f64::max) < 1e-6);
    }
}

/// Stops of which some tell first where the sizes will be: the same end as from all at once.
#[test]
fn sizes_found_by_way_of_some_stops_are_those_of_all() {
    let mut dice = Dice::new(83);
    let (problem, truth) =
        problem(&mut dice, &Request { images: 450, lattice: (5, 4), joint_noise: 4e-4, ..Request::default() });
    let fit = identify(truth.robot.chain, &[series(&problem)], &Options::default()).unwrap().fit;
    let mut from_above = fit.adjustment.clone();
    from_above.problem.noise.start_at(3e-3);
    let options = ComponentOptions::default();
    let [by_some, by_all] = [estimate_components_from_above, estimate_components].map(|find| {
        let outcome = find(from_above.clone(), &options);
        assert_eq!(outcome.status, Status::Converged);
        outcome.adjustment.problem.noise.joint
    });
    let by_some = by_some.iter().flatten();
    for (by_some, by_all) in by_some.zip(by_all.iter().flatten()) {
        // Both end within a hundredth of the fixed point in a round, of which what is left in all rounds is a few times as much.
        assert!((by_some / by_all - 1.0).abs() < 0.03, "{by_some} {by_all}");
        assert!((by_all / 4e-4 - 1.0).abs() < 0.25, "{by_all}");
    }
}

/// The covariance of the robot alone is that part of the covariance of all, whether the system is a sum of parts or not.
#[test]
fn the_first_columns_have_the_covariance_that_they_have_among_all() {
    let (problem, truth) = problem(&mut Dice::new(85), &Request { images: 30, lattice: (5, 4), ..Request::default() });
    let solution = identify(truth.robot.chain, &[series(&problem)], &Options::default()).unwrap();
    let whole = solution.fit.linear();
    let sets: Vec<Vec<usize>> = (0..3).map(|k| whole.lin.images.iter().copied().skip(k).step_by(4).collect()).collect();
    let theta = whole.adjustment.problem.layout.theta_len();
    let parts = Parts::of(whole, &sets).unwrap();
    for (parts, k) in [Some(&parts), None].into_iter().flat_map(|parts| (0..sets.len()).map(move |k| (parts, k))) {
        let left = whole.without_set(&sets, k, parts);
        let (of_first, of_all) = (left.covariance_of_first(theta).unwrap(), left.linear().covariance().unwrap());
        for (i, j) in (0..theta).flat_map(|i| (0..theta).map(move |j| (i, j))) {
            let off = (of_first[(i, j)] - of_all.reduced[(i, j)]).abs();
            // Rounding at a condition of 1e8 or so.
            assert!(off <= 1e-6 * of_all.sigma(i) * of_all.sigma(j), "{k}: {i} {j} {off:e}");
        }
    }
}
