//! The normal equations against dense ones from dual numbers: whatever is eliminated first, and however many images a stop has.

use crate::support::dense::{Dense, Unknown};
use crate::support::small::{Dice, Request, free_poses, hold, problem};
use nalgebra::{DMatrix, DVector, Vector3};
use robotcal::assess::{Limits, clustered_covariance};
use robotcal::fit::{Fit, NoEvidence, fit_of_outcome, log_evidence, log_evidence_of_outcome};
use robotcal::identify::{PoseStage, linear_step};
use robotcal::linalg::SymmetricFactor;
use robotcal::model::camera::Lens;
use robotcal::model::joint_terms::Term;
use robotcal::problem::{
    Adjustment, Image, ImageRejection, ObservationRejection, Problem, State, Step, Tie, release_measured_scales,
};
use robotcal::series::{CameraMount, ScaleBar};
use robotcal::solve::{Elimination, Settings, Status, System, in_frame, solve};

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
    hide(&mut problem);
    problem.images[1].observations[2].uv.x += 3.0;
    problem.images[2].observations[3].rejected = Some(ObservationRejection::Excluded);
    problem.plates[0].markers[4].sigma_m = 3e-5;
    measure_distance(&mut problem, 4, 11);
    hold(&mut problem.layout, |name| name.ends_with("joint_2/origin.rx") || name == "camera/front/lens.k3");
    (problem, state)
}

/// A displacement field: its columns stand before those of the plate, and after them in the blocks of an image.
fn with_field() -> (Problem, State) {
    let request = Request { lens: Lens::BrownField, images: 4, radius_m: 0.0, ..Request::default() };
    let (mut problem, state) = problem(&mut Dice::new(15), &request);
    hide(&mut problem);
    (problem, state)
}

/// No image shows the unseen marker.
fn hide(problem: &mut Problem) {
    for image in &mut problem.images {
        image.observations[UNSEEN].rejected = Some(ObservationRejection::Excluded);
    }
}

/// A distance known better than the tolerances of the markers, and 0.3 mm longer than nominal.
fn measure_distance(problem: &mut Problem, from: usize, to: usize) {
    let markers = &problem.plates[0].markers;
    let [a, b] = [&markers[from], &markers[to]];
    let distance_m = (a.position_m - b.position_m).norm() + 3e-4;
    problem.plates[0].scale = Some(ScaleBar { from: a.id, to: b.id, distance_m, sigma_m: 2e-5 });
    release_measured_scales(&mut problem.layout, &problem.plates);
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
    check_against_dense(with_field());
}

#[test]
fn the_images_of_a_stop_have_its_joint_errors_in_common() {
    for mount in [CameraMount::Hand, CameraMount::Fixed] {
        let mut dice = Dice::new(14);
        let request = Request { mount, images: 12, images_a_stop: 2, ..Request::default() };
        let (mut problem, mut state) = problem(&mut dice, &request);
        hide(&mut problem);
        measure_distance(&mut problem, 2, UNSEEN);
        // One camera of a stop is left out, one is held by nothing, and plates seem to be tilted.
        problem.images[4].rejected = Some(ImageRejection::Excluded);
        state = free_poses(&problem, &state, |i| i == 7);
        problem.noise.displacement = vec![2e-4];
        for i in [0, 1, 9] {
            state.ties[i] = Tie::Displaced(vec![1e-4, -2e-4]);
        }
        check_against_dense((problem, state));
    }
}

/// Step and covariance at a state near that one, by both eliminations.
fn check_against_dense((problem, state): (Problem, State)) {
    let mut state = shaken(&problem, &state);
    // Where the program linearises a distance to it.
    state.plates[0].corrections[UNSEEN] = Vector3::zeros();
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
            let position = lin.stops.iter().position(|used| used.stop == stop).unwrap();
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
        let got = &library.latents(std::slice::from_ref(&stop))[0];
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

/// What a fit knows of its system already serves where plates are held in their frames, unless distances are a part of it.
#[test]
fn plates_in_their_frames_are_the_same_by_the_system_of_the_fit() {
    for (problem, state) in [with_field(), awkward(CameraMount::Fixed)] {
        let adjustment = Adjustment { problem, state };
        let linearised = adjustment.linearise().unwrap();
        let covariance = adjustment.linear(&linearised).covariance().unwrap();
        let fit = Fit { adjustment, linearised, covariance };
        let columns = fit.problem.layout.len();
        let own = fit.in_frame().unwrap().dense(columns);
        let anew = in_frame(fit.linear(), &fit.covariance).unwrap().dense(columns);
        assert!(own.diagonal().min() >= 0.0 && own.diagonal().max() > 0.0);
        assert_eq!(own, anew);
    }
}

/// Every image in two, of one stop: each has every other observation.
fn in_halves(adjustment: &Adjustment) -> Adjustment {
    let mut halves = adjustment.clone();
    halves.problem.images.clear();
    halves.state.ties.clear();
    for (image, tie) in adjustment.problem.images.iter().zip(&adjustment.state.ties) {
        for part in 0..2 {
            let own = image.observations.iter().enumerate().filter(|(k, _)| k % 2 == part);
            let observations = own.map(|(_, o)| o.clone()).collect();
            halves.problem.images.push(Image { observations, ..image.clone() });
            halves.state.ties.push(tie.clone());
        }
    }
    halves
}

#[test]
fn two_halves_of_an_image_at_one_stop_say_what_the_whole_says() {
    let mut dice = Dice::new(15);
    let sigma = 3e-4;
    let request = Request { images: 10, lattice: (5, 4), joint_noise: sigma, ..Request::default() };
    let (mut problem, state) = problem(&mut dice, &request);
    problem.huber = f64::INFINITY;
    let outcome = solve(Adjustment { problem, state }, &Settings::new(200, 1e-9));
    assert_eq!(outcome.status, Status::Converged);
    let whole = outcome.adjustment;
    let halves = in_halves(&whole);
    let [a, b] = [&whole, &halves].map(|adjustment| adjustment.linearise().unwrap());
    assert_eq!((b.images.len(), b.stops.len()), (20, 10));
    assert!((a.cost / b.cost - 1.0).abs() < 1e-12, "{} {}", a.cost, b.cost);
    let limits = Limits { scatter_images: 1, ..Limits::default() };
    let of = |adjustment: &Adjustment, lin| {
        let linear = adjustment.linear(lin);
        let clustered = clustered_covariance(linear, &limits).unwrap();
        [linear.covariance().unwrap().reduced, clustered.model, clustered.sandwich]
    };
    let dense = whole.problem.layout.len();
    let pairs = of(&whole, &a).into_iter().zip(of(&halves, &b));
    // Rounding times the condition of two routes; the share of the scatter that the fit took is bounded in other directions of the halves.
    let kinds = [("all", 1e-6), ("by the model", 1e-6), ("by the scatter", 1e-3)];
    for ((what, bound), (a, b)) in kinds.into_iter().zip(pairs) {
        for c in 0..dense {
            let ratio = a[(c, c)] / b[(c, c)];
            assert!((ratio - 1.0).abs() < bound, "{what}, {}: {ratio}", whole.problem.layout.columns[c].name);
        }
    }
    // Two poses of one stop in the second stage have its joint errors in common, too.
    let of = |adjustment| linear_step(adjustment, &PoseStage::linearised(adjustment).unwrap(), sigma).unwrap();
    let ((_, one), (_, two)) = (of(&whole), of(&halves));
    for c in 0..one.nrows() {
        let ratio = (one[(c, c)] / two[(c, c)]).sqrt();
        assert!((ratio - 1.0).abs() < 0.01, "second stage, {}: {ratio}", whole.problem.layout.columns[c].name);
    }
}

/// The cost where an iteration was broken off is not that of an optimum, and what nothing tells has no determinant.
#[test]
fn what_came_to_no_end_or_is_singular_has_no_evidence() {
    let request = Request { images: 10, lattice: (5, 4), joint_noise: 3e-4, ..Request::default() };
    let (mut problem, state) = problem(&mut Dice::new(15), &request);
    problem.huber = f64::INFINITY;
    let start = Adjustment { state: shaken(&problem, &state), problem };
    let broken_off = solve(start.clone(), &Settings::new(1, 1e-9));
    assert_eq!(broken_off.status, Status::OutOfIterations);
    let why = NoEvidence::Unfinished(Status::OutOfIterations);
    assert_eq!(log_evidence_of_outcome(&broken_off), Err(why));
    assert_eq!(why.code(), robotcal::error::Code::NotConverged);
    assert_eq!(fit_of_outcome(broken_off).err(), Some(why));

    let mut ended = solve(start, &Settings::new(200, 1e-9));
    assert_eq!(ended.status, Status::Converged);
    assert_eq!(log_evidence_of_outcome(&ended).ok(), log_evidence(ended.linear().unwrap()));
    assert!(fit_of_outcome(ended.clone()).is_ok());
    // A prior that knows a free column exactly leaves no information that could be inverted.
    let free = ended.adjustment.problem.layout.columns.iter_mut().find(|c| c.free).unwrap();
    free.prior_sigma = 0.0;
    assert_eq!(log_evidence_of_outcome(&ended), Err(NoEvidence::Undetermined));
    assert_eq!(fit_of_outcome(ended).err(), Some(NoEvidence::Undetermined));
}
