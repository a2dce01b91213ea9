//! A result can be solved again from its own file: the same options, the same bits.

use std::path::Path;
use std::process::{Command, Output};

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
    let urdf = root.join("robots/kuka_kr6_r900/kuka_kr6_r900.urdf");
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
    run(at, &["identify", "--from", "first/solution.json", "--config", "few.toml", "--out", "few"]);
    let few = record(at, "few");
    assert!(!codes(&few).contains(&"few_images"), "{:?}", codes(&few));
    assert_eq!(few["options"]["limits"]["few_images"], 0);
    std::fs::write(at.join("wrong.toml"), "[limits]\nfewest = 0\n").unwrap();
    let refused = run(at, &["identify", "--from", "first/solution.json", "--config", "wrong.toml", "--out", "no"]);
    assert_eq!(refused.status.code(), Some(2));
}
