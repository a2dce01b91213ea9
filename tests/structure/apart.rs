//! What belongs together goes together: problem, state, linearisation and covariance of an adjustment are passed as one.

use std::fs;
use std::path::Path;

use super::imports::files_below;

/// Functions that may take them apart.
const MOST_APART: usize = 15;

/// What an adjustment, its linearisation and its fit are made of.
const PARTS: [&str; 4] = ["Problem", "State", "Linearised", "Covariance"];

/// What holds some of them: beside it none of them needs to be passed.
const WHOLES: [&str; 4] = ["Adjustment", "LinearProblem", "Fit", "Outcome"];

/// Name and parameters of every function of a file.
fn functions(text: &str) -> Vec<(&str, &str)> {
    let mut found = Vec::new();
    for (at, _) in text.match_indices("fn ") {
        let signature = &text[at + 3..];
        let Some(open) = signature.find('(').filter(|open| !signature[..*open].contains(['{', ';', '\n'])) else {
            continue;
        };
        let mut depth = 0;
        let close = signature[open..].find(|c| {
            depth += i32::from(c == '(') - i32::from(c == ')');
            depth == 0
        });
        if let Some(close) = close {
            found.push((&signature[..open], &signature[open + 1..open + close]));
        }
    }
    found
}

/// True where a parameter is of that type, by value or by reference.
fn takes(parameters: &str, name: &str) -> bool {
    parameters.match_indices(name).any(|(at, _)| {
        let before = parameters[..at].chars().next_back();
        let after = parameters[at + name.len()..].chars().find(|c| !c.is_whitespace());
        let is_type = matches!(before, Some('&' | ' ' | '(' | '<'));
        is_type && matches!(after, None | Some(',' | ')' | '>' | '<'))
    })
}

fn takes_apart(parameters: &str) -> bool {
    PARTS.iter().chain(&WHOLES).filter(|name| takes(parameters, name)).count() > 1
}

#[test]
fn problem_state_linearisation_and_covariance_go_together() {
    let mut files = Vec::new();
    for folder in ["src", "benches"] {
        files_below(&Path::new(env!("CARGO_MANIFEST_DIR")).join(folder), &mut files);
    }
    let mut apart = Vec::new();
    for path in files {
        let text = fs::read_to_string(&path).unwrap();
        let own = functions(&text).into_iter().filter(|(_, parameters)| takes_apart(parameters));
        apart.extend(own.map(|(name, _)| format!("{}: {name}", path.display())));
    }
    println!("{} functions take them apart:\n{}", apart.len(), apart.join("\n"));
    assert!(apart.len() <= MOST_APART, "{} functions take them apart:\n{}", apart.len(), apart.join("\n"));
}

#[test]
fn what_is_passed_apart_is_seen() {
    let text = "fn a(problem: &Problem,\n    state: &mut State) {}\nfn b(of: Fit, s: &[Stop]) -> State {}\nfn c<'a>(x: (&'a Problem, u8), lin: &Linearised) {}\n\
                fn d(Adjustment { problem, state }: &Adjustment) {}\nfn e(linear: LinearProblem, stated: &Covariance) {}";
    let apart: Vec<&str> = functions(text).into_iter().filter(|(_, p)| takes_apart(p)).map(|(name, _)| name).collect();
    assert_eq!(apart, ["a", "c<'a>", "e"]);
}
