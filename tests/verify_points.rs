//! `robotcal verify --points` on points that the nominal robot itself puts there.

#![allow(clippy::unwrap_used)]

use std::fmt::Write;
use std::path::Path;

use assert_cmd::Command;
use robotcal::model::robot::Robot;

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
