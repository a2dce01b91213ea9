//! Every series of datasets/bad gets the answer that its `expected.toml` asks for.

#![allow(clippy::unwrap_used)]

use std::path::{Path, PathBuf};
use std::process::Command;

use robotcal::simulate::faults::FAULTS;

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

struct Answer {
    code: u8,
    text: String,
}

fn identify(series: &Path, out: &Path) -> Answer {
    let output = Command::new(env!("CARGO_BIN_EXE_robotcal"))
        .args(["identify", "--urdf"])
        .arg(root().join("robots/kuka_kr6_r900/kuka_kr6_r900.urdf"))
        .arg("--series")
        .arg(series)
        .arg("--out")
        .arg(out)
        .output()
        .unwrap();
    let text = String::from_utf8_lossy(&output.stdout) + String::from_utf8_lossy(&output.stderr);
    // A crash has no exit code of its own: 101 of a panic is in no list.
    Answer { code: output.status.code().map_or(255, |c| c as u8), text: text.to_lowercase() }
}

/// What is missing from an answer; `None` when it is right.
fn shortcoming(answer: &Answer, expected: &toml::Table) -> Option<String> {
    let codes: Vec<i64> = expected["exit_codes"].as_array().unwrap().iter().map(|v| v.as_integer().unwrap()).collect();
    if !codes.contains(&i64::from(answer.code)) {
        return Some(format!("exit code {} is not in {codes:?}", answer.code));
    }
    let words = expected["words"].as_array().unwrap().iter().map(|v| v.as_str().unwrap());
    words.filter(|w| !answer.text.contains(&w.to_lowercase())).map(|w| format!("does not say \"{w}\"")).next()
}

#[test]
fn every_bad_series_is_diagnosed() {
    let out = tempfile::tempdir().unwrap();
    let mut wrong = Vec::new();
    for fault in FAULTS.iter().map(|e| e.name) {
        let series: PathBuf = root().join("datasets/bad").join(fault);
        let expected: toml::Table = std::fs::read_to_string(series.join("expected.toml")).unwrap().parse().unwrap();
        let answer = identify(&series, &out.path().join(fault));
        assert!(answer.code < 4, "{fault}: the program crashed:\n{}", answer.text);
        if let Some(what) = shortcoming(&answer, &expected) {
            wrong.push(format!("{fault}: {what}; it said:\n{}", answer.text));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn the_folders_are_those_of_the_table() {
    let mut folders: Vec<String> = std::fs::read_dir(root().join("datasets/bad"))
        .unwrap()
        .map(|e| e.unwrap())
        .filter(|e| e.path().is_dir())
        .map(|e| e.file_name().to_string_lossy().into_owned())
        .collect();
    folders.sort();
    let mut names: Vec<String> = FAULTS.iter().map(|e| e.name.to_owned()).collect();
    names.sort();
    assert_eq!(folders, names);
}
