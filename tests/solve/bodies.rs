//! Trackers and sockets in the place of a camera: simulated robots with known truth.

use std::path::Path;

use nalgebra::{DVector, Vector3};
use robotcal::assess::{MeasuredPoint, fit_points};
use robotcal::calibration::Export;
use robotcal::diagnose::{Subject, Weight};
use robotcal::error::Code;
use robotcal::geom::Pose;
use robotcal::identify::{Options, RobotModel, Solution, identify};
use robotcal::model::robot::{Posture, Robot};
use robotcal::output::{Poses, restore, solution_json};
use robotcal::problem::{
    Adjustment, BodySeen, InstrumentKind, MeasuredSeries, MeasuredStop, SeenBody, SeenLength, Step,
};
use robotcal::solve::{Elimination, System};
use robotcal::urdf::{self, Chain};

use crate::support::small::Dice;

/// What measures, and how well.
#[derive(Clone, Copy, PartialEq)]
enum Kind {
    Points,
    Poses,
}

struct World {
    truth: Robot,
    chain: Chain,
    series: MeasuredSeries,
    sigma_m: f64,
    noise_rad: f64,
}

fn chain() -> Chain {
    let urdf = Path::new(env!("CARGO_MANIFEST_DIR")).join("robots/kuka_kr6_r900/kuka_kr6_r900.urdf");
    urdf::read(&urdf).unwrap().chain(None, None).unwrap()
}

fn stop(k: usize, readings: Vec<f64>) -> MeasuredStop {
    let (image, placement) = (format!("{k:03}"), "placement_0".to_owned());
    MeasuredStop { row: k, image, readings: Some(readings), placement, observations: Vec::new(), left_out: None }
}

/// Robot with errors of 0.5 mm and 1 mrad an axis.
fn truth(dice: &mut Dice, chain: &Chain) -> Robot {
    let mut robot = Robot::nominal(chain.clone());
    for twist in &mut robot.twists {
        for k in 0..6 {
            twist[k] = dice.normal(if k < 3 { 5e-4 } else { 1e-3 });
        }
    }
    robot
}

/// Readings of the middle of the workspace.
fn readings(dice: &mut Dice) -> Vec<f64> {
    let middle = [0.0, -1.2, 1.4, 0.0, 0.6, 0.0];
    let reach = [1.2, 0.5, 0.6, 1.8, 0.9, 2.5];
    middle.iter().zip(reach).map(|(m, r)| m + dice.between(-r, r)).collect()
}

impl World {
    fn new(seed: u64, kind: Kind, stops: usize, sigmas: (f64, f64), noise_rad: f64) -> Self {
        let mut dice = Dice::new(seed);
        let chain = chain();
        let truth = truth(&mut dice, &chain);
        Self::taken(dice, truth, kind, stops, sigmas, noise_rad, |dice| {
            let q = readings(dice);
            let errors = (0..q.len()).map(|_| dice.normal(noise_rad)).collect();
            (q, errors)
        })
    }

    /// Poses at stops within ten degrees of each other, of a robot with a share of the usual errors. Its joints are off by `drive_rad`
    /// at each reading, in waves of five degrees, and by as much noise where `repeats` is false.
    fn neighbours(seed: u64, share: f64, drive_rad: f64, repeats: bool) -> Self {
        let mut dice = Dice::new(seed);
        let chain = chain();
        let mut truth = truth(&mut dice, &chain);
        truth.twists.iter_mut().for_each(|twist| *twist *= share);
        Self::taken(dice, truth, Kind::Poses, 60, (3e-5, 5e-5), drive_rad, |dice| {
            let middle = [0.1, -1.1, 1.3, 0.2, 0.7, -0.1];
            let q: Vec<f64> = middle.iter().map(|m| m + dice.between(-0.1, 0.1)).collect();
            let wave = |(r, q): (usize, &f64)| drive_rad * std::f64::consts::SQRT_2 * (75.0 * q + r as f64).sin();
            let errors = match repeats {
                true => q.iter().enumerate().map(wave).collect(),
                false => q.iter().map(|_| dice.normal(drive_rad)).collect(),
            };
            (q, errors)
        })
    }

    fn taken(
        mut dice: Dice,
        truth: Robot,
        kind: Kind,
        stops: usize,
        (sigma_m, sigma_rad): (f64, f64),
        noise_rad: f64,
        mut at: impl FnMut(&mut Dice) -> (Vec<f64>, Vec<f64>),
    ) -> Self {
        let tip_from_body = dice.pose(0.15, 1.0);
        let base_from_tracker = dice.pose(2.5, 2.0);
        let mut all = Vec::new();
        let mut seen = Vec::new();
        for k in 0..stops {
            let (q, errors) = at(&mut dice);
            let body = truth.pose_at(&Posture::at(&q), &errors) * tip_from_body;
            let tracker_from_body = base_from_tracker.inverse() * body;
            let jitter = Vector3::from_fn(|_, _| dice.normal(sigma_m));
            let turn = Vector3::from_fn(|_, _| dice.normal(sigma_rad));
            let noise = nalgebra::Vector6::new(jitter.x, jitter.y, jitter.z, turn.x, turn.y, turn.z);
            let measured = tracker_from_body.perturbed(&noise);
            let what = match kind {
                Kind::Points => BodySeen::Point(measured.translation),
                _ => BodySeen::Pose(measured),
            };
            seen.push(SeenBody {
                stop: k,
                instrument: "tracker".into(),
                kind: InstrumentKind::Tracker,
                body: "reflector".into(),
                seen: what,
                sigma_m,
                sigma_rad: sigma_rad.max(1e-6),
            });
            all.push(stop(k, q));
        }
        let mut series = MeasuredSeries::without_images("run", true, all);
        series.bodies = seen;
        Self { chain: truth.chain.clone(), truth, series, sigma_m, noise_rad }
    }

    /// A ball on the tip, put into sockets with the tip turned to many directions.
    fn sockets(seed: u64, places: usize, stops_each: usize, sigma_m: f64, noise_rad: f64) -> Self {
        let mut dice = Dice::new(seed);
        let chain = chain();
        let truth = truth(&mut dice, &chain);
        let ball = Pose::new(nalgebra::Matrix3::identity(), Vector3::new(0.02, -0.03, 0.11));
        let mut world =
            Self { series: MeasuredSeries::without_images("run", true, Vec::new()), truth, chain, sigma_m, noise_rad };
        let mut centres = Vec::new();
        for place in 0..places {
            let centre = (world.truth.pose_at(&Posture::at(&readings(&mut dice)), &[0.0; 6]) * ball).translation;
            for _ in 0..stops_each {
                let q = loop {
                    if let Some(q) = world.reached(&mut dice, &ball, &centre) {
                        break q;
                    }
                };
                let k = world.series.stops.len();
                world.series.bodies.push(SeenBody {
                    stop: k,
                    instrument: format!("socket {place}"),
                    kind: InstrumentKind::Socket,
                    body: "ball".into(),
                    seen: BodySeen::Point(Vector3::zeros()),
                    sigma_m,
                    sigma_rad: 1.0,
                });
                world.series.stops.push(stop(k, q));
            }
            centres.push(centre);
        }
        for (k, pair) in centres.windows(2).enumerate() {
            world.series.lengths.push(SeenLength {
                between: [format!("socket {k}"), format!("socket {}", k + 1)],
                distance_m: (pair[1] - pair[0]).norm() + dice.normal(5e-5),
                sigma_m: 5e-5,
            });
        }
        world
    }

    /// Readings with which the true robot, its joint errors included, has the ball in the socket up to its noise.
    fn reached(&self, dice: &mut Dice, ball: &Pose, centre: &Vector3<f64>) -> Option<Vec<f64>> {
        let mut q = readings(dice);
        let errors: Vec<f64> = (0..q.len()).map(|_| dice.normal(self.noise_rad)).collect();
        let wanted = centre + Vector3::from_fn(|_, _| dice.normal(self.sigma_m));
        for _ in 0..30 {
            let kinematics = self.truth.kinematics(&Posture::at(&q), &errors);
            let body = kinematics.base_from_tip * *ball;
            let missing = wanted - body.translation;
            if missing.norm() < 1e-12 {
                return (q.iter().all(|q| q.abs() < 3.0)).then_some(q);
            }
            let j = nalgebra::Matrix3xX::from_columns(
                &kinematics
                    .d_readings
                    .iter()
                    .map(|d| {
                        let (rho, phi) = (d.fixed_rows::<3>(0).into_owned(), d.fixed_rows::<3>(3).into_owned());
                        kinematics.base_from_tip.rotation * (rho + phi.cross(&ball.translation))
                    })
                    .collect::<Vec<_>>(),
            );
            let step = j.clone().svd(true, true).pseudo_inverse(1e-9).unwrap() * missing;
            let longest = step.amax();
            let share = if longest > 0.3 { 0.3 / longest } else { 1.0 };
            q.iter_mut().zip(step.iter()).for_each(|(q, s)| *q += share * s);
        }
        None
    }

    fn solve(&self, model: RobotModel) -> Solution {
        self.solve_with(&Options { model, ..Options::default() })
    }

    fn solve_with(&self, options: &Options) -> Solution {
        identify(self.chain.clone(), std::slice::from_ref(&self.series), options).unwrap()
    }

    /// RMS error of points on the tip, mm, over joint vectors that were not measured, the base frame and the point fitted.
    fn error_mm(&self, robot: &Robot) -> f64 {
        let mut dice = Dice::new(999);
        let points: Vec<MeasuredPoint> = (0..120)
            .map(|_| {
                let readings = readings(&mut dice);
                let at = self.truth.base_from_tip(&readings).transform(&Vector3::new(0.05, 0.02, 0.1));
                MeasuredPoint { position_m: at, readings }
            })
            .collect();
        1e3 * fit_points(robot, &points).unwrap().rms_m
    }
}

fn check(world: &World, most_mm: f64) {
    let solution = world.solve(RobotModel::Rigid);
    let nominal = world.error_mm(&Robot::nominal(world.chain.clone()));
    let found = world.error_mm(&solution.exported_robot());
    let factors = &solution.fit.problem.noise.body;
    println!("{nominal:.3} -> {found:.3} mm, factors {factors:?}, joint noise {:?}", solution.fit.problem.noise.joint);
    println!("held out {:?}", solution.accuracy.calibrated);
    assert!(found < most_mm.min(0.25 * nominal), "{nominal} {found}");
}

#[test]
fn a_robot_is_identified_from_tracker_points_alone() {
    check(&World::new(1, Kind::Points, 80, (3e-5, 0.0), 2e-5), 0.15);
}

#[test]
fn a_robot_is_identified_from_tracker_poses_alone() {
    check(&World::new(2, Kind::Poses, 40, (3e-5, 5e-5), 2e-5), 0.1);
}

#[test]
fn a_robot_is_identified_from_a_ball_in_sockets() {
    check(&World::sockets(3, 4, 25, 5e-5, 2e-5), 0.3);
}

/// Errors of drives that come back with the reading look like links where all stops are neighbours.
#[test]
fn a_robot_seen_at_neighbouring_stops_is_held_near_nominal_elsewhere() {
    let mut options = Options::default();
    options.limits.extrapolation_ratio = f64::MAX;
    // Sums of squares: nominal, held, not held.
    let mut sums = [0.0; 3];
    for seed in 21..27 {
        let world = World::neighbours(seed, 0.2, 2e-4, true);
        let solution = world.solve(RobotModel::Auto);
        let free = world.solve_with(&options).exported_robot();
        let robots = [Robot::nominal(world.chain.clone()), solution.exported_robot(), free];
        let errors = robots.map(|robot| world.error_mm(&robot));
        println!("seed {seed}: nominal, held, not held {errors:.3?} mm");
        assert!(solution.findings.iter().any(|f| f.code() == Code::HeldNearNominal), "seed {seed}");
        sums.iter_mut().zip(errors).for_each(|(sum, e)| *sum += e * e);
    }
    let [nominal, held, free] = sums.map(f64::sqrt);
    println!("together {nominal:.3}, {held:.3}, {free:.3} mm");
    // Six robots know a ratio of errors to a fifth.
    assert!(held < 1.2 * nominal && held < 0.6 * free, "{nominal} {held} {free}");
}

/// Noise from stop to stop is what the fit takes it for, and nothing is held.
#[test]
fn a_robot_with_joint_noise_alone_is_left_as_the_data_say() {
    for seed in 31..34 {
        let solution = World::neighbours(seed, 0.2, 2e-4, false).solve(RobotModel::Auto);
        assert!(solution.fit.problem.restraint.is_none(), "seed {seed}");
    }
}

/// Away from the optimum, so that the gradient is not nearly zero.
fn shaken(solution: &Solution) -> Adjustment {
    let mut dice = Dice::new(5);
    let mut adjustment = solution.fit.adjustment.clone();
    let layout = adjustment.problem.layout.clone();
    let dense: Vec<f64> = layout.columns.iter().map(|c| if c.free { dice.normal(3e-5) } else { 0.0 }).collect();
    let joint_errors = adjustment.state.joint_errors.iter().map(|s| s.iter().map(|_| dice.normal(3e-5)).collect());
    let step = Step {
        dense: DVector::from_vec(dense),
        joint_errors: joint_errors.collect(),
        ties: Vec::new(),
        markers: Vec::new(),
    };
    adjustment.state = adjustment.state.moved(&layout, &step);
    adjustment
}

#[test]
fn the_gradient_of_measured_bodies_is_that_of_the_cost() {
    for world in [
        World::new(4, Kind::Points, 12, (3e-5, 0.0), 2e-5),
        World::new(5, Kind::Poses, 12, (3e-5, 5e-5), 2e-5),
        World::sockets(6, 3, 8, 5e-5, 2e-5),
    ] {
        let adjustment = shaken(&world.solve(RobotModel::Gear));
        let (problem, state) = (&adjustment.problem, &adjustment.state);
        let lin = adjustment.linearise().unwrap();
        let system = System::with(Elimination::Markers, adjustment.linear(&lin), 0.0);
        let starts = &system.latent_start;
        let mut dice = Dice::new(8);
        for _ in 0..20 {
            let draw = |dice: &mut Dice, free: bool| if free { dice.normal(1.0) } else { 0.0 };
            let dense: Vec<f64> = problem.layout.columns.iter().map(|c| draw(&mut dice, c.free)).collect();
            let errors: Vec<Vec<f64>> =
                state.joint_errors.iter().map(|s| s.iter().map(|_| draw(&mut dice, true)).collect()).collect();
            let along: f64 = dense.iter().zip(system.rhs.iter()).map(|(d, g)| d * g).sum::<f64>()
                + (errors.iter().zip(starts))
                    .map(|(e, &s)| e.iter().enumerate().map(|(k, e)| e * system.rhs[s + k]).sum::<f64>())
                    .sum::<f64>();
            let cost = |h: f64| {
                let step = Step {
                    dense: DVector::from_vec(dense.clone()) * h,
                    joint_errors: errors.iter().map(|e| e.iter().map(|e| e * h).collect()).collect(),
                    ties: Vec::new(),
                    markers: Vec::new(),
                };
                let state = state.moved(&problem.layout, &step);
                Adjustment { problem: problem.clone(), state }.linearise().unwrap().cost
            };
            let h = 1e-7;
            let numeric = -(cost(h) - cost(-h)) / (2.0 * h);
            assert!((along - numeric).abs() < 1e-4 * along.abs().max(1e6), "{along} {numeric}");
        }
    }
}

#[test]
fn both_eliminations_of_measured_bodies_take_the_same_step() {
    let adjustment = shaken(&World::new(5, Kind::Poses, 12, (3e-5, 5e-5), 2e-5).solve(RobotModel::Rigid));
    let lin = adjustment.linearise().unwrap();
    let linear = adjustment.linear(&lin);
    let [a, b] = [Elimination::Markers, Elimination::Stops].map(|which| {
        let system = System::with(which, linear, 0.0);
        let x = system.factor(linear).unwrap().solve(&system.rhs);
        (system.step(linear, &x), system.decrement(&x), linear.covariance_by(which).unwrap())
    });
    let size = a.0.dense.amax();
    assert!((&a.0.dense - &b.0.dense).amax() < 1e-8 * size, "{}", (&a.0.dense - &b.0.dense).amax() / size);
    assert!((a.1 - b.1).abs() < 1e-8 * a.1);
    for (own, other) in a.0.joint_errors.iter().zip(&b.0.joint_errors) {
        assert!(own.iter().zip(other).all(|(a, b)| (a - b).abs() < 1e-11));
    }
    let sigma = |k: usize, of: &(Step, f64, robotcal::solve::Covariance)| of.2.sigma(k);
    let columns = adjustment.problem.layout.len();
    assert!((0..columns).all(|k| (sigma(k, &a) - sigma(k, &b)).abs() <= 1e-6 * sigma(k, &a)));
}

/// The series of a world as the files of a folder.
fn written(world: &World, folder: &Path) {
    let joints = &world.chain.readings;
    let mut rows = format!("stop,{}\n", joints.join(","));
    let mut contacts = String::from("stop,contact\n");
    for stop in &world.series.stops {
        let cells: Vec<String> = stop.readings.as_ref().unwrap().iter().map(|q| format!("{q:?}")).collect();
        rows += &format!("{},{}\n", stop.image, cells.join(","));
    }
    for seen in &world.series.bodies {
        contacts += &format!("{},{}\n", world.series.stops[seen.stop].image, seen.instrument);
    }
    let mut settings = format!("format = 1\njoint_unit = \"rad\"\n[contact]\nsigma_m = {}\n", world.sigma_m);
    for l in &world.series.lengths {
        let [a, b] = &l.between;
        settings += &format!(
            "[[distance]]\nbetween = [\"{a}\", \"{b}\"]\ndistance_m = {:?}\nsigma_m = {}\n",
            l.distance_m, l.sigma_m
        );
    }
    for (name, text) in [("joints.csv", rows), ("contacts.csv", contacts), ("series.toml", settings)] {
        std::fs::write(folder.join(name), text).unwrap();
    }
}

#[test]
fn a_folder_of_contacts_gives_a_robot_and_its_record_gives_it_again() {
    let world = World::sockets(7, 3, 14, 5e-5, 2e-5);
    let folder = tempfile::tempdir().unwrap();
    written(&world, folder.path());
    let urdf = Path::new(env!("CARGO_MANIFEST_DIR")).join("robots/kuka_kr6_r900/kuka_kr6_r900.urdf");
    let options = Options { model: RobotModel::Rigid, ..Options::default() };
    let calibration = robotcal::calibrate(&urdf, [folder.path()], &options).unwrap();
    let files = calibration.files(&Export { poses: Poses::Written, ..Export::default() }).unwrap();
    assert!(files.keys().any(|name| name.ends_with(".urdf")) && files.contains_key("report.html"));
    assert!(!files.contains_key("poses_covariance.npy"), "there are no poses");
    assert!(!files.keys().any(|name| name.starts_with("camera") || name.starts_with("plate")), "{:?}", files.keys());
    let record = solution_json::read(&files["solution.json"]).unwrap();
    assert_eq!((record.bodies.measurements.len(), record.bodies.lengths.len()), (42, 2));
    let again = identify(world.chain.clone(), &restore::measured_series(&record).unwrap(), &options).unwrap();
    let first = &calibration.solution().fit.state.robot.twists;
    let same = again.fit.state.robot.twists.iter().zip(first).all(|(a, b)| (a - b).amax() < 1e-9);
    assert!(same, "solved again from the record, the robot is another one");
}

#[test]
fn a_ball_that_sat_in_another_socket_is_left_out_by_name() {
    let mut world = World::sockets(7, 3, 14, 5e-5, 2e-5);
    world.series.bodies[5].instrument = "socket 2".into();
    let solution = world.solve(RobotModel::Rigid);
    let out: Vec<usize> = (solution.fit.problem.body_measurements.iter().enumerate())
        .filter(|(_, m)| m.rejected.is_some())
        .map(|(k, _)| k)
        .collect();
    assert_eq!(out, [5]);
    let found = solution.findings.iter().find(|f| f.code() == Code::MeasurementsLeftOut).unwrap();
    assert_eq!(found.subjects(), [Subject::Stop("005".into())]);
}

#[test]
fn a_left_out_measurement_is_named_by_its_own_series_behind_several_cameras() {
    let mut world = World::sockets(7, 3, 14, 5e-5, 2e-5);
    world.series.bodies[5].instrument = "socket 2".into();
    // Two views of one run have their stops in common: there are fewer runs than series.
    let view = |name: &str| {
        let stops = world.series.stops[..3].iter().cloned().enumerate().map(|(row, s)| MeasuredStop { row, ..s });
        let own = MeasuredSeries::without_images(name, true, stops.collect());
        MeasuredSeries { run: Some("cell".into()), ..own }
    };
    let series = [view("cell left"), view("cell right"), world.series.clone()];
    let options = Options { model: RobotModel::Rigid, ..Options::default() };
    let solution = identify(world.chain.clone(), &series, &options).unwrap();
    let found = solution.findings.iter().find(|f| f.code() == Code::MeasurementsLeftOut).unwrap();
    assert_eq!(found.subjects(), [Subject::Stop("005".into())]);
}

/// What is said of the scatter of positions and of rotations.
fn scatter(series: &MeasuredSeries, chain: &Chain) -> Vec<(String, Weight)> {
    let solution = identify(chain.clone(), std::slice::from_ref(series), &Options::default()).unwrap();
    let found = solution.findings.iter().filter(|f| f.code() == Code::MeasurementsScatter);
    found.map(|f| (f.quantities()[0].name.clone(), f.weight())).collect()
}

#[test]
fn measurements_that_miss_their_stated_sigma_by_far_are_named() {
    let world = World::new(11, Kind::Poses, 40, (5e-5, 1e-4), 2e-5);
    assert_eq!(scatter(&world.series, &world.chain), []);
    let with = |change: &dyn Fn(usize, &mut Pose)| {
        let mut series = world.series.clone();
        for body in &mut series.bodies {
            if let BodySeen::Pose(pose) = &mut body.seen {
                change(body.stop, pose);
            }
        }
        scatter(&series, &world.chain)
    };
    let positions = |weight| vec![("position_sigma_factor".to_owned(), weight)];
    // The tracker was pushed by a millimetre, by five, and it counts x the other way.
    let pushed = |by: f64| with(&|stop, pose| pose.translation.x += if stop >= 22 { by } else { 0.0 });
    assert_eq!(pushed(1e-3), positions(Weight::Note));
    assert_eq!(pushed(5e-3), positions(Weight::Gate));
    assert_eq!(with(&|_, pose| pose.translation.x *= -1.0), positions(Weight::Gate));
    // target_from_instrument for instrument_from_target.
    let inverted = with(&|_, pose| pose.rotation = pose.rotation.transpose());
    assert_eq!(inverted, [("rotation_sigma_factor".to_owned(), Weight::Gate)]);
}

/// What is said of the size of measured lengths: by how much they are too long.
fn sizes_doubted(series: MeasuredSeries, chain: &Chain) -> Vec<f64> {
    let solution = identify(chain.clone(), &[series], &Options::default()).unwrap();
    let doubted = solution.findings.iter().filter(|f| f.code() == Code::LengthsContradicted && f.fails());
    doubted.map(|f| f.quantities()[0].value).collect()
}

#[test]
fn a_tracker_one_or_two_percent_off_is_doubted_and_one_in_order_is_not() {
    for (kind, sigma_rad) in [(Kind::Points, 0.0), (Kind::Poses, 5e-5)] {
        let world = World::new(41, kind, 60, (3e-5, sigma_rad), 2e-5);
        for factor in [1.0, 1.02, 1.01, 0.99, 0.98] {
            let mut series = world.series.clone();
            for seen in &mut series.bodies {
                match &mut seen.seen {
                    BodySeen::Point(at) => *at *= factor,
                    BodySeen::Pose(pose) => pose.translation *= factor,
                }
            }
            let said = sizes_doubted(series, &world.chain);
            match said[..] {
                [] => assert_eq!(factor, 1.0),
                // The links are found to a few parts in a thousand.
                [off] => assert!(factor != 1.0 && (off - (factor - 1.0)).abs() < 4e-3, "{factor}: {off}"),
                _ => panic!("{said:?}"),
            }
        }
    }
}

#[test]
fn distances_between_sockets_that_are_wrong_alike_are_doubted() {
    let world = World::sockets(42, 4, 25, 5e-5, 2e-5);
    assert_eq!(sizes_doubted(world.series.clone(), &world.chain), Vec::<f64>::new());
    let mut series = world.series;
    series.lengths.iter_mut().for_each(|l| l.distance_m *= 1.02);
    let said = sizes_doubted(series, &world.chain);
    assert!(matches!(said[..], [off] if (off - 0.02).abs() < 6e-3), "{said:?}");
}

/// Usual mistakes in the readings are refused by name, as with images, and not fitted away.
#[test]
fn mistakes_in_readings_are_named_by_a_tracker_alone() {
    for (kind, sigma_rad) in [(Kind::Points, 0.0), (Kind::Poses, 5e-5)] {
        let world = World::new(43, kind, 60, (3e-5, sigma_rad), 2e-5);
        let named = |change: &dyn Fn(&mut Vec<f64>)| {
            let mut series = world.series.clone();
            series.stops.iter_mut().filter_map(|s| s.readings.as_mut()).for_each(change);
            let said = identify(world.chain.clone(), &[series], &Options::default()).map(|_| ()).unwrap_err();
            (said.code, said.place)
        };
        let at = |joints: &str| joints.to_owned();
        assert_eq!(named(&|q| q[2] = -q[2]), (Code::JointSignWrong, at("joint_a3")));
        assert_eq!(named(&|q| q[4] = -q[4]), (Code::JointSignWrong, at("joint_a5")));
        assert_eq!(named(&|q| q.swap(3, 5)), (Code::JointOrderWrong, at("joint_a4, joint_a6")));
        assert_eq!(named(&|q| q[2] += q[1]), (Code::JointCoupled, at("joint_a3")));
    }
}

#[test]
fn zeros_that_are_far_off_are_no_good_result_of_a_tracker() {
    let world = World::new(44, Kind::Poses, 60, (3e-5, 5e-5), 2e-5);
    let mut series = world.series.clone();
    for q in series.stops.iter_mut().filter_map(|s| s.readings.as_mut()) {
        (q[1], q[2]) = (q[1] + 8f64.to_radians(), q[2] - 10f64.to_radians());
    }
    let solution = identify(world.chain.clone(), &[series], &Options::default()).unwrap();
    let off = solution.findings.iter().filter(|f| f.code() == Code::ParameterOff && f.fails()).count();
    assert!(off > 0, "{:?}", solution.findings);
}
