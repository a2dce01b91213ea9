//! The maps of the code and of the manual name what is there.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use robotcal::assess::Limits;

use crate::architecture::LEVELS;

fn src() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("src")
}

fn entries(folder: &Path) -> impl Iterator<Item = PathBuf> {
    fs::read_dir(folder).unwrap().map(|e| e.unwrap().path())
}

fn stem(path: &Path) -> String {
    path.file_stem().unwrap().to_string_lossy().into_owned()
}

/// Rooms in the order of the table in lib.rs: what stands in the first column.
fn in_the_table() -> Vec<String> {
    let text = fs::read_to_string(src().join("lib.rs")).unwrap();
    let rows = text.lines().filter_map(|l| l.strip_prefix("//! | [`")?.split('|').next());
    rows.flat_map(|row| row.split(['`', '[', ']', ',', ' ']).filter(|p| !p.is_empty()).map(str::to_owned)).collect()
}

#[test]
fn every_room_has_a_level_and_a_row_in_the_table() {
    let outside = ["lib", "main", "guide"];
    let there: BTreeSet<String> =
        entries(&src()).map(|p| stem(&p)).filter(|s| !outside.contains(&s.as_str())).collect();
    let levels: BTreeSet<String> = LEVELS.iter().flat_map(|rooms| rooms.iter().map(|r| (*r).to_owned())).collect();
    let table = in_the_table();
    assert!(there.len() > 20, "only {} rooms", there.len());
    assert_eq!(there, levels, "folders of src against LEVELS of architecture.rs");
    assert_eq!(there, table.iter().cloned().collect(), "folders of src against the table of lib.rs");
    assert_eq!(table.len(), there.len(), "a room stands twice in the table: {table:?}");
    let level = |room: &String| LEVELS.iter().position(|rooms| rooms.contains(&room.as_str()));
    assert!(table.iter().map(level).is_sorted(), "the table of lib.rs does not go upwards: {table:?}");
}

#[test]
fn every_page_is_linked_and_a_module() {
    let guide = src().join("guide");
    let read = |name: &str| fs::read_to_string(guide.join(name)).unwrap();
    let (index, modules) = (read("README.md"), read("mod.rs"));
    let pages: Vec<String> = entries(&guide)
        .filter(|p| p.extension().is_some_and(|e| e == "md"))
        .map(|p| p.file_name().unwrap().to_string_lossy().into_owned())
        .filter(|name| name != "README.md")
        .collect();
    assert!(pages.len() > 20, "only {} pages", pages.len());
    let unlinked: Vec<&String> = pages.iter().filter(|p| !index.contains(&format!("]({p})"))).collect();
    assert!(unlinked.is_empty(), "no link in README.md of the guide: {unlinked:?}");
    // Its pictures are files beside it.
    let is_module = |p: &&String| *p == "pictures.md" || modules.contains(&format!("include_str!(\"{p}\")"));
    let missing: Vec<&String> = pages.iter().filter(|p| !is_module(p)).collect();
    assert!(missing.is_empty(), "no module of the guide: {missing:?}");
}

/// Keys of a JSON value, at any depth, but for the limits, which `Limits` documents.
fn keys(value: &serde_json::Value, all: &mut BTreeSet<String>) {
    match value {
        serde_json::Value::Object(object) => object.iter().for_each(|(key, inner)| {
            all.insert(key.clone());
            if key != "limits" {
                keys(inner, all);
            }
        }),
        serde_json::Value::Array(entries) => entries.iter().for_each(|entry| keys(entry, all)),
        _ => {}
    }
}

#[test]
fn every_key_of_a_solution_stands_in_the_manual() {
    let page = fs::read_to_string(src().join("guide/solution_file.md")).unwrap();
    let words: BTreeSet<&str> = page.split(|c: char| !c.is_ascii_alphanumeric() && c != '_').collect();
    let shipped = fs::read_to_string(src().join("../reports/kr6_small/solution.json")).unwrap();
    let mut there = BTreeSet::new();
    keys(&serde_json::from_str(&shipped).unwrap(), &mut there);
    assert!(there.len() > 150, "only {} keys", there.len());
    for file in ["solution_json", "bodies_record", "finding_record", "pose_record", "series_record"] {
        let text = fs::read_to_string(src().join(format!("output/solution/{file}.rs"))).unwrap();
        let fields = text.lines().filter_map(|l| l.trim().strip_prefix("pub ")?.split_once(": "));
        there.extend(fields.map(|(name, _)| name.to_owned()).filter(|name| !name.contains(' ')));
    }
    let missing: Vec<&String> = there.iter().filter(|key| !words.contains(key.as_str())).collect();
    assert!(missing.is_empty(), "not in guide/solution_file.md: {missing:?}");
}

/// Command of the README that makes the shipped result, and the limits that are stated in it.
#[test]
fn the_shipped_result_is_made_by_the_command_of_the_readme() {
    let [readme, shipped] = ["../README.md", "../reports/kr6_small/solution.json"]
        .map(|path| fs::read_to_string(src().join(path)).unwrap());
    let command = readme.lines().find_map(|l| l.trim().strip_prefix("cargo run --release -- identify")).unwrap();
    let shipped: serde_json::Value = serde_json::from_str(&shipped).unwrap();
    assert_eq!(shipped["program"]["command"], format!("target/release/robotcal identify{command}"));
    assert_eq!(shipped["options"]["limits"], serde_json::to_value(Limits::default()).unwrap());
}

/// Share, ends of its interval and letter of a two-stage fit, of a row of the table of decision 7.
fn of_row(row: &str) -> Vec<String> {
    let last = row.trim_end_matches([' ', '|']).rsplit('|').next().unwrap();
    last.replace(['(', ')', ','], " ").replace(" to ", " ").split_whitespace().map(str::to_owned).collect()
}

/// The same, of the line of `identify -v` in the frozen output of a series, rounded to two places.
fn of_output(name: &str) -> Vec<String> {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden").join(name);
    let text = fs::read_to_string(file).unwrap();
    let line = text.lines().find(|l| l.starts_with("two-step")).unwrap();
    let mut kinds = ["isotropic", "6x6 covariance of", "6x6 covariances", "full"].into_iter().zip(["A", "B", "C", "D"]);
    let (_, letter) = kinds.find(|(kind, _)| line.contains(&format!("two-stage, {kind} "))).unwrap();
    let (_, numbers) = line.split_once(") has ").unwrap();
    let numbers = numbers.split([' ', '(', ')']).filter_map(|w| w.parse::<f64>().ok()).take(3);
    numbers.map(|v| format!("{v:.2}")).chain([letter.to_owned()]).collect()
}

#[test]
fn the_two_stage_fits_of_decision_7_are_those_of_the_program() {
    let page = fs::read_to_string(src().join("guide/decisions/0007_one_stage_or_two.md")).unwrap();
    for (series, output) in [
        ("| Nachi, 2025-01-17 |", "nachi-2025-01-17.txt"),
        ("| Nachi, 2025-02-04 |", "nachi-2025-02-04.txt"),
        ("| Nachi, 2025-02-19 |", "nachi-2025-02-19.txt"),
        ("| all three |", "nachi_together.txt"),
        ("| Aubo, 2024-12-16 |", "aubo-2024-12-16.txt"),
    ] {
        let row = page.lines().find(|l| l.starts_with(series)).unwrap();
        assert_eq!(of_row(row), of_output(output), "{series}");
    }
}
