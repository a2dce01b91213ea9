//! What is said on stdout. A reader that has seen enough (`robotcal show .. | head`) ends the output, not the work.

use std::fmt;
use std::io::{self, ErrorKind, Write};
use std::sync::OnceLock;

use crate::diagnose::Weight;
use crate::output::corrections::FileFinding;

/// Why nothing more is said.
static ENDED: OnceLock<io::Error> = OnceLock::new();

/// Writes text to stdout, unless an earlier piece could not be written.
pub fn text(words: fmt::Arguments) {
    if ENDED.get().is_some() {
        return;
    }
    let mut out = io::stdout().lock();
    if let Err(error) = out.write_fmt(words).and_then(|()| out.flush()) {
        let _ = ENDED.set(error);
    }
}

/// Why the output did not reach its reader; none where the reader closed it.
pub fn failure() -> Option<&'static io::Error> {
    ENDED.get().filter(|e| e.kind() != ErrorKind::BrokenPipe)
}

/// Says findings of files with their codes, line by line.
pub fn findings<'a>(all: impl IntoIterator<Item = &'a FileFinding>) {
    for f in all {
        let rank = if f.weight == Weight::Gate { "GATE      " } else { "note      " };
        text(format_args!("{rank}{} [{}]\n", f.text, f.code));
    }
}

/// As `print!`, without a panic where stdout is closed.
macro_rules! say {
    ($($words:tt)*) => { $crate::cli::terminal::say::text(format_args!($($words)*)) };
}

/// As `println!`, without a panic where stdout is closed.
macro_rules! say_line {
    ($($words:tt)*) => { $crate::cli::terminal::say::text(format_args!("{}\n", format_args!($($words)*))) };
}

pub(in crate::cli) use {say, say_line};
