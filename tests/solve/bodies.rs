//! Trackers and sockets in the place of a camera: simulated robots with known truth.

use std::path::Path;

use nalgebra::DVector;
use robotcal::calibration::Export;
use robotcal::diagnose::{Carried, Displacement, Finding, Subject, Weight};
use robotcal::error::Code;
use robotcal::geom::Pose;
use robotcal::identify::{Options, RobotModel, Solution, identify};
use robotcal::model::robot::Robot;
use robotcal::output::{Poses, restore, solution_json};
use robotcal::problem::{Adjustment, BodySeen, MeasuredSeries, MeasuredStop, Step};
use robotcal::solve::{Elimination, System};
use robotcal::urdf::Chain;

use crate::measured_worlds::{Kind, World};
use crate::robots::kr6_urdf;
use crate::said::assert_says;
use crate::support::small::Dice;

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

/// At some of many stops the wrist is nearly singular: joint errors cannot be what a nominal robot misses by there.
#[test]
fn base_and_tool_of_a_nominal_robot_stand_where_it_misses_least() {
    let world = World::new(4, Kind::Poses, 600, (3e-5, 5e-5), 2e-5);
    let held_out = world.solve(RobotModel::Rigid).accuracy.nominal.rms_mm;
    let least = world.error_mm(&Robot::nominal(world.chain.clone()));
    println!("nominal: held out {held_out:.3} mm, best fit {least:.3} mm");
    // 120 other joint vectors tell the RMS to some percent; rotations take part in the fit of the poses.
    assert!(held_out < 1.15 * least, "{held_out} {least}");
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
    let urdf = kr6_urdf();
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

/// Touches that are said to be of one socket: it may have moved.
#[test]
fn the_socket_that_all_left_out_touches_are_of_is_named() {
    for (wrong, named) in [(&[2, 30, 45][..], Some("socket 1")), (&[2], None)] {
        let mut world = World::sockets(7, 4, 14, 5e-5, 2e-5);
        wrong.iter().for_each(|k: &usize| world.series.bodies[*k].instrument = "socket 1".into());
        let solution = world.solve(RobotModel::Rigid);
        let found = solution.findings.iter().find_map(|finding| match finding {
            Finding::MeasurementsLeftOut(found) => Some(found),
            _ => None,
        });
        let found = found.unwrap();
        assert_eq!((found.named.len(), found.all_of.as_deref()), (wrong.len(), named));
    }
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
    for (times, weight) in [(5.0, Weight::Note), (20.0, Weight::Gate)] {
        let mut series = World::new(11, Kind::Poses, 40, (times * 5e-5, 1e-4), 2e-5).series;
        series.bodies.iter_mut().for_each(|body| body.sigma_m = 5e-5);
        assert_eq!(scatter(&series, &world.chain), [("position_sigma_factor".to_owned(), weight)]);
    }
}

/// With what `change` makes of what was seen at each stop.
fn changed(world: &World, change: impl Fn(usize, &mut Pose)) -> MeasuredSeries {
    let mut series = world.series.clone();
    for body in &mut series.bodies {
        match &mut body.seen {
            BodySeen::Pose(pose) => change(body.stop, pose),
            BodySeen::Point(at) => {
                let mut pose = Pose::new(nalgebra::Matrix3::identity(), *at);
                change(body.stop, &mut pose);
                *at = pose.translation;
            }
        }
    }
    series
}

#[test]
fn a_tracker_and_a_target_that_move_are_named_with_the_stop() {
    let moved = Pose::from_xyz_rpy([8e-4, -6e-4, 0.0], [0.0; 3]);
    for (kind, sigma_rad) in [(Kind::Points, 0.0), (Kind::Poses, 1e-4)] {
        let world = World::new(12, kind, 60, (3e-5, sigma_rad), 2e-5);
        let said = |series: MeasuredSeries| {
            let solution = identify(world.chain.clone(), &[series], &Options::default()).unwrap();
            let displaced = |f| if let Finding::Displaced(found) = f { Some(found) } else { None };
            let all: Vec<_> = solution.findings.into_iter().filter(Finding::fails).filter_map(displaced).collect();
            let [found] = &all[..] else { panic!("{all:?}") };
            assert!((found.distance_m.0 - 1e-3).abs() < 1e-4, "{found:?}");
            (found.body, found.displacement, found.images[0].clone())
        };
        let from = |stop: usize| move |k: usize| k >= stop;
        let pushed = changed(&world, |k, pose| *pose = if from(22)(k) { moved * *pose } else { *pose });
        assert_eq!(said(pushed), (Carried::Instrument, Displacement::FromThenOn, "022".into()));
        if kind == Kind::Poses {
            let slipped = changed(&world, |k, pose| *pose = if from(35)(k) { *pose * moved } else { *pose });
            assert_eq!(said(slipped), (Carried::Target, Displacement::FromThenOn, "035".into()));
        }
    }
}

/// What is done to every pose, and the code with which it is refused.
type Misread<'a> = (&'a dyn Fn(&mut Pose), Code);

/// Files that are read in another way than they were written are refused by name, and not fitted.
#[test]
fn mistakes_in_the_file_of_a_tracker_are_named() {
    let turned = |pose: &mut Pose, to: [f64; 4]| *pose = Pose::from_xyz_quaternion(pose.xyz(), to);
    for (kind, sigma_rad) in [(Kind::Points, 0.0), (Kind::Poses, 1e-4)] {
        let world = World::new(13, kind, 30, (3e-5, sigma_rad), 2e-5);
        let said = |change: &dyn Fn(&mut Pose)| {
            let series = changed(&world, |_, pose| change(pose));
            identify(world.chain.clone(), &[series], &Options::default()).map_or_else(|e| Some(e.code), |_| None)
        };
        let mirrored = |pose: &mut Pose| {
            pose.translation.z *= -1.0;
            let [x, y, z, w] = pose.quaternion_xyzw();
            turned(pose, [-x, -y, z, w]);
        };
        let scalar_first = |pose: &mut Pose| {
            let [x, y, z, w] = pose.quaternion_xyzw();
            turned(pose, [w, x, y, z]);
        };
        let of_positions: [Misread; 5] = [
            (&|pose| pose.translation *= 1e3, Code::MeasuredUnit),
            (&|pose| pose.translation *= 1e2, Code::MeasuredUnit),
            (&|pose| pose.translation /= 0.0254, Code::MeasuredUnit),
            (&|pose| pose.translation /= 0.3048, Code::MeasuredUnit),
            (&|pose| pose.translation.x *= -1.0, Code::AxesMirrored),
        ];
        let other_angles = |pose: &mut Pose| {
            let [roll, pitch, yaw] = pose.rpy();
            *pose = Pose::from_xyz_rpy(pose.xyz(), [yaw, pitch, roll]);
        };
        let of_poses: [Misread; 6] = [
            (&mirrored, Code::AxesMirrored),
            (&|pose| pose.translation.swap_rows(0, 1), Code::AxesMirrored),
            (&other_angles, Code::RotationConvention),
            (&|pose| pose.rotation = pose.rotation.transpose(), Code::PosesInverted),
            (&|pose| *pose = pose.inverse(), Code::PosesInverted),
            (&scalar_first, Code::RotationConvention),
        ];
        let tried = of_positions.iter().chain(of_poses.iter().filter(|_| kind == Kind::Poses));
        let said: Vec<_> = tried.map(|(change, code)| (said(change), Some(*code))).collect();
        assert!(said.iter().all(|(said, code)| said == code), "{said:?}");
    }
}

#[test]
fn labels_of_two_sockets_that_were_exchanged_are_left_out_by_name() {
    let mut world = World::sockets(14, 4, 8, 5e-5, 2e-5);
    world.series.bodies[3].instrument = "socket 1".into();
    world.series.bodies[12].instrument = "socket 0".into();
    let solution = world.solve(RobotModel::Rigid);
    let found = solution.findings.iter().find(|f| f.code() == Code::MeasurementsLeftOut).unwrap();
    assert_eq!(found.subjects(), [Subject::Stop("003".into()), Subject::Stop("012".into())]);
}

#[test]
fn mistakes_in_readings_are_named_by_sockets_alone() {
    let world = World::sockets(15, 4, 12, 5e-5, 2e-5);
    let named = |change: &dyn Fn(&mut Vec<f64>)| {
        let mut series = world.series.clone();
        series.stops.iter_mut().filter_map(|s| s.readings.as_mut()).for_each(change);
        identify(world.chain.clone(), &[series], &Options::default()).map(|_| ()).unwrap_err().code
    };
    assert_eq!(named(&|q| q[4] = -q[4]), Code::JointSignWrong);
    assert_eq!(named(&|q| q.swap(3, 5)), Code::JointOrderWrong);
    assert_eq!(named(&|q| q.iter_mut().for_each(|q| *q = q.to_degrees())), Code::JointUnitWrong);
}

/// An arm that hardly moves keeps any ball in its socket.
#[test]
fn readings_of_other_stops_are_no_wrong_unit_in_sockets() {
    let world = World::sockets(15, 4, 12, 5e-5, 2e-5);
    let mut series = world.series.clone();
    let readings: Vec<_> = series.stops.iter().map(|s| s.readings.clone()).collect();
    let count = readings.len();
    series.stops.iter_mut().enumerate().for_each(|(k, stop)| stop.readings = readings[(5 * k + 7) % count].clone());
    // No mistake explains them: the fit has an end, and is not to be trusted.
    let solution = identify(world.chain.clone(), &[series], &Options::default()).unwrap();
    let gates: Vec<Code> = solution.findings.iter().filter(|f| f.fails()).map(|f| f.code()).collect();
    assert!(gates.contains(&Code::ParameterOff) && !gates.contains(&Code::JointUnitWrong), "{gates:?}");
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
        let world = World::new(43, kind, 30, (3e-5, sigma_rad), 2e-5);
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
fn a_joint_that_was_not_read_any_more_is_named_by_a_tracker() {
    let world = World::new(43, Kind::Poses, 30, (3e-5, 5e-5), 2e-5);
    let mut series = world.series.clone();
    let last = series.stops[14].readings.as_ref().unwrap()[2];
    series.stops[15..].iter_mut().filter_map(|s| s.readings.as_mut()).for_each(|q| q[2] = last);
    let solution = identify(world.chain.clone(), &[series], &Options::default()).unwrap();
    let still = solution.findings.iter().find_map(|f| match f {
        Finding::JointNoiseLarge(noise) if f.fails() => {
            noise.stands_still.clone().map(|still| (&noise.joint, still.stops))
        }
        _ => None,
    });
    assert_eq!(still, Some((&"joint_a3".to_owned(), 16)), "{:?}", solution.findings);
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

/// What an instrument or a body that was moved is refused with: its code, the stop, and by how much.
fn moved_at(series: MeasuredSeries, chain: &Chain) -> (Code, String, f64) {
    let said = identify(chain.clone(), &[series], &Options::default()).map(|_| ()).unwrap_err();
    let stop = said.place.rsplit(' ').next().unwrap().to_owned();
    (said.code, stop, said.quantities.iter().find(|q| q.name == "distance").unwrap().value)
}

/// The start goes by a part of the rows: no least squares over both stations is near either.
#[test]
fn a_tracker_that_was_set_up_anew_is_named_with_the_stop_by_its_points() {
    let world = World::new(51, Kind::Points, 40, (3e-5, 0.0), 2e-5);
    for (from, turn) in [(22, 0.1), (16, 0.3), (20, 1.0)] {
        let anew = Pose::from_xyz_rpy([0.5 * turn, -0.4 * turn, 0.3 * turn], [0.3 * turn, 0.5 * turn, 0.8 * turn]);
        let series = changed(&world, |k, pose| *pose = if k >= from { anew * *pose } else { *pose });
        let (code, stop, distance_m) = moved_at(series, &world.chain);
        assert_eq!((code, stop), (Code::TrackerDisplaced, format!("{from:03}")));
        assert!(distance_m > 0.05 * turn, "{distance_m}");
    }
}

#[test]
fn a_reflector_that_was_set_elsewhere_is_named_with_the_stop_by_its_points() {
    let world = World::new(52, Kind::Points, 40, (3e-5, 0.0), 2e-5);
    let mut series = world.series.clone();
    let off = nalgebra::Vector3::new(0.09, -0.05, 0.06);
    let tracker_from_base = {
        let placed = world.solve(RobotModel::Rigid);
        placed.fit.state.instruments[0].inverse()
    };
    for seen in &mut series.bodies[24..] {
        let tip = world.truth.base_from_tip(series.stops[seen.stop].readings.as_ref().unwrap());
        let BodySeen::Point(at) = &mut seen.seen else { panic!("points") };
        *at += tracker_from_base.rotation * tip.rotation * off;
    }
    let said = identify(world.chain.clone(), std::slice::from_ref(&series), &Options::default()).map(|_| ());
    assert_says(&said.unwrap_err(), Code::TargetDisplaced, &["reflector"]);
    let (code, stop, distance_m) = moved_at(series, &world.chain);
    assert_eq!((code, stop), (Code::TargetDisplaced, "024".to_owned()));
    assert!((distance_m - off.norm()).abs() < 0.01, "{distance_m}");
}

/// One wrong pair, the last row beside the first, draws least squares by tens of millimetres.
#[test]
fn points_shifted_by_a_row_are_named_whatever_stands_at_the_ends() {
    for (seed, stops) in [(53, 40), (54, 40), (55, 100)] {
        let world = World::new(seed, Kind::Points, stops, (3e-5, 0.0), 2e-5);
        for later in [true, false] {
            let mut series = world.series.clone();
            let last = series.bodies.len() - 1;
            series.bodies.remove(if later { last } else { 0 });
            series.bodies.iter_mut().for_each(|seen| seen.stop = if later { seen.stop + 1 } else { seen.stop - 1 });
            let said = identify(world.chain.clone(), &[series], &Options::default()).map(|_| ()).unwrap_err();
            assert_eq!(said.code, Code::RowsShifted, "{said}");
            assert!(
                said.remedy.contains("joints.csv"),
                "no other instrument says whose rows they are: {}",
                said.remedy
            );
        }
    }
}

/// Where poses of another target fit the readings, the rows of the points are wrong, and the other way round.
#[test]
fn the_table_that_others_contradict_is_named_where_rows_are_shifted() {
    let points = World::new(56, Kind::Points, 40, (3e-5, 0.0), 2e-5);
    let poses = World::new(56, Kind::Poses, 40, (3e-5, 5e-5), 2e-5);
    let readings = |world: &World| world.series.stops.iter().map(|s| s.readings.clone()).collect::<Vec<_>>();
    let tracker_from_base = |world: &World| world.solve(RobotModel::Rigid).fit.state.instruments[0].inverse();
    // Both at the stops of the points, seen in the frame of its tracker.
    let frame = tracker_from_base(&points);
    let target = Pose::from_xyz_rpy([0.04, 0.02, 0.1], [0.2, 0.1, -0.3]);
    let mut both = points.series.clone();
    for (k, q) in readings(&points).iter().enumerate() {
        let seen = frame * points.truth.base_from_tip(q.as_ref().unwrap()) * target;
        let of_pose = robotcal::problem::SeenBody {
            stop: k,
            body: "target".into(),
            seen: BodySeen::Pose(seen),
            ..poses.series.bodies[k].clone()
        };
        both.bodies.push(of_pose);
    }
    for (shifted, table) in [("reflector", "points.csv"), ("target", "poses.csv")] {
        let mut series = both.clone();
        series.bodies.retain(|seen| seen.body != shifted || seen.stop < 39);
        series.bodies.iter_mut().filter(|seen| seen.body == shifted).for_each(|seen| seen.stop += 1);
        let said = identify(points.chain.clone(), &[series], &Options::default()).map(|_| ()).unwrap_err();
        assert_says(&said, Code::RowsShifted, &[table]);
    }
}

#[test]
fn points_of_other_places_are_left_out_and_do_not_draw_the_others() {
    let world = World::new(57, Kind::Points, 40, (3e-5, 0.0), 2e-5);
    let mut series = world.series.clone();
    for k in [3, 7, 9, 12] {
        series.bodies[k].seen = BodySeen::Point(nalgebra::Vector3::zeros());
    }
    let solution = identify(world.chain.clone(), &[series], &Options::default()).unwrap();
    let out: Vec<usize> = (solution.fit.problem.body_measurements.iter().enumerate())
        .filter(|(_, m)| m.rejected.is_some())
        .map(|(k, _)| k)
        .collect();
    assert_eq!(out, [3, 7, 9, 12]);
}

#[test]
fn several_balls_in_another_socket_are_left_out_and_not_those_of_that_socket() {
    let mut world = World::sockets(5, 4, 15, 5e-5, 2e-5);
    let wrong = [17, 20, 33, 40, 50];
    wrong.iter().for_each(|&k| world.series.bodies[k].instrument = "socket 0".into());
    let solution = world.solve(RobotModel::Rigid);
    let out: Vec<usize> = (solution.fit.problem.body_measurements.iter().enumerate())
        .filter(|(_, m)| m.rejected.is_some())
        .map(|(k, _)| k)
        .collect();
    assert_eq!(out, wrong);
}

#[test]
fn places_of_two_contacts_that_were_exchanged_are_named() {
    let mut world = World::sockets(58, 4, 15, 5e-5, 2e-5);
    let solution = world.solve(RobotModel::Rigid);
    let fit = &solution.fit;
    let fixture = Pose::from_xyz_rpy([0.3, 0.2, -0.1], [0.1, 0.2, 0.3]);
    let place = |name: &str| {
        let k = fit.problem.instruments.iter().position(|i| i.name == name).unwrap();
        fixture.transform(&fit.state.instruments[k].translation)
    };
    for seen in &mut world.series.bodies {
        let named = match seen.instrument.as_str() {
            "socket 0" => "socket 1",
            "socket 1" => "socket 0",
            other => other,
        };
        seen.seen = BodySeen::Point(place(named));
        seen.kind = robotcal::problem::InstrumentKind::Places;
        seen.instrument = "fixture".into();
    }
    world.series.lengths.clear();
    let said = identify(world.chain.clone(), &[world.series], &Options::default()).map(|_| ()).unwrap_err();
    assert_eq!(said.code, Code::PlaceContradicted, "{said}");
}

/// A posture to which the robot returns again and again tells a start no more than once.
#[test]
fn postures_that_are_taken_often_hide_neither_good_touches_nor_mistakes() {
    let world = World::sockets(61, 6, 4, 5e-5, 2e-5);
    let mut often = world.series.clone();
    for k in (0..24).step_by(4) {
        let again = often.bodies[k].clone();
        often.bodies.extend((0..4).map(|_| again.clone()));
    }
    let solution = identify(world.chain.clone(), &[often], &Options { model: RobotModel::Rigid, ..Options::default() });
    let measured = solution.unwrap().fit.problem.body_measurements.clone();
    assert_eq!(measured.len(), 48);
    assert!(measured.iter().all(|m| m.rejected.is_none()), "{measured:?}");

    let points = World::new(62, Kind::Points, 40, (3e-5, 0.0), 2e-5);
    let mut home = points.series.clone();
    let again = home.bodies[0].clone();
    home.bodies.extend((0..60).map(|_| again.clone()));
    home.stops.iter_mut().filter_map(|stop| stop.readings.as_mut()).for_each(|q| q.swap(1, 2));
    let said = identify(points.chain.clone(), &[home], &Options::default()).map(|_| ()).unwrap_err();
    assert_eq!(said.code, Code::JointOrderWrong, "{said}");
}
