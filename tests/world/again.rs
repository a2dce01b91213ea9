//! A result comes out the same again: from its own file with the same options, and with any number of threads.

use std::collections::BTreeMap;
use std::path::Path;
use std::process::{Command, Output};

use crate::robots::kr6_urdf;
use serde_json::Value;

fn run(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_robotcal")).current_dir(folder).args(arguments).output().unwrap()
}

fn record(folder: &Path, name: &str) -> Value {
    let bytes = std::fs::read(folder.join(name).join("solution.json"));
    serde_json::from_slice(&bytes.expect("a result was written")).unwrap()
}

fn codes(record: &Value) -> Vec<&str> {
    record["findings"].as_array().unwrap().iter().map(|f| f["code"].as_str().unwrap()).collect()
}

/// One of its images has another size: it has observations and takes no part, at first and again.
#[test]
fn from_its_own_file_a_result_is_solved_again_bit_for_bit_with_its_own_options() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let urdf = kr6_urdf();
    let series = root.join("datasets/bad/image-of-other-size");
    let (urdf, series) = (urdf.to_str().unwrap(), series.to_str().unwrap());
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let options = ["--robot-model", "rigid", "--fix", "joint_a2.origin", "--joint-noise", "0.0001"];
    let given = [&["identify", "--urdf", urdf, "--series", series, "--out", "first"], &options[..]].concat();
    run(at, &given);
    run(at, &["identify", "--from", "first/solution.json", "--out", "again"]);
    let (first, again) = (record(at, "first"), record(at, "again"));
    assert_eq!(first["options"], again["options"]);
    assert_eq!(first["options"]["model"], "rigid");
    for part in ["estimates", "covariance_lower", "images", "cameras", "plates"] {
        assert!(first[part] == again[part], "{part} differs");
    }

    // Limits of a file take the place of the recorded ones; a name that is none is refused.
    assert!(codes(&first).contains(&"few_images"), "{:?}", codes(&first));
    std::fs::write(at.join("few.toml"), "[limits]\nfew_images = 0\n").unwrap();
    run(at, &["identify", "--from", "first", "--config", "few.toml", "--out", "few"]);
    let few = record(at, "few");
    assert!(!codes(&few).contains(&"few_images"), "{:?}", codes(&few));
    assert_eq!(few["options"]["limits"]["few_images"], 0);
    std::fs::write(at.join("wrong.toml"), "[limits]\nfewest = 0\n").unwrap();
    let refused = run(at, &["identify", "--from", "first/solution.json", "--config", "wrong.toml", "--out", "no"]);
    assert_eq!(refused.status.code(), Some(2));
}

/// Every file of a folder of results by its name.
fn files(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let entries = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let name = |path: &Path| path.file_name().unwrap().to_string_lossy().into_owned();
    entries.map(|path| (name(&path), std::fs::read(&path).unwrap())).collect()
}

/// Detection, free poses, joint fit, evidence, hold-out, diagnoses, report: all that is written of a series of images.
#[test]
fn one_thread_two_and_four_write_the_same_files() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let urdf = kr6_urdf();
    let series = root.join("datasets/kr6_small");
    let written = |threads: &str| {
        let folder = tempfile::tempdir().unwrap();
        let mut command = Command::new(env!("CARGO_BIN_EXE_robotcal"));
        // Not by --threads: the record says how the program was called.
        command.current_dir(folder.path()).env("RAYON_NUM_THREADS", threads).args(["identify", "--out", "out"]);
        let output = command.arg("--urdf").arg(&urdf).arg("--series").arg(&series).output().unwrap();
        assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
        files(&folder.path().join("out"))
    };
    let one = written("1");
    assert!(["solution.json", "observations.csv", "report.html"].iter().all(|name| one.contains_key(*name)));
    for threads in ["2", "4"] {
        let more = written(threads);
        assert!(one.keys().eq(more.keys()), "{:?} {:?}", one.keys(), more.keys());
        for (name, bytes) in &one {
            assert!(bytes == &more[name], "{name} differs with {threads} threads");
        }
    }
}
