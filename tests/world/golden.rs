//! What the program says of the series that come with it: terminal, exit code, findings and numbers, frozen in tests/golden.
//!
//! `GOLDEN=write cargo test --release --test world golden` writes them anew; a commit of its own says why. Numbers are compared within
//! [`SAME`] of their size; on the machine that wrote them, `GOLDEN=exact` asks for [`EXACT`].

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::robots::KR6;
use robotcal::simulate::faults::FAULTS;
use serde_json::Value;

/// Relative difference of numbers on machines whose arithmetic and mathematical functions round otherwise.
const SAME: f64 = 5e-3;
/// The same on one machine.
const EXACT: f64 = 1e-9;
/// Numbers below this are rounding on the way to zero, in SI units.
const NOTHING: f64 = 1e-9;
/// Numbers of one kind beyond which two sums stand for them.
const MANY: usize = 24;

/// What stands before the long table.
const ALL: &str = "--- show --all\n";

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// What `identify` said, and the record that it wrote.
struct Answer {
    code: i32,
    terminal: String,
    record: Option<Value>,
}

fn identify(urdf: &Path, series: &[PathBuf]) -> Answer {
    let out = tempfile::tempdir().unwrap();
    let mut command = Command::new(env!("CARGO_BIN_EXE_robotcal"));
    command.current_dir(root()).arg("identify").arg("--urdf").arg(urdf);
    for s in series {
        command.arg("--series").arg(s);
    }
    let output = command.arg("--out").arg(out.path().join("out")).output().unwrap();
    let mut text = String::from_utf8(output.stdout).unwrap();
    let solution = out.path().join("out/solution.json");
    if solution.exists() {
        let all = Command::new(env!("CARGO_BIN_EXE_robotcal")).args(["show", "--all"]).arg(&solution).output().unwrap();
        text += &format!("{ALL}{}", String::from_utf8(all.stdout).unwrap());
    }
    text += &format!("--- stderr\n{}", String::from_utf8(output.stderr).unwrap());
    let terminal =
        text.replace(&out.path().display().to_string(), "TMP").replace(&root().display().to_string(), "ROOT");
    let record = std::fs::read(out.path().join("out/solution.json")).ok().map(|b| serde_json::from_slice(&b).unwrap());
    Answer { code: output.status.code().expect("the program ended by itself"), terminal, record }
}

/// Numbers of a record by kind: each by itself where there are few, else their sums.
fn numbers(record: &Value) -> BTreeMap<String, f64> {
    let mut kinds: BTreeMap<String, Vec<f64>> = BTreeMap::new();
    let mut words: BTreeMap<String, f64> = BTreeMap::new();
    gather(record, "", &mut |path, value| match value {
        Value::Number(n) => kinds.entry(path.to_owned()).or_default().push(n.as_f64().unwrap()),
        Value::Bool(b) => kinds.entry(path.to_owned()).or_default().push(f64::from(u8::from(*b))),
        Value::Null => *words.entry(format!("{path} nulls")).or_default() += 1.0,
        _ => {}
    });
    for (path, all) in kinds {
        if all.len() <= MANY {
            words.extend(all.iter().enumerate().map(|(k, x)| (format!("{path} {k}"), *x)));
        } else {
            let size: f64 = all.iter().map(|x| x.abs()).sum();
            let signed: f64 = all.iter().enumerate().map(|(k, x)| x * (2.0 + (k as f64).cos())).sum();
            words.extend(
                [("count", all.len() as f64), ("size", size), ("sum", signed)].map(|(n, x)| (format!("{path} {n}"), x)),
            );
        }
    }
    words
}

/// Visits the leaves with the path of their keys; `estimates` are told apart by their names.
fn gather(value: &Value, path: &str, visit: &mut impl FnMut(&str, &Value)) {
    match value {
        Value::Array(all) => all.iter().for_each(|v| {
            let name = v.get("name").filter(|_| path == "/estimates").and_then(Value::as_str);
            gather(v, &name.map_or(path.to_owned(), |n| format!("{path}/{n}")), visit);
        }),
        // A share of nothing is rounding alone.
        Value::Object(all) => (all.iter().filter(|(key, _)| *key != "share_of_data"))
            .for_each(|(key, v)| gather(v, &format!("{path}/{key}"), visit)),
        leaf => visit(path, leaf),
    }
}

/// Differences between an answer and the frozen one; the frozen one is written where that is asked for.
fn differences(name: &str, answer: &Answer) -> Vec<String> {
    let folder = root().join("tests/golden");
    let [terminal, table] = ["txt", "csv"].map(|end| folder.join(format!("{name}.{end}")));
    let said = format!("exit {}\n{}", answer.code, answer.terminal);
    let found = answer.record.as_ref().map(numbers).unwrap_or_default();
    let mode = std::env::var("GOLDEN").unwrap_or_default();
    if mode == "write" {
        let mut text = String::new();
        found.iter().for_each(|(key, x)| writeln!(text, "{key},{x:e}").unwrap());
        std::fs::create_dir_all(&folder).unwrap();
        std::fs::write(terminal, said).unwrap();
        std::fs::write(table, text).unwrap();
        return Vec::new();
    }
    let (within, nothing) = if mode == "exact" { (EXACT, 0.0) } else { (SAME, NOTHING) };
    let mut all = Vec::new();
    let frozen = std::fs::read_to_string(terminal).unwrap();
    let lines = frozen.lines().zip(said.lines()).filter(|(a, b)| a != b && !(within == SAME && reads_alike(a, b)));
    all.extend(lines.map(|(a, b)| format!("{name}: was    {a}\n{name}: is now {b}")));
    if frozen.lines().count() != said.lines().count() {
        all.push(format!("{name}: other number of lines:\n{said}"));
    }
    let text = std::fs::read_to_string(table).unwrap();
    let mut frozen: BTreeMap<&str, f64> =
        text.lines().map(|l| l.rsplit_once(',').unwrap()).map(|(k, x)| (k, x.parse().unwrap())).collect();
    for (key, x) in &found {
        // Sums are as exact as the numbers that they add.
        let size = key.strip_suffix("sum").and_then(|kind| found.get(&format!("{kind}size"))).unwrap_or(x);
        match frozen.remove(key.as_str()) {
            Some(y) if (x - y).abs() <= within * size.abs().max(y.abs()) + nothing => {}
            other => all.push(format!("{name}: {key}: {other:?} -> {x:e}")),
        }
    }
    all.extend(frozen.keys().map(|key| format!("{name}: {key} is gone")));
    all
}

/// The same words, and numbers within [`SAME`] or one unit of their last digit.
fn reads_alike(a: &str, b: &str) -> bool {
    let words =
        |line: &str| line.split(' ').map(|w| w.trim_matches([',', ';', '(', ')']).to_owned()).collect::<Vec<_>>();
    let alike = |a: &String, b: &String| match (a.parse::<f64>(), b.parse::<f64>()) {
        (Ok(x), Ok(y)) => {
            let digits = a.split_once('.').map_or(0, |(_, d)| d.split('e').next().map_or(0, str::len));
            (x - y).abs() <= SAME * x.abs() + 1.01 * 0.1f64.powi(digits as i32)
        }
        _ => a == b,
    };
    let (a, b) = (words(a), words(b));
    a.len() == b.len() && a.iter().zip(&b).all(|(a, b)| alike(a, b))
}

fn kr6() -> PathBuf {
    PathBuf::from(KR6)
}

#[test]
fn the_answer_is_short_and_begins_with_the_verdict() {
    for file in std::fs::read_dir(root().join("tests/golden")).unwrap().map(|f| f.unwrap().path()) {
        let text = std::fs::read_to_string(&file).unwrap();
        let Some((answer, _)) = text.split_once(ALL) else { continue };
        let lines: Vec<&str> = answer.lines().skip(1).collect();
        // words: what stands first on the terminal is what is tested.
        assert!(lines.len() <= 12 && lines[0].starts_with("verdict "), "{}:\n{answer}", file.display());
        assert!(lines.iter().all(|l| l.chars().count() <= 100 && !l.contains('\u{1b}')), "{answer}");
    }
}

#[test]
fn bad_series_are_answered_as_before() {
    let all: Vec<String> = (FAULTS.iter())
        .flat_map(|f| differences(f.name, &identify(&kr6(), &[Path::new("datasets/bad").join(f.name)])))
        .collect();
    assert!(all.is_empty(), "{}", all.join("\n"));
}

#[test]
fn series_that_come_with_the_program_are_solved_as_before() {
    let ur10e = PathBuf::from("robots/ur10e/ur10e.urdf");
    let mut all = differences("kr6_small", &identify(&kr6(), &["datasets/kr6_small".into()]));
    all.extend(differences("ur10e_observations", &identify(&ur10e, &["datasets/ur10e_observations".into()])));
    assert!(all.is_empty(), "{}", all.join("\n"));
}

#[test]
#[ignore = "needs the real series"]
fn real_series_are_solved_as_before() {
    let names = ["nachi-2025-01-17", "nachi-2025-02-04", "nachi-2025-02-19", "aubo-2024-12-16"];
    let folder = |name: &str| Path::new("../shared/real").join(name);
    let mut all: Vec<String> =
        names.iter().flat_map(|n| differences(n, &identify(&folder(n).join("robot.urdf"), &[folder(n)]))).collect();
    let nachi: Vec<PathBuf> = names[..3].iter().map(|n| folder(n)).collect();
    all.extend(differences("nachi_together", &identify(&nachi[0].join("robot.urdf"), &nachi)));
    assert!(all.is_empty(), "{}", all.join("\n"));
}
