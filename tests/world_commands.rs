//! `robotcal plate` and `robotcal simulate` as a user calls them.

#![allow(clippy::unwrap_used)]

use std::path::Path;
use std::process::{Command, Output};

use robotcal::series::{Plate, read_plate};

fn robotcal(args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_robotcal")).args(args).output().unwrap()
}

fn text(output: &Output) -> String {
    format!("{}{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr))
}

fn plate(folder: &Path, args: &[&str]) -> (Output, Option<Plate>) {
    let out = folder.join("plate");
    let output = robotcal(&[&["plate", "--out", out.to_str().unwrap()], args].concat());
    (output, read_plate(&out.join("plate.toml"), &mut Vec::new()).ok())
}

#[test]
fn a_plate_for_a_sheet_and_a_camera_is_written_in_all_formats() {
    let folder = tempfile::tempdir().unwrap();
    let flags = ["--sheet", "A4", "--markers", "100", "--focal-px", "1200", "--distance-m", "0.15x0.4"];
    let (output, made) = plate(folder.path(), &flags);
    assert!(output.status.success(), "{}", text(&output));
    let made = made.unwrap();
    assert!((90..=110).contains(&made.markers.len()));
    assert!(text(&output).contains("A4, 297 x 210 mm") && text(&output).contains("differ in at least"));
    for (file, start) in [("plate.pdf", "%PDF"), ("plate.svg", "<svg"), ("plate.png", "\u{fffd}PNG")] {
        let bytes = std::fs::read(folder.path().join("plate").join(file)).unwrap();
        assert!(String::from_utf8_lossy(&bytes[..4]).starts_with(start), "{file}");
    }
}

#[test]
fn a_plate_that_the_camera_cannot_resolve_is_refused_and_not_written() {
    let folder = tempfile::tempdir().unwrap();
    let flags = ["--pitch-mm", "5", "--focal-px", "800", "--distance-m", "0.3x1.0"];
    let (output, made) = plate(folder.path(), &flags);
    assert_eq!(output.status.code(), Some(2));
    assert!(made.is_none() && text(&output).contains("cannot resolve") && text(&output).contains("try:"));
}

#[test]
fn wrong_wishes_of_a_simulation_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("series");
    let urdf = Path::new(env!("CARGO_MANIFEST_DIR")).join("robots/ur10e/ur10e.urdf");
    let common = ["simulate", "--urdf", urdf.to_str().unwrap(), "--out", out.to_str().unwrap(), "--observations"];
    let far = ["--near-m", "3", "--far-m", "4"];
    for (flags, code, word) in [
        (&["--fault", "moved-plat"][..], 2, "moved-plate"),
        (&["--fault", "no-markers"][..], 2, "images"),
        (&["--tip", "tool9"][..], 2, "tool9"),
        (&["--bits", "9"][..], 2, "8, 10, 12 or 16"),
        (&["--tilt-deg", "89"][..], 2, "tilt"),
        (&far[..], 3, "reach"),
    ] {
        let output = robotcal(&[&common[..], flags].concat());
        assert_eq!(output.status.code(), Some(code), "{flags:?}: {}", text(&output));
        assert!(text(&output).contains(word), "{flags:?}: {}", text(&output));
        assert!(!out.exists(), "{flags:?}");
    }
}
