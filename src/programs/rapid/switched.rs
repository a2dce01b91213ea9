//! What instructions switch for all moves behind them: checks of configurations, displacements.

use crate::programs::flow::{Followed, Held};
use crate::programs::scan::Reader;

/// Instructions that move all robtargets behind them, until `PDispOff`.
pub(super) const DISPLACES: [&str; 2] = ["PDISPON", "PDISPSET"];
/// Instructions that move external axes, until `EOffsOff`.
pub(super) const OFFSETS: [&str; 2] = ["EOFFSON", "EOFFSSET"];

/// Whether confdata count for a kind of move.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Watched {
    On,
    Off,
    /// Other routines switch it.
    Unknown,
}

/// What instructions switch for those behind them.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Switched {
    /// The checks of configurations.
    pub watched: [Held<Watched>; 2],
    /// True where a program displacement may be active.
    pub displaced: Held<bool>,
    /// True where an offset of external axes may be active.
    pub offset: Held<bool>,
}

impl Switched {
    /// Where nothing has switched anything yet.
    pub fn new(watched: [Watched; 2], displaced: bool, offset: bool) -> Self {
        Self { watched: watched.map(Held::new), displaced: Held::new(displaced), offset: Held::new(offset) }
    }
}

impl Followed for Switched {
    fn merged(&self, other: &Self, _: &str) -> Self {
        let watched = |k: usize| self.watched[k].merged(&other.watched[k], |_, _| Watched::Unknown);
        Self {
            watched: [0, 1].map(watched),
            displaced: self.displaced.merged(&other.displaced, |_, _| true),
            offset: self.offset.merged(&other.offset, |_, _| true),
        }
    }

    fn at_top(&self) -> Self {
        Self {
            watched: [0, 1].map(|k| self.watched[k].at_top()),
            displaced: self.displaced.at_top(),
            offset: self.offset.at_top(),
        }
    }

    fn behind_call(&self, end: &Self) -> Self {
        Self {
            watched: [0, 1].map(|k| self.watched[k].behind_call(&end.watched[k])),
            displaced: self.displaced.behind_call(&end.displaced),
            offset: self.offset.behind_call(&end.offset),
        }
    }
}

/// `ConfJ \Off`, `ConfL \On`: which check, and its state; the reader stands on the name.
pub(super) fn switch(reader: &Reader<'_>) -> Option<(usize, Watched)> {
    let which = match reader.name()?.as_str() {
        "CONFJ" => 0,
        "CONFL" => 1,
        _ => return None,
    };
    let state = reader.ahead(2).filter(|_| reader.ahead_is_mark(1, b'\\'))?;
    match reader.text(state).to_ascii_uppercase().as_slice() {
        b"ON" => Some((which, Watched::On)),
        b"OFF" => Some((which, Watched::Off)),
        _ => None,
    }
}
