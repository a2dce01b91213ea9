//! A recording with the solution of its series, read without this program's own reader.

use std::collections::BTreeMap;
use std::process::Command;

use crate::recording_support::annotations;
use crate::robots::{kr6_urdf, repo};
use serde_json::Value;

fn run(args: &[&str]) {
    let output = Command::new(env!("CARGO_BIN_EXE_robotcal")).args(args).output().unwrap();
    assert!(output.status.success(), "{args:?}: {}", String::from_utf8_lossy(&output.stderr));
}

/// Values of a list of names with values.
fn values(list: &Value) -> Vec<f64> {
    list.as_array().unwrap().iter().map(|pair| pair[1].as_f64().unwrap()).collect()
}

/// Little-endian doubles stand in the message next to each other.
fn holds(message: &[u8], values: &[f64]) -> bool {
    let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
    message.windows(bytes.len()).any(|w| w == bytes)
}

#[test]
fn camera_frames_and_residuals_of_the_solution_are_in_the_recording() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name).display().to_string();
    let urdf = kr6_urdf().display().to_string();
    let series = repo("datasets/kr6_small").display().to_string();
    run(&["identify", "--urdf", &urdf, "--series", &series, "--robot-model", "rigid", "--out", &at("result")]);
    let solution = at("result/solution.json");
    run(&["convert", &series, &at("run.mcap"), "--urdf", &urdf, "--solution", &solution]);

    let solution: Value = serde_json::from_slice(&std::fs::read(solution).unwrap()).unwrap();
    let bytes = std::fs::read(at("run.mcap")).unwrap();
    let mut topics: BTreeMap<String, Vec<Vec<u8>>> = BTreeMap::new();
    for message in mcap::MessageStream::new(&bytes).unwrap() {
        let message = message.unwrap();
        topics.entry(message.channel.topic.clone()).or_default().push(message.data.to_vec());
    }
    let images = solution["images"].as_array().unwrap();
    for topic in ["/camera/image/compressed", "/camera/camera_info", "/camera/annotations", "/tf"] {
        assert_eq!(topics[topic].len(), images.len(), "{topic}");
    }
    let p = values(&solution["cameras"][0]["parameters"]);
    let matrix = [p[0], 0.0, p[2], 0.0, p[1], p[3], 0.0, 0.0, 1.0];
    assert!(topics["/camera/camera_info"].iter().all(|m| holds(m, &matrix)));
    // ROS orders the coefficients k1 k2 p1 p2 k3, as OpenCV does
    assert!(holds(&topics["/camera/camera_info"][0], &p[4..9]), "{p:?}");

    let camera = solution["mountings"][0]["pose"]["xyz_m"].as_array().unwrap();
    let camera: Vec<f64> = camera.iter().map(|v| v.as_f64().unwrap()).collect();
    assert!(topics["/tf"].iter().all(|m| holds(m, &camera)), "{camera:?}");
    for (image, marks) in images.iter().zip(&topics["/camera/annotations"]) {
        let drawn: usize = annotations(marks).iter().map(|(_, points)| points.len()).sum();
        // a residual is a line of two points, a measured place is one
        let used = image["observations"]["reason"].as_array().unwrap().iter().filter(|r| r.is_null()).count();
        assert!(drawn >= 2 * used && used > 30, "{drawn} points for {used} observations");
    }
}

/// Of two arms with a tool each, the series says which is meant.
#[test]
fn base_and_tip_of_the_series_choose_the_chain_of_its_recording() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    std::fs::create_dir_all(at("run/images")).unwrap();
    for name in ["series.toml", "plate.toml", "plate.csv", "images/img_000.png", "images/img_001.png"] {
        std::fs::copy(repo("datasets/kr6_small").join(name), at("run").join(name)).unwrap();
    }
    let joints = std::fs::read_to_string(repo("datasets/kr6_small/joints.csv")).unwrap();
    std::fs::write(at("run/joints.csv"), joints.lines().take(3).collect::<Vec<_>>().join("\n") + "\n").unwrap();
    let urdf = std::fs::read_to_string(kr6_urdf()).unwrap();
    let second = r#"<link name="other_tool0"/><joint name="to_other" type="fixed"><parent link="flange"/><child link="other_tool0"/></joint></robot>"#;
    std::fs::write(at("cell.urdf"), urdf.replace("</robot>", second)).unwrap();
    let convert = |to: &str| {
        let paths = [at("run"), at(to), at("cell.urdf")].map(|p| p.display().to_string());
        let args = ["convert", &paths[0], &paths[1], "--urdf", &paths[2]];
        let output = Command::new(env!("CARGO_BIN_EXE_robotcal")).args(args).output().unwrap();
        (output.status.code(), String::from_utf8_lossy(&output.stderr).into_owned())
    };
    assert_eq!(convert("stated.mcap").0, Some(0));
    let manifest = std::fs::read_to_string(at("run/series.toml")).unwrap();
    std::fs::write(at("run/series.toml"), manifest.replace("tip = \"tool0\"\n", "")).unwrap();
    let (code, said) = convert("open.mcap");
    assert!(code == Some(2) && said.contains("tip_ambiguous"), "{said}");
}
