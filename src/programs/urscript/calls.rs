//! Calls that are no known moves: some move the robot to where the text does not tell, some are in none of the files.

use std::collections::BTreeSet;

use super::routines::{Blocks, called};
use super::{MOVES, Script, Value};
use crate::programs::field::FieldPlace;
use crate::programs::program::Left;
use crate::programs::reason::{LeftReason, Why};
use crate::programs::scan::{Reader, Token, TokenKind};

/// Calls behind which the robot stands elsewhere; true where it keeps its posture, because the tool moves a little or on a path.
const ELSEWHERE: [(&str, bool); 5] =
    [("speedj", false), ("freedrive_mode", false), ("teach_mode", false), ("speedl", true), ("force_mode", true)];
/// Words before a bracket that call nothing.
const WORDS: [&str; 13] =
    ["and", "case", "elif", "for", "if", "in", "not", "or", "return", "run", "switch", "while", "xor"];
/// Functions of the language that can be given a position and do not go there (Universal Robots, *The URScript Programming Language*).
const READ: [&str; 50] = [
    "add_frame",
    "assert",
    "attach_frame",
    "convert_pose",
    "get_forward_kin",
    "get_inverse_kin",
    "get_inverse_kin_has_solution",
    "get_jacobian",
    "get_jacobian_time_derivative",
    "get_list_length",
    "interpolate_pose",
    "inv",
    "is_within_safety_limits",
    "length",
    "make_list",
    "move_frame",
    "norm",
    "path_offset_set",
    "path_offset_set_max_offset",
    "point_dist",
    "popup",
    "pose_add",
    "pose_dist",
    "pose_inv",
    "pose_sub",
    "pose_trans",
    "rpc_factory",
    "rpy2rotvec",
    "rotvec2rpy",
    "rtde_set_watchdog",
    "screw_driving",
    "set_base_acceleration",
    "set_gravity",
    "set_payload",
    "set_payload_cog",
    "set_target_payload",
    "set_tcp",
    "size",
    "socket_send_line",
    "socket_send_string",
    "socket_set_var",
    "str_cat",
    "struct",
    "textmsg",
    "to_str",
    "track_conveyor_circular",
    "track_conveyor_linear",
    "transpose",
    "varmsg",
    "wrench_trans",
];

/// Beginnings and ends of names of functions that set or read something of a motion.
const OF_SETTINGS: [&str; 3] = ["set_", "get_", "is_"];
const SETTINGS: [&str; 8] = ["acceleration", "average", "gain", "gains", "limit", "limits", "speed", "speeds"];

/// True for the name of a function that may move the robot; `remove` and `set_move_speed` do not.
fn is_motion(name: &str) -> bool {
    let name = name.to_ascii_lowercase().replace("remov", "");
    if OF_SETTINGS.iter().any(|begins| name.starts_with(begins)) || SETTINGS.iter().any(|ends| name.ends_with(ends)) {
        return false;
    }
    let mut parts = name.split(|c: char| !c.is_ascii_alphabetic());
    ["mov", "servo", "ptp"].iter().any(|word| name.contains(word))
        || parts.any(|part| ["lin", "linear"].contains(&part))
}

/// True where a list of so many values that are no lists stands at a token.
fn is_list_of(reader: &Reader<'_>, at: usize, count: usize) -> bool {
    let Some(close) = reader.closing(at) else { return false };
    let (mut commas, mut k) = (0, at + 1);
    while k < close {
        if reader.token_is_mark(k, b'[') {
            return false;
        }
        commas += usize::from(reader.token_is_mark(k, b','));
        k = if reader.token_is_mark(k, b'(') { reader.closing(k).unwrap_or(k) } else { k } + 1;
    }
    close > at + 1 && commas + 1 == count
}

/// A position that a call in none of the files is given, which may go there.
struct Given {
    /// Where its numbers begin, where a variable has them.
    first_byte: Option<usize>,
}

/// A routine of a text.
struct Routine {
    name: String,
    parameters: Vec<Vec<u8>>,
    /// Calls that are given one of its parameters.
    hands_on_to: Vec<String>,
}

/// Name and closing bracket of the call on whose name the reader stands; methods of other computers (`camera.look(..)`) cannot move the robot.
fn call(reader: &Reader<'_>) -> Option<(String, usize)> {
    let is_call = reader.ahead_is_mark(1, b'(') && !reader.ahead_is_mark(-1, b'.');
    let name = called(reader, 0).filter(|name| is_call && !WORDS.contains(&name.as_str()))?;
    Some((name, reader.closing(reader.at + 1)?))
}

/// Words and lists that are arguments, or elements of lists that are, of the call that ends at `close`; the reader stands on its name.
fn arguments(reader: &Reader<'_>, close: usize) -> Vec<usize> {
    let (mut all, mut at) = (Vec::new(), reader.at + 2);
    while at < close {
        let is_word = reader.token(at).is_some_and(|t| t.kind == TokenKind::Word);
        if is_word && reader.token_is_mark(at + 1, b'(') {
            at = reader.closing(at + 1).unwrap_or(close);
        } else if is_word || (reader.token_is_mark(at, b'[') && reader.token(at - 1).is_some_and(is_no_word)) {
            all.push(at);
        }
        at += 1;
    }
    all
}

fn is_no_word(token: &Token) -> bool {
    token.kind != TokenKind::Word
}

impl Script<'_> {
    /// Routines of the text that hand what they are given on to one that is in none of the files.
    pub(super) fn find_routines_that_hand_on(&mut self) {
        let mut blocks = Blocks::default();
        let mut routines: Vec<Routine> = Vec::new();
        while !self.reader.done() {
            let word = self.reader.word().unwrap_or_default();
            let is_statement = blocks.follow(word);
            if blocks.routines > routines.len() {
                self.reader.at += 1;
                let name = called(&self.reader, 0).unwrap_or_default();
                routines.push(Routine { name, parameters: self.parameters(), hands_on_to: Vec::new() });
            } else if let Some(within) = blocks.routine().filter(|_| !is_statement)
                && let Some((name, close)) = call(&self.reader)
            {
                let arguments = arguments(&self.reader, close);
                let texts = arguments.iter().filter_map(|at| Some(self.reader.text(self.reader.token(*at)?)));
                let routine = &mut routines[within];
                if texts.into_iter().any(|text| routine.parameters.iter().any(|p| p == text)) {
                    routine.hands_on_to.push(name);
                }
            }
            self.reader.at += 1;
        }
        self.reader.at = 0;
        self.handing_on = handing_on(&routines, |name| self.is_unknown(name));
    }

    /// True for a routine that is in none of the files and no function of the language.
    fn is_unknown(&self, name: &str) -> bool {
        let is_of_language = READ.contains(&name)
            || ELSEWHERE.iter().any(|(known, _)| *known == name)
            || MOVES.iter().any(|(known, ..)| *known == name.as_bytes());
        !is_of_language && !self.flow.has_routine(name)
    }

    /// A call that is no known move; the reader stands on its name.
    pub(super) fn other_call(&mut self) {
        let Some((name, close)) = call(&self.reader) else { return };
        match self.reader.ahead_is_word(-1, "run") {
            true => self.runs(name.clone()),
            false => self.way.call(name.clone(), self.flow, &mut self.now),
        }
        match ELSEWHERE.iter().find(|(known, _)| *known == name) {
            Some((_, true)) => self.way.go_beyond(&mut self.now.1),
            Some((_, false)) => self.way.lose(&mut self.now.1),
            None => {}
        }
        if !READ.contains(&name.as_str()) && !self.flow.has_routine(&name) {
            self.time_passes();
        }
        if self.is_unknown(&name) || self.handing_on.contains(&name) {
            let all: Vec<Given> =
                arguments(&self.reader, close).into_iter().filter_map(|at| self.given(at, &name)).collect();
            all.into_iter().for_each(|given| self.goes_perhaps(&name, given));
        }
    }

    /// The position that stands at a token, `p[..]` or a variable with one; joint values are one where the name of the function is that of a motion.
    fn given(&self, at: usize, function: &str) -> Option<Given> {
        let axes = self.setting.axes.len();
        if self.reader.token_is_mark(at, b'[') {
            let is_position = is_motion(function) && is_list_of(&self.reader, at, axes);
            return is_position.then_some(Given { first_byte: None });
        }
        let name = self.reader.text(self.reader.token(at)?);
        if self.reader.token_is_mark(at + 1, b'[') {
            // `w[2]` is a number of a position.
            return (name == b"p").then_some(Given { first_byte: None });
        }
        let fields = match self.variables.get(name).filter(|_| !self.computed.contains(name))? {
            Value::Pose(fields, _) => &fields[..],
            Value::Joints(fields, _) if is_motion(function) && fields.len() == axes => fields,
            _ => return None,
        };
        let starts = fields.iter().filter_map(|field| match &field.place {
            FieldPlace::At(range) => Some(range.start),
            FieldPlace::Missing(..) => None,
        });
        Some(Given { first_byte: starts.min() })
    }

    /// The robot goes there, or does not.
    fn goes_perhaps(&mut self, name: &str, given: Given) {
        let words = format!(
            "{name} is in none of the files, or calls a routine that is not: what it does with this position is not known"
        );
        let why = Why::new(LeftReason::NotATarget, words);
        let left = Left { file: self.reader.index, line: self.reader.line(), name: name.to_owned(), why };
        match given.first_byte {
            None => self.way.leave(left, false, &mut self.now.1),
            Some(first_byte) => {
                self.way.lose(&mut self.now.1);
                self.perhaps.push((first_byte, left));
            }
        }
    }

    /// Positions in variables to which only such calls may go, each named once.
    pub(super) fn leave_unvisited(&mut self) {
        let mut named = BTreeSet::new();
        for (first_byte, left) in std::mem::take(&mut self.perhaps) {
            let targets = &self.way.program.targets;
            let is_target = targets.iter().any(|t| t.file == left.file && t.kind.first_byte() == first_byte);
            if !is_target && named.insert((left.file, first_byte)) {
                self.way.program.left.push(left);
            }
        }
    }
}

/// Routines that hand a parameter on to an unknown one, at once or by way of others.
fn handing_on(routines: &[Routine], is_unknown: impl Fn(&str) -> bool) -> BTreeSet<String> {
    let mut all = BTreeSet::new();
    loop {
        let before = all.len();
        for routine in routines {
            if routine.hands_on_to.iter().any(|name| is_unknown(name) || all.contains(name)) {
                all.insert(routine.name.clone());
            }
        }
        if all.len() == before {
            return all;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::is_motion;

    #[test]
    fn names_of_motions() {
        for name in ["my_movej", "moveh", "doServo", "PTP_fast", "go_lin", "lin2", "linear_to"] {
            assert!(is_motion(name), "{name}");
        }
        for name in [
            "remove_item",
            "polyline",
            "cooling",
            "set_limits",
            "set_move_speed",
            "set_moving_average",
            "get_moved_joints",
            "is_moving",
            "servo_gains",
            "servoSpeed",
            "moving_average",
        ] {
            assert!(!is_motion(name), "{name}");
        }
    }
}
