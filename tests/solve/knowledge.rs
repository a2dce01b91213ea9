//! What data tell: rank and names, selections, the flange's covariance, clusters, and solving again from solution.json.

use crate::outputs_support::{context, robot, solved};
use nalgebra::{DMatrix, DVector, Vector6};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use robotcal::Code;
use robotcal::assess::{
    Cause, Identifiability, Limits, MeasuredPoint, fit_points, ideal_stops, identifiability_of_stops, minimal_set,
    structural,
};
use robotcal::diagnose::{Finding, Subject, Weight};
use robotcal::geom::Pose;
use robotcal::identify::{
    Config, JointNoise, Options, Parameters, RobotModel, Selection, Solution, StatedPrior, identify, verify_series,
};
use robotcal::model::joint_terms::{JointTerm, Term, TermKind};
use robotcal::model::robot::{Posture, Robot};
use robotcal::output::difference::compare_solutions;
use robotcal::output::restore::{found_model, measured_series, robot_description};
use robotcal::output::verdict::Verdict;
use robotcal::output::{files, solution_json};
use robotcal::problem::{ImageRejection, Layout, Names, State, short_name};
use robotcal::series::{CameraMount, Marker, Observation, Plate, PlateKind};
use robotcal::simulate::truth::{TrueTerm, Truth};
use robotcal::simulate::{RobotErrors, WorldRequest, series};
use robotcal::study::measured;
use robotcal::urdf::Chain;

fn chain() -> Chain {
    robot().chain(None, None).unwrap()
}

/// A state of nothing but a robot.
fn robot_alone(robot: Robot) -> State {
    State {
        instruments: Vec::new(),
        bodies: Vec::new(),
        robot,
        mountings: vec![],
        placements: vec![],
        cameras: vec![],
        plates: vec![],
        joint_errors: vec![],
        ties: vec![],
    }
}

fn layout(model: RobotModel) -> (Robot, Layout) {
    let robot = model.robot(chain());
    let state = robot_alone(robot.clone());
    let layout = Layout::new(&state, &Names::default());
    (robot, layout)
}

#[test]
fn a_six_axis_arm_has_eighteen_geometric_parameters_of_its_own() {
    // 4 per revolute joint and 6 for the tip, less 12 for base and tip frame (Everett, Driels, Mooring 1987).
    let (robot, layout) = layout(RobotModel::Rigid);
    let kept = minimal_set(&robot, &layout, &structural(&robot, &layout, Limits::default().share_of_data));
    assert_eq!(kept.len(), 18, "{:?}", kept.iter().map(|&c| &layout.columns[c].name).collect::<Vec<_>>());
    let found = identifiability_of_stops(&robot, &layout, &ideal_stops(&robot), &Limits::default()).unwrap();
    assert_eq!((found.tellable, found.rank), (18, 18));
    assert!(found.unknown.iter().all(|d| d.cause != Cause::Stops));
}

fn told(stops: &[Posture], model: RobotModel) -> Identifiability {
    let (robot, layout) = layout(model);
    identifiability_of_stops(&robot, &layout, stops, &Limits::default()).unwrap()
}

#[test]
fn a_joint_that_stands_still_is_named_with_what_to_do() {
    let (robot, _) = layout(RobotModel::Gear);
    let mut stops = ideal_stops(&robot);
    stops.iter_mut().for_each(|s| s.readings[2] = 0.5);
    let name = &robot.chain.readings[2];
    let found = told(&stops, RobotModel::Gear);
    assert!(found.rank < found.tellable);
    let gear = found
        .unknown
        .iter()
        .find(|d| d.cause == Cause::Stops && d.parameters.iter().any(|(p, _)| *p == format!("{name}.gear")));
    let remedy = gear.unwrap().remedy.as_ref().unwrap();
    assert!(remedy.contains(name) && remedy.contains("29"), "{remedy}");
    assert!(found.next.iter().any(|a| a.joint == *name), "{:?}", found.next);
    // Joints that move through all of their range are known.
    let other = &robot.chain.readings[3];
    let of_other = |d: &&robotcal::assess::UnknownDirection| {
        d.cause == Cause::Stops && d.parameters.iter().all(|(p, _)| p.starts_with(&format!("{other}.")))
    };
    assert_eq!(found.unknown.iter().filter(of_other).count(), 0);
}

#[test]
fn visiting_every_stop_twice_doubles_the_information() {
    let (robot, _) = layout(RobotModel::Rigid);
    let once = ideal_stops(&robot);
    let twice: Vec<Posture> = once.iter().chain(&once).cloned().collect();
    let (a, b) = (told(&once, RobotModel::Rigid).observability, told(&twice, RobotModel::Rigid).observability);
    let (a, b) = (a.unwrap(), b.unwrap());
    let root = 2f64.sqrt();
    for (what, a, b) in [
        ("O1", a.o1, b.o1),
        ("O2", a.o2, b.o2),
        ("O3", root * a.o3, b.o3),
        ("O4", root * a.o4, b.o4),
        ("O5", root * a.o5, b.o5),
    ] {
        assert!((a / b - 1.0).abs() < 1e-6, "{what}: {a} {b}");
    }
    assert!((a.o4 - a.o2 * a.o3).abs() < 1e-12 * a.o4);
}

#[test]
fn names_choose_what_is_free_and_wrong_ones_are_answered() {
    let (robot, fresh) = layout(RobotModel::Full);
    let mut state = robot_alone(robot);
    let mut apply = |selection: &Selection| {
        let mut layout = fresh.clone();
        selection.apply(&mut layout, &mut state, &Limits::default()).map(|()| layout)
    };
    let names = |l: &Layout| l.columns.iter().filter(|c| c.free).map(|c| short_name(&c.name)).collect::<Vec<_>>();
    let only = Selection { free: vec!["joint_a2.offset".into(), "joint_a3.origin.rx".into()], ..Selection::default() };
    let mut expected = names(&apply(&only).unwrap());
    expected.sort();
    assert_eq!(expected, ["joint_a2.offset", "joint_a3.origin.rx"]);
    let fixed = Selection { fix: vec!["*.backlash".into(), "joint_a4".into()], ..Selection::default() };
    let left = names(&apply(&fixed).unwrap());
    assert!(left.iter().all(|n| !n.ends_with(".backlash") && !n.starts_with("joint_a4.")));
    assert!(left.iter().any(|n| n == "joint_a5.gear"));
    let wrong = Selection { free: vec!["joint_a2.ofset".into()], ..Selection::default() };
    let error = apply(&wrong).unwrap_err();
    assert!(
        error.code == Code::ParameterUnknown && error.place == "--free" && error.remedy.contains("joint_a2.offset"),
        "{error}"
    );
    let prior = |name: &str, p: StatedPrior| Selection { prior: [(name.to_owned(), p)].into(), ..Selection::default() };
    let rad = StatedPrior { sigma_rad: Some(0.001), mean: Some(0.002), ..StatedPrior::default() };
    let layout = apply(&prior("joint_a2.offset", rad)).unwrap();
    let column = &layout.columns[layout.find("robot/joint_a2.offset").unwrap()];
    assert_eq!((column.prior_sigma, column.prior_mean), (0.001, 0.002));
    let metres = StatedPrior { sigma_m: Some(0.001), ..StatedPrior::default() };
    let error = apply(&prior("joint_a2.offset", metres)).unwrap_err();
    assert!(error.code == Code::PriorUnit && error.remedy.contains("sigma_rad"), "{error}");
}

#[test]
fn a_configuration_with_an_unknown_key_is_refused_with_its_line() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("robotcal.toml");
    std::fs::write(&path, "parameters = \"minimal\"\n[prior]\n\"joint_2.offset\" = { sigma_rad = 0.001 }\n").unwrap();
    let config = Config::read(&path).unwrap();
    assert_eq!(config.parameters, Some(Parameters::Minimal));
    assert_eq!(config.prior["joint_2.offset"].sigma_rad, Some(0.001));
    std::fs::write(&path, "parameters = \"minimal\"\nrobot_modell = \"full\"\n").unwrap();
    let error = Config::read(&path).unwrap_err();
    assert!(
        error.code == Code::SettingSyntax
            && error.place.ends_with("robotcal.toml:2")
            && error.remedy.contains("robot_model"),
        "{error}"
    );
    std::fs::write(&path, "[prior]\n\"joint_2.offset\" = { sigma_grad = 0.001 }\n").unwrap();
    assert!(Config::read(&path).unwrap_err().place.ends_with("robotcal.toml:2"));
}

/// Of a joint whose true origin and zero are elsewhere, of one that turns the whole base, of terms that the true robot does not have.
#[test]
fn what_is_held_at_a_value_that_the_data_contradict_is_named() {
    let description = robot();
    let series = [crate::outputs_support::series(CameraMount::Hand, &description)];
    let found = |fix: &str, model: RobotModel| {
        let selection = Selection { fix: vec![fix.into()], ..Selection::default() };
        let options = Options { model, selection, ..Options::default() };
        let solution = identify(description.chain(None, None).unwrap(), &series, &options).unwrap();
        let found = solution.findings.into_iter().find(|f| f.code() == Code::HeldContradicted);
        println!("{fix}: {:?}", found.as_ref().map(|f| (f.weight(), f.quantities())));
        found
    };
    let wrong = found("joint_a3", RobotModel::Rigid).unwrap();
    assert_eq!(wrong.weight(), Weight::Gate);
    let named = |s: &Subject| matches!(s, Subject::Parameter(name) if name.starts_with("robot/joint_a3"));
    assert!(!wrong.subjects().is_empty() && wrong.subjects().iter().all(named), "{:?}", wrong.subjects());
    assert!(wrong.quantities().iter().any(|q| q.name == "deviate" && q.value > 4.0));
    assert_eq!(found("joint_a1", RobotModel::Rigid), None);
    assert_eq!(found("*.backlash", RobotModel::Full), None);
}

fn record_of(solution: &Solution) -> solution_json::SolutionRecord {
    let description = robot();
    let files = files(solution, &context(&description)).unwrap();
    solution_json::read(&files["solution.json"]).unwrap()
}

#[test]
fn solution_json_alone_gives_the_same_solution_again() {
    let solution = solved(CameraMount::Hand, RobotModel::Rigid);
    let record = record_of(&solution);
    let chain = robot_description(&record).unwrap().chain(Some(&record.robot.base), Some(&record.robot.tip)).unwrap();
    let series = measured_series(&record).unwrap();
    let again = identify(chain.clone(), &series, &Options { model: RobotModel::Rigid, ..Options::default() }).unwrap();
    let layout = &solution.fit.problem.layout;
    let (a, b) = (solution.fit.state.values(layout), again.fit.state.values(layout));
    for k in 0..layout.len() {
        let sigma = solution.fit.covariance.sigma(k).max(1e-15);
        assert!((a[k] - b[k]).abs() < 1e-2 * sigma, "{}: {} {}", layout.columns[k].name, a[k], b[k]);
    }
    let same = compare_solutions(&record, &record_of(&again)).unwrap();
    assert!(same.everywhere.rms_m < 1e-6 && same.parameters.is_empty() && !same.disagrees(), "{same:?}");
    // Parameters that differ by two sigmas each, and the flange by far more than both state of it.
    let mut moved = record.clone();
    for name in ["joint_a2", "joint_a3", "joint_a4"] {
        let joint = moved.robot.joints.iter_mut().find(|j| j.name == name).unwrap();
        for (k, axis) in ["rx", "ry", "rz"].into_iter().enumerate() {
            let name = format!("robot/{name}/origin.{axis}");
            let of = moved.estimates.iter_mut().find(|e| e.name == name).unwrap();
            let by = 2.0 * std::f64::consts::SQRT_2 * of.sigma.unwrap();
            *of.value.as_mut().unwrap() += by;
            joint.twist[3 + k] += by;
        }
    }
    let apart = compare_solutions(&record, &moved).unwrap();
    let flange = apart.covered.as_ref().unwrap();
    println!("{} m, {:?} sigmas", flange.rms_m, flange.sigmas());
    assert!(apart.parameters.is_empty() && flange.rms_m > 3.0 * flange.stated_m.unwrap(), "{apart:?}");
    assert!(flange.disagrees() && apart.disagrees());
    // Within all joint limits the difference is that at joint vectors drawn from all of them.
    let [first, second] = [&record, &moved].map(|record| found_model(record).unwrap().robot);
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    let drawn = |rng: &mut ChaCha8Rng| first.chain.ranges().iter().map(|(l, h)| rng.random_range(*l..*h)).collect();
    let points: Vec<MeasuredPoint> = (0..600)
        .map(|_| drawn(&mut rng))
        .map(|readings: Vec<f64>| MeasuredPoint { position_m: first.base_from_tip(&readings).translation, readings })
        .collect();
    let independent = fit_points(&second, &points).unwrap().rms_m;
    println!("{} and {independent} m", apart.everywhere.rms_m);
    assert!((apart.everywhere.rms_m / independent - 1.0).abs() < 0.1);
    // With other options it is another solution, and the comparison says by how much.
    let fixed = Selection { fix: vec!["joint_a3.origin".into(), "joint_a3.offset".into()], ..Selection::default() };
    let options = Options { model: RobotModel::Rigid, selection: fixed, ..Options::default() };
    let other = identify(chain, &series, &options).unwrap();
    let record_b = record_of(&other);
    assert!(record_b.estimates.iter().any(|e| e.name == "robot/joint_a3.offset" && !e.free && e.sigma.is_none()));
    let apart = compare_solutions(&record, &record_b).unwrap();
    assert!(apart.everywhere.rms_m > 10.0 * same.everywhere.rms_m, "{apart:?}");
}

#[test]
fn solutions_differ_by_as_much_as_both_let_expect() {
    const DRAWS: usize = 100;
    let record = record_of(&solved(CameraMount::Hand, RobotModel::Rigid));
    let model = found_model(&record).unwrap();
    let (twists, terms) = (&model.layout.twists, &model.layout.terms);
    let robot = twists.clone().chain(terms.clone().take(record.robot.terms.len()));
    let used: Vec<usize> = robot.filter(|&c| model.covariance[(c, c)] > 0.0).collect();
    let covariance = DMatrix::from_fn(used.len(), used.len(), |i, j| model.covariance[(used[i], used[j])]);
    let root = covariance.cholesky().unwrap().l();
    let mut rng = ChaCha8Rng::seed_from_u64(11);
    let mut ratios = Vec::new();
    for _ in 0..DRAWS {
        let step = &root * DVector::from_fn(used.len(), |_, _| StandardNormal.sample(&mut rng));
        let mut drawn = record.clone();
        for (&c, by) in used.iter().zip(step.iter()) {
            let joints = &mut drawn.robot.joints;
            match c.checked_sub(terms.start) {
                Some(term) => drawn.robot.terms[term].value += by,
                None => joints[(c - twists.start) / 6].twist[(c - twists.start) % 6] += by,
            }
        }
        let found = compare_solutions(&record, &drawn).unwrap();
        let flange = found.covered.unwrap();
        // Only one of the two was drawn.
        ratios.push(2.0 * (flange.rms_m / flange.stated_m.unwrap()).powi(2));
        assert!(!flange.disagrees());
    }
    let mean = ratios.iter().sum::<f64>() / DRAWS as f64;
    let sigma = (ratios.iter().map(|r| (r - mean).powi(2)).sum::<f64>() / DRAWS as f64).sqrt() / (DRAWS as f64).sqrt();
    println!("{mean} +- {sigma}");
    assert!((mean - 1.0).abs() < 4.0 * sigma, "{mean} +- {sigma}");
}

#[test]
fn the_flange_scatters_as_its_covariance_says() {
    const DRAWS: usize = 400;
    let record = record_of(&solved(CameraMount::Hand, RobotModel::Rigid));
    let model = found_model(&record).unwrap();
    let flange = model.flange().unwrap();
    let (still, column) = model.still.unwrap();
    let readings = vec![0.3, -1.2, 1.5, 0.4, 0.9, -0.2];
    let stated = flange.at(&readings).covariance;
    // Draws of robot and plate pose from the stated covariance; the free columns alone have a Cholesky factor.
    let used: Vec<usize> =
        (0..model.layout.terms.end).chain(column..column + 6).filter(|&c| model.covariance[(c, c)] > 0.0).collect();
    let covariance = DMatrix::from_fn(used.len(), used.len(), |i, j| model.covariance[(used[i], used[j])]);
    let scale = covariance.diagonal().map(|v| v.sqrt());
    let scaled = DMatrix::from_fn(used.len(), used.len(), |i, j| covariance[(i, j)] / (scale[i] * scale[j]));
    let factor = scaled.cholesky().unwrap().l();
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let mut sum = nalgebra::Matrix6::zeros();
    for _ in 0..DRAWS {
        let normal = DVector::from_fn(used.len(), |_, _| StandardNormal.sample(&mut rng));
        let drawn = (&factor * normal).component_mul(&scale);
        let (mut robot, mut twist) = (model.robot.clone(), Vector6::zeros());
        for (&c, d) in used.iter().zip(drawn.iter()) {
            if c >= column {
                twist[c - column] = *d;
            } else if model.layout.twists.contains(&c) {
                robot.twists[c / 6][c % 6] += d;
            } else {
                robot.terms[c - model.layout.terms.start].value += d;
            }
        }
        let moved = still.perturbed(&twist);
        let error = |stop: &Posture| {
            let noise = vec![0.0; 6];
            let before = still.inverse() * model.robot.pose_at(stop, &noise);
            (before.inverse() * (moved.inverse() * robot.pose_at(stop, &noise))).log()
        };
        let mean = model.stops.iter().map(error).sum::<Vector6<f64>>() / model.stops.len() as f64;
        let e = error(&Posture::at(&readings)) - mean;
        sum += e * e.transpose();
    }
    let found = sum / DRAWS as f64;
    for k in 0..6 {
        let ratio = (found[(k, k)] / stated[(k, k)]).sqrt();
        // The sigma of 400 draws is known to 1/sqrt(800) = 3.5 %; four of these.
        assert!((ratio - 1.0).abs() < 0.14, "axis {k}: {ratio}");
    }
}

fn request(seed: u64, joint_noise_rad: f64) -> WorldRequest {
    let plate = Plate::lattice(PlateKind::Points, 6, 5, 0.05, 0.05e-3);
    WorldRequest {
        joint_noise_rad,
        pixel_sigma_px: 0.05,
        marker_sigma_m: 0.05e-3,
        images: 40,
        least_markers: 12,
        seed,
        ..WorldRequest::typical(chain(), plate)
    }
}

fn world(seed: u64, joint_noise_rad: f64) -> robotcal::problem::MeasuredSeries {
    measured(&series(&request(seed, joint_noise_rad)).unwrap(), &chain())
}

/// The robot of a simulated world.
fn true_robot(truth: &Truth) -> Robot {
    let mut robot = Robot::nominal(chain());
    for (joint, twist) in robot.chain.joints.iter().zip(&mut robot.twists) {
        *twist = truth.twists.get(&joint.name).map_or_else(Vector6::zeros, |t| Vector6::from_column_slice(t));
    }
    let readings = &robot.chain.readings;
    let term = |t: &TrueTerm| JointTerm {
        reading: readings.iter().position(|r| *r == t.joint).unwrap(),
        term: t.term,
        value: t.value,
    };
    robot.terms = truth.terms.iter().map(term).collect();
    robot
}

/// Error of the flange relative to the plate at `q`, right on average over the stops, RMS, m; `still` is the plate in the base.
fn relative_error_m(
    found: (&Robot, &Pose),
    truth: (&Robot, &Pose),
    stops: &[Posture],
    q: &[(Posture, Vec<f64>)],
) -> f64 {
    let error = |stop: &Posture, noise: &[f64]| {
        let model = found.1.inverse() * found.0.pose_at(stop, &[0.0; 6]);
        (model.inverse() * (truth.1.inverse() * truth.0.pose_at(stop, noise))).log()
    };
    let mean = stops.iter().map(|s| error(s, &[0.0; 6])).sum::<Vector6<f64>>() / stops.len() as f64;
    let sum: f64 = q.iter().map(|(s, noise)| (error(s, noise) - mean).fixed_rows::<3>(0).norm_squared()).sum();
    (sum / q.len() as f64).sqrt()
}

/// What is stated of the flange is what is found of it: nominal, URDF alone, whole model.
#[test]
fn what_is_promised_of_the_flange_is_what_is_found() {
    const SIGMA: f64 = 1e-4;
    let full = Options { model: RobotModel::Full, ..Options::default() };
    let (mut found, mut stated) = ([0.0; 4], [0.0; 4]);
    for seed in 11..=14 {
        let errors = RobotErrors::default().with(TermKind::Gear, 5e-4).with(TermKind::Gravity, 0.2e-3);
        let made = series(&WorldRequest { errors, ..request(seed, SIGMA) }).unwrap();
        let solution = identify(chain(), &[measured(&made, &chain())], &full).unwrap();
        let truth = true_robot(&made.truth);
        let plate = made.truth.plate_poses.values().next().unwrap().pose();
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let covered = &solution.uncertainty.identifiability.as_ref().unwrap().covered;
        let places: Vec<(Posture, Vec<f64>)> = (0..400)
            .map(|_| {
                let readings: Vec<f64> = covered.iter().map(|(_, low, high)| rng.random_range(*low..*high)).collect();
                let noise = (0..6)
                    .map(|_| {
                        let x: f64 = StandardNormal.sample(&mut rng);
                        x * SIGMA
                    })
                    .collect();
                (Posture::at(&readings), noise)
            })
            .collect();
        let whole = Robot {
            terms: solution
                .fit
                .state
                .robot
                .terms
                .iter()
                .copied()
                .filter(|t| !matches!(t.term, Term::Local(_)))
                .collect(),
            ..solution.fit.state.robot.clone()
        };
        let mut urdf = whole.clone();
        urdf.terms.retain(|t| t.term == Term::Offset);
        let point = |(s, noise): &(Posture, Vec<f64>)| MeasuredPoint {
            position_m: truth.pose_at(s, noise).translation,
            readings: s.readings.clone(),
        };
        let points: Vec<MeasuredPoint> = places.iter().map(point).collect();
        let stops: Vec<Posture> = solution.fit.problem.stops.iter().filter_map(|s| s.posture.clone()).collect();
        let of = |robot: &Robot| {
            relative_error_m((robot, &solution.fit.state.placements[0]), (&truth, &plate), &stops, &places)
        };
        let alone = solution.uncertainty.alone.as_ref().unwrap();
        let left = [fit_points(&Robot::nominal(chain()), &points).unwrap().rms_m, of(&urdf), of(&whole), of(alone)];
        let e = solution.uncertainty.flange.unwrap();
        let alone_m = e.alone_m.unwrap();
        println!("seed {seed}: found {left:?}, stated {e:?}");
        for (k, (f, s)) in left.into_iter().zip([e.nominal_m, e.urdf_m, e.model_m, alone_m]).enumerate() {
            (found[k], stated[k]) = (found[k] + f * f, stated[k] + s * s);
        }
        assert!(e.scatter_m < e.model_m && e.model_m < e.urdf_m && e.model_m < e.nominal_m, "{e:?}");
        assert!(e.model_m < alone_m && alone_m < 0.8 * e.urdf_m, "{e:?}");
        assert!(left[3] < left[1], "{left:?}");
    }
    for k in 0..4 {
        // Four worlds with some twenty directions each that matter.
        let ratio = (stated[k] / found[k]).sqrt();
        println!("{k}: stated over found {ratio:.3}");
        assert!((0.75..1.35).contains(&ratio), "{k}: stated over found {ratio}");
    }
}

/// Few images with much noise.
fn few_images(seed: u64, errors: RobotErrors) -> WorldRequest {
    WorldRequest { errors, images: 12, pixel_sigma_px: 1.0, ..request(seed, 1e-4) }
}

/// Few images with much noise say little of a robot that is right: what is held out does not make it look worse than it is.
#[test]
fn held_out_images_do_not_speak_against_a_robot_that_is_right() {
    let [mut nominal2, mut calibrated2] = [0.0; 2];
    for seed in 51..=56 {
        let errors = RobotErrors { translation_m: 5e-5, rotation_rad: 1e-4, ..RobotErrors::NONE };
        let made = series(&few_images(seed, errors)).unwrap();
        let solution = identify(chain(), &[measured(&made, &chain())], &Options::default()).unwrap();
        let [nominal, calibrated] = [&solution.accuracy.nominal, &solution.accuracy.calibrated].map(|e| e.rms_mm);
        println!("seed {seed}: held out {nominal:.3} -> {calibrated:.3} mm");
        // Neither they nor the covariance show a gain: which of the two is smaller by chance decides nothing.
        let no_gain = solution.findings.iter().find(|f| f.code() == Code::NoGain);
        assert_eq!(no_gain.map(Finding::weight), Some(Weight::Gate), "seed {seed}: {:?}", solution.findings);
        (nominal2, calibrated2) = (nominal2 + nominal * nominal, calibrated2 + calibrated * calibrated);
    }
    assert!(nominal2 < calibrated2, "held out: nominal {nominal2}, calibrated {calibrated2} mm^2");
}

/// Data that know everything tell all that any series could, and no more.
#[test]
fn no_more_directions_are_told_than_any_series_could_tell() {
    let (robot, layout) = layout(RobotModel::Rigid);
    let known = DMatrix::from_diagonal(&DVector::from_iterator(
        layout.len(),
        layout.columns.iter().map(|c| (1e-3 * c.prior_sigma).powi(2)),
    ));
    let stops = ideal_stops(&robot);
    let found = robotcal::assess::identifiability(&robot, &layout, &stops, &known, &Limits::default()).unwrap();
    assert_eq!((found.rank, found.tellable), (18, 18));
    let little = told(&stops[..4], RobotModel::Full);
    let untold = little.unknown.iter().filter(|d| d.cause == Cause::Stops).count();
    assert!(untold > 0 && little.rank + untold == little.tellable, "{} {untold} {}", little.rank, little.tellable);
}

#[test]
fn exact_readings_leave_no_tilt_to_be_stated() {
    let exact = Options { joint_noise: JointNoise::Known(0.0), model: RobotModel::Rigid, ..Options::default() };
    let record = record_of(&identify(chain(), &[world(2, 0.0)], &exact).unwrap());
    assert_eq!(record.cameras[0].apparent_tilt_rad, 0.0);
}

/// What is left out of a fit is decided by the limits that were given.
#[test]
fn narrow_limits_leave_more_observations_out() {
    let seen = world(4, 2e-5);
    let left_out = |sigmas: f64| {
        let usual = Limits::default();
        let limits = Limits { observation_sigmas: sigmas, observation_back_sigmas: 0.9 * sigmas, ..usual };
        let options = Options { model: RobotModel::Rigid, limits, ..Options::default() };
        let found = identify(chain(), std::slice::from_ref(&seen), &options).unwrap();
        found.fit.problem.images.iter().map(|i| i.observations.len() - i.used().count()).sum::<usize>()
    };
    let [usual, narrow] = [4.5, 3.0].map(left_out);
    assert!(narrow > usual + 5, "{usual} and {narrow}");
}

/// What the terminal counts as a doubt is a finding, which programs read.
#[test]
fn every_doubt_is_a_finding_with_a_code() {
    let mut seen = world(4, 2e-5);
    let without = seen.stops.len() - 1;
    seen.stops[without].observations = Vec::new().into();
    seen.stops[without].left_out = Some(ImageRejection::NoObservations);
    let doubtful =
        Limits { doubtful_share_left_out: 0.01, doubtful_gain: 1e9, doubtful_odd_image: 0.5, ..Limits::default() };
    let doubts = [Code::ImagesLeftOut, Code::SmallGain, Code::OddImage];
    for (limits, found) in [(doubtful, true), (Limits::default(), false)] {
        let options = Options { model: RobotModel::Rigid, limits, ..Options::default() };
        let record = record_of(&identify(chain(), std::slice::from_ref(&seen), &options).unwrap());
        for code in doubts {
            let own: Vec<_> = record.findings.iter().filter(|f| f.code == code).collect();
            assert_eq!(own.len(), usize::from(found), "{code}: {:?}", record.findings);
            assert!(own.iter().all(|f| f.weight == Weight::Note && !f.remedy.is_empty()));
        }
        let asked = Verdict::of(&record).reasons.len();
        assert!(record.failed_gates.is_empty() && if found { asked >= 3 } else { asked == 0 }, "{asked}");
    }
}

#[test]
fn images_off_the_robot_alone_are_no_robot() {
    let mut off = world(2, 2e-5);
    off.stops.iter_mut().for_each(|s| s.readings = None);
    let place = format!("joints.csv of {}", off.name);
    let error = identify(chain(), &[off], &Options::default()).unwrap_err();
    assert_eq!((error.code, error.place.as_str()), (Code::ReadingsMissing, place.as_str()));
    assert!(error.what.contains("40"), "{error}");
}

#[test]
fn a_camera_that_looked_straight_ahead_only_is_named() {
    let mut straight = world(3, 2e-5);
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let markers = straight.plate.markers.clone();
    for stop in &mut straight.stops {
        let camera_from_plate = Pose::from_xyz_rpy(
            [rng.random_range(-0.03..0.03), rng.random_range(-0.03..0.03), rng.random_range(0.3..0.6)],
            [std::f64::consts::PI, 0.0, rng.random_range(-3.0..3.0)],
        );
        let seen = stop.observations[0];
        let observation = |m: &Marker| {
            let x = camera_from_plate.transform(&m.position_m);
            let uv = [640.0 + 1000.0 * x.x / x.z, 512.0 + 1000.0 * x.y / x.z];
            Observation { marker: m.id, uv: uv.map(|v| v + rng.random_range(-0.05..0.05)), ..seen }
        };
        stop.observations = markers.iter().map(observation).collect();
    }
    let error = identify(chain(), &[straight], &Options::default()).unwrap_err();
    assert_eq!((error.code, error.place.as_str()), (Code::ViewsFrontal, "camera"), "{error}");
    assert!(error.what.contains("40"), "{error}");
}

/// A robot that did not stand still: joint noise, and images that are blurred and off.
#[test]
fn blurred_images_of_a_moving_robot_are_named() {
    let mut moving = world(5, 1e-3);
    for k in [7, 19] {
        for o in &mut moving.stops[k].observations {
            o.covariance = Some([9e-2, 0.0, 9e-2]);
        }
    }
    let solution =
        identify(chain(), &[moving.clone()], &Options { model: RobotModel::Rigid, ..Options::default() }).unwrap();
    let noise = solution.findings.iter().find(|f| f.code() == Code::JointNoiseLarge).unwrap();
    for k in [7, 19] {
        let image = Subject::Image(moving.stops[k].image.clone());
        assert!(noise.subjects().contains(&image), "{noise}");
    }
}

#[test]
fn clusters_contradict_a_wrong_noise_model_and_no_right_one() {
    let ratio = |seed: u64, model: RobotModel, joint_noise: JointNoise| {
        let options = Options { model, joint_noise, ..Options::default() };
        identify(chain(), &[world(seed, 1e-4)], &options).unwrap().uncertainty
    };
    let right: Vec<f64> = (1..=4)
        .flat_map(|seed| [RobotModel::Rigid, RobotModel::Full].map(|m| ratio(seed, m, JointNoise::Estimated)))
        .map(|worth| worth.clustered_ratio.unwrap())
        .collect();
    let wrong = ratio(1, RobotModel::Rigid, JointNoise::Known(0.0));
    println!("right noise model {right:?}, readings taken as exact {:?}", wrong.clustered_ratio);
    assert!(right.iter().all(|r| (0.8..1.15).contains(r)), "{right:?}");
    assert!(wrong.larger_stated && wrong.clustered_ratio.unwrap() > 1.5, "{:?}", wrong.clustered_ratio);
}

/// Readings that are trusted too much make the arm look as if something had moved.
#[test]
fn a_joint_noise_that_the_images_contradict_is_named_and_nothing_else() {
    let found = |joint_noise: JointNoise| {
        let options = Options { model: RobotModel::Rigid, joint_noise, ..Options::default() };
        identify(chain(), &[world(1, 1e-4)], &options).unwrap().findings
    };
    for stated in [0.0, 1e-6] {
        let findings = found(JointNoise::Known(stated));
        let failed: Vec<Code> = findings.iter().filter(|f| f.weight() == Weight::Gate).map(|f| f.code()).collect();
        println!("{stated}: {failed:?}");
        assert!(failed.contains(&Code::JointNoiseContradicted), "{stated}: {findings:?}");
        assert!(findings.iter().all(|f| !matches!(f, Finding::Displaced(_) | Finding::LooseMounting(_))), "{stated}");
    }
    assert!(found(JointNoise::Estimated).iter().all(|f| f.weight() != Weight::Gate));
    let none = identify(
        chain(),
        &[world(1, 0.0)],
        &Options { model: RobotModel::Rigid, joint_noise: JointNoise::Known(2e-4), ..Options::default() },
    );
    let too_much = none.unwrap().findings.iter().find_map(|f| match f {
        Finding::NoiseContradicted(found) => Some((found.weight, found.found, found.interval)),
        _ => None,
    });
    println!("none, 2e-4 stated: {too_much:?}");
    assert!(matches!(too_much, Some((Weight::Note, 0.0, [0.0, high])) if high > 0.0), "{too_much:?}");
    let true_size = found(JointNoise::Known(1e-4));
    assert!(true_size.iter().all(|f| f.code() != Code::JointNoiseContradicted), "{true_size:?}");
}

#[test]
fn evidence_prefers_the_rigid_model_for_a_rigid_robot() {
    let auto = Options { model: RobotModel::Auto, ..Options::default() };
    let solution = identify(chain(), &[world(3, 2e-5)], &auto).unwrap();
    println!("{:?}", solution.evidences);
    let best = solution.evidences.iter().find(|e| e.log_evidence == 0.0).unwrap();
    assert_eq!(best.model, RobotModel::Rigid);
    assert_eq!(solution.fit.state.robot.terms.len(), 6);
}

/// The terms of the full model take up all noise of a few stops; a rigid robot is not judged by that.
#[test]
fn a_rigid_robot_of_few_stops_is_found_rigid() {
    let mut few = world(5, 5e-5);
    few.stops.truncate(9);
    let auto = Options { model: RobotModel::Auto, ..Options::default() };
    let solution = identify(chain(), &[few], &auto).unwrap();
    println!("{:?}", solution.evidences);
    assert_eq!(solution.fit.state.robot.terms.len(), 6, "{:?}", solution.evidences);
}

#[test]
fn another_series_tells_a_calibrated_robot_from_the_nominal_one() {
    // Seeds share no robot: the second series is the second half of the first.
    let mut first = world(4, 2e-5);
    let mut second = first.clone();
    second.stops = first.stops.split_off(26);
    second.name = "second".into();
    let solution = identify(chain(), &[first], &Options { model: RobotModel::Rigid, ..Options::default() }).unwrap();
    let rms = |robot: &Robot| {
        let judged = verify_series(robot, std::slice::from_ref(&second), &Limits::default()).unwrap().into_images();
        let (sum, count) = judged.iter().fold((0.0, 0.0), |(s, c), i| (s + i.error.mm2, c + i.error.count));
        (sum / f64::max(count, 1.0)).sqrt()
    };
    let (nominal, calibrated) = (rms(&Robot::nominal(chain())), rms(&solution.fit.state.robot));
    println!("nominal {nominal:.3} mm, calibrated {calibrated:.3} mm");
    assert!(calibrated < 0.5 * nominal, "{nominal} {calibrated}");
}
