//! What instructions switch for all moves behind them: checks of configurations, displacements.

use crate::programs::branches::Merged;
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
#[derive(Debug, Clone, Copy)]
pub(super) struct Switched {
    /// The checks of configurations.
    pub watched: [Watched; 2],
    /// True where a program displacement may be active.
    pub displaced: bool,
    /// True where an offset of external axes may be active.
    pub offset: bool,
}

impl Merged for Switched {
    fn merged(&self, other: &Self) -> Self {
        let alike = |k: usize| if self.watched[k] == other.watched[k] { self.watched[k] } else { Watched::Unknown };
        Self {
            watched: [0, 1].map(alike),
            displaced: self.displaced || other.displaced,
            offset: self.offset || other.offset,
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
