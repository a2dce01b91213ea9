//! Calls of routines that may change what they are given.

use std::ops::Range;

use super::Task;
use super::moves::{targets_of, writes_found};
use super::statements::{CONTROL, DECLARE, OPERATORS, behind_header, is_control, statement_end};
use super::switching::{ROUTINES, routine_name, words_before_name};
use super::value::{TYPES, element, is_set};
use crate::programs::references::{Call, Calling, Given, Parameter, Passing, References, Which, parts, variable};
use crate::programs::scan::{Reader, TokenKind};

/// Instructions and functions of the controller that can name a position, a tool or a work object, and only read them (ABB, *Technical reference
/// manual RAPID Instructions, Functions and Data types*).
const READ: [&str; 54] = [
    "ARCMOVEEXTJ",
    "ARGNAME",
    "CALCJOINTT",
    "CALCROBT",
    "CALCROTAXFRAMEZ",
    "CALCROTAXISFRAME",
    "CJOINTT",
    "CPOS",
    "CROBT",
    "DEFACCFRAME",
    "DEFDFRAME",
    "DEFFRAME",
    "DIM",
    "DISTANCE",
    "DROPWOBJ",
    "EGMACTJOINT",
    "EGMACTMOVE",
    "EGMACTPOSE",
    "EGMRUNJOINT",
    "EGMRUNPOSE",
    "EGMSTREAMSTART",
    "EOFFSON",
    "EOFFSSET",
    "ERRLOG",
    "GRIPLOAD",
    "ISPERS",
    "ISVAR",
    "LOADID",
    "MIRPOS",
    "MOVEEXTJ",
    "OFFS",
    "ORIENTZYX",
    "OROBT",
    "PACKRAWBYTES",
    "PDISPON",
    "PDISPSET",
    "POSEINV",
    "POSEMULT",
    "POSEVECT",
    "PRESENT",
    "RELTOOL",
    "RETURN",
    "RMQSENDMESSAGE",
    "RMQSENDWAIT",
    "SETSYSDATA",
    "SOCKETSEND",
    "STTUNE",
    "STTUNERESET",
    "SYNCMOVEON",
    "TPWRITE",
    "VALTOSTR",
    "WAITWOBJ",
    "WRITE",
    "WZHOMEJOINTDEF",
];
/// The switch behind which instructions that move name their work object.
const WORK: &str = "WOBJ";
/// Stands for a routine whose name is computed.
const LATE: &str = "%";

/// True for what the controller itself offers, as far as it reads its arguments only.
fn reads(routine: &str) -> bool {
    targets_of(routine).is_some() || READ.contains(&routine)
}

/// The name that an argument is, alone or with an index or components.
fn name_of(reader: &mut Reader<'_>, part: Range<usize>) -> Option<String> {
    let start = std::mem::replace(&mut reader.at, part.start);
    reader.skip_line_ends();
    let name = reader.name().map(|name| {
        reader.at += 1;
        element(reader, name)
    });
    while reader.take_mark(b'.') {
        reader.at += 1;
        element(reader, String::new());
    }
    reader.skip_line_ends();
    let is_whole = reader.at >= part.end;
    reader.at = start;
    name.filter(|_| is_whole)
}

/// Arguments between two tokens that are names.
fn given(reader: &mut Reader<'_>, range: Range<usize>) -> Vec<Given> {
    let (mut all, mut count) = (Vec::new(), 0);
    let is_there = |reader: &Reader<'_>, k: usize| reader.token(k).is_some_and(|t| t.kind != TokenKind::LineEnd);
    for part in parts(reader, range, |mark| mark == b',') {
        let mut pieces = parts(reader, part, |mark| mark == b'\\').into_iter();
        if let Some(plain) = pieces.next().filter(|p| p.clone().any(|k| is_there(reader, k))) {
            let which = Which::Nth(count);
            all.extend(name_of(reader, plain).map(|name| Given { which, name }));
            count += 1;
        }
        for switch in pieces {
            let named = reader.name_of(switch.start);
            // `\NAME:=value`, or `\NAME?parameter`.
            let behind = if reader.token_is_mark(switch.start + 1, b'?') { 2 } else { 3 };
            let value = name_of(reader, (switch.start + behind).min(switch.end)..switch.end);
            all.extend(named.zip(value).map(|(named, name)| Given { which: Which::Named(named), name }));
        }
    }
    all
}

/// Parameters between the brackets at token `open`: `INOUT robtarget p, num n{*} \switch s`.
fn parameters(reader: &Reader<'_>, open: usize) -> Vec<Parameter> {
    let is_open = reader.token_is_mark(open, b'(');
    let Some(close) = reader.closing(open).filter(|_| is_open) else { return Vec::new() };
    let mut all = Vec::new();
    for part in parts(reader, open + 1..close, |mark| mark == b',') {
        for (k, piece) in parts(reader, part, |mark| mark == b'\\').into_iter().enumerate() {
            let words: Vec<String> = piece.filter_map(|k| reader.name_of(k)).collect();
            let is_reference = words.first().is_some_and(|w| ["INOUT", "VAR", "PERS", "REF"].contains(&w.as_str()));
            let passing = match (is_reference, k > 0) {
                (true, false) => Passing::Reference,
                (true, true) => Passing::NamedReference,
                (false, false) => Passing::Value,
                (false, true) => Passing::NamedValue,
            };
            all.extend(words.last().map(|name| Parameter { name: name.clone(), passing }));
        }
    }
    all
}

/// Notes the routines of a file, what they set, and what they call.
fn look_through(references: &mut References, mut reader: Reader<'_>) {
    let mut begins = 0;
    while !reader.done() {
        let Some(word) = reader.name() else {
            reader.at += 1;
            continue;
        };
        if ROUTINES.contains(&word.as_str()) && reader.at >= begins {
            begins = behind_header(&mut reader, &word);
            let open = reader.at + 2 + words_before_name(&word);
            references.routine_begins(routine_name(&reader), parameters(&reader, open));
            reader.at = begins;
            continue;
        }
        if is_set(&mut reader) {
            references.sets(&word);
        } else if reader.ahead_is_mark(1, b'(') && !is_control(&reader) && !OPERATORS.contains(&word.as_str()) {
            let open = reader.at + 1;
            let close = reader.closing(open).unwrap_or(open);
            let given = given(&mut reader, open + 1..close.max(open + 1));
            references.calls(word.clone(), Calling::Function, given);
        }
        if reader.at < begins {
            reader.at += 1;
        } else if CONTROL.contains(&word.as_str()) {
            if word.strip_prefix("END").is_some_and(|kind| ROUTINES.contains(&kind)) {
                references.routine_ends();
            }
            begins = behind_header(&mut reader, &word);
            reader.at = if word == "MODULE" || word == "RECORD" { begins } else { reader.at + 1 };
        } else {
            begins = statement(references, &mut reader, &word);
            reader.at += 1;
        }
    }
}

/// A statement that begins with a word of its own; where it ends.
fn statement(references: &mut References, reader: &mut Reader<'_>, word: &str) -> usize {
    if reader.ahead_is_mark(1, b':') && !reader.ahead_is_mark(2, b'=') {
        return reader.at + 2;
    }
    let end = statement_end(reader);
    let is_data = DECLARE.contains(&word) || TYPES.contains(&word);
    if !is_data && !is_set(reader) {
        // `%"name"% argument, ..` calls by a name that is computed.
        let is_late = reader.ahead_is_mark(-1, b'%');
        let (routine, first) = if is_late { (LATE, reader.at) } else { (word, reader.at + 1) };
        let given = given(reader, first..end);
        references.calls(routine.to_owned(), Calling::Instruction, given);
    }
    end
}

impl Task<'_> {
    /// Routines and calls of a file.
    pub(super) fn look_for_calls(references: &mut References, reader: Reader<'_>) {
        look_through(references, reader);
    }

    /// Variables that calls may change are computed; constants cannot be given by reference.
    pub(super) fn changed_by_calls(&mut self, references: &References) {
        let changed = references.changed(|call, given| match writes_found(&call.routine) {
            true => given.which == Which::Nth(1),
            false => !reads(&call.routine) && !self.goes(call),
        });
        for (name, routine) in changed {
            let name = variable(&name);
            if self.data.get(name).is_some_and(|datum| !datum.is_constant) {
                let by: &str = if routine == LATE { "a call by a computed name" } else { &routine };
                self.is_assigned(name, &format!("{by} may set what it is given"));
            }
        }
    }

    /// True for an instruction that names a tool, and a point or a work object behind `\WObj`: it goes somewhere with them, and what moves the
    /// robot reads its tool and its work object.
    fn goes(&self, call: &Call) -> bool {
        let is_point = |name: &str| self.data.get(variable(name)).is_some_and(|d| d.kind.ends_with("TARGET"));
        let is_work = |which: &Which| matches!(which, Which::Named(name) if name == WORK);
        call.calling == Calling::Instruction
            && call.given.iter().any(|given| is_point(&given.name) || is_work(&given.which))
            && call.given.iter().any(|given| self.is_tool(&given.name))
    }
}
