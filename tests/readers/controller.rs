//! controller.csv: what is accepted, and what is refused with line, stop and remedy.

use std::fs;

use robotcal::series::{RotationKind, StopKey, read};
use robotcal::{Code, Error};
use tempfile::TempDir;

use crate::said::assert_says;

const MANIFEST: &str =
    "format = 1\ncamera_mount = \"hand\"\nplate = \"plate.toml\"\n[controller]\nrotation = \"quaternion\"\n";
const PLATE: &str = "format = 1\nkind = \"chessboard\"\ncolumns = 3\nrows = 2\npitch_m = 0.02\ntolerance_m = 0.0001\n";
const POSES: &str =
    "stop,x_m,y_m,z_m,qx,qy,qz,qw,time_s\na,0.5,0.25,1,0,0,0,1,4\nb,0.5,0.125,1,1,0,0,0,\noff,,,,,,,,\n";

fn folder(files: &[(&str, &str)]) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    fs::create_dir(folder.path().join("images")).unwrap();
    let good = [("series.toml", MANIFEST), ("plate.toml", PLATE), ("controller.csv", POSES)];
    let images = ["images/a.png", "images/b.png", "images/off.png"].map(|i| (i, ""));
    for (name, text) in good.iter().chain(&images).chain(files) {
        fs::write(folder.path().join(name), text).unwrap();
    }
    folder
}

fn refusal(files: &[(&str, &str)]) -> Error {
    let error = read(folder(files).path()).unwrap_err();
    assert_eq!(error.exit_code(), 2);
    error
}

#[test]
fn poses_stand_in_the_place_of_joint_readings() {
    let series = read(folder(&[]).path()).unwrap();
    assert_eq!(series.stops.key, StopKey::Stop);
    let stops: Vec<_> =
        series.stops.stops.iter().map(|s| (s.image.as_str(), s.time_s, s.raw_readings.is_some())).collect();
    assert_eq!(stops, [("a.png", Some(4.0), false), ("b.png", None, false), ("off.png", None, false)]);
    let poses = series.controller.unwrap().base_from_flange;
    assert_eq!(poses[0].unwrap().xyz(), [0.5, 0.25, 1.0]);
    // Half a turn about x.
    assert!((poses[1].unwrap().rotation[(2, 2)] + 1.0).abs() < 1e-15);
    assert_eq!(poses[2], None);
}

#[test]
fn poses_go_with_their_stops_into_the_order_of_time() {
    let timed = "stop,x_m,y_m,z_m,qx,qy,qz,qw,time_s\na,0.5,0.25,1,0,0,0,1,4\nb,0.5,0.125,1,1,0,0,0,3\noff,,,,,,,,1\n";
    let series = read(folder(&[("controller.csv", timed)]).path()).unwrap();
    let stops: Vec<_> = series.stops.stops.iter().map(|s| (s.image.as_str(), s.line)).collect();
    assert_eq!(stops, [("off.png", 4), ("b.png", 3), ("a.png", 2)]);
    let poses = series.controller.unwrap().base_from_flange;
    assert_eq!(poses.iter().map(|p| p.map(|p| p.xyz()[1])).collect::<Vec<_>>(), [None, Some(0.125), Some(0.25)]);
    assert_eq!(series.notices.iter().filter(|n| n.code == Code::RowsByTime).count(), 1);
}

#[test]
fn what_the_manifest_must_say_is_asked_for() {
    let without = MANIFEST.replace("[controller]\nrotation = \"quaternion\"\n", "");
    assert_says(&refusal(&[("series.toml", &without)]), Code::SettingMissing, &["[controller]", "rotvec_rad"]);
    let joints = "image,j1\na.png,0\n";
    assert_says(&refusal(&[("joints.csv", joints)]), Code::SettingConflict, &["controller.csv", "joints.csv"]);
    for kind in RotationKind::ALL.iter().filter(|k| **k != RotationKind::Quaternion) {
        let manifest = MANIFEST.replace("quaternion", kind.name());
        let error = refusal(&[("series.toml", &manifest)]);
        assert_says(&error, Code::CsvColumnMissing, &["controller.csv:1", kind.name(), "\"quaternion\""]);
    }
    // The same columns mean another rotation in another convention.
    let turned = "stop,x_m,y_m,z_m,rx,ry,rz\na,0.5,0.25,1,90,90,0\n";
    let manifest = MANIFEST.replace("quaternion", "xyz_deg");
    let poses =
        read(folder(&[("controller.csv", turned), ("series.toml", &manifest)]).path()).unwrap().controller.unwrap();
    // A quarter about x, then about the new y: what was along z goes along x.
    let along = poses.base_from_flange[0].unwrap().rotation.column(2).into_owned();
    assert!((along[0] - 1.0).abs() < 1e-12, "{along}");
}

#[test]
fn a_bad_pose_names_line_and_stop() {
    let with = |from: &str, to: &str| refusal(&[("controller.csv", &POSES.replace(from, to))]);
    assert_says(
        &with("b,0.5,0.125,1,1,0,0,0", "b,0.5,0.125,1,1,1,0,0"),
        Code::CsvRange,
        &["controller.csv:3", "stop b", "1.4142"],
    );
    assert_says(&with("0.125", ""), Code::CsvCellEmpty, &["controller.csv:3", "stop b", "y_m"]);
    assert_says(&with("0.125", "far"), Code::CsvNumber, &["controller.csv:3", "y_m", "far"]);
    assert_says(&with("b,", "a,"), Code::CsvRowTwice, &["controller.csv:3", "line 2"]);
    assert_says(&with("time_s", "when"), Code::CsvColumnUnknown, &["controller.csv:1", "when"]);
    assert_says(&with("x_m", "x"), Code::CsvColumnMissing, &["controller.csv:1", "\"x_m\""]);
    let far = POSES.replace("0.5,", "500,");
    assert_says(&refusal(&[("controller.csv", &far)]), Code::MillimetresAsMetres, &["controller.csv", "1000"]);
    let turned = "stop,x_m,y_m,z_m,rx,ry,rz\na,0.5,0.25,1,180,0,0\n";
    let manifest = MANIFEST.replace("quaternion", "rotvec_rad");
    let error = refusal(&[("controller.csv", turned), ("series.toml", &manifest)]);
    assert_says(&error, Code::DegreesAsRadians, &["controller.csv", "180"]);
    let tracked = format!("{MANIFEST}[tracker]\nname = \"t\"\n");
    let strange = ("points.csv", "stop,target,x_m,y_m,z_m\nc,t,0,0,0\n");
    assert_says(
        &refusal(&[("series.toml", &tracked), strange]),
        Code::StopUnknown,
        &["points.csv:2", "\"c\"", "controller.csv"],
    );
    let empty = "stop,x_m,y_m,z_m,qx,qy,qz,qw\n";
    assert_says(&refusal(&[("controller.csv", empty)]), Code::FileEmpty, &["controller.csv"]);
}
