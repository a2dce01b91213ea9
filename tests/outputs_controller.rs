//! Files for controllers: joint offsets in either of two places, xacro properties, MDH parameters.

#![allow(clippy::unwrap_used)]

mod outputs_support;

use std::collections::BTreeMap;
use std::path::Path;

use nalgebra::Matrix4;
use outputs_support::{context, robot, solved};
use robotcal::model::robot::Robot;
use robotcal::output::{Offsets, files, read_compensation};
use robotcal::recipe::RobotModel;
use robotcal::series::CameraMount;
use robotcal::urdf::RobotDescription;

type Files = BTreeMap<String, Vec<u8>>;

fn text(files: &Files, name: &str) -> String {
    String::from_utf8(files.get(name).unwrap_or_else(|| panic!("no {name} among {:?}", files.keys())).clone()).unwrap()
}

/// The robot as URDF and compensation.toml say.
fn reread(files: &Files) -> Robot {
    let urdf = text(files, "kuka_kr6_r900.calibrated.urdf");
    let chain = RobotDescription::from_text(Path::new("c.urdf"), urdf).unwrap().chain(None, None).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("compensation.toml");
    std::fs::write(&path, text(files, "compensation.toml")).unwrap();
    let mut robot = read_compensation(&path, chain).unwrap();
    // Gravity is a function of the posture by readings, which mastering shifts; the rest is the same to rounding.
    robot.terms.retain(|t| !t.term.name().starts_with("gravity"));
    robot
}

/// Rows of a table behind its remarks.
fn rows(text: &str) -> Vec<BTreeMap<String, String>> {
    csv::ReaderBuilder::new()
        .comment(Some(b'#'))
        .from_reader(text.as_bytes())
        .deserialize()
        .map(|r| r.unwrap())
        .collect()
}

#[test]
fn offsets_in_the_controller_or_in_the_origins_are_the_same_robot() {
    let description = robot();
    let solution = solved(CameraMount::Hand, RobotModel::Full, &description);
    let folded = files(&solution, &context(&description)).unwrap();
    let mut mastering = context(&description);
    mastering.offsets = Offsets::Mastering;
    let mastering = files(&solution, &mastering).unwrap();
    let table = rows(&text(&mastering, "mastering.csv"));
    assert_eq!(table.len(), 6);
    assert!(table.iter().all(|r| r["in_urdf"] == "no" && r["unit"] == "deg"));
    assert!(rows(&text(&folded, "mastering.csv")).iter().all(|r| r["in_urdf"] == "yes"));
    let determined: Vec<&str> = table.iter().map(|r| r["determined"].as_str()).collect();
    assert_eq!((determined[0], determined[5]), ("no", "no"), "first and last joint belong to base and tool");
    let degrees = |r: &BTreeMap<String, String>, what: &str| r[what].parse::<f64>().unwrap();
    for r in table.iter().filter(|r| r["determined"] == "yes") {
        let (offset, sigma) = (degrees(r, "offset"), degrees(r, "sigma"));
        assert!(offset.abs() > 2.0 * sigma || sigma < 0.029, "{offset} +- {sigma} deg is no offset to enter");
    }
    let offsets: Vec<f64> = table.iter().map(|r| r["offset"].parse::<f64>().unwrap().to_radians()).collect();
    assert!(offsets.iter().any(|o| o.abs() > 1e-4), "no offset, no test");
    let (one, other) = (reread(&folded), reread(&mastering));
    assert_ne!(one.chain, other.chain);
    for k in 0..20 {
        let q: Vec<f64> = (0..6).map(|i| ((5 * k + 2 * i) as f64).sin()).collect();
        let shown: Vec<f64> = q.iter().zip(&offsets).map(|(q, o)| q + o).collect();
        let (rad, m) = one.base_from_tip(&q).distance(&other.base_from_tip(&shown));
        // Six decimals of a degree, six joints, at most 1.5 m.
        assert!(rad < 6e-8 && m < 8e-8, "{m:e} m, {rad:e} rad");
    }
}

#[test]
fn xacro_properties_are_the_origins_of_the_urdf() {
    let description = robot();
    let solution = solved(CameraMount::Hand, RobotModel::Rigid, &description);
    let files = files(&solution, &context(&description)).unwrap();
    let chain = reread(&files).chain;
    let xacro = text(&files, "kinematics.xacro");
    let document = roxmltree::Document::parse(&xacro).unwrap();
    let value = |name: String| -> Vec<f64> {
        let node =
            document.descendants().find(|n| n.attribute("name") == Some(&name)).unwrap_or_else(|| panic!("{name}"));
        node.attribute("value").unwrap().split(' ').map(|v| v.parse().unwrap()).collect()
    };
    for joint in &chain.joints {
        let name = joint.name.replace('-', "_");
        assert_eq!(value(format!("{name}_origin_xyz")), joint.origin.xyz());
        let rpy = value(format!("{name}_origin_rpy"));
        let read = robotcal::geom::matrix_from_rpy([rpy[0], rpy[1], rpy[2]]);
        assert!((read - joint.origin.rotation).amax() < 1e-13);
    }
    for (name, bytes) in &files {
        let text = String::from_utf8_lossy(bytes);
        assert!(!text.contains("rising"), "{name}: <calibration rising> means something else");
    }
    for name in ["kinematics.yaml", "kinematics.xacro", "mdh.csv", "mastering.csv", "compensation.toml"] {
        assert!(text(&files, name).contains("for ") || text(&files, name).contains("reads"), "{name} names no reader");
    }
}

#[test]
fn mdh_parameters_say_what_they_leave() {
    let description = robot();
    let solution = solved(CameraMount::Hand, RobotModel::Rigid, &description);
    let files = files(&solution, &context(&description)).unwrap();
    let real = Robot::nominal(reread(&files).chain);
    let mdh = text(&files, "mdh.csv");
    assert!(mdh.contains("WARNING: nearly parallel axes") && mdh.contains("joint_a2 and joint_a3"), "{mdh}");
    let numbers = |line: &str| -> Vec<f64> {
        let parts = line.split([' ', ',']);
        parts.filter_map(|p| p.parse().ok()).collect()
    };
    let line = |start: &str| numbers(mdh.lines().find(|l| l.starts_with(start)).unwrap());
    let pose = |v: Vec<f64>| robotcal::geom::Pose::from_xyz_rpy([v[0], v[1], v[2]], [v[3], v[4], v[5]]).matrix();
    let (base, tip) = (pose(line("# base_from_first:")), pose(line("# last_from_tip:")));
    let stated = line("# Against the corrected URDF");
    let (rms_mm, worst_mm, worst_mrad) = (stated[1], stated[2], stated[3]);
    let table = rows(&mdh);
    let mut errors = Vec::new();
    for k in 0..200 {
        let q: Vec<f64> = (0..6).map(|i| 2.5 * ((5 * k + 2 * i) as f64).sin()).collect();
        let mut t: Matrix4<f64> = base;
        for (row, q) in table.iter().zip(&q) {
            let v = |name: &str| row[name].parse::<f64>().unwrap();
            let ((sa, ca), (st, ct)) = (v("alpha_rad").sin_cos(), (v("theta_offset_rad") + q).sin_cos());
            let (a, d) = (v("a_m"), v("d_m"));
            assert!(a.abs() < 1.0 && d.abs() < 1.0, "{row:?}");
            // Craig, equation 3.6.
            t *= Matrix4::new(
                ct,
                -st,
                0.0,
                a,
                st * ca,
                ct * ca,
                -sa,
                -sa * d,
                st * sa,
                ct * sa,
                ca,
                ca * d,
                0.0,
                0.0,
                0.0,
                1.0,
            );
        }
        t *= tip;
        let wanted = real.base_from_tip(&q).matrix();
        errors.push(1e3 * (t - wanted).fixed_view::<3, 1>(0, 3).norm());
    }
    let worst = errors.iter().fold(0.0, |m: f64, e| m.max(*e));
    let rms = (errors.iter().map(|e| e * e).sum::<f64>() / errors.len() as f64).sqrt();
    assert!(worst < 1.5 * worst_mm && (rms / rms_mm - 1.0).abs() < 0.5, "{worst} {rms}; stated {stated:?}");
    assert!(rms > 1e-3 && worst_mrad > 0.0, "axes taken as parallel cost something");
}
