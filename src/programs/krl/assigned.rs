//! Variables that hold something else at one time than at another: which of it a motion finds, the text does not tell.

use std::collections::{BTreeMap, BTreeSet};

use super::aggregate::index;
use super::reads::reads;
use crate::programs::references::{References, variable};
use crate::programs::scan::Reader;

/// Beginnings and ends of branches and loops.
const BEGIN: [&str; 6] = ["IF", "SWITCH", "WHILE", "LOOP", "FOR", "REPEAT"];
const END: [&str; 6] = ["ENDIF", "ENDSWITCH", "ENDWHILE", "ENDLOOP", "ENDFOR", "UNTIL"];

/// `[DECL] [GLOBAL] [TYPE] NAME[n][.COMPONENT] =`: the name, and true where it is a component alone that is set. The reader ends behind the mark.
pub(super) fn assigned(reader: &mut Reader<'_>) -> Option<(String, bool)> {
    let mut name = String::new();
    while let Some(word) = reader.name() {
        reader.at += 1;
        name = word + &index(reader);
    }
    let component = reader.is_mark(b'.');
    while component && !reader.at_line_end() && !reader.is_mark(b'=') {
        reader.at += 1;
    }
    let is_one = !name.is_empty() && reader.take_mark(b'=') && !reader.is_mark(b'=');
    is_one.then_some((name, component))
}

/// The numbers of an element of an array, where its name is that of the pattern with numbers in the place of words.
pub(super) fn matching(name: &str, pattern: &str) -> Option<Vec<i64>> {
    let (array, indices) = name.strip_suffix(']')?.split_once('[')?;
    let (wanted, pattern) = pattern.strip_suffix(']')?.split_once('[')?;
    let numbers = indices.split(',').map(|n| n.parse().ok()).collect::<Option<Vec<i64>>>()?;
    let patterns: Vec<&str> = pattern.split(',').collect();
    let same = array == wanted
        && patterns.len() == numbers.len()
        && patterns.iter().zip(&numbers).all(|(p, n)| p.parse::<i64>().map_or(true, |p| p == *n));
    same.then_some(numbers)
}

/// How often a name is set: in data, in statements, and of these in branches and loops; by its components, or by a call.
#[derive(Debug, Clone, Copy, Default)]
struct Times {
    data: usize,
    statements: usize,
    nested: usize,
    parts: usize,
}

/// All names that are set in the files.
#[derive(Debug, Default)]
pub(super) struct Assigned {
    times: BTreeMap<String, Times>,
    /// Elements of arrays whose index is computed: any of the array may be meant.
    any_of: BTreeSet<String>,
    routines: usize,
    /// Jumps from statement to statement.
    jumps: usize,
}

impl Assigned {
    /// Looks through a file of data, or of statements.
    pub fn look_through(&mut self, mut reader: Reader<'_>, is_data: bool) {
        let mut depth = 0_usize;
        while !reader.done() {
            let of_all = isize::from(reader.ahead_is_word(0, "GLOBAL"));
            let is_one_of = |words: &[&str]| words.iter().any(|word| reader.ahead_is_word(of_all, word));
            depth = (depth + usize::from(is_one_of(&BEGIN))).saturating_sub(usize::from(is_one_of(&END)));
            self.jumps += usize::from(is_one_of(&["GOTO"]));
            self.routines += usize::from(is_one_of(&["DEF", "DEFFCT"]));
            self.beside(&mut reader);
            if let Some((name, component)) = assigned(&mut reader).filter(|(name, _)| !name.starts_with('$')) {
                if name.ends_with(']') && matching(&name, &name).is_none() {
                    self.any_of.insert(name.clone());
                }
                let times = self.times.entry(name).or_default();
                times.parts += usize::from(component);
                times.nested += usize::from(depth > 0);
                *(if is_data { &mut times.data } else { &mut times.statements }) += 1;
            }
            reader.skip_line();
        }
    }

    /// True for a name to which the files give something, be it to an element or a component.
    pub fn sets(&self, name: &str) -> bool {
        self.times.keys().any(|set| variable(set) == name)
    }

    /// What an interrupt or a trigger sets, `DO NAME=..`, whenever that is.
    fn beside(&mut self, reader: &mut Reader<'_>) {
        let start = reader.at;
        while !reader.at_line_end() {
            reader.at += 1;
            if reader.ahead_is_word(-1, "DO")
                && let Some((name, _)) = assigned(reader)
            {
                self.changes_somewhere(name);
            }
        }
        reader.at = start;
    }

    fn changes_somewhere(&mut self, name: String) {
        if name.ends_with(']') && matching(&name, &name).is_none() {
            self.any_of.insert(name);
        } else {
            self.times.entry(name).or_default().parts += 1;
        }
    }

    /// Parameters are what the call has; what calls change by reference changes, too.
    pub fn changed_by_calls(&mut self, references: &References) {
        let parameters = references.parameters().map(|parameter| parameter.name.clone());
        let changed = references.changed(|call, given| !reads(&call.routine, &given.which));
        parameters.chain(changed.into_keys()).for_each(|name| self.changes_somewhere(name));
    }

    /// True for a name whose value changes: as a parameter, by a component, beside its data, by an index that is computed, or by one of several
    /// statements, unless all of them are reached from top to bottom.
    pub fn changes(&self, name: &str) -> bool {
        let itself = self.times.get(name).is_some_and(|t| {
            let is_straight = self.routines <= 1 && self.jumps == 0 && t.nested == 0 && t.data == 0;
            t.parts > 0 || (t.statements > 0 && t.data + t.statements > 1 && !is_straight)
        });
        itself || self.any_of.iter().any(|any| matching(name, any).is_some())
    }
}
