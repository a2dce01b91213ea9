//! Routines of a script.

use crate::programs::routines::Routines;
use crate::programs::scan::{Reader, TokenKind};

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
