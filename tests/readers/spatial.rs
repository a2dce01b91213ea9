//! Points and poses of a tracker, contacts, and stops that have more than an image.

use std::fs;
use std::path::Path;

use robotcal::series::{Manifest, RotationKind, Series, Source, StopKey, read};
use robotcal::{Code, Error};
use tempfile::TempDir;

use crate::said::assert_says;

const MANIFEST: &str = "format = 1\njoint_unit = \"rad\"\n";
const JOINTS: &str = "stop,j1,temperature_c,tau_nm:j1,time_s\nleft/0,0.1,21.5,3.25,1\nleft/1,-0.7,,,2\n";
const POINTS: &str = "stop,target,x_m,y_m,z_m,sigma_m\nleft/0,ball,1,2,3,\nleft/1,ball,1.5,2,3,0.0001\n";
const POSES: &str = "stop,target,x_m,y_m,z_m,qx,qy,qz,qw\nleft/1,body,1,2,3,0,0,0.7071068,0.7071068\n";
const CONTACTS: &str = "stop,contact,x_m,y_m,z_m\nleft/0,front,,,\nleft/1,cad,0.5,0,0.25\n";

fn folder(files: &[(&str, &str)]) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    let good = [
        ("series.toml", MANIFEST),
        ("joints.csv", JOINTS),
        ("points.csv", POINTS),
        ("poses.csv", POSES),
        ("contacts.csv", CONTACTS),
    ];
    for (name, text) in good.iter().chain(files) {
        fs::write(folder.path().join(name), text).unwrap();
    }
    folder
}

fn series(files: &[(&str, &str)]) -> Series {
    read(folder(files).path()).unwrap()
}

fn refusal(name: &str, text: &str) -> Error {
    let error = read(folder(&[(name, text)]).path()).unwrap_err();
    assert_eq!(error.exit_code(), 2);
    error
}

#[test]
fn a_series_without_images_is_read() {
    let series = series(&[]);
    assert_eq!(series.source, Source::NoImages);
    assert_eq!(series.stops.key, StopKey::Stop);
    assert!(series.plate.markers.is_empty());
    let points = &series.spatial.points;
    assert_eq!(
        points.iter().map(|p| (p.stop, p.sigma_m, p.line)).collect::<Vec<_>>(),
        [(0, None, 2), (1, Some(1e-4), 3)]
    );
    assert_eq!(points[1].tracker_from_point_m.as_slice(), [1.5, 2.0, 3.0]);
    let pose = &series.spatial.poses[0];
    assert_eq!((pose.stop, pose.target.as_str(), pose.sigma_rad), (1, "body", None));
    // A quarter turn about z takes x to y.
    assert!((pose.tracker_from_target.rotation[(1, 0)] - 1.0).abs() < 1e-7);
    let contacts = &series.spatial.contacts;
    assert_eq!(contacts[0].position_m, None);
    assert_eq!(contacts[1].position_m.unwrap().as_slice(), [0.5, 0.0, 0.25]);
}

#[test]
fn temperatures_and_torques_are_no_joints() {
    let stops = series(&[]).stops;
    assert_eq!((stops.joints, stops.torque_joints), (vec!["j1".to_owned()], vec!["j1".to_owned()]));
    assert_eq!(stops.stops[0].covariates.temperature_c, Some(21.5));
    assert_eq!(stops.stops[0].covariates.torques_nm, [Some(3.25)]);
    assert_eq!(stops.stops[1].covariates.torques_nm, [None]);
    assert_says(&refusal("joints.csv", &JOINTS.replace("21.5", "warm")), Code::CsvNumber, &["joints.csv:2", "warm"]);
}

#[test]
fn sections_beside_the_camera_are_read() {
    let sections = "[tracker]\nname = \"leica\"\nsigma_m = 5e-5\n[contact]\nsigma_m = 1e-4\nframe = \"cad\"\n\
                    [[distance]]\nbetween = [\"a\", \"b\"]\ndistance_m = 0.05\nsigma_m = 1e-4\n[controller]\nrotation = \"abc_deg\"\n\
                    [[camera]]\nname = \"left\"\nmount = \"hand\"\n[[camera]]\nname = \"right\"\nmount = \"fixed\"\n";
    let manifest = Manifest::parse(Path::new("series.toml"), &format!("{MANIFEST}{sections}")).unwrap();
    assert_eq!(manifest.tracker.as_ref().unwrap().sigma_m, Some(5e-5));
    assert_eq!(manifest.contact.as_ref().unwrap().frame.as_deref(), Some("cad"));
    assert_eq!(manifest.distance[0].between, ["a", "b"]);
    assert_eq!(manifest.controller.as_ref().unwrap().rotation, RotationKind::Abc);
    let names: Vec<_> = manifest.cameras.iter().map(|c| c.name.as_deref().unwrap()).collect();
    assert_eq!(names, ["left", "right"]);
    let again = manifest.to_toml().unwrap();
    assert_eq!(Manifest::parse(Path::new("series.toml"), &again).unwrap(), manifest);
}

#[test]
fn bad_sections_name_their_key() {
    let with = |lines: &str| refusal("series.toml", &format!("{MANIFEST}{lines}\n"));
    assert_says(&with("[tracker]\nsigma_m = 0"), Code::SettingRange, &["tracker.sigma_m"]);
    assert_says(&with("[contact]\nsigma = 1"), Code::SettingSyntax, &["series.toml:4", "`sigma`"]);
    for section in ["tracker", "contact"] {
        let in_mm = with(&format!("[{section}]\nsigma_m = 0.03"));
        assert_says(&in_mm, Code::SettingRange, &[&format!("{section}.sigma_m"), "0.03", "metres"]);
    }
    assert_says(&refusal("points.csv", &POINTS.replace("0.0001", "0.1")), Code::CsvRange, &["points.csv:3", "0.1"]);
    assert_says(
        &with("[controller]\nrotation = \"abc\""),
        Code::SettingSyntax,
        &["series.toml:4", "`abc`", "`abc_deg`"],
    );
    assert_says(&with("[[camera]]\nname = \"a\"\n[[camera]]"), Code::SettingMissing, &["2 of 2"]);
    assert_says(&with("[[camera]]\nname = \"a\"\nfocal = 1"), Code::SettingSyntax, &["series.toml:5", "`focal`"]);
}

#[test]
fn links_that_carry_camera_and_plate_contradict_nobody() {
    let parse = |lines: &str| Manifest::parse(Path::new("series.toml"), &format!("{MANIFEST}{lines}\n"));
    let table = "[plate_mount]\nlink = \"table\"\n";
    let wrist = "[camera]\nlink = \"wrist\"\n";
    assert_eq!(parse(table).unwrap().carriers(), [Some("table"), None]);
    assert_eq!(parse(&format!("camera_mount = \"fixed\"\n{table}")).unwrap().carriers(), [None, Some("table")]);
    assert_eq!(parse(&format!("tip = \"hand\"\n{wrist}{table}")).unwrap().ends(), [Some("table"), Some("wrist")]);
    let refused = |lines: &str| parse(lines).unwrap_err();
    assert_says(&refused(&format!("{table}[robot_2]")), Code::SettingConflict, &["plate_mount", "robot_2"]);
    assert_says(&refused("camera_mount = \"fixed\"\n[robot_2]"), Code::SettingConflict, &["robot_2"]);
    let two = "[[camera]]\nname = \"a\"\nlink = \"wrist\"\n[[camera]]\nname = \"b\"\n";
    assert_says(&refused(two), Code::SettingConflict, &["\"b\""]);
    let mixed = "[[camera]]\nname = \"a\"\nmount = \"hand\"\n[[camera]]\nname = \"b\"\nmount = \"fixed\"\n";
    assert_says(&refused(&format!("{mixed}{table}")), Code::SettingConflict, &["\"b\""]);
}

#[test]
fn a_bad_row_names_file_line_and_stop() {
    for (file, text) in [("points.csv", POINTS), ("poses.csv", POSES), ("contacts.csv", CONTACTS)] {
        let error = refusal(file, &text.replace("left/1", "lefft/1"));
        assert_says(&error, Code::StopUnknown, &[file, "lefft/1", "\"left/1\""]);
        let error = refusal(file, &text.replace("left/1", "left/9"));
        assert_says(&error, Code::StopUnknown, &[file, "left/9"]);
        assert!(!error.to_string().contains("left/0"), "{error}");
        assert_says(&refusal(file, &text.replace("left/1", "")), Code::CsvCellEmpty, &[file, "stop"]);
        let column = text.split(',').nth(1).unwrap();
        assert_says(&refusal(file, &text.replace(column, "body_name")), Code::CsvColumnUnknown, &[file, "body_name"]);
    }
    let twice = POINTS.replace("left/1", "left/0");
    assert_says(&refusal("points.csv", &twice), Code::CsvRowTwice, &["points.csv:3", "ball", "line 2"]);
    assert_says(&refusal("points.csv", &POINTS.replace("0.0001", "-1")), Code::CsvRange, &["points.csv:3", "-1"]);
    assert_says(&refusal("points.csv", &POINTS.replace("1.5", "")), Code::CsvNumber, &["points.csv:3", "x_m"]);
    assert_says(
        &refusal("contacts.csv", &CONTACTS.replace("0.25", "")),
        Code::CsvCellEmpty,
        &["contacts.csv:3", "z_m"],
    );
    let long = POSES.replace("0.7071068", "0.8");
    assert_says(&refusal("poses.csv", &long), Code::CsvRange, &["poses.csv:2", "left/1", "1.1314"]);
    assert_says(&refusal("joints.csv", &JOINTS.replace("left/1", "left/0")), Code::CsvRowTwice, &["joints.csv:3"]);
    assert_says(
        &refusal("joints.csv", &JOINTS.replace("j1,temp", "image,temp")),
        Code::CsvColumnTwice,
        &["joints.csv:1"],
    );
}

#[test]
fn nothing_measured_is_no_series() {
    let folder = folder(&[]);
    for name in ["points.csv", "poses.csv", "contacts.csv"] {
        fs::remove_file(folder.path().join(name)).unwrap();
    }
    let error = read(folder.path()).unwrap_err();
    assert_says(&error, Code::SettingMissing, &["camera_mount"]);
}

/// A tracker that lost the beam writes its own origin; a device with its frame in the target is there once.
#[test]
fn rows_of_a_lost_target_are_left_out_with_their_lines() {
    let head = "stop,target,x_m,y_m,z_m\n";
    let lost = "left/0,ball,0,0,0\nleft/0,cone,1,2,3\nleft/1,ball,0.0,0,-0.0\nleft/1,cone,1,2,4\n";
    let read = series(&[("points.csv", &format!("{head}{lost}"))]);
    assert_eq!(read.spatial.points.iter().map(|p| p.line).collect::<Vec<_>>(), [3, 5]);
    let said: Vec<_> = read.notices.iter().filter(|n| n.code == Code::TargetLost).collect();
    let [notice] = said[..] else { panic!("{said:?}") };
    assert_says(notice, Code::TargetLost, &["points.csv", "2", "4"]);
    let once = series(&[("points.csv", &format!("{head}left/0,ball,0,0,0\nleft/1,ball,1,2,4\n"))]);
    assert_eq!((once.spatial.points.len(), once.notices.len()), (2, 0));
}

/// All zeros are no pose, not even one: a quaternion of length 0 beside a place is a mistake.
#[test]
fn zeros_with_their_quaternion_are_a_lost_target() {
    let head = "stop,target,x_m,y_m,z_m,qx,qy,qz,qw\n";
    let good = "left/1,body,1,2,3,0,0,0.7071068,0.7071068\n";
    let read = series(&[("poses.csv", &format!("{head}left/0,body,0,0.0,0,0,0,0,-0\n{good}"))]);
    assert_eq!(read.spatial.poses.iter().map(|p| p.line).collect::<Vec<_>>(), [3]);
    assert_eq!(read.notices.iter().map(|n| n.code).collect::<Vec<_>>(), [Code::TargetLost]);
    assert!(read.spatial.lost.is_empty(), "{:?}", read.spatial.lost);
    let of_other = series(&[("poses.csv", &format!("{head}left/0,other,0,0,0,0,0,0,0\n{good}"))]);
    assert_eq!(of_other.spatial.lost, ["other"]);
    let elsewhere = refusal("poses.csv", &format!("{head}left/0,body,1,0,0,0,0,0,0\n{good}"));
    assert_eq!(elsewhere.code, Code::CsvRange);
    let unknown = refusal("poses.csv", &format!("{head}left/7,body,0,0,0,0,0,0,0\n{good}"));
    assert_eq!(unknown.code, Code::StopUnknown);
    let all = refusal("poses.csv", &format!("{head}left/0,body,0,0,0,0,0,0,0\nleft/1,body,0,0,0,0,0,0,0\n"));
    assert_eq!(all.code, Code::TargetLost);
}
