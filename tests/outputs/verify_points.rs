//! `robotcal verify --points` on points that the nominal robot itself puts there.

use std::fmt::Write;
use std::path::{Path, PathBuf};

use assert_cmd::Command;
use nalgebra::Vector3;
use robotcal::Code;
use robotcal::assess::{
    DeviceMoved, Limits, MeasuredPoint, StepCause, device_moved, fit_points, odd_points, size_of_points,
};
use robotcal::identify::Estimator;
use robotcal::model::joint_terms::{JointTerm, Term};
use robotcal::model::robot::Robot;
use robotcal::simulate::truth::Truth;

use crate::robots::{kr6_and_positioner, kr6_urdf};
use crate::verify_series::codes;

/// A copy of a series with its first 24 stops.
fn few_stops(of: &Path, into: &Path) -> PathBuf {
    let series = into.join("series");
    std::fs::create_dir(&series).unwrap();
    for entry in std::fs::read_dir(of).unwrap() {
        let path = entry.unwrap().path();
        std::fs::copy(&path, series.join(path.file_name().unwrap())).unwrap();
    }
    let image = |line: &str| line.split(',').next().unwrap().to_owned();
    let joints = std::fs::read_to_string(of.join("joints.csv")).unwrap();
    let few: Vec<&str> = joints.lines().take(1 + 24).collect();
    let names: Vec<String> = few.iter().map(|line| image(line)).collect();
    let seen = std::fs::read_to_string(of.join("observations.csv")).unwrap();
    let seen: Vec<&str> = seen.lines().filter(|line| names.contains(&image(line))).collect();
    std::fs::write(series.join("joints.csv"), few.join("\n")).unwrap();
    std::fs::write(series.join("observations.csv"), seen.join("\n")).unwrap();
    series
}

#[test]
fn a_two_stage_result_is_written_shown_judged_and_solved_again_like_a_joint_one() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let urdf = root.join("robots/ur10e/ur10e.urdf");
    let folder = tempfile::tempdir().unwrap();
    let run = |args: &[&str]| {
        let mut command = Command::cargo_bin("robotcal").unwrap();
        command.current_dir(folder.path()).args(args).output().unwrap()
    };
    let series = few_stops(&root.join("datasets/ur10e_observations"), folder.path());
    let (urdf, series) = (urdf.to_str().unwrap(), series.to_str().unwrap());
    let estimator = |out: &str| {
        let text = std::fs::read(folder.path().join(out).join("solution.json")).unwrap();
        robotcal::output::solution_json::read(&text).unwrap().estimator
    };
    let of =
        ["identify", "--urdf", urdf, "--series", series, "--robot-model", "rigid", "--two-stage", "b", "--out", "b"];
    let found = run(&of);
    assert!(found.status.success(), "{}", String::from_utf8_lossy(&found.stderr));
    assert_eq!(estimator("b"), Estimator::Blocks);
    assert!(run(&["show", "b/solution.json"]).status.success());
    let truth = Truth::read(&root.join("datasets/ur10e_observations/truth.toml")).unwrap();
    let mut table = format!("x_m,y_m,z_m,{}\n", truth.joints.join(","));
    for held in &truth.held_out {
        let cells: Vec<String> =
            held.base_from_tip.pose().xyz().iter().chain(&held.readings).map(|v| format!("{v:.9}")).collect();
        writeln!(table, "{}", cells.join(",")).unwrap();
    }
    std::fs::write(folder.path().join("points.csv"), table).unwrap();
    let mut corrected = std::fs::read_dir(folder.path().join("b")).unwrap().map(|e| e.unwrap().path());
    let corrected = corrected.find(|p| p.extension().is_some_and(|e| e == "urdf")).unwrap();
    let corrected = corrected.to_str().unwrap().to_owned();
    let verify = [
        "verify",
        "--urdf",
        &corrected,
        "--compensation",
        "b/compensation.toml",
        "--nominal",
        urdf,
        "--base",
        &truth.base,
        "--tip",
        &truth.tip,
        "--points",
        "points.csv",
        "--joint-unit",
        "rad",
    ];
    let judged = run(&verify);
    assert!(
        judged.status.success(),
        "{}{}",
        String::from_utf8_lossy(&judged.stdout),
        String::from_utf8_lossy(&judged.stderr)
    );
    assert!(
        run(&["identify", "--from", "b/solution.json", "--robot-model", "rigid", "--out", "again"]).status.success()
    );
    assert_eq!(estimator("again"), Estimator::Blocks);
    // No joint noise can be stated for an estimator that has none.
    let refused = run(&["identify", "--from", "b/solution.json", "--joint-noise", "0.0001", "--out", "no"]);
    assert_eq!(refused.status.code(), Some(2));
    // A model is judged with the limits of its solution.
    let path = folder.path().join("b/solution.json");
    let mut record: serde_json::Value = serde_json::from_slice(&std::fs::read(&path).unwrap()).unwrap();
    record["options"]["limits"]["scatter_images"] = 10_000.into();
    std::fs::write(&path, serde_json::to_vec(&record).unwrap()).unwrap();
    assert_eq!(run(&verify).status.code(), Some(1));
}

const NOISE_M: f64 = 5e-5;

fn kr6() -> (PathBuf, Robot) {
    let urdf = kr6_urdf();
    let robot = Robot::nominal(robotcal::urdf::read(&urdf).unwrap().chain(None, None).unwrap());
    (urdf, robot)
}

/// Points of a reflector where the robot puts it, with errors that repeat every seven rows.
fn points(robot: &Robot, count: usize, noise_m: f64) -> Vec<MeasuredPoint> {
    let point = |k: usize| {
        let readings: Vec<f64> = (0..6).map(|j| (((k * (2 * j + 3) + 5 * j) % 17) as f64 - 8.0) / 8.0).collect();
        let error = [1, 3, 5].map(|step| (step * k % 7) as f64 / 2.0 - 1.5);
        let at = robot.base_from_tip(&readings).transform(&[0.03, -0.02, 0.1].into());
        MeasuredPoint { position_m: at + noise_m * Vector3::from(error), readings }
    };
    (0..count).map(point).collect()
}

#[test]
fn points_of_a_device_of_another_size_tell_it() {
    let ((_, robot), limits) = (kr6(), Limits::default());
    let seen = points(&robot, 40, NOISE_M);
    let fit = fit_points(&robot, &seen).unwrap();
    assert_eq!(size_of_points(&robot, &seen, &fit, &limits), None);
    for off in [0.001, -0.003, 0.03] {
        let mut scaled = seen.clone();
        scaled.iter_mut().for_each(|p| p.position_m *= 1.0 + off);
        let of_scaled = fit_points(&robot, &scaled).unwrap();
        let found = size_of_points(&robot, &scaled, &of_scaled, &limits).unwrap();
        println!("{off}: {found:?}, {} m", of_scaled.rms_m);
        assert!((found.off - off).abs() < 1e-4 && (found.left_m / fit.rms_m - 1.0).abs() < 0.05, "{off}: {found:?}");
    }
}

#[test]
fn one_wrong_point_is_told_from_the_others() {
    let ((_, robot), limits) = (kr6(), Limits::default());
    let mut seen = points(&robot, 40, NOISE_M);
    assert_eq!(odd_points(&robot, &seen, &[], &limits), None);
    seen[17].position_m.x += 5e-3;
    let odd = odd_points(&robot, &seen, &[], &limits).unwrap();
    assert_eq!(odd.points, [17]);
    assert!((odd.off_m[0] - 5e-3).abs() < 4.0 * NOISE_M && odd.without.rms_m < 2.5 * NOISE_M, "{odd:?}");
    // Points in other postures all around say that no robot does this.
    assert_eq!(odd.wrong, [17]);
}

#[test]
fn a_point_that_misses_what_is_stated_of_the_model_there_does_not_stand_out() {
    let ((_, robot), limits) = (kr6(), Limits::default());
    let mut seen = points(&robot, 40, 0.2 * NOISE_M);
    seen[17].position_m.x += 0.3e-3;
    assert_eq!(odd_points(&robot, &seen, &[], &limits).map(|odd| odd.points), Some(vec![17]));
    let mut stated_m = vec![2e-5; 40];
    assert_eq!(odd_points(&robot, &seen, &stated_m, &limits).map(|odd| odd.points), Some(vec![17]));
    stated_m[17] = 0.1e-3;
    assert_eq!(odd_points(&robot, &seen, &stated_m, &limits), None);
}

/// Of two points far from all others the bad one draws the good one along, whose place the others tell.
#[test]
fn a_good_point_is_not_left_out_with_the_bad_one_beside_it() {
    let ((_, robot), limits) = (kr6(), Limits::default());
    let on_tip = [0.03, -0.02, 0.1].into();
    let mut seen = points(&robot, 26, 0.0);
    for (k, point) in seen.iter_mut().enumerate() {
        let far = if k < 24 { [0.0; 6] } else { [1.6, 0.4, -0.5, 0.7, 0.6, 0.9] };
        for (reading, far) in point.readings.iter_mut().zip(far) {
            *reading = 0.15 * *reading + far;
        }
        point.position_m = robot.base_from_tip(&point.readings).transform(&on_tip);
    }
    seen[25].position_m += Vector3::new(2e-3, -3e-3, 4e-3);
    let odd = odd_points(&robot, &seen, &[], &limits).unwrap();
    assert_eq!(odd.points, [25]);
    assert!(odd.without.rms_m < 1e-9, "{odd:?}");
}

/// A robot whose first joint is mounted off its axis, rad.
fn eccentric(robot: &Robot) -> Robot {
    let mut own = robot.clone();
    own.terms.extend([(Term::Cosine(1), 1.2e-3), (Term::Sine(1), -0.9e-3)].map(|(term, value)| JointTerm {
        reading: 0,
        term,
        value,
    }));
    own
}

#[test]
fn a_true_point_where_the_robot_misses_more_than_elsewhere_counts_in_the_verdict() {
    let (_, robot) = kr6();
    let seen: Vec<MeasuredPoint> = points(&robot, 40, 0.0)
        .into_iter()
        .enumerate()
        .map(|(k, point)| {
            let mut readings = point.readings;
            readings[0] = 0.2 * readings[0] + if k == 3 { 1.5 } else { 0.0 };
            let on_tip = [0.03, -0.02, 0.1].into();
            MeasuredPoint { position_m: eccentric(&robot).base_from_tip(&readings).transform(&on_tip), readings }
        })
        .collect();
    let odd = odd_points(&robot, &seen, &[], &Limits::default()).unwrap();
    assert_eq!((odd.points.as_slice(), odd.wrong.as_slice()), (&[3][..], &[][..]), "{:?}", odd.off_m);
    let all_mm = 1e3 * fit_points(&robot, &seen).unwrap().rms_m;
    // A robot that misses by 2 mm in one place alone.
    assert!(odd.off_m[0] > 1.5e-3 && 1e3 * odd.without.rms_m < 0.5 * all_mm, "{all_mm} {}", odd.without.rms_m);
    let found = verdict(&seen, "rad", None);
    let text = String::from_utf8(found.stdout).unwrap();
    println!("{text}");
    let words = text.split_whitespace().collect::<Vec<_>>().join(" ");
    let (_, judged) = words.split_once("verdict ").unwrap();
    assert_eq!(found.status.code(), Some(0));
    assert!(judged.contains(&format!("{all_mm:.3} mm")), "{judged}");
}

#[test]
fn an_eccentric_joint_is_no_move_of_the_device() {
    let ((_, robot), limits) = (kr6(), Limits::default());
    let own = eccentric(&robot);
    let mut seen = points(&own, 60, NOISE_M);
    seen.sort_by(|a, b| a.readings[0].total_cmp(&b.readings[0]));
    let found = device_moved(&robot, &seen, &fit_points(&robot, &seen).unwrap(), &limits);
    assert!(found.is_none_or(|f| f.cause == StepCause::DeviceOrRobot), "{found:?}");
}

#[test]
fn a_device_that_was_moved_is_told_from_noise() {
    let ((_, robot), limits) = (kr6(), Limits::default());
    let mut seen = points(&robot, 40, NOISE_M);
    let moved = |seen: &[MeasuredPoint]| device_moved(&robot, seen, &fit_points(&robot, seen).unwrap(), &limits);
    assert_eq!(moved(&seen), None);
    seen[22..].iter_mut().for_each(|p| p.position_m.y += 3e-3);
    let found = moved(&seen).unwrap();
    assert_eq!((found.first, found.cause), (22, StepCause::Device));
    assert!((found.by_m - 3e-3).abs() < 3.0 * NOISE_M && found.rms_m < 2.5 * NOISE_M, "{found:?}");
}

/// A step behind the first rows, or before the last, explains much of what one point is off.
#[test]
fn a_single_wrong_point_is_no_move_of_the_device() {
    let ((_, robot), limits) = (kr6(), Limits::default());
    for (count, wrong) in [(100, 2), (100, 50), (30, 2), (30, 27), (30, 5), (14, 2), (12, 6), (10, 1)] {
        let mut seen = points(&robot, count, NOISE_M);
        seen[wrong].position_m.y += 5e-3;
        let odd = odd_points(&robot, &seen, &[], &limits);
        assert_eq!(odd.as_ref().map(|odd| odd.points.clone()), Some(vec![wrong]), "{count}");
        let moved = device_moved(&robot, &seen, &fit_points(&robot, &seen).unwrap(), &limits);
        println!("{count} {wrong}: {moved:?}");
        assert!(moved.is_none_or(|moved| odd.unwrap().explain(&moved, &limits)), "{count} {moved:?}");
    }
    // Six rows behind a move are neither odd, nor a part of it.
    let mut seen = points(&robot, 40, NOISE_M);
    seen[34..].iter_mut().for_each(|p| p.position_m.y += 3e-3);
    let moved = device_moved(&robot, &seen, &fit_points(&robot, &seen).unwrap(), &limits).unwrap();
    assert_eq!((moved.first, moved.cause), (34, StepCause::Device));
    let odd = odd_points(&robot, &seen, &[], &limits);
    assert!(odd.is_none_or(|odd| !odd.explain(&moved, &limits)));
}

/// The robot with errors as robots have them: origins off by 0.7 mm and 1.4 mrad RMS per axis, zeros by 3.5 mrad.
fn with_usual_errors(robot: &Robot, phase: f64) -> Robot {
    let mut robot = robot.clone();
    for (j, twist) in robot.twists.iter_mut().enumerate() {
        for c in 0..6 {
            let size = if c < 3 { 1e-3 } else { 2e-3 };
            twist[c] = size * (2.4 * (6 * j + c) as f64 + phase).sin();
        }
    }
    let zero = |reading: usize| 5e-3 * (1.7 * reading as f64 + phase).cos();
    let offset = |reading| JointTerm { reading, term: Term::Offset, value: zero(reading) };
    robot.terms.extend((0..robot.chain.readings.len()).map(offset));
    robot
}

/// Points of a robot in postures about one place, and then about another.
fn at_two_places(robot: &Robot, count: usize) -> Vec<MeasuredPoint> {
    let mut seen = points(robot, count, NOISE_M);
    for (k, point) in seen.iter_mut().enumerate() {
        let place = if k < count / 2 { [0.8, -0.6, 0.5, 0.3, 0.4, 0.2] } else { [-0.6, 0.4, -0.4, -0.5, -0.7, 1.2] };
        let noise = point.position_m - robot.base_from_tip(&point.readings).transform(&[0.03, -0.02, 0.1].into());
        point.readings.iter_mut().zip(place).for_each(|(q, about)| *q = about + 0.5 * *q);
        point.position_m = robot.base_from_tip(&point.readings).transform(&[0.03, -0.02, 0.1].into()) + noise;
    }
    seen
}

/// What a robot that nobody corrected misses differs from place to place, as if the device had been moved between them.
#[test]
fn errors_of_a_nominal_robot_are_no_move_of_the_device_and_a_move_is_named_beside_them() {
    let ((_, robot), limits) = (kr6(), Limits::default());
    let moved = |seen: &[MeasuredPoint]| -> Option<DeviceMoved> {
        device_moved(&robot, seen, &fit_points(&robot, seen).unwrap(), &limits)
    };
    let mut doubted = 0;
    for turn in 0..12 {
        let own = with_usual_errors(&robot, f64::from(turn));
        let mut seen = at_two_places(&own, 40);
        let found = moved(&seen);
        assert!(found.is_none_or(|f| f.cause == StepCause::DeviceOrRobot), "{turn}: {found:?}");
        doubted += usize::from(found.is_some());
        seen[25..].iter_mut().for_each(|p| p.position_m.y += 10e-3);
        let found = moved(&seen).unwrap();
        assert_eq!((found.first, found.cause), (25, StepCause::Device), "{turn}");
        // The points of one place on either side tell the step as well as their noise is averaged.
        assert!((found.by_m - 10e-3).abs() < 3.0 * NOISE_M, "{turn}: {found:?}");
    }
    // A fit of frame and reflector alone takes most of them for a move.
    assert!(doubted >= 6, "{doubted} of 12");
}

#[test]
fn a_step_that_the_nominal_robot_explains_is_a_doubt_of_the_verdict_and_no_gate() {
    let (_, robot) = kr6();
    // Less than the millimetre from which on a robot counts as one that nobody corrected.
    let mut own = with_usual_errors(&robot, 9.0);
    own.twists.iter_mut().for_each(|twist| *twist *= 0.7);
    own.terms.iter_mut().for_each(|term| term.value *= 0.7);
    let seen = at_two_places(&own, 40);
    let judged = |points: &[MeasuredPoint]| {
        let found = verdict(points, "rad", None);
        let text = String::from_utf8(found.stdout).unwrap();
        println!("{text}{}", String::from_utf8_lossy(&found.stderr));
        (found.status.code(), codes(&text))
    };
    let found = device_moved(&robot, &seen, &fit_points(&robot, &seen).unwrap(), &Limits::default());
    assert_eq!(found.map(|f| f.cause), Some(StepCause::DeviceOrRobot), "{found:?}");
    assert_eq!(judged(&seen), (Some(0), vec![]));
    let mut moved = seen;
    moved[25..].iter_mut().for_each(|p| p.position_m.y += 10e-3);
    assert_eq!(judged(&moved).0, Some(1));
}

/// `verify --points` of the robot by these points, with readings in this unit.
fn verdict(points: &[MeasuredPoint], unit: &str, compared_with: Option<&Path>) -> std::process::Output {
    let (urdf, robot) = kr6();
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("points.csv");
    let rows =
        points.iter().map(|p| p.position_m.iter().chain(&p.readings).map(|v| format!("{v:.9}")).collect::<Vec<_>>());
    let rows: Vec<String> = rows.map(|row| row.join(",")).collect();
    std::fs::write(&file, format!("x_m,y_m,z_m,{}\n{}\n", robot.chain.readings.join(","), rows.join("\n"))).unwrap();
    let mut command = Command::cargo_bin("robotcal").unwrap();
    command.args(["verify", "--joint-unit", unit, "--urdf"]).arg(&urdf).arg("--points").arg(&file);
    compared_with.into_iter().for_each(|other| {
        command.arg("--nominal").arg(other);
    });
    command.output().unwrap()
}

/// The description with the upper arm 5 mm longer.
fn with_a_longer_arm(folder: &Path) -> PathBuf {
    let other = folder.join("nominal.urdf");
    let text = std::fs::read_to_string(kr6().0).unwrap();
    assert!(text.contains("0.455 0 0"), "the arm of this robot");
    std::fs::write(&other, text.replace("0.455 0 0", "0.460 0 0")).unwrap();
    other
}

/// Wrong points are none of the robot's errors, neither of the model nor of the nominal one.
#[test]
fn a_wrong_point_takes_nothing_off_the_gain() {
    let (_, robot) = kr6();
    let folder = tempfile::tempdir().unwrap();
    let nominal = with_a_longer_arm(folder.path());
    let share = |points: &[MeasuredPoint]| -> f64 {
        let text = String::from_utf8(verdict(points, "rad", Some(&nominal)).stdout).unwrap();
        println!("{text}");
        let (before, _) = text.split_once(" % of the nominal error").unwrap();
        before.split_whitespace().last().unwrap().parse().unwrap()
    };
    let mut seen = points(&robot, 60, NOISE_M);
    let clean = share(&seen);
    seen[17].position_m.x += 17e-3;
    assert!(clean < 10.0 && (share(&seen) - clean).abs() <= 1.0, "{clean}");
}

#[test]
fn points_that_do_not_belong_together_or_are_few_are_no_good_verdict() {
    let (_, robot) = kr6();
    let folder = tempfile::tempdir().unwrap();
    let other = with_a_longer_arm(folder.path());
    let code = |points: &[MeasuredPoint]| {
        let found = verdict(points, "rad", Some(&other));
        assert!(found.status.code().is_some_and(|c| c <= 3), "{}", String::from_utf8_lossy(&found.stderr));
        found.status.code()
    };
    let good = points(&robot, 40, NOISE_M);
    assert_eq!(code(&good), Some(0));
    assert_eq!(code(&good[..5]), Some(1), "few");
    // Three points fit by themselves, whatever sign their readings have.
    assert_eq!(code(&good[..3]), Some(1), "three");
    let repeated: Vec<MeasuredPoint> = good[..5].iter().cycle().take(40).cloned().collect();
    assert_eq!(code(&repeated), Some(1), "the same few again and again");
    let mut moved = good.clone();
    moved[22..].iter_mut().for_each(|p| p.position_m.y += 3e-3);
    assert_eq!(code(&moved), Some(1), "moved");
    let mut wrong = good;
    wrong.iter_mut().for_each(|p| p.readings[5] = -p.readings[5]);
    assert_eq!(code(&wrong), Some(3), "the sign of a joint");
}

/// A device on the floor does not see the points in the frame of the table that a positioner moves.
#[test]
fn points_in_another_base_frame_are_told_by_the_flag_of_the_base() {
    let folder = tempfile::tempdir().unwrap();
    let cell = kr6_and_positioner(folder.path());
    let (_, arm) = kr6();
    let on_floor = points(&arm, 40, NOISE_M);
    let file = folder.path().join("points.csv");
    let mut table = format!("x_m,y_m,z_m,{},tilt,turn\n", arm.chain.readings.join(","));
    for (k, p) in on_floor.iter().enumerate() {
        let numbers: Vec<String> = p.position_m.iter().chain(&p.readings).map(|v| format!("{v:.9}")).collect();
        writeln!(table, "{},{},{}", numbers.join(","), 0.4 * (k as f64).sin(), 2.0 * (1.7 * k as f64).sin()).unwrap();
    }
    std::fs::write(&file, table).unwrap();
    let verified = |base: &str| {
        let mut command = Command::cargo_bin("robotcal").unwrap();
        command.args(["verify", "--joint-unit", "rad", "--base", base, "--tip", "tool0", "--urdf"]);
        let output = command.arg(&cell).arg("--points").arg(&file).output().unwrap();
        (output.status.success(), String::from_utf8(output.stderr).unwrap())
    };
    let (good, said) = verified("base_link");
    assert!(good, "{said}");
    let (good, said) = verified("table");
    let named = [Code::PointsContradict.name(), "--base", "\"table\"", "tilt", "turn"];
    assert!(!good && named.iter().all(|name| said.contains(name)), "{said}");
}

#[test]
fn readings_in_another_unit_are_no_good_verdict() {
    let (_, robot) = kr6();
    let seen = points(&robot, 30, 0.0);
    let right = verdict(&seen, "rad", None);
    assert!(right.status.success(), "{}", String::from_utf8_lossy(&right.stderr));
    assert!(String::from_utf8_lossy(&right.stdout).contains(": 0.000 mm RMS"));
    let wrong = verdict(&seen, "deg", None);
    let said = String::from_utf8_lossy(&wrong.stderr);
    assert!(!wrong.status.success() && said.contains("--joint-unit"), "{said}");
}

/// What wide priors of the robot absorb leaves so little of the noise that six numbers explain most of it.
#[test]
fn few_faultless_points_are_of_no_device_that_moved() {
    let (_, robot) = kr6();
    for count in 15..25 {
        let found = verdict(&points(&robot, count, 5e-5), "rad", None);
        assert!(found.status.success(), "{count}: {}", String::from_utf8_lossy(&found.stdout));
    }
}

/// As `identify` names them in a tracker's points.
#[test]
fn left_handed_axes_and_rows_that_are_shifted_by_one_are_named() {
    let (_, robot) = kr6();
    let seen = points(&robot, 30, NOISE_M);
    let mirrored = |axis: usize| {
        let mut all = seen.clone();
        all.iter_mut().for_each(|p| p.position_m[axis] = -p.position_m[axis]);
        (all, Code::AxesMirrored)
    };
    let beside = |(a, b): (&MeasuredPoint, &MeasuredPoint)| MeasuredPoint { readings: b.readings.clone(), ..a.clone() };
    let above = seen.iter().skip(1).zip(&seen).map(beside).collect();
    let below = seen.iter().zip(&seen[1..]).map(beside).collect();
    for (wrong, code) in [mirrored(0), mirrored(2), (above, Code::RowsShifted), (below, Code::RowsShifted)] {
        let found = verdict(&wrong, "rad", None);
        let said = String::from_utf8_lossy(&found.stderr);
        assert_eq!(found.status.code(), Some(3), "{said}");
        assert!(said.contains(&format!("error[{}]", code.name())), "{said}");
    }
}

/// Points of the robot of the shipped report, within the ranges of its stops, with this error of the zero of its third joint, rad.
fn measured_by_a_tracker(folder: &Path, zero: f64) -> PathBuf {
    measured_with(folder, zero, 2e-5)
}

/// The same by a device of this sigma per axis, m.
fn measured_with(folder: &Path, zero: f64, sigma_m: f64) -> PathBuf {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let truth = Truth::read(&root.join("datasets/kr6_small/truth.toml")).unwrap();
    let robot = truth.robot(&kr6().1.chain).unwrap();
    let mut table = format!("x_m,y_m,z_m,{}\n", truth.joints.join(","));
    for (k, held) in truth.held_out.iter().enumerate() {
        let mut readings = held.readings.clone();
        readings[2] += zero;
        let error = [1, 3, 5].map(|step| (step * k % 7) as f64 / 2.0 - 1.5);
        let at = robot.base_from_tip(&readings).transform(&[0.03, -0.02, 0.1].into()) + sigma_m * Vector3::from(error);
        let cells: Vec<String> = at.iter().chain(&held.readings).map(|v| format!("{v:.9}")).collect();
        writeln!(table, "{}", cells.join(",")).unwrap();
    }
    let file = folder.join(format!("points_{zero}_{sigma_m}.csv"));
    std::fs::write(&file, table).unwrap();
    file
}

#[test]
fn points_that_a_model_misses_by_more_than_its_solution_states_are_no_good_verdict() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let report = root.join("reports/kr6_small");
    let folder = tempfile::tempdir().unwrap();
    let urdf = report.join("kuka_kr6_r900.calibrated.urdf");
    let judged = |urdf: &Path, points: &Path, flags: &[&str]| {
        let mut command = Command::cargo_bin("robotcal").unwrap();
        command.args(["verify", "--joint-unit", "rad", "--urdf"]).arg(urdf);
        command.arg("--points").arg(points).args(flags);
        let found = command.output().unwrap();
        let text = String::from_utf8(found.stdout).unwrap();
        println!("{text}{}", String::from_utf8_lossy(&found.stderr));
        (found.status.code(), codes(&text))
    };
    let (nominal, compensation) = (kr6().0, report.join("compensation.toml"));
    let [nominal, compensation] = [&nominal, &compensation].map(|p| p.to_str().unwrap());
    let (right, changed) = (measured_by_a_tracker(folder.path(), 0.0), measured_by_a_tracker(folder.path(), 2e-3));
    for flags in [vec!["--compensation", compensation], vec!["--compensation", compensation, "--nominal", nominal]] {
        assert_eq!(judged(&urdf, &right, &flags), (Some(0), vec![]));
        assert_eq!(judged(&urdf, &changed, &flags), (Some(1), vec![Code::StatedExceeded]));
    }
    // What a device is known to scatter by is no error of the model.
    let own = ["--compensation", compensation];
    let noisy = measured_with(folder.path(), 0.0, 5e-4);
    assert_eq!(judged(&urdf, &noisy, &own), (Some(1), vec![Code::StatedExceeded]));
    assert_eq!(judged(&urdf, &noisy, &[own[0], own[1], "--point-sigma-m", "0.0005"]), (Some(0), vec![]));
    assert_eq!(judged(&urdf, &changed, &[own[0], own[1], "--point-sigma-m", "0.00002"]).0, Some(1));
    assert_eq!(judged(&urdf, &noisy, &[own[0], own[1], "--point-sigma-m", "-1"]).0, Some(2));
    // A compensation.toml of the URDF lies beside it, and no solution.
    let copy = folder.path().join("copy.urdf");
    std::fs::copy(&urdf, &copy).unwrap();
    std::fs::write(folder.path().join("compensation.toml"), "[joint.joint_a2]\ngear_scale = 0.0001\n").unwrap();
    assert_eq!(judged(&copy, &right, &[]), (Some(0), vec![Code::CompensationNotGiven]));
}

/// A copy of the shipped report; its corrected description.
fn own_report(folder: &Path) -> PathBuf {
    let report = Path::new(env!("CARGO_MANIFEST_DIR")).join("reports/kr6_small");
    for name in ["kuka_kr6_r900.calibrated.urdf", "compensation.toml", "solution.json"] {
        std::fs::copy(report.join(name), folder.join(name)).unwrap();
    }
    folder.join("kuka_kr6_r900.calibrated.urdf")
}

fn judged_by_report(urdf: &Path, points: &Path, flags: &[&str]) -> std::process::Output {
    let mut command = Command::cargo_bin("robotcal").unwrap();
    command.args(["verify", "--joint-unit", "rad", "--urdf"]).arg(urdf).arg("--points").arg(points);
    let output = command.args(flags).output().unwrap();
    println!("{}{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    output
}

/// Less than what robots miss that nobody corrected is no merit of one whose solution states a tenth of it.
#[test]
fn a_solution_that_cannot_be_used_is_not_passed_over() {
    let folder = tempfile::tempdir().unwrap();
    let urdf = own_report(folder.path());
    let [compensation, solution] = ["compensation.toml", "solution.json"].map(|name| folder.path().join(name));
    let compensation = ["--compensation", compensation.to_str().unwrap()];
    let points = measured_by_a_tracker(folder.path(), 1e-3);
    let judged = |points: &Path, flags: &[&str]| {
        let output = judged_by_report(&urdf, points, &[&compensation, flags].concat());
        let refused = String::from_utf8(output.stderr).unwrap();
        let code = Code::ALL.iter().copied().find(|code| refused.starts_with(&format!("error[{}]", code.name())));
        let is_named = refused.contains(solution.to_str().unwrap());
        (output.status.code(), codes(&String::from_utf8(output.stdout).unwrap()), code.filter(|_| is_named))
    };
    assert_eq!(judged(&points, &[]), (Some(1), vec![Code::StatedExceeded], None));
    let whole = std::fs::read_to_string(&solution).unwrap();
    std::fs::write(&solution, &whole[..20_000]).unwrap();
    assert_eq!(judged(&points, &[]), (Some(2), vec![], Some(Code::SolutionDamaged)));
    std::fs::write(&solution, whole.replacen("\"format\":2", "\"format\":10000", 1)).unwrap();
    let (exit, said, refused) = judged(&points, &[]);
    assert!(exit == Some(2) && said.is_empty() && refused.is_some(), "{exit:?} {refused:?}");
    // Of points at one reading of the first joint the base may be the link behind it.
    std::fs::write(&solution, whole).unwrap();
    let turned = by_some_joints(folder.path(), &[1, 2, 3, 4, 5], 0.0);
    assert_eq!(judged(&turned, &["--base", "link_1"]), (Some(2), vec![], Some(Code::SolutionDiffers)));
    // That of another description says nothing of this one, which is a doubt.
    let text = std::fs::read_to_string(&urdf).unwrap();
    assert!(text.contains("xyz=\"0.02494"), "an origin of this report");
    std::fs::write(&urdf, text.replace("xyz=\"0.02494", "xyz=\"0.02496")).unwrap();
    let urdf_alone = judged_by_report(&urdf, &measured_by_a_tracker(folder.path(), 0.0), &[]);
    let said = codes(&String::from_utf8(urdf_alone.stdout).unwrap());
    assert_eq!((urdf_alone.status.code(), said), (Some(0), vec![Code::SolutionDiffers]));
}

/// What the verdict is by, and what is stated, are of the same points.
#[test]
fn what_is_stated_is_of_the_points_without_the_wrong_one() {
    let folder = tempfile::tempdir().unwrap();
    let urdf = own_report(folder.path());
    let seen = std::fs::read_to_string(measured_with(folder.path(), 0.0, 2e-4)).unwrap();
    let stated = |lines: &[String]| -> [f64; 2] {
        let file = folder.path().join("some.csv");
        std::fs::write(&file, lines.join("\n")).unwrap();
        let flags = ["--compensation", folder.path().join("compensation.toml").to_str().unwrap()].map(str::to_owned);
        let flags = [flags[0].as_str(), &flags[1], "--point-sigma-m", "0.0005"];
        let output = judged_by_report(&urdf, &file, &flags);
        assert_eq!(output.status.code(), Some(0));
        let words: Vec<String> =
            String::from_utf8(output.stdout).unwrap().split_whitespace().map(str::to_owned).collect();
        let words = words.join(" ");
        ["its solution states ", " mm here, at most "]
            .map(|after| words.split_once(after).unwrap().1.split(' ').next().unwrap().parse().unwrap())
    };
    let mut lines: Vec<String> = seen.lines().take(1 + 40).map(str::to_owned).collect();
    let (x, rest) = lines[6].split_once(',').unwrap();
    lines[6] = format!("{:.9},{rest}", x.parse::<f64>().unwrap() + 0.03);
    let with_wrong = stated(&lines);
    lines.remove(6);
    assert_eq!(with_wrong, stated(&lines));
}

/// The mean and the most that the solution of the shipped report states at points, mm, as it is or with this upper end of the intervals of its joint noise.
fn stated_with_noise_up_to(points: &Path, most: Option<&serde_json::Value>) -> [f64; 2] {
    let report = Path::new(env!("CARGO_MANIFEST_DIR")).join("reports/kr6_small");
    let folder = tempfile::tempdir().unwrap();
    let own = |name: &str| folder.path().join(name);
    for name in ["kuka_kr6_r900.calibrated.urdf", "compensation.toml"] {
        std::fs::copy(report.join(name), own(name)).unwrap();
    }
    let mut record: serde_json::Value =
        serde_json::from_slice(&std::fs::read(report.join("solution.json")).unwrap()).unwrap();
    let intervals = record["series"][0]["noise"]["joint_interval"].as_array_mut().unwrap();
    assert_eq!(intervals.len(), 6);
    most.into_iter().for_each(|most| intervals.iter_mut().for_each(|interval| interval[1] = most.clone()));
    std::fs::write(own("solution.json"), serde_json::to_vec(&record).unwrap()).unwrap();
    let mut command = Command::cargo_bin("robotcal").unwrap();
    command.args(["verify", "--joint-unit", "rad", "--urdf"]).arg(own("kuka_kr6_r900.calibrated.urdf"));
    let found =
        command.arg("--compensation").arg(own("compensation.toml")).arg("--points").arg(points).output().unwrap();
    let text = String::from_utf8(found.stdout).unwrap();
    println!("{text}{}", String::from_utf8_lossy(&found.stderr));
    assert_eq!((found.status.code(), codes(&text)), (Some(0), vec![]));
    let words = text.split_whitespace().collect::<Vec<_>>().join(" ");
    let number = |after: &str| -> f64 {
        let (_, rest) = words.split_once(after).unwrap();
        rest.split_whitespace().next().unwrap().parse().unwrap()
    };
    [number("its solution states "), number(" mm here, at most ")]
}

/// Joint noise that a fit found at zero may still be there.
#[test]
fn the_most_that_a_solution_states_at_points_has_the_doubt_of_its_joint_noise_in_it() {
    let folder = tempfile::tempdir().unwrap();
    let points = measured_by_a_tracker(folder.path(), 0.0);
    let [rms, most] = stated_with_noise_up_to(&points, None);
    assert!(most > rms);
    let added = |upper: &serde_json::Value| {
        let [same, larger] = stated_with_noise_up_to(&points, Some(upper));
        assert!((same - rms).abs() < 1e-9, "what is expected stays: {same}, {rms}");
        (larger.powi(2) - most.powi(2)).sqrt()
    };
    // Of six readings, that do together what one does with a lever of a metre: 0.2 mm where all are at their upper ends at once, and that over
    // the root of six at least.
    let with_doubt = added(&2e-4.into());
    assert!((0.06..0.25).contains(&with_doubt), "{with_doubt} mm");
    // An upper end that is not told is that of a robot in order, 0.5 mrad.
    let untold = added(&serde_json::Value::Null);
    assert!((untold / with_doubt - 2.5).abs() < 0.1, "{untold} mm");
}

/// Ten points of one neighbourhood of the robot of the shipped report, with this noise per axis, or where the nominal robot puts them.
fn neighbours(folder: &Path, reach: f64, sigma_m: f64, by_nominal: bool) -> PathBuf {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let truth = Truth::read(&root.join("datasets/kr6_small/truth.toml")).unwrap();
    let (_, nominal) = kr6();
    let robot = if by_nominal { nominal } else { truth.robot(&nominal.chain).unwrap() };
    let mut table = format!("x_m,y_m,z_m,{}\n", truth.joints.join(","));
    for k in 0..10 {
        let offset = |j: usize| reach * (((k * (2 * j + 3) + 5 * j) % 17) as f64 - 8.0) / 8.0;
        let readings: Vec<f64> = truth.held_out[0].readings.iter().enumerate().map(|(j, q)| q + offset(j)).collect();
        let error = [1, 3, 5].map(|step| (step * k % 7) as f64 / 2.0 - 1.5);
        let at = robot.base_from_tip(&readings).transform(&[0.03, -0.02, 0.1].into()) + sigma_m * Vector3::from(error);
        let cells: Vec<String> = at.iter().chain(&readings).map(|v| format!("{v:.9}")).collect();
        writeln!(table, "{}", cells.join(",")).unwrap();
    }
    let file = folder.join(format!("neighbours_{reach}_{by_nominal}.csv"));
    std::fs::write(&file, table).unwrap();
    file
}

/// Points of the robot of the shipped report with these joints alone moved, and with a zero that makes it miss by centimetres, or none.
fn by_some_joints(folder: &Path, moved: &[usize], zero: f64) -> PathBuf {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let truth = Truth::read(&root.join("datasets/kr6_small/truth.toml")).unwrap();
    let robot = truth.robot(&kr6().1.chain).unwrap();
    let mut table = format!("x_m,y_m,z_m,{}\n", truth.joints.join(","));
    for k in 0..20 {
        let mut readings = truth.held_out[0].readings.clone();
        for &j in moved {
            readings[j] += 0.6 * (((k * (2 * j + 3) + 5 * j) % 17) as f64 - 8.0) / 8.0;
        }
        let mut own = readings.clone();
        own[1] += zero;
        let error = [1, 3, 5].map(|step| (step * k % 7) as f64 / 2.0 - 1.5);
        let at = robot.base_from_tip(&own).transform(&[0.03, -0.02, 0.1].into()) + 2e-5 * Vector3::from(error);
        let cells: Vec<String> = at.iter().chain(&readings).map(|v| format!("{v:.9}")).collect();
        writeln!(table, "{}", cells.join(",")).unwrap();
    }
    let file = folder.join(format!("some_{moved:?}_{zero}.csv"));
    std::fs::write(&file, table).unwrap();
    file
}

/// Of points at which most joints stand still a frame takes up whatever these do.
#[test]
fn points_that_cannot_show_what_a_robot_misses_are_no_good_verdict() {
    let report = Path::new(env!("CARGO_MANIFEST_DIR")).join("reports/kr6_small");
    let folder = tempfile::tempdir().unwrap();
    let judged = |points: &Path| {
        let mut command = Command::cargo_bin("robotcal").unwrap();
        command.args(["verify", "--joint-unit", "rad", "--urdf"]).arg(report.join("kuka_kr6_r900.calibrated.urdf"));
        command.arg("--compensation").arg(report.join("compensation.toml"));
        let found = command.args(["--point-sigma-m", "0.00002", "--points"]).arg(points).output().unwrap();
        let [text, said] = [found.stdout, found.stderr].map(|bytes| String::from_utf8(bytes).unwrap());
        println!("{text}{said}");
        let refused = said.contains(&format!("error[{}]", Code::PointsUndetermined.name()));
        (found.status.code(), codes(&text), refused)
    };
    // A circle about the last joint tells neither the frame nor the reflector.
    for zero in [0.0, 3e-2] {
        assert_eq!(judged(&by_some_joints(folder.path(), &[5], zero)), (Some(3), vec![], true));
        let wrist = judged(&by_some_joints(folder.path(), &[4, 5], zero));
        assert_eq!(wrist, (Some(1), vec![Code::PointsUndetermined], false));
    }
    assert_eq!(judged(&by_some_joints(folder.path(), &[0, 1, 2, 3, 4, 5], 0.0)), (Some(0), vec![], false));
    let (exit, said, _) = judged(&by_some_joints(folder.path(), &[0, 1, 2, 3, 4, 5], 3e-2));
    assert_eq!((exit, said), (Some(1), vec![Code::StatedExceeded]));
    // Nor where the model misses more than is stated, by so little that it is a note.
    let (exit, said, _) = judged(&neighbours(folder.path(), 0.006, 6e-5, false));
    assert_eq!((exit, said), (Some(1), vec![Code::StatedExceeded, Code::PointsUndetermined]));
}

/// Of neighbouring points frame and reflector take up what two robots differ by.
#[test]
fn points_that_do_not_tell_a_model_from_the_nominal_robot_are_a_doubt() {
    let report = Path::new(env!("CARGO_MANIFEST_DIR")).join("reports/kr6_small");
    let folder = tempfile::tempdir().unwrap();
    let judged = |points: &Path| {
        let mut command = Command::cargo_bin("robotcal").unwrap();
        command.args(["verify", "--joint-unit", "rad", "--urdf"]).arg(report.join("kuka_kr6_r900.calibrated.urdf"));
        command.arg("--compensation").arg(report.join("compensation.toml")).arg("--nominal").arg(kr6().0);
        let found = command.args(["--point-sigma-m", "0.00005", "--points"]).arg(points).output().unwrap();
        let text = String::from_utf8(found.stdout).unwrap();
        println!("{text}{}", String::from_utf8_lossy(&found.stderr));
        (found.status.code(), codes(&text), text)
    };
    let (exit, said, text) = judged(&neighbours(folder.path(), 0.006, 5e-5, false));
    // Nor any other robot from it.
    assert_eq!((exit, said), (Some(1), vec![Code::ModelsNotTold, Code::PointsUndetermined]));
    let words = text.split_whitespace().collect::<Vec<_>>().join(" ");
    let number = |before: &str| -> f64 {
        let (front, _) = words.split_once(before).unwrap();
        front.split_whitespace().last().unwrap().parse().unwrap()
    };
    // Robots as these differ by a millimetre over the stops of a series.
    let [here, at_stops, needed] = [" mm here, beside", " mm at the stops", " points or more"].map(number);
    assert!(here < 0.05 && at_stops > 0.5 && needed >= 10.0, "{here} {at_stops} {needed}");
    // So many of them tell.
    let (exit, said, _) = judged(&measured_by_a_tracker(folder.path(), 0.0));
    assert_eq!((exit, said), (Some(0), vec![]));
    // Where the nominal robot is the better one, the whole interval says so.
    let (exit, said, _) = judged(&neighbours(folder.path(), 0.5, 0.0, true));
    assert!(exit == Some(1) && !said.contains(&Code::ModelsNotTold), "{exit:?} {said:?}");
}
