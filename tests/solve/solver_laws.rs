//! What must hold of any solver of this problem, whatever it eliminates first.

#![allow(clippy::unwrap_used, clippy::panic)]

use crate::support::dense::{Dense, Unknown};
use crate::support::small::{Dice, Part, Request, problem, series};
use nalgebra::{DMatrix, DVector, Vector3};
use robotcal::assess::Limits;
use robotcal::geom::{Pose, exp_so3};
use robotcal::identify::{JointNoise, Options, RobotModel, Solution, adjust_free_poses, identify};
use robotcal::linalg::SymmetricFactor;
use robotcal::model::joint_terms::Term;
use robotcal::problem::{Adjustment, ImageRejection, ObservationRejection, Problem, State, Step, Tie};
use robotcal::series::CameraMount;
use robotcal::solve::{
    ComponentOptions, Covariance, Elimination, Fit, JOINT_NOISE_FLOOR, NoiseUncertainty, Outcome, Settings, Status,
    System, estimate_components, noise_information, solve,
};

/// Iterates to where rounding ends it.
const TIGHT: Settings = Settings { iterations: 200, decrement: 1e-9 };

fn converged(problem: &Problem, start: State, settings: &Settings) -> Outcome {
    let outcome = solve(Adjustment { problem: problem.clone(), state: start }, settings);
    assert_eq!(outcome.status, Status::Converged);
    outcome
}

fn covariance(outcome: &Outcome) -> Covariance {
    outcome.linear().unwrap().covariance().unwrap()
}

/// A marker that no image shows.
const UNSEEN: usize = 7;

/// Joint noise, exact readings and a free pose; rejected observations, an unseen marker and gross errors; fixed columns.
fn awkward(mount: CameraMount) -> (Problem, State) {
    let mut dice = Dice::new(11);
    let terms = vec![Term::Offset, Term::Gear, Term::Gravity(0)];
    let (mut problem, mut state) = problem(&mut dice, &Request { terms, mount, images: 7, ..Request::default() });
    state = free_poses(&problem, &state, |i| i == 5);
    state.joint_errors[4] = Vec::new();
    problem.stops[5].posture = None;
    problem.images[6].rejected = Some(ImageRejection::Excluded);
    for image in &mut problem.images {
        image.observations[UNSEEN].rejected = Some(ObservationRejection::Excluded);
    }
    problem.images[1].observations[2].uv.x += 3.0;
    problem.images[2].observations[3].rejected = Some(ObservationRejection::Excluded);
    problem.plates[0].markers[4].sigma_m = 3e-5;
    problem.layout.set_free(false, |name| name.ends_with("joint_2/origin.rx") || name == "camera/front/lens.k3");
    (problem, state)
}

/// A step away from the solution, so that the right-hand side is not nearly zero.
fn shaken(problem: &Problem, state: &State) -> State {
    let mut dice = Dice::new(12);
    let prior = |s: f64| if s.is_finite() { s } else { 1e-3 };
    let step = Step {
        dense: DVector::from_iterator(
            problem.layout.len(),
            problem.layout.columns.iter().map(|c| if c.free { dice.normal(0.3 * prior(c.prior_sigma)) } else { 0.0 }),
        ),
        joint_errors: state.joint_errors.iter().map(|s| vec![3e-4; s.len()]).collect(),
        ties: state.ties.iter().map(|t| vec![3e-4; t.len()]).collect(),
        markers: state.plates.iter().map(|p| vec![Vector3::new(1e-5, -2e-5, 3e-5); p.nominal.len()]).collect(),
    };
    state.moved(&problem.layout, &step)
}

/// What is compared is known to about rounding times condition, in units of sigma; a factor for the length of the sums.
fn tolerance(condition: f64) -> f64 {
    assert!(condition < 1e10, "test problem too badly conditioned: {condition:e}");
    100.0 * f64::EPSILON * condition
}

#[test]
fn the_reduced_system_equals_the_dense_normal_equations() {
    for mount in [CameraMount::Hand, CameraMount::Fixed] {
        check_against_dense(awkward(mount));
    }
}

#[test]
fn the_images_of_a_stop_have_its_joint_errors_in_common() {
    for mount in [CameraMount::Hand, CameraMount::Fixed] {
        let mut dice = Dice::new(14);
        let request = Request { mount, images: 12, images_a_stop: 2, ..Request::default() };
        let (mut problem, mut state) = problem(&mut dice, &request);
        for image in &mut problem.images {
            image.observations[UNSEEN].rejected = Some(ObservationRejection::Excluded);
        }
        // One camera of a stop is left out, one is held by nothing, and plates seem to be tilted.
        problem.images[4].rejected = Some(ImageRejection::Excluded);
        state = free_poses(&problem, &state, |i| i == 7);
        problem.noise.tilt = vec![2e-4];
        for i in [0, 1, 9] {
            state.ties[i] = Tie::Tilted([1e-4, -2e-4]);
        }
        check_against_dense((problem, state));
    }
}

/// Step and covariance at a state near that one, by both eliminations.
fn check_against_dense((problem, state): (Problem, State)) {
    let state = shaken(&problem, &state);
    let adjustment = Adjustment { problem, state };
    let dense = Dense::new(&adjustment);
    let (cov, x, condition) = dense.solve();
    let bound = tolerance(condition);
    for which in [Elimination::Markers, Elimination::Stops] {
        println!("{which:?}");
        check_step(which, &adjustment, &dense, (&cov, &x), bound);
        check_covariance(which, &adjustment, &dense, &cov, bound);
    }
}

/// With free camera poses of some images, where their readings put them.
fn free_poses(problem: &Problem, state: &State, which: impl Fn(usize) -> bool) -> State {
    let given = Adjustment { problem: problem.clone(), state: state.clone() };
    let mut free = state.clone();
    for i in (0..problem.images.len()).filter(|&i| which(i)) {
        free.ties[i] = Tie::Free(given.camera_from_plate(i).unwrap());
        // A stop whose images are all free has nothing latent of its own.
        if problem.images.iter().enumerate().all(|(k, image)| image.stop != problem.images[i].stop || which(k)) {
            free.joint_errors[problem.images[i].stop] = Vec::new();
        }
    }
    free
}

/// A part of what is latent at a stop in a step.
fn latent_step<'a>(step: &'a mut Step, adjustment: &Adjustment, stop: usize, k: usize) -> &'a mut f64 {
    if k < step.joint_errors[stop].len() {
        return &mut step.joint_errors[stop][k];
    }
    let mut left = k - step.joint_errors[stop].len();
    for (i, _) in adjustment.problem.used().filter(|(_, image)| image.stop == stop) {
        if left < step.ties[i].len() {
            return &mut step.ties[i][left];
        }
        left -= step.ties[i].len();
    }
    panic!("{k} is not latent at stop {stop}")
}

fn check_step(
    which: Elimination,
    adjustment: &Adjustment,
    dense: &Dense,
    (cov, x): (&DMatrix<f64>, &DVector<f64>),
    bound: f64,
) {
    let lin = adjustment.linearise().unwrap();
    let system = System::with(which, adjustment.linear(&lin), 0.0);
    let reduced = SymmetricFactor::new(&system.information).unwrap().solve(&system.rhs);
    let mut step = system.step(adjustment.linear(&lin), &reduced);
    for (at, u) in dense.unknowns.iter().enumerate() {
        let got = match *u {
            Unknown::Column(c) => step.dense[c],
            Unknown::Latent(stop, k) => *latent_step(&mut step, adjustment, stop, k),
            // An unseen marker gets no step, though its prior asks for one: nothing depends on it.
            Unknown::Marker(UNSEEN, k) => {
                assert_eq!(step.markers[0][UNSEEN][k], 0.0);
                continue;
            }
            Unknown::Marker(m, k) => step.markers[0][m][k],
        };
        let off = (got - x[at]).abs() / cov[(at, at)].sqrt();
        assert!(off < bound * x.len() as f64, "{u:?}: {got:e} for {:e}, off by {off:e} sigma", x[at]);
    }
}

fn check_covariance(which: Elimination, adjustment: &Adjustment, dense: &Dense, truth: &DMatrix<f64>, bound: f64) {
    let problem = &adjustment.problem;
    let lin = adjustment.linearise().unwrap();
    let library = adjustment.linear(&lin).covariance_by(which).unwrap();
    let index = |u: &Unknown| match *u {
        Unknown::Column(c) => Some(c),
        Unknown::Latent(stop, k) => {
            let position = lin.stops.iter().position(|(used, _)| *used == stop).unwrap();
            library.system.latent_start.get(position).map(|start| start + k)
        }
        Unknown::Marker(..) => None,
    };
    let mut compared = 0;
    for (a, ua) in dense.unknowns.iter().enumerate() {
        for (b, ub) in dense.unknowns.iter().enumerate() {
            let (Some(i), Some(j)) = (index(ua), index(ub)) else { continue };
            let unit = (truth[(a, a)] * truth[(b, b)]).sqrt();
            let off = (library.reduced[(i, j)] - truth[(a, b)]).abs() / unit;
            assert!(off < bound, "{ua:?} with {ub:?}: {off:e}");
            compared += 1;
        }
    }
    assert!(compared > 3000, "{compared}");
    for (c, column) in problem.layout.columns.iter().enumerate().filter(|(_, c)| !c.free) {
        assert_eq!(library.sigma(c), 0.0, "{}", column.name);
    }
    for stop in adjustment.linear(&lin).stops().filter(|stop| stop.unknowns() > 0) {
        let (i, n) = (stop.index, stop.unknowns());
        let at = dense.find(Unknown::Latent(i, 0)).unwrap();
        let expected = truth.view((at, at), (n, n));
        let got = library.latents(&stop);
        for (a, b) in (0..n).flat_map(|a| (0..n).map(move |b| (a, b))) {
            let unit = (expected[(a, a)] * expected[(b, b)]).sqrt();
            assert!((got[(a, b)] - expected[(a, b)]).abs() < bound * unit, "latents of stop {i}\n{got}{expected}");
        }
    }
    let markers = &library.markers()[0];
    for (m, covariance) in markers.iter().enumerate() {
        let Some(covariance) = covariance else {
            assert_eq!(m, UNSEEN, "a marker that was seen has no covariance");
            continue;
        };
        let at = dense.find(Unknown::Marker(m, 0)).unwrap();
        let expected = truth.fixed_view::<3, 3>(at, at);
        let off = (covariance - expected).amax() / expected.diagonal().max();
        assert!(off < bound, "marker {m}: {off:e}\n{covariance}{expected}");
    }
}

#[test]
fn the_right_hand_side_is_the_slope_of_the_cost() {
    let (problem, state) = awkward(CameraMount::Hand);
    let state = shaken(&problem, &state);
    let adjustment = Adjustment { problem, state };
    let dense = Dense::new(&adjustment);
    let Adjustment { problem, state } = &adjustment;
    let (cov, ..) = dense.solve();
    let mut dice = Dice::new(13);
    for _ in 0..10 {
        let mut step = Step {
            dense: DVector::zeros(problem.layout.len()),
            joint_errors: state.joint_errors.iter().map(|s| vec![0.0; s.len()]).collect(),
            ties: state.ties.iter().map(|t| vec![0.0; t.len()]).collect(),
            markers: vec![vec![Vector3::zeros(); problem.plates[0].markers.len()]],
        };
        let mut slope = 0.0;
        for (at, u) in dense.unknowns.iter().enumerate() {
            // Conditional sigmas: a step of one in every coordinate raises the cost by about one each.
            let d = dice.normal(1.0) / dense.information[(at, at)].sqrt();
            slope -= d * dense.rhs[at];
            match *u {
                Unknown::Column(c) => step.dense[c] = d,
                Unknown::Latent(stop, k) => *latent_step(&mut step, &adjustment, stop, k) = d,
                Unknown::Marker(m, k) => step.markers[0][m][k] = d,
            }
        }
        let cost = |h: f64| {
            let scaled = Step {
                dense: &step.dense * h,
                joint_errors: step.joint_errors.iter().map(|s| s.iter().map(|x| x * h).collect()).collect(),
                ties: step.ties.iter().map(|t| t.iter().map(|x| x * h).collect()).collect(),
                markers: step.markers.iter().map(|p| p.iter().map(|x| x * h).collect()).collect(),
            };
            Adjustment { problem: problem.clone(), state: state.moved(&problem.layout, &scaled) }
                .linearise()
                .unwrap()
                .cost
        };
        // The cost is quadratic but for curvature of relative size 1e-3 and Huber's kinks: central differences at h are right
        // to h^2 and rounding of the cost over h.
        let h = 1e-3;
        let numeric = (cost(h) - cost(-h)) / (2.0 * h);
        let unit = slope.abs().max((cov.nrows() as f64).sqrt());
        assert!((numeric - slope).abs() < 1e-3 * unit, "{numeric} {slope}");
    }
}

/// Poses of all images, robot and camera of two outcomes, in units of sigma of the first.
fn assert_same_solution(a: &Outcome, b: &Outcome, names: impl Fn(&str) -> bool, bound: f64) {
    let problem = &a.adjustment.problem;
    let cov = covariance(a);
    let [va, vb] = [a, b].map(|o| o.adjustment.state.values(&problem.layout));
    let mut compared = 0;
    for (c, column) in problem.layout.columns.iter().enumerate().filter(|(_, c)| names(&c.name)) {
        let sigma = cov.sigma(c);
        if va[c] == vb[c] {
            continue;
        }
        let off = (va[c] - vb[c]).abs() / sigma;
        assert!(off < bound, "{}: {:e} and {:e}, {off:e} sigma", column.name, va[c], vb[c]);
        compared += 1;
    }
    assert!(compared > 0, "nothing to compare");
}

fn cost(outcome: &Outcome) -> f64 {
    outcome.linearised.as_ref().unwrap().cost
}

/// Two solutions of the same least-squares problem whose Newton decrement is 1e-9 differ by that and by rounding times the
/// condition of the problem (about 1e8), in sigma.
const SAME: f64 = 1e-6;

#[test]
fn another_base_frame_changes_nothing() {
    let mut dice = Dice::new(21);
    let terms = vec![Term::Offset, Term::Gear];
    let (problem, state) = problem(&mut dice, &Request { terms, ..Request::default() });
    let first = converged(&problem, state.clone(), &TIGHT);
    let new_from_old = dice.pose(2.0, 3.0);
    let mut moved = state;
    moved.robot.chain.joints[0].origin = new_from_old * moved.robot.chain.joints[0].origin;
    moved.placements.iter_mut().for_each(|p| *p = new_from_old * *p);
    let second = converged(&problem, moved, &TIGHT);
    assert!((cost(&first) - cost(&second)).abs() < 1e-9 * cost(&first));
    assert_same_solution(&first, &second, |_| true, SAME);
    for (i, image) in problem.used() {
        let [a, b] = [&first, &second].map(|o| o.adjustment.camera_from_plate(i).unwrap());
        let (angle, distance) = a.distance(&b);
        assert!(angle < 1e-9 && distance < 1e-9, "{}: {angle:e} rad {distance:e} m", image.name);
    }
    let (a, b) = (covariance(&first), covariance(&second));
    for c in problem.layout.twists.start..problem.layout.terms.end {
        assert!((a.sigma(c) / b.sigma(c) - 1.0).abs() < 1e-6, "{}", problem.layout.columns[c].name);
    }
}

#[test]
fn another_plate_frame_changes_nothing() {
    let mut dice = Dice::new(22);
    let (mut problem, state) = problem(&mut dice, &Request::default());
    // Modes are about the origin of the plate and would mean something else.
    problem.layout.set_free(false, |n| n.starts_with("plate_shape"));
    let mut start = state;
    start.plates[0].modes = [0.0; 6];
    let first = converged(&problem, start.clone(), &TIGHT);
    let new_from_old = Pose::new(exp_so3(&Vector3::new(0.0, 0.0, 1.1)), Vector3::new(0.05, -0.2, 0.01));
    for x in &mut start.plates[0].nominal {
        *x = new_from_old.transform(x);
    }
    start.plates[0].corrections.iter_mut().for_each(|c| *c = new_from_old.rotation * *c);
    start.placements.iter_mut().for_each(|p| *p = *p * new_from_old.inverse());
    for tie in &mut start.ties {
        if let Tie::Free(p) = tie {
            *p = *p * new_from_old.inverse();
        }
    }
    let second = converged(&problem, start, &TIGHT);
    assert!((cost(&first) - cost(&second)).abs() < 1e-9 * cost(&first));
    assert_same_solution(&first, &second, |n| !n.starts_with("plate"), SAME);
}

/// Largest difference of the camera columns in sigma, and of log sigma.
fn camera_difference(a: &Outcome, b: &Outcome) -> (f64, f64) {
    let layout = &a.adjustment.problem.layout;
    let (ca, cb) = (covariance(a), covariance(b));
    let [va, vb] = [a, b].map(|o| o.adjustment.state.values(layout));
    layout.cameras[0].clone().fold((0.0, 0.0), |(value, sigma), c| {
        let off = (va[c] - vb[c]).abs() / ca.sigma(c);
        (f64::max(value, off), f64::max(sigma, (ca.sigma(c) / cb.sigma(c)).ln().abs()))
    })
}

#[test]
fn large_joint_noise_tends_to_the_free_poses() {
    let mut dice = Dice::new(32);
    // A gantry with a wrist has no singular posture: joints and camera pose are of a size.
    let parts = [[Part::Prismatic; 3], [Part::Revolute; 3]].concat();
    let (mut problem, state) = problem(&mut dice, &Request { parts, ..Request::default() });
    // The valley along which joints trade against twists is long and curved: many steps.
    let settings = Settings { iterations: 1000, decrement: 1e-5 };
    let free = converged(&problem, free_poses(&problem, &state, |_| true), &settings);
    let differences = [0.1, 1.0].map(|sigma| {
        problem.noise.joint = vec![vec![sigma; 6]];
        camera_difference(&free, &converged(&problem, state.clone(), &settings))
    });
    println!("{differences:?}");
    // The latent joint errors pull with (sigma of the free pose / joint noise)^2: a hundred times less for ten times the noise, of which a
    // factor of five is granted to curvature (the images of one plate share their error in depth, some centimetres).
    let [(value, sigma), (less, least)] = differences;
    assert!(value < 0.1 && less < value / 20.0, "{differences:?}");
    assert!(sigma < 0.1 && least < sigma / 20.0, "{differences:?}");
}

#[test]
fn vanishing_joint_noise_tends_to_the_hard_fit() {
    let mut dice = Dice::new(32);
    let (mut problem, state) = problem(&mut dice, &Request { joint_noise: 0.0, ..Request::default() });
    problem.noise.joint = vec![vec![1e-9; 6]];
    let soft = converged(&problem, state.clone(), &TIGHT);
    let exact = State { joint_errors: vec![Vec::new(); problem.stops.len()], ..state };
    let hard = converged(&problem, exact, &TIGHT);
    // A pixel noise of 0.1 px over ten markers is some 1e-5 rad: (1e-9 / 1e-5)^2 of a sigma, and rounding at a condition of 1e10.
    assert_same_solution(&hard, &soft, |_| true, 1e-4);
    assert!((cost(&hard) - cost(&soft)).abs() < 1e-6 * cost(&hard));
}

#[test]
fn poses_mode_is_the_free_pose_adjustment() {
    let mut dice = Dice::new(33);
    let (problem, state) = problem(&mut dice, &Request { images: 8, lattice: (5, 4), ..Request::default() });
    // From nothing, with rejection and variance components ...
    let mut nothing = state.clone();
    nothing.plates[0].modes = [0.0; 6];
    nothing.plates[0].corrections.iter_mut().for_each(|c| *c = Vector3::zeros());
    let nothing = Adjustment { problem: problem.clone(), state: nothing };
    let (Adjustment { problem, .. }, found, _) = adjust_free_poses(nothing, &[None], &Limits::default()).unwrap();
    // ... and with the same weights from the truth, robot present but tied to nothing.
    let mode = converged(&problem, free_poses(&problem, &state, |_| true), &TIGHT);
    let cov = covariance(&mode);
    // The fit stops when no unknown moves by more than 1e-3 of its sigma.
    let mut by_free_poses = mode.clone();
    by_free_poses.adjustment.state = found.state.clone();
    assert_same_solution(&mode, &by_free_poses, |n| n.starts_with("camera"), 2e-3);
    for (stop, (i, image)) in mode.linear().unwrap().stops().zip(problem.used()) {
        let pose = found.poses[i].as_ref().unwrap();
        let direct = mode.adjustment.camera_from_plate(i).unwrap();
        let off = (direct.inverse() * pose.camera_from_plate).log();
        let c = cov.latents(&stop);
        for a in 0..6 {
            assert!(off[a].abs() < 2e-3 * c[(a, a)].sqrt(), "{}: {off}", image.name);
            let ratio = pose.covariance[(a, a)] / c[(a, a)];
            assert!((ratio - 1.0).abs() < 1e-3, "{}: variance ratio {ratio}", image.name);
        }
    }
    // A robot that is tied to nothing stays where its priors hold it.
    for c in problem.layout.twists.start..problem.layout.terms.end {
        let prior = problem.layout.columns[c].prior_sigma;
        assert!((cov.sigma(c) / prior - 1.0).abs() < 1e-9, "{}", problem.layout.columns[c].name);
    }
}

/// Redundancy of the latents of every reading at a linearisation, for other sizes of the joint noise.
fn redundancies(outcome: &Outcome, sigma: &[f64]) -> Vec<f64> {
    let mut adjustment = outcome.adjustment.clone();
    adjustment.problem.noise.joint = vec![sigma.to_vec()];
    let lin = outcome.linearised.as_ref().unwrap();
    let cov = adjustment.linear(lin).covariance().unwrap();
    let latents: Vec<_> = adjustment.linear(lin).stops().map(|stop| cov.latents(&stop)).collect();
    let of = |c: &DMatrix<f64>, r: usize| 1.0 - c[(r, r)] / sigma[r].powi(2);
    (0..sigma.len()).map(|r| latents.iter().map(|c| of(c, r)).sum()).collect()
}

#[test]
fn the_information_on_the_joint_noise_is_the_slope_of_the_redundancies() {
    // rho_b = tr(P V_b) has the slope d rho_b / d ln v_a = delta_ab rho_b - tr(P V_a P V_b) = delta_ab rho_b - 2 F_ab.
    let mut dice = Dice::new(34);
    let (mut problem, state) = problem(&mut dice, &Request { images: 12, lattice: (5, 4), ..Request::default() });
    let sigma = [2e-4, 5e-5, 1e-4, 3e-4, 1e-5, 8e-5];
    problem.noise.joint = vec![sigma.to_vec()];
    let outcome = converged(&problem, state, &TIGHT);
    let at = redundancies(&outcome, &sigma);
    let h: f64 = 1e-4;
    let shifted = |a: usize, by: f64| {
        let mut moved = sigma;
        moved[a] *= (0.5 * by).exp();
        redundancies(&outcome, &moved)
    };
    let slopes: Vec<(Vec<f64>, Vec<f64>)> = (0..6).map(|a| (shifted(a, h), shifted(a, -h))).collect();
    let information = nalgebra::Matrix6::from_fn(|a, b| {
        let slope = (slopes[a].0[b] - slopes[a].1[b]) / (2.0 * h);
        // Joints are drawn together with the weight of five observations.
        0.5 * (f64::from(a == b) * at[b] - slope) + 2.5 * (f64::from(a == b) - 1.0 / 6.0)
    });
    let told = noise_information(&outcome.fit().unwrap()).unwrap();
    let expected = information.try_inverse().unwrap();
    for readings in [vec![0], vec![1], vec![4], vec![0, 3], vec![0, 1, 2, 3, 4, 5]] {
        let v = nalgebra::Vector6::from_fn(|r, _| {
            if readings.contains(&r) { sigma[r].powi(2) / readings.len() as f64 } else { 0.0 }
        });
        let spread = told.mean_variance(&[0], &readings);
        let ratio = spread.sigma / (expected * v).dot(&v).sqrt();
        // Central differences with h = 1e-4 of redundancies good to some 1e-9.
        assert!((ratio - 1.0).abs() < 1e-4, "{readings:?}: {ratio}");
        assert!((spread.variance / v.sum() - 1.0).abs() < 1e-12);
    }
}

#[test]
fn what_the_uncertainty_of_the_joint_noise_adds_is_the_curvature_of_the_covariance() {
    // C + sum_ab W_ab (C_a C^-1 C_b - C_ab), with the derivatives of C by the variances and the scatter W of those.
    let mut dice = Dice::new(35);
    let (mut problem, state) = problem(&mut dice, &Request { images: 12, lattice: (5, 4), ..Request::default() });
    let sigma = [2e-4, 5e-5, 1e-4, 3e-4, 2e-5, 8e-5];
    problem.noise.joint = vec![sigma.to_vec()];
    let outcome = converged(&problem, state, &TIGHT);
    let fit = outcome.fit().unwrap();
    let told = noise_information(&fit).unwrap();
    let cov = &fit.covariance;
    let variance = |readings: &[usize]| told.mean_variance(&[0], readings).sigma.powi(2);
    let w = nalgebra::Matrix6::from_fn(|a, b| match a == b {
        true => variance(&[a]),
        false => 0.5 * (4.0 * variance(&[a, b]) - variance(&[a]) - variance(&[b])),
    });
    // What is found scatters less where joints are drawn together with the weight of five observations.
    let drawn =
        nalgebra::Matrix6::from_fn(|a, b| 2.5 * (f64::from(a == b) - 1.0 / 6.0) / (sigma[a] * sigma[b]).powi(2));
    let w = w - w * drawn * w;
    let free: Vec<usize> = (0..problem.layout.len()).filter(|&c| cov.reduced[(c, c)] > 0.0).collect();
    let dense = |m: &DMatrix<f64>| DMatrix::from_fn(free.len(), free.len(), |i, k| m[(free[i], free[k])]);
    let at = |step: nalgebra::Vector6<f64>| {
        let mut moved = fit.adjustment.clone();
        moved.problem.noise.joint[0].iter_mut().zip(step.iter()).for_each(|(s, by)| *s = (*s * *s + by).sqrt());
        dense(&moved.linear(&fit.linearised).covariance().unwrap().reduced)
    };
    let here = dense(&cov.reduced);
    let inverse = here.clone().try_inverse().unwrap();
    let directions = w.symmetric_eigen();
    let mut expected = DMatrix::zeros(free.len(), free.len());
    for k in 0..6 {
        let direction = directions.eigenvectors.column(k) * directions.eigenvalues[k].sqrt();
        let h = 0.02 * (0..6).map(|a| sigma[a].powi(2) / direction[a].abs()).fold(f64::MAX, f64::min);
        let (above, below) = (at(direction * h), at(-direction * h));
        let slope = (&above - &below) / (2.0 * h);
        let curvature = (&above + &below - 2.0 * &here) / (h * h);
        expected += &slope * &inverse * &slope - curvature;
    }
    let added = dense(&NoiseUncertainty::of(&told, &fit).unwrap().added());
    let whitened = |m: &DMatrix<f64>| {
        DMatrix::from_fn(free.len(), free.len(), |i, k| m[(i, k)] / (here[(i, i)] * here[(k, k)]).sqrt())
    };
    let (added, expected) = (whitened(&added), whitened(&expected));
    println!("adds {:.4} of a variance at most; off by {:e}", added.max(), (&added - &expected).abs().max());
    assert!(added.diagonal().min() >= -1e-12 && added.max() > 0.01);
    // Second differences with steps of 2 %: the fourth derivative makes out some 1e-4 of them.
    assert!((&added - &expected).abs().max() < 3e-3 * added.max());
}

#[test]
fn variance_components_recover_pixel_and_joint_noise() {
    // Sum of squared normalised errors of log sigma over seeds: each is chi-squared with one degree of freedom.
    let (mut pixel, mut joint) = (0.0, 0.0);
    let seeds = 6;
    for seed in 0..seeds {
        let mut dice = Dice::new(40 + seed);
        let truth = 2e-4;
        let request = Request {
            images: 25,
            lattice: (5, 4),
            joint_noise: truth,
            pixel_factor: 1.3,
            deviation: 5e-4,
            ..Request::default()
        };
        let (mut problem, state) = problem(&mut dice, &request);
        // From above, as `identify` does.
        problem.noise.pixel_factor = vec![3.0];
        problem.noise.joint = vec![vec![3e-3; 6]];
        let options = ComponentOptions { rounds: 100, ..ComponentOptions::default() };
        let outcome = estimate_components(Adjustment { problem, state }, &options);
        assert_eq!(outcome.status, Status::Converged);
        let fit = outcome.fit().unwrap();
        let Fit { adjustment: Adjustment { problem, .. }, linearised: lin, .. } = &fit;
        let sigma = &problem.noise.joint[0];
        let told = noise_information(&fit).unwrap();
        let spread = told.mean_variance(&[0], &[0, 1, 2, 3, 4, 5]);
        let mean = (sigma.iter().map(|s| s * s).sum::<f64>() / 6.0).sqrt();
        assert!((spread.variance.sqrt() / mean - 1.0).abs() < 1e-12);
        let observations = 2.0 * lin.terms.iter().map(|t| t.residuals.len() as f64).sum::<f64>();
        let used = 70.0 + 6.0 * lin.images.len() as f64;
        println!("pixel {} joint {mean:e} +- {:e}", problem.noise.pixel_factor[0], spread.of_root());
        pixel += (problem.noise.pixel_factor[0] / 1.3).ln().powi(2) * 2.0 * (observations - used);
        joint += ((spread.variance - truth * truth) / spread.sigma).powi(2);
    }
    // 99.9 % point of chi-squared with 6 degrees of freedom.
    assert!(pixel < 22.5, "pixel noise is off: chi-squared {pixel:.1} of {seeds}");
    assert!(joint < 22.5, "joint noise is off: chi-squared {joint:.1} of {seeds}");
}

#[test]
fn one_thread_and_two_give_the_same_bits() {
    // Many markers: they are eliminated; few: what is latent at stops is.
    for lattice in [(7, 6), (4, 3)] {
        let mut dice = Dice::new(51);
        let request = Request { images: 14, lattice, radius_m: 0.0, joint_noise: 1e-4, ..Request::default() };
        let (problem, state) = problem(&mut dice, &request);
        let run = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let options = Options { joint_noise: JointNoise::Estimated, model: RobotModel::Gear, ..Options::default() };
            pool.install(|| identify(state.robot.chain.clone(), &[series(&problem)], &options)).unwrap()
        };
        assert_same_bits(&run(1), &run(2));
    }
}

#[test]
fn joint_noise_has_an_interval_where_it_is_estimated_and_none_where_it_is_given() {
    let mut dice = Dice::new(52);
    let request = Request { images: 14, lattice: (7, 6), radius_m: 0.0, joint_noise: 3e-4, ..Request::default() };
    let (problem, state) = problem(&mut dice, &request);
    let run = |joint_noise: JointNoise| {
        let options = Options { joint_noise, model: RobotModel::Rigid, ..Options::default() };
        identify(state.robot.chain.clone(), &[series(&problem)], &options).unwrap()
    };
    let estimated = run(JointNoise::Estimated);
    let sigma = estimated.fit.problem.joint_sigma(0);
    assert_eq!(estimated.worth.joint_noise.len(), 1);
    assert_eq!(estimated.worth.joint_noise[0].len(), sigma.len());
    for (s, [low, high]) in sigma.iter().zip(&estimated.worth.joint_noise[0]) {
        assert!(low < s && s < high && high.is_finite(), "{low:e} {s:e} {high:e}");
    }
    let given = run(JointNoise::Known(3e-4));
    assert_eq!(given.fit.problem.joint_sigma(0), vec![3e-4; sigma.len()]);
    assert!(given.worth.joint_noise.is_empty());
}

#[test]
fn joint_noise_that_is_not_told_from_none_counts_as_none() {
    let found = |seed: u64, joint_noise: f64| {
        let mut dice = Dice::new(60 + seed);
        let request = Request { images: 14, lattice: (7, 6), radius_m: 0.0, joint_noise, ..Request::default() };
        let (problem, state) = problem(&mut dice, &request);
        let options = Options { joint_noise: JointNoise::Estimated, model: RobotModel::Rigid, ..Options::default() };
        let solution = identify(state.robot.chain.clone(), &[series(&problem)], &options).unwrap();
        solution.fit.problem.noise.joint[0].clone()
    };
    let seeds = 0..8;
    // One of a hundred gets past: two of eight with a probability of 0.3 %.
    let told = seeds.clone().filter(|&s| found(s, 0.0).iter().any(|s| *s > JOINT_NOISE_FLOOR)).count();
    assert!(told <= 1, "joint noise was found in {told} of 8 robots without");
    for sigmas in seeds.map(|s| found(s, 3e-4)) {
        assert!(sigmas.iter().all(|s| (5e-5..2e-3).contains(s)), "{sigmas:?}");
    }
}

fn assert_same_bits(one: &Solution, two: &Solution) {
    let bits = |v: &[f64]| v.iter().map(|x| x.to_bits()).collect::<Vec<u64>>();
    // Comparison of numbers takes 0 for -0, nothing else; none of these is NaN in a converged solution.
    assert_eq!(one.fit.problem.noise, two.fit.problem.noise);
    assert_eq!(one.iterations, two.iterations);
    assert_eq!(one.fit.state, two.fit.state);
    assert_eq!(one.free_poses.state, two.free_poses.state);
    assert_eq!(one.free_poses.poses, two.free_poses.poses);
    assert_eq!(one.accuracy, two.accuracy);
    assert_eq!(bits(one.fit.covariance.reduced.as_slice()), bits(two.fit.covariance.reduced.as_slice()));
    assert_eq!(one.fit.linearised.cost.to_bits(), two.fit.linearised.cost.to_bits());
    let markers = |s: &Solution| s.fit.covariance.markers();
    assert_eq!(markers(one), markers(two));
}

#[test]
fn fixed_columns_do_not_move() {
    let mut dice = Dice::new(61);
    let (mut problem, state) = problem(&mut dice, &Request::default());
    let mut start = state;
    start.cameras[0].parameters[0] += 2.0;
    let fixed =
        |n: &str| n.contains("joint_3") || n.ends_with(".fx") || n.starts_with("hand_camera") || n.ends_with("skew");
    problem.layout.set_free(false, fixed);
    let outcome = converged(&problem, start.clone(), &Settings::default());
    let (before, after) = (start.values(&problem.layout), outcome.adjustment.state.values(&problem.layout));
    let mut moved = 0;
    for (c, column) in problem.layout.columns.iter().enumerate() {
        if fixed(&column.name) {
            assert_eq!(before[c].to_bits(), after[c].to_bits(), "{}", column.name);
        } else {
            moved += usize::from(before[c] != after[c]);
        }
    }
    assert_eq!(start.mountings, outcome.adjustment.state.mountings);
    assert!(moved > 30);
}

#[test]
fn what_no_data_touch_keeps_its_prior() {
    let mut dice = Dice::new(62);
    let request =
        Request { parts: vec![Part::Revolute; 6], terms: vec![Term::Offset, Term::Backlash], ..Request::default() };
    let (mut problem, mut state) = problem(&mut dice, &request);
    for stop in &mut problem.stops {
        stop.posture.as_mut().unwrap().approach = None;
    }
    state.robot.terms.iter_mut().filter(|t| t.term == Term::Backlash).for_each(|t| t.value = 0.0);
    let backlash = problem.layout.find("robot/joint_1.backlash").unwrap();
    problem.layout.columns[backlash].prior_mean = 1e-4;
    let outcome = converged(&problem, state, &TIGHT);
    let cov = covariance(&outcome);
    let values = outcome.adjustment.state.values(&problem.layout);
    let column = &problem.layout.columns[backlash];
    assert!((cov.sigma(backlash) / column.prior_sigma - 1.0).abs() < 1e-12);
    assert!((values[backlash] - 1e-4).abs() < 1e-9 * column.prior_sigma);
}
