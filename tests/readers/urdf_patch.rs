//! Patching robot descriptions as text, and real descriptions where they are at hand.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use crate::robots::shared;
use crate::said::assert_says;
use nalgebra::Vector6;
use robotcal::Code;
use robotcal::geom::Pose;
use robotcal::urdf::{JointKind, RobotDescription, patch_origins, read};

/// Origins of all joints that lie on a chain, after a re-read.
fn origins(text: &str) -> BTreeMap<String, Pose> {
    let robot = RobotDescription::from_text(Path::new("patched.urdf"), text.to_string()).unwrap();
    let chains = robot.links().filter_map(|link| robot.chain(None, Some(link)).ok());
    chains.flat_map(|c| c.joints).map(|j| (j.name, j.origin)).collect()
}

/// A file with a byte order mark, CRLF, tabs, and a commented joint of the same name.
fn shell(joint: &str) -> String {
    format!(
        "\u{feff}<?xml version='1.0'?>\r\n<!-- <joint name=\"j\"><origin xyz=\"9 9 9\"/></joint> -->\r\n\
         <robot name=\"r\" version=\"1.1\">\r\n\t<link name=\"a\"/> <link name=\"b\"/>\r\n{joint}\r\n</robot>\r\n"
    )
}

fn patch(text: &str, pose: Pose) -> String {
    patch_origins(text, &BTreeMap::from([("j".to_string(), pose)])).unwrap()
}

const OPEN: &str = "<joint name='j' type='revolute'>";
const TAIL: &str = "<parent link='a'/><child link='b'/><axis xyz='0 0 1'/></joint>";

#[test]
fn a_patch_changes_the_values_only() {
    let turned = Pose::from_xyz_rpy([0.1, -0.25, 1e-7], [0.0, 0.0, 0.5]);
    let lifted = Pose::from_xyz_rpy([0.0, 0.0, 0.5], [0.0; 3]);
    for (before, pose, after) in [
        // both values; odd blanks and quotes stay
        (
            "<origin  rpy='0 0 0'\r\n xyz = \"1 2  3\" />",
            turned,
            "<origin  rpy='0 0 0.5'\r\n xyz = \"0.1 -0.25 1e-7\" />",
        ),
        // an unchanged rotation keeps its bytes
        ("<origin xyz='1 2 3' rpy='-0.0 0.00 0'/>", lifted, "<origin xyz='0 0 0.5' rpy='-0.0 0.00 0'/>"),
        // missing attributes
        ("<origin rpy='0 0 0.5'/>", turned, "<origin rpy='0 0 0.5' xyz='0.1 -0.25 1e-7'/>"),
        ("<origin xyz='1 2 3'></origin>", turned, "<origin xyz='0.1 -0.25 1e-7' rpy='0 0 0.5'></origin>"),
        ("<origin/>", turned, "<origin xyz=\"0.1 -0.25 1e-7\" rpy=\"0 0 0.5\"/>"),
        ("<origin />", lifted, "<origin xyz=\"0 0 0.5\" />"),
        // a missing element
        ("\r\n\t\t", turned, "\r\n\t\t<origin xyz='0.1 -0.25 1e-7' rpy='0 0 0.5'/>\r\n\t\t"),
        ("<!-- > / -->", turned, "<origin xyz='0.1 -0.25 1e-7' rpy='0 0 0.5'/><!-- > / -->"),
        ("", Pose::identity(), ""),
    ] {
        let text = shell(&format!("{OPEN}{before}{TAIL}"));
        let patched = patch(&text, pose);
        assert_eq!(patched, shell(&format!("{OPEN}{after}{TAIL}")));
        assert_eq!(patch(&patched, pose), patched, "patching twice is patching once");
        assert!((origins(&patched)["j"].matrix() - pose.matrix()).abs().max() < 1e-15, "{patched}");
    }
}

#[test]
fn quaternions_stay_quaternions() {
    let pose = Pose::from_xyz_rpy([0.0, 0.0, 0.5], [0.3, 1.2, -2.0]);
    let text = shell(&format!("{OPEN}<origin quat_xyzw=\"0 0 0 1\"/>{TAIL}"));
    let patched = patch(&text, pose);
    assert!(patched.contains("\" xyz=\"0 0 0.5\"/>") && !patched.contains("rpy"), "{patched}");
    assert!((origins(&patched)["j"].matrix() - pose.matrix()).abs().max() < 1e-15, "{patched}");
    let moved = Pose { translation: [1.0, 2.0, 3.0].into(), ..Pose::identity() };
    assert!(patch(&text, moved).contains("quat_xyzw=\"0 0 0 1\" xyz=\"1 2 3\""));
}

#[test]
fn what_cannot_be_patched_is_refused() {
    let text = shell(&format!("{OPEN}<origin xyz='1 2 3' rpy='.5 0 -0'/>{TAIL}"));
    let same = Pose::from_xyz_rpy([1.0, 2.0, 3.0], [0.5, 0.0, 0.0]);
    assert_eq!(patch(&text, same), text);
    let refuse =
        |name: &str, pose: Pose| patch_origins(&text, &BTreeMap::from([(name.to_string(), pose)])).unwrap_err();
    assert_says(&refuse("k", same), Code::UrdfTwice, &["\"k\""]);
    let missing = refuse("j", Pose::from_xyz_rpy([f64::NAN, 0.0, 0.0], [0.0; 3]));
    assert_eq!(missing.code, Code::OriginNotWritten, "{missing}");
    let sheared = Pose::new(same.rotation * 1.001, same.translation);
    let refused = refuse("j", sheared);
    assert_eq!(refused.code, Code::OriginNotWritten, "{refused}");
}

#[test]
fn rotations_at_and_near_gimbal_lock_survive_the_text() {
    let text = shell(&format!("{OPEN}<origin xyz=\"0 0 1\"/>{TAIL}"));
    let half = std::f64::consts::FRAC_PI_2;
    for pitch in [half, -half] {
        for off in [0.0, 1e-15, 1e-12, 1e-10, 1e-9, 3e-9, 1e-8, 1e-7, 1e-5, 1e-3] {
            for (roll, yaw) in [(0.0, 0.0), (1.0, -2.0), (-3.0, 0.7)] {
                let pose = Pose::from_xyz_rpy([0.0; 3], [roll, pitch + off, yaw]);
                let error = (origins(&patch(&text, pose))["j"].rotation - pose.rotation).abs().max();
                assert!(error < 1e-13, "pitch {pitch} + {off}, roll {roll}, yaw {yaw}: {error:e}");
            }
        }
    }
}

/// Real descriptions; there are some of each kind.
fn shared_files(extension: &str) -> Vec<PathBuf> {
    let mut files: Vec<_> = std::fs::read_dir(shared("urdf")).unwrap().map(|f| f.unwrap().path()).collect();
    files.retain(|f| f.extension().is_some_and(|e| e == extension));
    files.sort();
    assert!(!files.is_empty(), "no {extension}");
    files
}

/// Text without the origins of joints: what a patch must leave alone.
fn without_origins(text: &str) -> String {
    let document = roxmltree::Document::parse(text).unwrap();
    let joints = document.root_element().children().filter(|n| n.has_tag_name("joint"));
    let cuts = joints.filter_map(|j| j.children().find(|c| c.has_tag_name("origin"))).map(|o| o.range());
    let mut kept = String::new();
    let mut at = 0;
    for cut in cuts {
        kept += &text[at..cut.start];
        at = cut.end;
    }
    kept + &text[at..]
}

#[test]
#[ignore = "needs the real series"]
fn real_descriptions_are_read_and_patched_byte_for_byte() {
    for file in shared_files("urdf") {
        let shown = file.display();
        let text = std::fs::read_to_string(&file).unwrap();
        assert_eq!(read(&file).unwrap_or_else(|e| panic!("{e}")).text, text);
        let nominal = origins(&text);
        assert!(nominal.len() >= 7, "{shown}");
        assert_eq!(patch_origins(&text, &nominal).unwrap(), text, "{shown}: the same origins change nothing");

        // Only joints that have an origin, so that cutting all origins out compares the rest.
        let document = roxmltree::Document::parse(&text).unwrap();
        let joints = document.root_element().children().filter(|n| n.has_tag_name("joint"));
        let with_origin = joints.filter(|j| j.children().any(|c| c.has_tag_name("origin")));
        let names: Vec<_> = with_origin.filter_map(|j| j.attribute("name")).collect();
        let twist = Vector6::new(1e-3, -2e-3, 3e-4, 2e-3, -1e-3, 3e-3);
        let new: BTreeMap<_, _> = nominal
            .iter()
            .filter(|(name, _)| names.contains(&name.as_str()))
            .map(|(name, pose)| (name.clone(), pose.perturbed(&twist)))
            .collect();
        let patched = patch_origins(&text, &new).unwrap();
        assert_eq!(without_origins(&patched), without_origins(&text), "{shown}");
        let read_back = origins(&patched);
        for (name, pose) in &new {
            let error = (read_back[name].matrix() - pose.matrix()).abs().max();
            assert!(error < 1e-12, "{shown}: {name} off by {error:e}");
        }
        for (name, pose) in &new {
            let one = patch_origins(&text, &BTreeMap::from([(name.clone(), *pose)])).unwrap();
            let changed = text.lines().zip(one.lines()).filter(|(a, b)| a != b).count();
            assert_eq!(changed, 1, "{shown}: {name}");
        }
    }
}

#[test]
#[ignore = "needs the real series"]
fn real_xacros_are_refused() {
    for file in shared_files("xacro") {
        assert_says(&read(&file).unwrap_err(), Code::UrdfXacro, &["xacro kr6"]);
    }
}

#[test]
#[ignore = "needs the real series"]
fn chains_of_real_robots() {
    let files = shared_files("urdf");
    for (name, base, tip, readings) in [
        ("kr16_2", "base_link", "tool0", 6),
        ("lbr_iiwa_14_r820", "base_link", "tool0", 7),
        ("panda", "panda_link0", "panda_hand", 7),
        ("panda", "panda_link0", "panda_rightfinger", 8),
        ("ur5_robot", "base_link", "ee_link", 6),
    ] {
        let file = files.iter().find(|f| f.file_stem().unwrap() == name).unwrap();
        let chain = read(file).unwrap().chain(Some(base), Some(tip)).unwrap_or_else(|e| panic!("{e}"));
        assert_eq!(chain.readings.len(), readings, "{name} {:?}", chain.readings);
        assert!(chain.joints.iter().all(|j| j.kind == JointKind::Fixed || (j.axis.norm() - 1.0).abs() < 1e-12));
    }
}
