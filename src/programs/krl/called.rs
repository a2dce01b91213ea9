//! What calls do: routines in the files are followed; of others the text tells little.

use std::ops::Range;

use super::aggregate::Aggregate;
use super::calls::{WORDS, given, is_beside, routine_name};
use super::frames::FrameIs;
use super::given::Given;
use super::moves::{MOVES, RELATIVE, begins_spline};
use super::reads::{is_still, reads};
use super::{AXIS_NAMES, Module, POSE_NAMES, Value};
use crate::programs::program::Left;
use crate::programs::reason::{LeftReason, Why};
use crate::programs::references::Given as Argument;
use crate::programs::scan::{Reader, TokenKind};

/// Calls between which a sensor moves the robot on top of its targets (KUKA, *RobotSensorInterface*), of all its versions.
const SENSOR_BEGINS: [&str; 3] = ["RSI_ON", "ST_ON", "ST_ON1"];
const SENSOR_ENDS: [&str; 2] = ["RSI_OFF", "ST_OFF"];
/// Calls during which a sensor alone moves it.
const SENSOR_MOVES: [&str; 2] = ["RSI_MOVECORR", "ST_SKIPSENS"];
/// Arrays of the controller that hold frames.
const FRAMES: [&str; 2] = ["BASE_DATA[", "TOOL_DATA["];

/// True for numbers that may be a position.
fn is_position(aggregate: &Aggregate) -> bool {
    POSE_NAMES[..3].iter().all(|name| aggregate.has(&[name])) || aggregate.has(&AXIS_NAMES[..1])
}

/// The tokens of the line from where the reader stands.
fn rest_of_line(reader: &Reader<'_>) -> Range<usize> {
    let end = (reader.at..).find(|&k| reader.token(k).is_none_or(|t| t.kind == TokenKind::LineEnd));
    reader.at..end.unwrap_or(reader.at)
}

impl Module<'_> {
    /// Routines that a line calls; the reader stands at its beginning.
    pub(super) fn calls(&mut self, reader: &mut Reader<'_>) {
        // What BAS sets stands in its arguments.
        let first = reader.name().unwrap_or_default();
        if routine_name(reader).is_some() || ["BAS", "EXT", "EXTFCT"].contains(&first.as_str()) {
            return;
        }
        let is_motion =
            begins_spline(reader) || MOVES.iter().any(|(m, _)| *m == first) || RELATIVE.contains(&first.as_str());
        let is_beside = is_beside(reader);
        for at in rest_of_line(reader) {
            let Some(word) = reader.token(at).filter(|token| token.kind == TokenKind::Word) else { continue };
            let name = String::from_utf8_lossy(reader.text(word)).to_ascii_uppercase();
            let is_given = [b'(', b','].iter().any(|mark| at > 0 && reader.token_is_mark(at - 1, *mark));
            let is_called = reader.token_is_mark(at + 1, b'(');
            if is_called && is_beside {
                self.begins_beside(name);
            } else if is_called && self.flow.has_routine(&name) {
                let before = self.now.clone();
                self.way.call(name.clone(), &mut self.flow, &mut self.now);
                self.may_have_been_left(&name, &before);
            } else if is_called && !is_motion {
                self.calls_unknown(reader, name, at + 1);
            } else if is_given && self.assigned.changes(&name) {
                self.may_change(&name);
            }
        }
    }

    fn may_change(&mut self, name: &str) {
        let unknown = FrameIs::untold("a routine that it is given to may change it");
        match name {
            "$TOOL" => self.now.0.tool.set(unknown),
            "$BASE" => self.now.0.base.set(unknown),
            _ => {}
        }
    }

    /// A routine in none of the files, with its bracket at token `open`.
    fn calls_unknown(&mut self, reader: &mut Reader<'_>, name: String, open: usize) {
        if WORDS.contains(&name.as_str()) {
            return;
        }
        if SENSOR_BEGINS.contains(&name.as_str()) {
            self.now.0.is_sensed.set(true);
        } else if SENSOR_ENDS.contains(&name.as_str()) {
            self.now.0.is_sensed.set(false);
        } else if SENSOR_MOVES.contains(&name.as_str()) {
            self.way.lose(&mut self.now.1);
            self.time_passes();
        } else if !is_still(&name) {
            self.way.may_go(&mut self.now.1);
            self.goes_untold();
            self.is_given(reader, &name, open);
            self.time_passes();
        }
    }

    /// Positions among the arguments of such a routine: in numbers, which stay as they are, and in variables.
    fn is_given(&mut self, reader: &mut Reader<'_>, routine: &str, open: usize) {
        let Some(close) = reader.closing(open) else { return };
        let start = reader.at;
        for at in (open..close).filter(|&at| reader.token_is_mark(at, b'{')).collect::<Vec<_>>() {
            reader.at = at;
            let line = reader.line();
            if Aggregate::read(reader).is_ok_and(|aggregate| is_position(&aggregate)) {
                let words = format!("{routine} is no motion of the language, and its routine is in none of the files");
                let why = Why::new(LeftReason::NotATarget, words);
                let left = Left { file: reader.index, line, name: routine.to_owned(), why };
                self.way.leave(left, false, &mut self.now.1);
            }
        }
        reader.at = start;
        let may_go_there = |given: &Argument| !reads(routine, &given.which);
        for Argument { name, .. } in given(reader, open).into_iter().filter(may_go_there) {
            let place = match self.values.get(&name) {
                Some(Value::Aggregate(a) | Value::Copied(Ok((a, _)))) => {
                    if is_position(a) {
                        self.way.lose(&mut self.now.1);
                    }
                    Some((a.file, a.line))
                }
                _ => None,
            };
            self.given.push(Given { name, routine: routine.to_owned(), place });
        }
    }

    /// Names the positions in variables of statements that went to such routines alone.
    pub(super) fn given_away(&mut self, is_of_statements: impl Fn(usize) -> bool) {
        for Given { name, routine, place } in std::mem::take(&mut self.given) {
            let held = match self.values.get(&name) {
                Some(Value::Aggregate(a) | Value::Copied(Ok((a, _)))) if is_position(a) => Some((a.file, a.line)),
                _ => None,
            };
            let is_frame = self.uses.is_frame(&name) || FRAMES.iter().any(|array| name.starts_with(array));
            let Some((file, line)) = held.and(place.or(held)).filter(|(file, _)| !is_frame && is_of_statements(*file))
            else {
                continue;
            };
            let program = &self.way.program;
            let is_target = program.targets.iter().any(|t| (t.file, t.line) == (file, line));
            let is_named = program
                .left
                .iter()
                .any(|l| l.why.about.as_deref() == Some(&name) || (l.file, l.line, &l.name) == (file, line, &name));
            if !is_target && !is_named {
                let words = format!("{routine} is given it, and its routine is in none of the files");
                self.leave_at(file, line, &name, Why::new(LeftReason::NotATarget, words));
            }
        }
    }
}
