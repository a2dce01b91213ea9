//! Every series of datasets/bad gets the answer that its `expected.toml` asks for.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::robots::kr6_urdf;
use robotcal::Code;
use robotcal::output::solution_json;
use robotcal::problem::ImageRejection;
use robotcal::simulate::faults::FAULTS;

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

struct Answer {
    exit_code: u8,
    /// What it said.
    text: String,
    /// Codes of the error, of the findings, and of the images that were left out.
    codes: BTreeSet<Code>,
}

/// The code of `error[code]: ..`.
fn code_of_error(text: &str) -> Option<Code> {
    let name = text.lines().find_map(|l| l.strip_prefix("error[")?.split(']').next())?;
    Some(*Code::ALL.iter().find(|c| c.name() == name).unwrap())
}

fn identify(series: &Path, out: &Path) -> Answer {
    let output = Command::new(env!("CARGO_BIN_EXE_robotcal"))
        .args(["identify", "--urdf"])
        .arg(kr6_urdf())
        .arg("--series")
        .arg(series)
        .arg("--out")
        .arg(out)
        .output()
        .unwrap();
    let mut text = String::from_utf8_lossy(&output.stdout).into_owned() + &String::from_utf8_lossy(&output.stderr);
    // The answer is short; the long table has every name.
    if out.join("solution.json").exists() {
        let all = Command::new(env!("CARGO_BIN_EXE_robotcal"))
            .args(["show", "--all"])
            .arg(out.join("solution.json"))
            .output()
            .unwrap();
        text += &String::from_utf8_lossy(&all.stdout);
    }
    let mut codes: BTreeSet<Code> = code_of_error(&text).into_iter().collect();
    if let Ok(bytes) = std::fs::read(out.join("solution.json")) {
        let record = solution_json::read(&bytes).unwrap();
        codes.extend(record.findings.iter().map(|f| f.code));
        codes.extend(record.images.iter().filter_map(|i| i.rejection.as_ref()).map(ImageRejection::code));
    }
    // A crash has no exit code of its own: 101 of a panic is in no list.
    Answer { exit_code: output.status.code().map_or(255, |c| c as u8), text, codes }
}

fn expected(series: &Path) -> toml::Table {
    std::fs::read_to_string(series.join("expected.toml")).unwrap().parse().unwrap()
}

fn texts<'a>(expected: &'a toml::Table, key: &str) -> Vec<&'a str> {
    expected[key].as_array().unwrap().iter().map(|v| v.as_str().unwrap()).collect()
}

/// What is missing from an answer; `None` when it is right.
fn shortcoming(answer: &Answer, expected: &toml::Table) -> Option<String> {
    let exits: Vec<i64> = expected["exit_codes"].as_array().unwrap().iter().map(|v| v.as_integer().unwrap()).collect();
    if !exits.contains(&i64::from(answer.exit_code)) {
        return Some(format!("exit code {} is not in {exits:?}", answer.exit_code));
    }
    let given = |code: &str| answer.codes.iter().any(|c| c.name() == code);
    if let Some(code) = texts(expected, "codes").into_iter().find(|code| !given(code)) {
        return Some(format!("has no code {code} among {:?}", answer.codes));
    }
    let name = texts(expected, "names").into_iter().find(|name| !answer.text.contains(name));
    name.map(|name| format!("does not name {name}"))
}

#[test]
fn every_bad_series_is_diagnosed() {
    let out = tempfile::tempdir().unwrap();
    let mut wrong = Vec::new();
    for fault in FAULTS.iter().map(|e| e.name) {
        let series: PathBuf = root().join("datasets/bad").join(fault);
        let answer = identify(&series, &out.path().join(fault));
        assert!(answer.exit_code < 4, "{fault}: the program crashed:\n{}", answer.text);
        if let Some(what) = shortcoming(&answer, &expected(&series)) {
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

#[test]
fn the_expectations_are_those_of_the_table() {
    for fault in &FAULTS {
        let expected = expected(&root().join("datasets/bad").join(fault.name));
        let codes: Vec<&str> = fault.codes.iter().map(|c| c.name()).collect();
        assert_eq!(
            (texts(&expected, "codes"), texts(&expected, "names")),
            (codes, fault.names.to_vec()),
            "{}",
            fault.name
        );
        assert!(!fault.codes.is_empty(), "{}", fault.name);
    }
}
