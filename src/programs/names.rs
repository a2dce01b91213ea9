//! Names that stand for something else in one module or routine than in another: each has a number behind it, which no message shows.

use super::program::Program;
use crate::error::Error;

/// Marks around the number: no text of a program has them in a name.
const BEGIN: char = '\u{1}';
const END: char = '\u{2}';

/// The name of a scope of its own.
pub(super) fn in_scope(name: &str, scope: usize) -> String {
    format!("{name}{BEGIN}{scope}{END}")
}

/// A text as it is without scopes.
pub(super) fn plain(text: &str) -> String {
    let mut is_inside = false;
    let is_shown = |c: &char| {
        is_inside = (is_inside || *c == BEGIN) && *c != END;
        !is_inside && *c != END
    };
    text.chars().filter(is_shown).collect()
}

/// All names of a program without scopes.
pub(super) fn plain_names(mut program: Program) -> Program {
    let shorten = |text: &mut String| *text = plain(text);
    program.targets.iter_mut().for_each(|target| shorten(&mut target.name));
    for left in &mut program.left {
        shorten(&mut left.name);
        shorten(&mut left.why.words);
        left.why.about.iter_mut().for_each(shorten);
        left.why.starts_from.iter_mut().for_each(|point| shorten(&mut point.name));
    }
    program
}

/// An error without scopes.
pub(super) fn plain_error(error: Error) -> Error {
    Error { what: plain(&error.what), ..error }
}
