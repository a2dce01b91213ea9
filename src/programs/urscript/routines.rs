//! Routines of a script.

use crate::programs::routines::Routines;
use crate::programs::scan::{Reader, TokenKind};

/// Statements that end with `end`.
pub(super) const BLOCKS: [&[u8]; 6] = [b"def", b"thread", b"if", b"while", b"switch", b"for"];

/// Statements of a text that wait for their `end`, followed word by word.
#[derive(Default)]
pub(super) struct Blocks {
    /// Of each the number of the routine that it is; `None` for other statements.
    open: Vec<Option<usize>>,
    /// Routines so far.
    pub routines: usize,
}

impl Blocks {
    /// Follows a word; false for one that neither begins nor ends a statement.
    pub fn follow(&mut self, word: &[u8]) -> bool {
        if word == b"end" {
            self.open.pop();
            return true;
        }
        let begins = BLOCKS.contains(&word);
        if begins {
            let is_routine = matches!(word, b"def" | b"thread");
            self.open.push(is_routine.then_some(self.routines));
            self.routines += usize::from(is_routine);
        }
        begins
    }

    /// True within a statement that is no routine.
    pub fn is_nested(&self) -> bool {
        self.open.contains(&None)
    }

    /// The innermost routine, by its number.
    pub fn routine(&self) -> Option<usize> {
        self.open.iter().rev().copied().flatten().next()
    }
}

/// Notes the routines of a file.
pub(super) fn routines_in(mut reader: Reader<'_>, all: &mut Routines) {
    while !reader.done() {
        if matches!(reader.word(), Some(b"def" | b"thread"))
            && let Some(name) = called(&reader, 1)
        {
            all.declare(name, reader.index, false);
        }
        reader.at += 1;
    }
}

/// The word some tokens on.
pub(super) fn called(reader: &Reader<'_>, ahead: isize) -> Option<String> {
    let token = reader.ahead(ahead).filter(|t| t.kind == TokenKind::Word)?;
    Some(String::from_utf8_lossy(reader.text(token)).into_owned())
}
