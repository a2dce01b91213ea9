//! What statements do with names beside going there: frames, and what is computed.

use std::collections::{BTreeMap, BTreeSet};

use super::aggregate::index;
use super::assigned::assigned;
use super::moves::{MOVES, begins_spline, is_seen_from_null};
use crate::programs::scan::{Reader, TokenKind};

/// Variables of the controller that hold frames.
const FRAMES: [&str; 2] = ["$BASE", "$TOOL"];

/// Names that statements use.
#[derive(Debug, Default)]
pub(super) struct Uses {
    /// What is set to something with them in it.
    by: BTreeMap<String, String>,
    /// Those that are frames as they are.
    frames: BTreeSet<String>,
    /// Names with those that are set to them as they are.
    copies: BTreeMap<String, BTreeSet<String>>,
    /// Those in the targets of motions that are computed: by file and line.
    motions: BTreeMap<(usize, usize), Vec<String>>,
}

/// Names in the rest of a line, up to where it `ends` before.
fn names(reader: &mut Reader<'_>, ends: impl Fn(&Reader<'_>) -> bool) -> Vec<String> {
    let mut all = Vec::new();
    while !reader.at_line_end() && !ends(reader) {
        let is_other = [b'.', b'#'].iter().any(|mark| reader.ahead_is_mark(-1, *mark))
            || reader.ahead_is_mark(1, b'(')
            || is_seen_from_null(reader);
        let name = reader.name().filter(|_| !is_other);
        reader.at += 1;
        if let Some(name) = name {
            all.push(name + &index(reader));
        }
    }
    all
}

/// True for a target `P:Q`; the reader stands on the name of the motion.
fn is_computed(reader: &Reader<'_>) -> bool {
    let is_of_target =
        |&k: &isize| reader.ahead(k).is_some_and(|t| t.kind != TokenKind::LineEnd) && !reader.ahead_is_word(k, "WITH");
    let mut target = (1..).take_while(is_of_target);
    // `{E6POS: X ..}` names a type.
    target.any(|k| reader.ahead_is_mark(k, b':') && !reader.ahead_is_mark(k - 2, b'{'))
}

impl Uses {
    /// Looks through a file of statements.
    pub fn look_through(&mut self, mut reader: Reader<'_>) {
        while !reader.done() {
            let word = reader.name().unwrap_or_default();
            if begins_spline(&reader) {
                self.behind_with(&mut reader);
            } else if MOVES.iter().any(|(name, _)| *name == word) {
                self.motion(&mut reader, &word);
            } else if let Some((set, _)) = assigned(&mut reader) {
                self.assignment(&mut reader, &set);
            }
            reader.skip_line();
        }
    }

    fn assignment(&mut self, reader: &mut Reader<'_>, set: &str) {
        let used = names(reader, |_| false);
        match &used[..] {
            [name] if FRAMES.contains(&set) => _ = self.frames.insert(name.clone()),
            [name] => _ = self.copies.entry(name.clone()).or_default().insert(set.to_owned()),
            _ => {}
        }
        used.into_iter().for_each(|name| _ = self.by.insert(name, set.to_owned()));
    }

    /// A target `P:Q`, and frames behind `WITH`.
    fn motion(&mut self, reader: &mut Reader<'_>, motion: &str) {
        let place = (reader.index, reader.line());
        let is_computed = is_computed(reader);
        reader.at += 1;
        let used = names(reader, |reader| reader.ahead_is_word(0, "WITH"));
        if is_computed {
            used.iter().for_each(|name| _ = self.by.insert(name.clone(), motion.to_owned()));
            self.motions.insert(place, used);
        }
        self.behind_with(reader);
    }

    /// Frames in the rest of a line.
    fn behind_with(&mut self, reader: &mut Reader<'_>) {
        while !reader.at_line_end() {
            let set = reader.name().filter(|name| FRAMES.contains(&name.as_str()) && reader.ahead_is_mark(1, b'='));
            reader.at += 1;
            if let Some(set) = set {
                reader.at += 1;
                self.within_with(names(reader, |reader| reader.is_mark(b',')), &set);
            }
        }
    }

    fn within_with(&mut self, used: Vec<String>, set: &str) {
        self.frames.extend(used.iter().filter(|_| used.len() == 1).cloned());
        used.into_iter().for_each(|name| _ = self.by.insert(name, set.to_owned()));
    }

    /// What is computed with a name, or set to it.
    pub fn of(&self, name: &str) -> Option<&String> {
        self.by.get(name)
    }

    /// True for a name that is `$BASE` or `$TOOL` at some place, itself or by a copy.
    pub fn is_frame(&self, name: &str) -> bool {
        let (mut all, mut seen) = (vec![name], BTreeSet::new());
        while let Some(name) = all.pop() {
            if self.frames.contains(name) {
                return true;
            }
            if seen.insert(name) {
                all.extend(self.copies.get(name).into_iter().flatten().map(String::as_str));
            }
        }
        false
    }

    /// Names in the target of a motion that is computed.
    pub fn in_motion(&self, file: usize, line: usize) -> impl Iterator<Item = &String> {
        self.motions.get(&(file, line)).into_iter().flatten()
    }
}
