//! Calls of routines that may change what they are given: a parameter of KRL that is not `:IN` is a reference.

use std::ops::Range;

use super::aggregate::index;
use super::assigned::assigned;
use super::moves::{MOVES, begins_spline};
use crate::programs::references::{Calling, Given, Parameter, Passing, References, Which, parts};
use crate::programs::routines::Routines;
use crate::programs::scan::{Reader, TokenKind};

/// Words before a bracket that call nothing.
pub(super) const WORDS: [&str; 23] = [
    "IF", "ELSE", "WHILE", "UNTIL", "FOR", "TO", "STEP", "SWITCH", "CASE", "RETURN", "WAIT", "AND", "OR", "EXOR",
    "NOT", "WHEN", "DO", "B_NOT", "B_AND", "B_OR", "B_EXOR", "SEC", "PULSE",
];

/// Statements that run something beside the text, when an event comes.
const BESIDE: [&str; 2] = ["INTERRUPT", "TRIGGER"];

/// True where the line on whose beginning the reader stands runs something beside the text.
pub(super) fn is_beside(reader: &Reader<'_>) -> bool {
    let first = isize::from(reader.ahead_is_word(0, "GLOBAL"));
    BESIDE.iter().any(|word| reader.ahead_is_word(first, word))
}

/// Name of the routine that a line begins: `[GLOBAL] DEF NAME(..)`, `[GLOBAL] DEFFCT TYPE NAME(..)`.
pub(super) fn routine_name(reader: &Reader<'_>) -> Option<String> {
    let word = |k| Some(String::from_utf8_lossy(reader.text(reader.ahead(k)?)).to_ascii_uppercase());
    let first = isize::from(word(0)? == "GLOBAL");
    match word(first)?.as_str() {
        "DEF" => word(first + 1),
        "DEFFCT" => word(first + 2),
        _ => None,
    }
}

/// Notes the routines of a file: the first one has the name of the file and is there for all, as those that are `GLOBAL`.
pub(super) fn routines_in(mut reader: Reader<'_>, all: &mut Routines) {
    let mut is_first = true;
    while !reader.done() {
        if let Some(name) = routine_name(&reader) {
            all.declare(name, reader.index, !is_first && !reader.ahead_is_word(0, "GLOBAL"));
            is_first = false;
        }
        reader.skip_line();
    }
}

/// True where a statement of a file leaves the routines that an interrupt has come upon.
pub(super) fn resumes(mut reader: Reader<'_>) -> bool {
    while !reader.done() {
        if reader.ahead_is_word(0, "RESUME") {
            return true;
        }
        reader.skip_line();
    }
    false
}

/// The name that an argument is, alone or with an index or components.
fn name_of(reader: &mut Reader<'_>, part: Range<usize>) -> Option<String> {
    let start = std::mem::replace(&mut reader.at, part.start);
    let name = reader.name().map(|name| {
        reader.at += 1;
        name + &index(reader)
    });
    while reader.take_mark(b'.') {
        reader.at += 1;
        index(reader);
    }
    let is_whole = reader.at >= part.end;
    reader.at = start;
    name.filter(|_| is_whole)
}

/// Arguments in the brackets at token `open` that are names.
pub(super) fn given(reader: &mut Reader<'_>, open: usize) -> Vec<Given> {
    let Some(close) = reader.closing(open) else { return Vec::new() };
    let all = parts(reader, open + 1..close, |mark| mark == b',').into_iter().enumerate();
    let name = |(k, part)| name_of(reader, part).map(|name| Given { which: Which::Nth(k), name });
    all.filter_map(name).collect()
}

/// Parameters in the rest of a line that begins a routine: `NAME`, `NAME :OUT`, `NAME[] :IN`.
pub(super) fn parameters(reader: &Reader<'_>) -> Vec<Parameter> {
    let line = (reader.at..).take_while(|&k| reader.token(k).is_some_and(|t| t.kind != TokenKind::LineEnd));
    let open = line.into_iter().find(|&k| reader.token_is_mark(k, b'('));
    let Some((open, close)) = open.and_then(|open| Some((open, reader.closing(open)?))) else { return Vec::new() };
    let parameter = |part: Range<usize>| {
        let words: Vec<String> = part.filter_map(|k| reader.name_of(k)).collect();
        let passing = if words.last()? == "IN" && words.len() > 1 { Passing::Value } else { Passing::Reference };
        Some(Parameter { name: words.first()?.clone(), passing })
    };
    parts(reader, open + 1..close, |mark| mark == b',').into_iter().filter_map(parameter).collect()
}

/// Notes the routines of a file, what they set, and what they call.
pub(super) fn look_through(references: &mut References, mut reader: Reader<'_>) {
    while !reader.done() {
        if let Some(name) = routine_name(&reader) {
            references.routine_begins(name, parameters(&reader));
        } else if reader.ahead_is_word(0, "END") || reader.ahead_is_word(0, "ENDFCT") {
            references.routine_ends();
        } else {
            line(references, &mut reader);
        }
        reader.skip_line();
    }
}

/// What a line sets and calls; what motions state behind `WITH` reads only.
fn line(references: &mut References, reader: &mut Reader<'_>) {
    let start = reader.at;
    let is_motion =
        begins_spline(reader) || reader.name().is_some_and(|word| MOVES.iter().any(|(name, _)| *name == word));
    if let Some((name, _)) = assigned(reader) {
        references.sets(&name);
    }
    reader.at = start;
    let ends = |reader: &Reader<'_>| reader.at_line_end() || (is_motion && reader.ahead_is_word(0, "WITH"));
    while !ends(reader) {
        if let Some(word) = reader.name()
            && reader.ahead_is_mark(1, b'(')
            && !WORDS.contains(&word.as_str())
        {
            let open = reader.at + 1;
            let given = given(reader, open);
            references.calls(word, Calling::Function, given);
        }
        reader.at += 1;
        // `TRIGGER .. DO NAME=..`
        if reader.ahead_is_word(-1, "DO") {
            let at = reader.at;
            if let Some((name, _)) = assigned(reader) {
                references.sets(&name);
            }
            reader.at = at;
        }
    }
}
