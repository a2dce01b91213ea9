//! The codes: named after their variants, each used, and all of them in the guide.

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

use robotcal::{Code, ErrorKind};

use super::imports::files_below;

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// The page of the guide, as the table of codes gives it.
fn page() -> String {
    let mut text = String::from(
        "# Codes\n\nEvery error, notice and finding has a code, which stays the same when its sentence is written better: `error[code]: ..` on stderr, `[code]` behind a \
         note, `code` of `findings` in solution.json and findings.json and of what detection.json says of an image. An error of the kind *input* ends the \
         program with exit code 2, one of the kind *unsolved* with 3; the same code on a note or finding does not.\n\nThis page follows from `src/error/code.rs` \
         (`GOLDEN=write cargo test --release --test structure codes` writes it anew).\n",
    );
    let mut group = "";
    for code in Code::ALL {
        if code.group() != group {
            group = code.group();
            let kind = match code.kind() {
                ErrorKind::Input => "input",
                ErrorKind::Unsolved => "unsolved",
            };
            write!(text, "\n## {group} ({kind})\n\n| code | what it says |\n|---|---|\n").unwrap();
        }
        writeln!(text, "| `{code}` | {} |", code.meaning()).unwrap();
    }
    text
}

#[test]
fn the_guide_lists_every_code() {
    let path = root().join("src/guide/codes.md");
    if std::env::var("GOLDEN").is_ok_and(|mode| mode == "write") {
        fs::write(&path, page()).unwrap();
    }
    assert_eq!(fs::read_to_string(&path).unwrap(), page(), "GOLDEN=write writes it anew");
}

#[test]
fn codes_are_named_after_their_variants_and_read_back() {
    let mut names: Vec<&str> = Code::ALL.iter().map(|c| c.name()).collect();
    for code in Code::ALL {
        let mut snake = String::new();
        for c in format!("{code:?}").chars() {
            if c.is_uppercase() && !snake.is_empty() {
                snake.push('_');
            }
            snake.push(c.to_ascii_lowercase());
        }
        assert_eq!(code.name(), snake);
        let written = serde_json::to_string(code).unwrap();
        assert_eq!(written, format!("\"{code}\""));
        assert_eq!(serde_json::from_str::<Code>(&written).unwrap(), *code);
    }
    names.sort_unstable();
    names.dedup();
    assert_eq!(names.len(), Code::ALL.len());
}

#[test]
fn every_code_is_used() {
    let mut files: Vec<PathBuf> = Vec::new();
    files_below(&root().join("src"), &mut files);
    files.retain(|f| !f.ends_with("src/error/code.rs"));
    let text: String = files.iter().map(|f| fs::read_to_string(f).unwrap()).collect();
    // `Self::Noticed` stands for notices of earlier versions.
    let used = |code: &Code| {
        let name = format!("Code::{code:?}");
        text.match_indices(&name).any(|(at, _)| !text[at + name.len()..].starts_with(char::is_alphanumeric))
    };
    let unused: Vec<&Code> = Code::ALL.iter().filter(|c| **c != Code::Noticed && !used(c)).collect();
    assert!(unused.is_empty(), "{unused:?}");
}
