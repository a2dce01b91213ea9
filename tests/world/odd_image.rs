//! Images that the others predict worse than each other.

use std::path::Path;

use robotcal::output::solution_json::{self, SolutionRecord};
use robotcal::{Code, diagnose::Quantity};

use crate::program::{robotcal, text};
use crate::robots::kr6_urdf;

fn run(args: &[&str], out: &Path) {
    let urdf = kr6_urdf();
    let common = ["--urdf", urdf.to_str().unwrap(), "--out", out.to_str().unwrap()];
    let output = robotcal(&[args, &common].concat());
    assert_eq!(output.status.code(), Some(0), "{}", text(&output));
}

fn identified(folder: &Path) -> SolutionRecord {
    let (series, report) = (folder.join("series"), folder.join("report"));
    run(&["identify", "--series", series.to_str().unwrap()], &report);
    solution_json::read(&std::fs::read(report.join("solution.json")).unwrap()).unwrap()
}

/// Seed 5: the stop that reaches farthest in two joints misses by 0.86 mm, seven times the RMS, where it is held out, and the others leave
/// 0.6 mm an axis open there.
#[test]
fn a_stop_that_reaches_farther_than_the_others_is_not_odd() {
    let folder = tempfile::tempdir().unwrap();
    let args = ["simulate", "--errors", "full", "--images", "30", "--seed", "5", "--observations"];
    run(&args, &folder.path().join("series"));
    let record = identified(folder.path());
    let worst = record.accuracy.calibrated.worst_mm / record.accuracy.calibrated.rms_mm;
    assert!(worst > 5.0, "{worst}");
    assert!(record.findings.iter().all(|f| f.code != Code::OddImage), "{:?}", record.findings);
}

/// One stop of a clean series whose elbow stood 0.7 mrad beside its reading.
#[test]
fn a_stop_beside_its_reading_is_odd() {
    let folder = tempfile::tempdir().unwrap();
    let series = folder.path().join("series");
    run(&["simulate", "--images", "30", "--seed", "3", "--observations", "--outer-only"], &series);
    assert!(identified(folder.path()).findings.iter().all(|f| f.code != Code::OddImage));
    let table = std::fs::read_to_string(series.join("joints.csv")).unwrap();
    let beside = table.lines().map(|row| {
        let mut cells: Vec<String> = row.split(',').map(str::to_owned).collect();
        if cells[0] == "img_012.png" {
            cells[3] = (cells[3].parse::<f64>().unwrap() + 0.04).to_string();
        }
        cells.join(",") + "\n"
    });
    let beside: String = beside.collect();
    std::fs::write(series.join("joints.csv"), beside).unwrap();
    let record = identified(folder.path());
    let odd = record.findings.iter().find(|f| f.code == Code::OddImage).unwrap();
    let of = |name: &str| odd.quantities.iter().find(|q: &&Quantity| q.name == name).unwrap().value;
    let [error, rms, expected] = ["error", "rms", "expected"].map(of);
    assert!(error > 4e-4 && error > 3.0 * rms && error > 3.0 * expected, "{error} {rms} {expected}");
    // Joint noise of 0.05 to 0.1 mrad at some 0.6 m, as it was found with that stop.
    assert!((2e-5..2e-4).contains(&expected), "{expected}");
}
