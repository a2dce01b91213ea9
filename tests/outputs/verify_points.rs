//! `robotcal verify --points` on points that the nominal robot itself puts there.

use std::fmt::Write;
use std::path::{Path, PathBuf};

use assert_cmd::Command;
use robotcal::identify::Estimator;
use robotcal::model::robot::Robot;
use robotcal::simulate::truth::Truth;

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
    let judged = run(&[
        "verify",
        "--urdf",
        corrected.to_str().unwrap(),
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
    ]);
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
}

#[test]
fn readings_in_another_unit_are_no_good_verdict() {
    let urdf = Path::new(env!("CARGO_MANIFEST_DIR")).join("robots/kuka_kr6_r900/kuka_kr6_r900.urdf");
    let robot = Robot::nominal(robotcal::urdf::read(&urdf).unwrap().chain(None, None).unwrap());
    let mut table = format!("x_m,y_m,z_m,{}\n", robot.chain.readings.join(","));
    for k in 0..30 {
        let q: Vec<f64> = (0..6).map(|j| (f64::from((k * (2 * j + 3) + 5 * j) % 17) - 8.0) / 8.0).collect();
        let at = robot.base_from_tip(&q).transform(&[0.03, -0.02, 0.1].into());
        let cells: Vec<String> = at.iter().chain(&q).map(|v| format!("{v:.9}")).collect();
        writeln!(table, "{}", cells.join(",")).unwrap();
    }
    let folder = tempfile::tempdir().unwrap();
    let points = folder.path().join("points.csv");
    std::fs::write(&points, table).unwrap();
    let run = |unit: &str| {
        let mut command = Command::cargo_bin("robotcal").unwrap();
        command.args(["verify", "--joint-unit", unit, "--urdf"]).arg(&urdf).arg("--points").arg(&points);
        command.output().unwrap()
    };
    let right = run("rad");
    assert!(right.status.success(), "{}", String::from_utf8_lossy(&right.stderr));
    assert!(String::from_utf8_lossy(&right.stdout).contains(": 0.000 mm RMS"));
    let wrong = run("deg");
    let said = String::from_utf8_lossy(&wrong.stderr);
    assert!(!wrong.status.success() && said.contains("--joint-unit"), "{said}");
}
