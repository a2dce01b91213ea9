//! Three real series of one robot, judged by points that a laser tracker measured on it.

#![allow(clippy::unwrap_used)]

use std::path::{Path, PathBuf};

use nalgebra::Vector3;
use robotcal::assess::{MeasuredPoint, fit_points};
use robotcal::model::joint_terms::Term;
use robotcal::model::robot::Robot;
use robotcal::recipe::{Options, identify, measure};

const SERIES: [&str; 3] = ["nachi-2025-01-17", "nachi-2025-02-04", "nachi-2025-02-19"];

fn real() -> Option<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/real");
    if !folder.exists() {
        println!("skipped: {} is not there", folder.display());
        return None;
    }
    Some(folder)
}

fn tracker_points(path: &Path) -> Vec<MeasuredPoint> {
    let mut reader = csv::Reader::from_path(path).unwrap();
    let row = |r: Result<csv::StringRecord, csv::Error>| -> Vec<f64> {
        r.unwrap().iter().map(|cell| cell.parse().unwrap()).collect()
    };
    let point = |v: Vec<f64>| MeasuredPoint { position_m: Vector3::new(v[0], v[1], v[2]), readings: v[3..].to_vec() };
    reader.records().map(|r| point(row(r))).collect()
}

#[test]
fn the_tracker_confirms_model_and_stated_uncertainty() {
    let Some(real) = real() else { return };
    let urdf = robotcal::urdf::read(&real.join(SERIES[0]).join("robot.urdf")).unwrap();
    let chain = urdf.chain(Some("base_link"), Some("flange")).unwrap();
    let points = tracker_points(&real.join("tracker-nachi-2025-01-15.csv"));
    let nominal = fit_points(&Robot::nominal(chain.clone()), &points).unwrap().rms_m;
    let measured = SERIES.map(|name| {
        let series = robotcal::series::read(&real.join(name)).unwrap();
        measure(&series, &chain, true, |_| {}).unwrap().series
    });
    // Each series alone sees six postures of the first three joints; all together some twelve.
    let selections = [&measured[..1], &measured[1..2], &measured[2..], &measured[..]];
    for chosen in selections {
        let s = identify(chain.clone(), chosen, &Options::default()).unwrap();
        let fit = fit_points(&s.state.robot, &points).unwrap();
        let robot = s.problem.layout.terms.end;
        let covariance = s.covariance.reduced.view((0, 0), (robot, robot)).into_owned();
        let expected = fit.expected(&s.state.robot, &points, &covariance, &s.problem.joint_sigma(0)).unwrap();
        let names: Vec<&str> = chosen.iter().map(|m| m.name.as_str()).collect();
        println!(
            "{}: {:.3} mm on the tracker (nominal {:.3}), expected {:.3}, with joint noise {:.3}",
            names.join(" + "),
            1e3 * fit.rms_m,
            1e3 * nominal,
            1e3 * expected.model_m,
            1e3 * expected.with_joint_noise_m
        );
        let flange = s.worth.flange.unwrap();
        let mut urdf = s.state.robot.clone();
        urdf.terms.retain(|t| t.term == Term::Offset);
        let urdf = fit_points(&urdf, &points).unwrap().rms_m;
        println!("  stated in the region of the stops {flange:?}; URDF alone on the tracker {:.3} mm", 1e3 * urdf);
        // Four fifths of the tracker's points lie outside that region.
        for (stated, found) in [(flange.model_m, fit.rms_m), (flange.urdf_m, urdf)] {
            assert!((0.7..1.4).contains(&(stated / found)), "{names:?}: stated {stated}, found {found}");
        }
        assert!(fit.rms_m < 0.62e-3 && fit.rms_m < nominal, "{names:?}: {}", fit.rms_m);
        let ratio = fit.rms_m / expected.with_joint_noise_m;
        assert!((0.6..2.0).contains(&ratio), "{names:?}: actual over expected {ratio}");
    }
}
