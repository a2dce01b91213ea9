//! Optional crates are named in modules of the features that bring them, so that a library user does not compile them.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

use super::imports::files_below;

/// Feature -> what it turns on, as in Cargo.toml.
fn features() -> BTreeMap<String, BTreeSet<String>> {
    let text = fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("Cargo.toml")).unwrap();
    let manifest: toml::Table = text.parse().unwrap();
    let row = |(name, list): (&String, &toml::Value)| {
        let on = list.as_array().unwrap().iter().map(|v| v.as_str().unwrap().to_owned());
        (name.clone(), on.collect())
    };
    manifest["features"].as_table().unwrap().iter().map(row).collect()
}

/// Crates, as they are written in code, that a feature brings by itself or by the features in it.
fn crates_of(feature: &str, all: &BTreeMap<String, BTreeSet<String>>) -> BTreeSet<String> {
    let on = all.get(feature).into_iter().flatten();
    on.flat_map(|o| match o.strip_prefix("dep:") {
        Some(name) => BTreeSet::from([name.replace('-', "_")]),
        None => crates_of(o, all),
    })
    .collect()
}

/// The feature without which `mod name;` is not compiled.
fn gate(text: &str, name: &str) -> Option<String> {
    let lines: Vec<&str> = text.lines().collect();
    let is_it = |l: &&str| l.strip_suffix(';').is_some_and(|l| l.split_whitespace().rev().take(2).eq([name, "mod"]));
    let at = lines.iter().position(is_it)?;
    let cfg = lines[at.checked_sub(1)?].strip_prefix("#[cfg(feature = \"")?;
    Some(cfg.trim_end_matches("\")]").to_owned())
}

/// The features that a file of src needs, by the modules that it lies in.
fn gates(src: &Path, file: &Path) -> Vec<String> {
    let inside = file.strip_prefix(src).unwrap();
    let mut parts: Vec<String> =
        inside.components().map(|c| c.as_os_str().to_string_lossy().trim_end_matches(".rs").to_owned()).collect();
    parts.retain(|p| p != "mod");
    let mut at = src.to_path_buf();
    let mut found = Vec::new();
    for (depth, part) in parts.iter().enumerate() {
        let text = fs::read_to_string(at.join(if depth == 0 { "lib.rs" } else { "mod.rs" })).unwrap();
        found.extend(gate(&text, part));
        at.push(part);
    }
    found
}

/// True where code names the crate: not a path within this crate, not a comment.
fn names(text: &str, krate: &str) -> bool {
    let of_own = text.contains(&format!("mod {krate};"));
    let code = text.lines().filter(|l| !l.trim_start().starts_with("//"));
    let named = |line: &str| {
        line.match_indices(&format!("{krate}::")).any(|(at, _)| {
            let before = line[..at].chars().next_back();
            !before.is_some_and(|c| c.is_alphanumeric() || c == '_' || c == ':')
        })
    };
    !of_own && code.into_iter().any(named)
}

#[test]
fn optional_crates_stay_in_modules_of_their_features() {
    let features = features();
    assert_eq!(features["default"], BTreeSet::from(["cli".to_owned()]));
    let optional: BTreeSet<String> = features.keys().flat_map(|f| crates_of(f, &features)).collect();
    assert!(["clap", "maud", "mcap", "pdf_writer", "tiny_skia"].iter().all(|c| optional.contains(*c)), "{optional:?}");
    let src = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut files = Vec::new();
    files_below(&src, &mut files);
    let mut seen = BTreeSet::new();
    for file in files.iter().filter(|f| !f.ends_with("src/lib.rs") && !f.ends_with("src/main.rs")) {
        let text = fs::read_to_string(file).unwrap();
        for krate in optional.iter().filter(|c| names(&text, c)) {
            seen.insert(krate.clone());
            let gates = gates(&src, file);
            let brought = gates.iter().any(|g| crates_of(g, &features).contains(krate));
            assert!(brought, "{} names {krate} and needs the features {gates:?} only", file.display());
        }
    }
    assert_eq!(seen, optional, "every optional crate is used somewhere");
}
