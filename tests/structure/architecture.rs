//! The wall between the rooms: imports go downwards only, and no file grows without bound.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::imports::{files_below, rooms};

/// Rooms from the bottom up; rooms on one level are peers and do not import each other, but for the pairs in `PEERS`.
pub const LEVELS: [&[&str]; 16] = [
    &["error", "stage"],
    &["files", "geom", "linalg"],
    &["series", "urdf"],
    &["detect"],
    &["model"],
    &["problem"],
    &["init", "solve"],
    &["fit"],
    &["assess"],
    &["plan", "programs"],
    &["simulate", "diagnose", "frames"],
    &["identify"],
    &["output"],
    &["calibration"],
    &["study"],
    &["cli"],
];

/// Peers where the first may import the second: readings are matched to chains.
const PEERS: [(&str, &str); 1] = [("series", "urdf")];

const MOST_LINES: usize = 600;

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("src")
}

fn all_sources() -> Vec<PathBuf> {
    let mut files = Vec::new();
    files_below(&root(), &mut files);
    assert!(files.len() > 30, "found only {} source files", files.len());
    files
}

fn room(path: &Path) -> String {
    let inside = path.strip_prefix(root()).unwrap();
    let first = inside.components().next().unwrap().as_os_str().to_string_lossy().into_owned();
    first.trim_end_matches(".rs").to_owned()
}

#[test]
fn imports_go_downwards() {
    let level: BTreeMap<&str, usize> =
        LEVELS.iter().enumerate().flat_map(|(k, rooms)| rooms.iter().map(move |r| (*r, k))).collect();
    let mut wrong = Vec::new();
    for path in all_sources() {
        let own = room(&path);
        let Some(&own_level) = level.get(own.as_str()) else { continue };
        let text = fs::read_to_string(&path).unwrap();
        for other in rooms(path.strip_prefix(root()).unwrap(), &text).into_iter().filter(|o| *o != own) {
            let Some(&other_level) = level.get(other.as_str()) else { continue };
            let peers = PEERS.contains(&(own.as_str(), other.as_str()));
            if other_level > own_level || (other_level == own_level && !peers) {
                wrong.push(format!("{}: {own} imports {other}", path.display()));
            }
        }
    }
    assert!(wrong.is_empty(), "imports against the direction of the rooms:\n{}", wrong.join("\n"));
}

#[test]
fn files_stay_small() {
    let long: Vec<String> = all_sources()
        .iter()
        .map(|p| (p, fs::read_to_string(p).unwrap().lines().count()))
        .filter(|(_, lines)| *lines > MOST_LINES)
        .map(|(p, lines)| format!("{}: {lines} lines", p.display()))
        .collect();
    assert!(long.is_empty(), "files over {MOST_LINES} lines:\n{}", long.join("\n"));
}

#[test]
fn only_linalg_knows_the_factorisation_libraries() {
    let mut wrong = Vec::new();
    for path in all_sources().into_iter().filter(|p| room(p) != "linalg") {
        let text = fs::read_to_string(&path).unwrap();
        if ["use faer", "faer::", "use clarabel", "clarabel::"].iter().any(|w| text.contains(w)) {
            wrong.push(path.display().to_string());
        }
    }
    assert!(wrong.is_empty(), "faer or clarabel outside linalg: {wrong:?}");
}

/// "1.89" -> [1, 89, 0].
fn version(text: &str) -> Vec<u32> {
    let mut parts: Vec<u32> = text.split('.').map(|part| part.parse().unwrap()).collect();
    parts.resize(3, 0);
    parts
}

#[test]
fn the_stated_rust_version_suffices_for_all_dependencies() {
    let cargo = || Command::new(env!("CARGO"));
    let told = String::from_utf8(cargo().arg("-vV").output().unwrap().stdout).unwrap();
    let host = told.lines().find_map(|l| l.strip_prefix("host: ")).unwrap();
    let out = cargo()
        .args(["metadata", "--locked", "--offline", "--format-version", "1", "--filter-platform", host])
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .output()
        .unwrap();
    assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
    let metadata: serde_json::Value = serde_json::from_slice(&out.stdout).unwrap();
    let packages = metadata["packages"].as_array().unwrap();
    assert!(packages.len() > 50, "only {} packages", packages.len());
    let stated = env!("CARGO_PKG_RUST_VERSION");
    let newer: Vec<String> = packages
        .iter()
        .filter_map(|p| p["rust_version"].as_str().map(|v| (p["name"].as_str().unwrap(), v)))
        .filter(|(_, v)| version(v) > version(stated))
        .map(|(name, v)| format!("{name} {v}"))
        .collect();
    assert!(newer.is_empty(), "Cargo.toml states Rust {stated}; newer ones are demanded by {}", newer.join(", "));
    let readme = fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("README.md")).unwrap();
    assert!(readme.contains(&format!("{stated} or later")), "README.md does not state Rust {stated}");
}

#[test]
fn only_the_command_line_prints() {
    let mut wrong = Vec::new();
    for path in all_sources().into_iter().filter(|p| room(p) != "cli") {
        let text = fs::read_to_string(&path).unwrap();
        let code = text.split("#[cfg(test)]").next().unwrap_or("");
        // Examples in the documentation may print.
        let code: String = code.lines().filter(|l| !l.trim_start().starts_with("//")).collect();
        if ["println!(", "eprintln!(", "print!(", "eprint!("].iter().any(|w| code.contains(w)) {
            wrong.push(path.display().to_string());
        }
    }
    assert!(wrong.is_empty(), "printing outside cli: {wrong:?}");
}

/// `println!` panics where the reader has gone.
#[test]
fn the_command_line_prints_in_one_place() {
    let mut wrong = Vec::new();
    for path in all_sources().into_iter().filter(|p| room(p) == "cli" && !p.ends_with("say.rs")) {
        let text = fs::read_to_string(&path).unwrap();
        if ["println!(", "print!("].iter().any(|w| text.contains(w)) {
            wrong.push(path.display().to_string());
        }
    }
    assert!(wrong.is_empty(), "use say! and say_line!: {wrong:?}");
}
