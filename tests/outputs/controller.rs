//! Files for controllers: joint offsets in either of two places, xacro properties, MDH parameters.

use std::collections::BTreeMap;
use std::path::Path;

use super::whole::Origin;
use crate::outputs_support::{context, robot, series, series_in_postures, solved};
use nalgebra::{Matrix4, Vector3, Vector6};
use robotcal::Code;
use robotcal::geom::{Pose, exp_so3};
use robotcal::identify::{Options, RobotModel, Selection, Solution, identify};
use robotcal::model::joint_terms::Term;
use robotcal::model::robot::Robot;
use robotcal::output::difference::compare_solutions;
use robotcal::output::flange_table::flange_at;
use robotcal::output::restore::{exported_model, exported_robot, found_model};
use robotcal::output::{
    Offsets, compensated, files, kinematics_xacro, kinematics_yaml, read_compensation, solution_json,
};
use robotcal::series::CameraMount;
use robotcal::urdf::{RobotDescription, patch_origins};
use serde::Deserialize;

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

/// What mastering.csv tells to enter, rad: rows that the URDF does not hold.
fn to_enter(files: &Files) -> Vec<f64> {
    let table = rows(&text(files, "mastering.csv"));
    let entered = |row: &BTreeMap<String, String>| match row["in_urdf"].as_str() {
        "no" => row["offset"].parse::<f64>().unwrap().to_radians(),
        _ => 0.0,
    };
    table.iter().map(entered).collect()
}

/// The one that goes without compensation.toml: no term, the origins of the robot that does best by itself, in either place of the offsets.
#[test]
fn the_urdf_for_those_who_read_nothing_else_is_a_file_of_its_own() {
    let description = robot();
    let name = "kuka_kr6_r900.calibrated_alone.urdf";
    let rigid = solved(CameraMount::Hand, RobotModel::Rigid);
    assert!(rigid.uncertainty.alone.is_none());
    assert!(!files(&rigid, &context(&description)).unwrap().contains_key(name));

    let solution = solved(CameraMount::Hand, RobotModel::Full);
    let alone = solution.uncertainty.alone.as_ref().unwrap();
    let mut mastering = context(&description);
    mastering.offsets = Offsets::Mastering;
    for context in [context(&description), mastering] {
        let files = files(&solution, &context).unwrap();
        let of = alone.mastered_by(&to_enter(&files));
        let urdf = text(&files, name);
        let chain = RobotDescription::from_text(Path::new("c.urdf"), urdf).unwrap().chain(None, None).unwrap();
        let (written, q) = (Robot::nominal(chain), [0.4, -1.2, 1.1, 0.7, -0.9, 2.0]);
        let (angle, distance) = written.base_from_tip(&q).distance(&of.base_from_tip(&q));
        assert!(angle < 1e-9 && distance < 1e-9, "{angle} rad, {distance} m");
    }
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("compensation.toml");
    std::fs::write(&path, text(&files(&solution, &context(&description)).unwrap(), "compensation.toml")).unwrap();
    let of = |name: &str| text(&files(&solution, &context(&description)).unwrap(), name);
    let with = |urdf: String, path| {
        let chain = RobotDescription::from_text(Path::new("c.urdf"), urdf).unwrap().chain(None, None).unwrap();
        compensated(chain, path).map(|_| ()).map_err(|e| e.code)
    };
    let terms = Some(path.as_path());
    assert_eq!(with(of(name), terms), Err(Code::OptionConflict), "terms would count twice");
    assert_eq!(with(description.text.clone(), terms), Err(Code::OptionConflict), "the nominal URDF");
    assert_eq!((with(of(name), None), with(of("kuka_kr6_r900.calibrated.urdf"), terms)), (Ok(()), Ok(())));
    let e = solution.uncertainty.flange.unwrap();
    assert!(e.alone_m.unwrap() <= e.urdf_m && e.model_m <= e.alone_m.unwrap(), "{e:?}");
}

/// A joint that was not estimated has no offset that is known to be none.
#[test]
fn an_offset_that_was_held_is_not_determined() {
    let description = robot();
    let chain = description.chain(None, None).unwrap();
    let selection = Selection { fix: vec!["robot/joint_a1*".into()], ..Selection::default() };
    let options = Options { selection, model: RobotModel::Rigid, ..Options::default() };
    let solution = identify(chain, &[series(CameraMount::Hand, &description)], &options).unwrap();
    let table = rows(&text(&files(&solution, &context(&description)).unwrap(), "mastering.csv"));
    let row = table.iter().find(|row| row["joint"] == "joint_a1").unwrap();
    assert_eq!((row["sigma"].as_str(), row["determined"].as_str()), ("", "no"), "{row:?}");
}

/// With offsets of every size, of joints that are determined and of those that are not.
fn solved_with_offsets(model: RobotModel) -> Solution {
    let mut solution = solved(CameraMount::Hand, model);
    for t in solution.fit.state.robot.terms.iter_mut().filter(|t| t.term == Term::Offset) {
        t.value += 1e-3 * (t.reading as f64 + 1.0);
    }
    solution
}

#[test]
fn offsets_in_the_controller_or_in_the_origins_are_the_same_robot() {
    let description = robot();
    let solution = solved_with_offsets(RobotModel::Full);
    let folded = files(&solution, &context(&description)).unwrap();
    let mut mastering = context(&description);
    mastering.offsets = Offsets::Mastering;
    let mastering = files(&solution, &mastering).unwrap();
    let told = |files: &Files| solution_json::read(&files["solution.json"]).unwrap().offsets_in_mastering;
    assert_eq!([&folded, &mastering].map(told), [false, true]);
    let named = |files: &Files| text(files, "report.html").matches("mastering.csv").count();
    assert!(named(&mastering) > named(&folded), "the report tells to enter the zeros");
    let table = rows(&text(&mastering, "mastering.csv"));
    assert_eq!(table.len(), 6);
    assert!(table.iter().all(|r| (r["in_urdf"] == "no") == (r["determined"] == "yes") && r["unit"] == "deg"));
    assert!(rows(&text(&folded, "mastering.csv")).iter().all(|r| r["in_urdf"] == "yes"));
    let determined: Vec<&str> = table.iter().map(|r| r["determined"].as_str()).collect();
    assert_eq!((determined[0], determined[5]), ("no", "no"), "first and last joint belong to base and tool");
    let degrees = |r: &BTreeMap<String, String>, what: &str| r[what].parse::<f64>().unwrap();
    for r in table.iter().filter(|r| r["determined"] == "yes") {
        let (offset, sigma) = (degrees(r, "offset"), degrees(r, "sigma"));
        assert!(offset.abs() > 2.0 * sigma || sigma < 0.029, "{offset} +- {sigma} deg is no offset to enter");
    }
    let offsets = to_enter(&mastering);
    assert!(offsets.iter().any(|o| o.abs() > 1e-4), "no offset, no test");
    let (one, other) = (reread(&folded), reread(&mastering));
    assert_ne!(one.chain, other.chain);
    for k in 0..20 {
        let q: Vec<f64> = (0..6).map(|i| ((5 * k + 2 * i) as f64).sin()).collect();
        let shown: Vec<f64> = q.iter().zip(&offsets).map(|(q, o)| q + o).collect();
        let (rad, m) = one.base_from_tip(&q).distance(&other.base_from_tip(&shown));
        // What the six decimals of the table leave stands in the URDF.
        assert!(rad < 1e-9 && m < 1e-9, "{m:e} m, {rad:e} rad");
    }
}

/// Who enters what the file tells to enter, and nothing else, has the robot that was found; so has every command that reads the solution.
#[test]
fn a_controller_that_took_the_determined_offsets_has_the_robot_that_was_found() {
    let description = robot();
    let solution = solved_with_offsets(RobotModel::Rigid);
    let readings = description.chain(None, None).unwrap().readings.len();
    let mut mastering = context(&description);
    mastering.offsets = Offsets::Mastering;
    let files = files(&solution, &mastering).unwrap();
    let entered = to_enter(&files);
    let count = entered.iter().filter(|offset| **offset != 0.0).count();
    assert!(count > 0 && count < readings, "both kinds of offsets: {entered:?}");
    let record = solution_json::read(&files[solution_json::FILE_NAME]).unwrap();
    let exported = exported_robot(&record).unwrap();
    let (full, written) = (&solution.fit.state.robot, reread(&files));
    for k in 0..20 {
        let q: Vec<f64> = (0..6).map(|i| ((5 * k + 2 * i) as f64).sin()).collect();
        let shown: Vec<f64> = q.iter().zip(&entered).map(|(q, o)| q + o).collect();
        for (of, robot) in [("files", &written), ("exported robot of the solution", &exported)] {
            assert_same(of, robot.base_from_tip(&shown), full.base_from_tip(&q));
        }
    }
    let folded =
        solution_json::read(&self::files(&solution, &context(&description)).unwrap()[solution_json::FILE_NAME])
            .unwrap();
    let apart = compare_solutions(&folded, &record).unwrap();
    assert!(apart.everywhere.rms_m < 1e-9, "one robot");
    assert_eq!(apart.zeros, record.offsets_to_enter, "which takes other joint angles");
}

/// Zeros that are tens of degrees off are in the origins since before the fit: the controller is to be given them, and the files are without.
#[test]
fn a_zero_that_was_found_before_the_fit_is_part_of_the_offset_to_enter() {
    let description = robot();
    let chain = description.chain(None, None).unwrap();
    let lacking = [0.0, 0.0, -10f64.to_radians(), 25f64.to_radians(), 6f64.to_radians(), 0.0];
    let mut series = series(CameraMount::Hand, &description);
    for stop in &mut series.stops {
        stop.readings.as_mut().unwrap().iter_mut().zip(&lacking).for_each(|(q, zero)| *q -= zero);
    }
    let options = Options { model: RobotModel::Full, ..Options::default() };
    let solution = identify(chain.clone(), &[series], &options).unwrap();
    assert!(solution.findings.iter().any(|f| f.code() == Code::ZeroOff), "no zero found, no test");
    let mut mastering = context(&description);
    mastering.offsets = Offsets::Mastering;
    let files = files(&solution, &mastering).unwrap();
    let record = solution_json::read(&files[solution_json::FILE_NAME]).unwrap();
    let entered = to_enter(&files);
    let table = rows(&text(&files, "mastering.csv"));
    let of_joints = table.iter().zip(&entered).zip(lacking.iter().zip(&record.offsets_to_enter));
    for ((row, entered), (lacking, recorded)) in of_joints.skip(2).take(3) {
        // Offsets of the true robot are drawn with 3 mrad, and shared with its origins.
        assert_eq!(row["in_urdf"], "no", "{row:?}");
        assert!((entered - lacking).abs() < 0.025 && (entered - recorded).abs() < 1e-12, "{entered} {lacking}");
    }
    let written = reread(&files);
    let nominal = Robot::nominal(chain);
    let exported = exported_robot(&record).unwrap();
    let [found, mastered] = [found_model(&record).unwrap(), exported_model(&record).unwrap()];
    let [flange_before, flange_after] = [&found, &mastered].map(|m| m.flange().unwrap());
    let mut without_gravity = exported.clone();
    without_gravity.terms.retain(|t| !t.term.name().starts_with("gravity"));
    for k in 0..20 {
        let q: Vec<f64> = (0..6).map(|i| ((5 * k + 2 * i) as f64).sin()).collect();
        let shown: Vec<f64> = q.iter().zip(&entered).map(|(q, o)| q + o).collect();
        assert_same("solution", exported.base_from_tip(&shown), found.robot.base_from_tip(&q));
        assert_same("files", written.base_from_tip(&shown), without_gravity.base_from_tip(&shown));
        // Origins off by some 1 mrad each, and offsets that are not entered by up to 10.
        assert!(written.base_from_tip(&shown).distance(&nominal.base_from_tip(&shown)).0 < 0.05, "the given zeros");
        let [before, after] = [flange_before.at(&q), flange_after.at(&shown)].map(|f| f.sigmas());
        assert!(before.iter().zip(&after).all(|(b, a)| (a / b - 1.0).abs() < 1e-6), "{before:?} {after:?}");
    }
}

/// The URDF with frames is the exported one, and `compensate` knows the solution from which the exported one came.
#[test]
fn commands_take_the_exported_robot_of_a_mastered_solution() {
    let description = robot();
    let solution = solved(CameraMount::Hand, RobotModel::Rigid);
    let mut mastering = context(&description);
    mastering.offsets = Offsets::Mastering;
    let files = files(&solution, &mastering).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    for name in [solution_json::FILE_NAME, "kuka_kr6_r900.calibrated.urdf"] {
        std::fs::write(path(name), &files[name]).unwrap();
    }
    std::fs::write(path("nominal.urdf"), &description.text).unwrap();
    let run = |args: &[&str]| {
        std::process::Command::new(env!("CARGO_BIN_EXE_robotcal")).args(args).current_dir(&folder).output().unwrap()
    };
    let output = run(&["frames", "--from", solution_json::FILE_NAME, "--plate", "--out", "frames"]);
    let mut listed = std::fs::read_dir(path("frames")).unwrap().map(|e| e.unwrap().path());
    let urdf = listed.find(|p| p.to_string_lossy().ends_with(".frames.urdf"));
    let urdf = urdf.unwrap_or_else(|| panic!("{}", String::from_utf8_lossy(&output.stderr)));
    let record = solution_json::read(&files[solution_json::FILE_NAME]).unwrap();
    let (base, tip) = (Some(record.robot.base.as_str()), Some(record.robot.tip.as_str()));
    let framed = robotcal::urdf::read(&urdf).unwrap().chain(base, tip).unwrap();
    let q = [0.4, -1.2, 1.1, 0.7, -0.9, 2.0];
    assert_same("frames", Robot::nominal(framed).base_from_tip(&q), reread(&files).base_from_tip(&q));

    std::fs::write(path("program.src"), PROGRAM).unwrap();
    let corrected = "kuka_kr6_r900.calibrated.urdf";
    let models = ["--nominal", "nominal.urdf", "--urdf", corrected, "--solution", solution_json::FILE_NAME];
    let output = run(&[&["compensate", "program.src", "--frames", "nominal", "--out", "fixed"][..], &models].concat());
    assert!(matches!(output.status.code(), Some(0 | 1)), "{}", String::from_utf8_lossy(&output.stderr));
}

const PROGRAM: &str = "DEF P()\nPTP {A1 5, A2 -80, A3 100, A4 10, A5 40, A6 0}\nEND\n";

#[test]
fn xacro_properties_are_the_origins_of_the_urdf() {
    let description = robot();
    let solution = solved(CameraMount::Hand, RobotModel::Rigid);
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
        // words: a key of the driver of Universal Robots, which means something else.
        assert!(!text.contains("rising"), "{name}: <calibration rising> means something else");
    }
    for name in ["kinematics.yaml", "kinematics.xacro", "mdh.csv", "mastering.csv", "compensation.toml"] {
        // words: the head of a file is for people, and says who reads it.
        assert!(["for ", "reads"].iter().any(|word| text(&files, name).contains(word)), "{name} names no reader");
    }
}

/// A joint of a URDF: name, type, parent, child, xyz, rpy.
type JointRow<'a> = (&'a str, &'a str, &'a str, &'a str, &'a str, &'a str);

/// A URDF of these joints, all axes along `axis`.
fn urdf(joints: &[JointRow], axis: &str) -> RobotDescription {
    let mut links: Vec<&str> = joints.iter().flat_map(|j| [j.2, j.3]).collect();
    links.sort_unstable();
    links.dedup();
    let links: String = links.iter().map(|l| format!("<link name=\"{l}\"/>")).collect();
    let joint = |(name, kind, parent, child, xyz, rpy): &JointRow| {
        format!(
            "<joint name=\"{name}\" type=\"{kind}\"><parent link=\"{parent}\"/><child link=\"{child}\"/>\
             <origin xyz=\"{xyz}\" rpy=\"{rpy}\"/><axis xyz=\"{axis}\"/></joint>"
        )
    };
    let joints: String = joints.iter().map(joint).collect();
    let text = format!("<robot name=\"r\">{links}{joints}</robot>");
    RobotDescription::from_text(Path::new("r.urdf"), text).unwrap()
}

const HALF: &str = "1.5707963267948966";

/// The links and joints of ur_description, dimensions of a UR5e.
fn ur(axis: &str, prefix: &str) -> RobotDescription {
    let (down, turned) = (format!("{HALF} 0 0"), "0 0 3.141592653589793");
    let (flange, tool) = (format!("0 -{HALF} -{HALF}"), format!("{HALF} 0 {HALF}"));
    let p = |name: &str| format!("{prefix}{name}");
    let names = |j: &(&str, &str, &str, &str, &str, &str)| [p(j.0), p(j.2), p(j.3)];
    let rows: Vec<JointRow> = vec![
        ("base_link-base_link_inertia", "fixed", "base_link", "base_link_inertia", "0 0 0", turned),
        ("base_link-base_fixed_joint", "fixed", "base_link", "base", "0 0 0", turned),
        ("shoulder_pan_joint", "continuous", "base_link_inertia", "shoulder_link", "0 0 0.1625", "0 0 0"),
        ("shoulder_lift_joint", "continuous", "shoulder_link", "upper_arm_link", "0 0 0", &down),
        ("elbow_joint", "continuous", "upper_arm_link", "forearm_link", "-0.425 0 0", "0 0 0"),
        ("wrist_1_joint", "continuous", "forearm_link", "wrist_1_link", "-0.3922 0 0.1333", "0 0 0"),
        ("wrist_2_joint", "continuous", "wrist_1_link", "wrist_2_link", "0 -0.0997 0", &down),
        (
            "wrist_3_joint",
            "continuous",
            "wrist_2_link",
            "wrist_3_link",
            "0 0.0996 0",
            "1.5707963267948966 3.141592653589793 3.141592653589793",
        ),
        ("wrist_3-flange", "fixed", "wrist_3_link", "flange", "0 0 0", &flange),
        ("flange-tool0", "fixed", "flange", "tool0", "0 0 0", &tool),
    ];
    let named: Vec<[String; 3]> = rows.iter().map(names).collect();
    let rows: Vec<JointRow> =
        rows.iter().zip(&named).map(|(r, n)| (n[0].as_str(), r.1, n[1].as_str(), n[2].as_str(), r.4, r.5)).collect();
    urdf(&rows, axis)
}

/// A robot whose moving joints, and the fixed ones before them, are off by some tenths of a millimetre and milliradians.
fn off(description: &RobotDescription, base: Option<&str>) -> Robot {
    let mut robot = Robot::nominal(description.chain(base, None).unwrap());
    let last = robot.chain.joints.iter().rposition(|j| j.drive.is_some()).unwrap();
    for (k, twist) in robot.twists.iter_mut().enumerate().take(last + 1) {
        *twist = Vector6::from_fn(|i, _| if i < 3 { 5e-4 } else { 2e-3 } * ((7 * k + i) as f64).sin());
    }
    robot
}

/// Flange of the corrected URDF.
fn exported(robot: &Robot, description: &RobotDescription, q: &[f64]) -> Pose {
    let origins = robot.urdf_origins().into_iter().map(|(name, o)| (name.to_owned(), o)).collect();
    let text = patch_origins(&description.text, &origins).unwrap();
    let chain = RobotDescription::from_text(Path::new("c.urdf"), text).unwrap();
    Robot::nominal(chain.chain(Some(&robot.chain.base), None).unwrap()).base_from_tip(q)
}

/// The origin, then a turn about z.
fn turned(origin: &Origin, q: f64) -> Pose {
    origin.pose() * Pose::new(exp_so3(&(Vector3::z() * q)), Vector3::zeros())
}

fn assert_same(what: &str, one: Pose, other: Pose) {
    let (rad, m) = one.distance(&other);
    assert!(rad < 1e-9 && m < 1e-9, "{what}: {m:e} m, {rad:e} rad");
}

#[derive(Deserialize)]
struct File {
    kinematics: Links,
}
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Links {
    shoulder: Origin,
    upper_arm: Origin,
    forearm: Origin,
    wrist_1: Origin,
    wrist_2: Origin,
    wrist_3: Origin,
    hash: String,
}

/// Flange of ur_description with this file, base_link_inertia at `before`; tool0 is wrist_3_link there.
fn read_by_ur_description(file: &File, before: Pose, q: &[f64]) -> Pose {
    let k = &file.kinematics;
    let links = [k.shoulder, k.upper_arm, k.forearm, k.wrist_1, k.wrist_2, k.wrist_3];
    links.iter().zip(q).fold(before, |pose, (link, q)| pose * turned(link, *q))
}

#[test]
fn kinematics_yaml_of_a_ur_is_what_ur_description_reads() {
    let q = [0.3, -1.2, 0.9, 2.0, -0.7, 1.4];
    let mut hashes = Vec::new();
    for (prefix, base) in [("", None), ("left_", None), ("", Some("base"))] {
        let description = ur("0 0 1", prefix);
        let robot = off(&description, base);
        let file: File = serde_saphyr::from_str(&kinematics_yaml(&robot, &description, "")).unwrap();
        // base_link_inertia is turned by half a turn in base_link, and stands as base does.
        let half = Pose::from_xyz_rpy([0.0; 3], [0.0, 0.0, std::f64::consts::PI]);
        let before = if base.is_none() { half } else { Pose::identity() };
        assert_same("ur", read_by_ur_description(&file, before, &q), exported(&robot, &description, &q));
        hashes.push(file.kinematics.hash);
    }
    assert!(!hashes[0].is_empty() && hashes[0] == hashes[1] && hashes[0] != hashes[2], "{hashes:?}");
    // The older description of the same joint names has other axes, and reads no such file.
    let older = ur("0 1 0", "");
    let text = kinematics_yaml(&off(&older, None), &older, "");
    assert!(text.contains("shoulder_pan_joint:") && !text.contains("hash:"), "{text}");
}

/// The frames of its URDF end before the flange, which ur_description has in the last joint: 0.11655 m.
#[test]
fn the_flange_of_a_ur_is_found_whatever_its_link_is_called() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("robots/ur10e/ur10e.urdf");
    let plain = std::fs::read_to_string(path).unwrap();
    let q = [0.3, -1.2, 0.9, 2.0, -0.7, 1.4];
    let of = |text: String| {
        let description = RobotDescription::from_text(Path::new("ur10e.urdf"), text).unwrap();
        let robot = off(&description, None);
        (kinematics_yaml(&robot, &description, ""), exported(&robot, &description, &q))
    };
    for text in [
        plain.clone(),
        plain.replace("\"tool0\"", "\"flange\""),
        plain.replace("\"tool0\"", "\"my_tool0\""),
        plain.replace("<joint name=\"", "<joint name=\"left_"),
    ] {
        let (yaml, flange) = of(text);
        let file: File = serde_saphyr::from_str(&yaml).unwrap();
        assert!((file.kinematics.wrist_3.y - 0.11655).abs() < 5e-3, "{yaml}");
        assert_same("ur10e", read_by_ur_description(&file, Pose::identity(), &q), flange);
        // The frames of the URDF stand elsewhere along the axes; bodies hang on those of ur_description.
        let k = &file.kinematics;
        let along = [k.shoulder.z - 0.1807, k.upper_arm.z, k.wrist_1.z - 0.17415, k.wrist_2.y + 0.11985];
        assert!(along.iter().all(|m| m.abs() < 5e-3), "{yaml}");
        assert!(!yaml.contains("WARNING"), "{yaml}");
    }
    // A camera beside the flange, whose own frame has no link: nobody knows where tool0 is to be.
    let camera = plain.replace("\"tool0\"", "\"camera\"").replace("0 0 0.11655", "0.1 0 0.02");
    let (yaml, _) = of(camera);
    assert!(yaml.contains("wrist_3_joint:") && !yaml.contains("hash:"), "{yaml}");
}

#[test]
fn kinematics_yaml_of_a_franka_and_of_an_xarm_is_what_their_descriptions_read() {
    #[derive(Deserialize)]
    struct Joint {
        kinematic: Origin,
    }
    let bent = format!("{HALF} 0 0");
    let arm = |prefix: &str, base: &str, count: usize| -> Vec<[String; 3]> {
        let link = |k: usize| if k == 0 { format!("{prefix}{base}") } else { format!("{prefix}link{k}") };
        (1..=count).map(|k| [format!("{prefix}joint{k}"), link(k - 1), link(k)]).collect()
    };
    let rows = |names: &[[String; 3]]| -> Vec<(String, String, String)> {
        names.iter().map(|[a, b, c]| (a.clone(), b.clone(), c.clone())).collect()
    };
    let built = |names: &[(String, String, String)], fixed: usize| {
        let kind = |k: usize| if k < names.len() - fixed { "continuous" } else { "fixed" };
        let rows: Vec<JointRow> = names
            .iter()
            .enumerate()
            .map(|(k, n)| (n.0.as_str(), kind(k), n.1.as_str(), n.2.as_str(), "0.1 0.02 0.3", bent.as_str()))
            .collect();
        urdf(&rows, "0 0 1")
    };
    let q = [0.3, -1.2, 0.9, 2.0, -0.7, 1.4, -2.2];
    let description = built(&rows(&arm("panda_", "link0", 8)), 1);
    let robot = off(&description, None);
    let file: BTreeMap<String, Joint> = serde_saphyr::from_str(&kinematics_yaml(&robot, &description, "")).unwrap();
    assert_eq!(file.len(), 8);
    let turns = q.iter().copied().chain([0.0]).enumerate();
    let read =
        turns.fold(Pose::identity(), |pose, (k, q)| pose * turned(&file[&format!("joint{}", k + 1)].kinematic, q));
    assert_same("franka", read, exported(&robot, &description, &q));
    for count in [5, 6, 7] {
        let description = built(&rows(&arm("", "link_base", count)), 0);
        let robot = off(&description, None);
        let text = kinematics_yaml(&robot, &description, "");
        let file: BTreeMap<String, BTreeMap<String, Origin>> = serde_saphyr::from_str(&text).unwrap();
        assert!(text.contains("xarm_description"), "{text}");
        let joints = &file["kinematics"];
        assert_eq!(joints.len(), count);
        let turns = q[..count].iter().enumerate();
        let read = turns.fold(Pose::identity(), |pose, (k, q)| pose * turned(&joints[&format!("joint{}", k + 1)], *q));
        assert_same("xarm", read, exported(&robot, &description, &q[..count]));
    }
}

#[test]
fn every_joint_has_properties_of_its_own_in_the_xacro_and_the_element_that_uses_them() {
    let rows = [
        ("a-b", "continuous", "base", "one", "0.1 0 0", "0 0 0"),
        ("a_b", "continuous", "one", "two", "0.2 0 0", "0 0 0"),
        ("3--axis", "continuous", "two", "three", "0.3 0 0", "0 0 0"),
    ];
    let description = urdf(&rows, "0 0 1");
    let text = kinematics_xacro(&Robot::nominal(description.chain(None, None).unwrap()), "");
    let document = roxmltree::Document::parse(&text).unwrap();
    let value = |name: &str| {
        document.descendants().find(|n| n.attribute("name") == Some(name)).and_then(|n| n.attribute("value"))
    };
    let comments: Vec<&str> = document.descendants().filter(|n| n.is_comment()).filter_map(|n| n.text()).collect();
    for (joint, x) in [("a-b:", "0.1"), ("a_b:", "0.2"), ("3- -axis:", "0.3")] {
        let recipe =
            comments.iter().find(|c| c.trim().starts_with(joint)).unwrap_or_else(|| panic!("{joint} {comments:?}"));
        let (_, rest) = recipe.split_once("xyz=\"${").unwrap();
        let name = rest.split_once('}').unwrap().0;
        let letter_first = name.starts_with(|c: char| c.is_ascii_alphabetic());
        assert!(
            letter_first && name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_'),
            "{name} is no name in Python"
        );
        assert!(value(name).unwrap().starts_with(x), "{joint} {name}");
    }
}

#[test]
fn what_is_stated_of_the_flange_is_what_the_exported_files_give() {
    let description = robot();
    let series = series_in_postures(CameraMount::Hand, &description, 4);
    let chain = description.chain(None, None).unwrap();
    let options = Options { model: RobotModel::Full, ..Options::default() };
    let solution = identify(chain, std::slice::from_ref(&series), &options).unwrap();
    let files = files(&solution, &context(&description)).unwrap();
    let record = solution_json::read(&files[solution_json::FILE_NAME]).unwrap();
    assert!(!record.robot.local_errors.is_empty(), "no local errors, no test");
    assert!(record.robot.terms.iter().all(|t| !t.term.starts_with("local")));
    // The robot as others have it: corrected URDF and compensation.toml.
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("compensation.toml");
    std::fs::write(&path, text(&files, "compensation.toml")).unwrap();
    let urdf = text(&files, "kuka_kr6_r900.calibrated.urdf");
    let chain = RobotDescription::from_text(Path::new("c.urdf"), urdf).unwrap().chain(None, None).unwrap();
    let exported = read_compensation(&path, chain).unwrap();
    let plate = Pose::from(&record.placements[0].pose);
    let readings: Vec<Vec<f64>> = series.stops.iter().filter_map(|s| s.readings.clone()).collect();
    let found = flange_at(&found_model(&record).unwrap(), &readings).unwrap();
    let mut most_local = 0.0f64;
    for (q, at) in readings.iter().zip(&found) {
        assert_same("--at", at.pose, plate.inverse() * exported.base_from_tip(q));
        most_local = most_local.max(solution.fit.state.robot.base_from_tip(q).distance(&exported.base_from_tip(q)).1);
    }
    assert!(most_local > 1e-5, "the local errors of this series are too small to be missed: {most_local:e} m");
    for place in &record.workspace {
        let xyz = exported.base_from_tip(&place.readings).translation;
        assert!((xyz - Vector3::from(place.xyz_m)).norm() < 1e-9, "workspace map");
    }
}

#[test]
fn mdh_parameters_say_what_they_leave() {
    let description = robot();
    let solution = solved(CameraMount::Hand, RobotModel::Rigid);
    let files = files(&solution, &context(&description)).unwrap();
    let real = Robot::nominal(reread(&files).chain);
    let mdh = text(&files, "mdh.csv");
    let warned = |l: &str| ["# ", "joint_a2", "joint_a3"].iter().all(|name| l.contains(name));
    assert!(mdh.lines().any(warned), "the nearly parallel axes are named: {mdh}");
    // The parameters are worth something between these links alone.
    let chain = &solution.fit.state.robot.chain;
    let ends = [&chain.base, &chain.tip].map(|link| format!("\"{link}\""));
    let named = |l: &str| l.starts_with('#') && ends.iter().all(|end| l.contains(end));
    assert!(mdh.lines().any(named), "{ends:?}: {mdh}");
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
