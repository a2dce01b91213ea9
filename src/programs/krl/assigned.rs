//! Variables that hold something else at one time than at another: which of it a motion finds, the text does not tell.

use std::collections::BTreeMap;

use super::aggregate::index;
use crate::programs::scan::{Reader, TokenKind};

/// Words behind which the text is not read from top to bottom.
const BRANCHES: [&str; 9] = ["IF", "SWITCH", "WHILE", "LOOP", "FOR", "REPEAT", "GOTO", "DEF", "DEFFCT"];

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

/// Parameters in the rest of a line, `NAME :IN`: they are what the call has.
fn parameters(reader: &Reader<'_>) -> Vec<String> {
    let line = (0..).take_while(|&n| reader.ahead(n).is_some_and(|t| t.kind != TokenKind::LineEnd));
    let names = line.filter(|&n| reader.ahead_is_mark(n + 1, b':')).filter_map(|n| reader.ahead(n));
    names.map(|t| String::from_utf8_lossy(reader.text(t)).to_ascii_uppercase()).collect()
}

/// How often a name is set, in data and in statements.
#[derive(Debug, Clone, Copy, Default)]
struct Times {
    data: usize,
    statements: usize,
    components: usize,
}

/// All names that are set in the files.
#[derive(Debug, Default)]
pub(super) struct Assigned {
    times: BTreeMap<String, Times>,
    /// Routines, branches and loops.
    branches: usize,
}

impl Assigned {
    /// Looks through a file of data, or of statements.
    pub fn look_through(&mut self, mut reader: Reader<'_>, is_data: bool) {
        while !reader.done() {
            let first = reader.name().unwrap_or_default();
            let routine = usize::from(first == "GLOBAL");
            let word = if routine == 1 { reader.ahead(1).map(|t| reader.text(t).to_ascii_uppercase()) } else { None };
            let word = word.map_or(first, |w| String::from_utf8_lossy(&w).into_owned());
            self.branches += usize::from(BRANCHES.contains(&word.as_str()));
            if matches!(word.as_str(), "DEF" | "DEFFCT") {
                parameters(&reader).into_iter().for_each(|name| self.times.entry(name).or_default().components += 1);
            }
            if let Some((name, component)) = assigned(&mut reader).filter(|(name, _)| !name.starts_with('$')) {
                let times = self.times.entry(name).or_default();
                times.components += usize::from(component);
                *(if is_data { &mut times.data } else { &mut times.statements }) += 1;
            }
            reader.skip_line();
        }
    }

    /// True for a name whose value changes: as a parameter, by a component, beside its data, by an index that is computed, or by one of several statements, unless
    /// there is one routine that runs from top to bottom.
    pub fn changes(&self, name: &str) -> bool {
        let by_index = |other: &String| other != name && matching(name, other).is_some();
        let itself = self.times.get(name).is_some_and(|t| {
            let is_straight = self.branches <= 1 && t.data == 0;
            t.components > 0 || (t.statements > 0 && t.data + t.statements > 1 && !is_straight)
        });
        itself || (name.ends_with(']') && self.times.keys().any(by_index))
    }
}
