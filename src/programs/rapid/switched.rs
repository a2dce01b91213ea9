//! What instructions switch for all moves behind them: checks of configurations, displacements.

use std::collections::BTreeSet;

use crate::programs::external::OffZero;
use crate::programs::flow::{Either, Followed, Held};
use crate::programs::scan::{Reader, Token, TokenKind};

/// Instructions that move all robtargets behind them, until `PDispOff`.
pub(super) const DISPLACES: [&str; 2] = ["PDISPON", "PDISPSET"];
/// Instructions that move external axes, until `EOffsOff`.
pub(super) const OFFSETS: [&str; 2] = ["EOFFSON", "EOFFSSET"];

/// Instructions that move an axis independently of the targets, until `IndReset` (ABB, *Application manual Controller software*, Independent Axes).
pub(super) const INDEPENDENT: [&str; 4] = ["INDAMOVE", "INDCMOVE", "INDDMOVE", "INDRMOVE"];
/// Ends that of the axis which it names.
pub(super) const INDEPENDENT_ENDS: &str = "INDRESET";

/// Whether confdata count for a kind of move.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Watched {
    On,
    Off,
    /// Other routines switch it.
    Unknown,
}

impl Either for Watched {
    fn either(&self, other: &Self) -> Self {
        if self == other { *self } else { Self::Unknown }
    }
}

/// One thing that instructions switch.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Switch<V>(Held<V>);

impl<V: Either + Clone + PartialEq> Switch<V> {
    fn new(value: V) -> Self {
        Self(Held::new(value))
    }

    /// What holds.
    pub fn value(&self) -> &V {
        &self.0.value
    }

    /// What holds where the text begins.
    pub fn begin(&mut self, value: V) {
        *self = Self::new(value);
    }

    /// An instruction switches it.
    pub fn set(&mut self, value: V) {
        self.0.set(value);
    }

    /// Notes what another has passed through.
    fn note(&mut self, other: &Self) {
        self.0.note(&other.0);
    }

    /// What the routine, and those that it has called, have switched it to at one time or another; `None` where they have not.
    fn passed(&self) -> Option<V> {
        self.0.passed().iter().cloned().reduce(|one, other| one.either(&other))
    }

    /// The same where any statement of the routine may have been the last one: it began with `top`, which has noted all that it passed through.
    fn anywhere(mut self, top: &Self) -> Self {
        if let Some(passed) = top.passed() {
            self.0.becomes(self.value().either(&passed).either(top.value()));
        }
        self
    }

    /// The same where a routine that ends so may have been left at any of its statements.
    fn or_left_by(&mut self, end: &Self) {
        if let Some(passed) = end.passed() {
            self.set(self.value().either(&passed));
        }
    }

    fn merged(&self, other: &Self) -> Self {
        Self(self.0.merged(&other.0, V::either))
    }

    fn at_top(&self) -> Self {
        Self(self.0.at_top())
    }

    fn behind_call(&self, end: &Self) -> Self {
        Self(self.0.behind_call(&end.0))
    }
}

/// What instructions switch for those behind them.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Switched {
    /// The checks of configurations.
    pub watched: [Switch<Watched>; 2],
    /// True where a program displacement may be active.
    pub displaced: Switch<bool>,
    /// True where an offset of external axes may be active.
    pub offset: Switch<bool>,
    /// True where axis 4 may be locked, so that the tool turns as it can.
    pub locked: Switch<bool>,
    /// Axes that may be moved independently of the targets, as the instructions name them.
    pub independent: Switch<BTreeSet<String>>,
    /// External axes that do not stand at zero.
    pub off_zero: Switch<OffZero>,
    /// Trap routines that an interrupt may run at any time.
    pub beside: Switch<BTreeSet<String>>,
}

impl Switched {
    /// Where nothing has switched anything yet.
    pub fn new(watched: [Watched; 2], [displaced, offset, locked]: [bool; 3]) -> Self {
        let [displaced, offset, locked] = [displaced, offset, locked].map(Switch::new);
        Self {
            watched: watched.map(Switch::new),
            displaced,
            offset,
            locked,
            independent: Switch::new(BTreeSet::new()),
            off_zero: Switch::new(OffZero::default()),
            beside: Switch::new(BTreeSet::new()),
        }
    }

    /// Notes what another has passed through.
    pub fn note(&mut self, other: &Self) {
        self.watched.iter_mut().zip(&other.watched).for_each(|(own, other)| own.note(other));
        self.displaced.note(&other.displaced);
        self.offset.note(&other.offset);
        self.locked.note(&other.locked);
        self.independent.note(&other.independent);
        self.off_zero.note(&other.off_zero);
        self.beside.note(&other.beside);
    }

    /// The same where a routine that ends so may have been left at any of its statements.
    pub fn or_left_by(&mut self, end: &Self) {
        self.watched.iter_mut().zip(&end.watched).for_each(|(own, end)| own.or_left_by(end));
        self.displaced.or_left_by(&end.displaced);
        self.offset.or_left_by(&end.offset);
        self.locked.or_left_by(&end.locked);
        self.independent.or_left_by(&end.independent);
        self.off_zero.or_left_by(&end.off_zero);
        self.beside.or_left_by(&end.beside);
    }

    /// Where `main` begins again behind an end of it: axes that are moved independently of the targets go on so.
    pub fn moves_on_from(&mut self, end: &Self) {
        self.independent.begin(self.independent.value().either(end.independent.value()));
    }

    /// The same where any statement of the routine may have been the last one: it began with `top`, which has noted all that it passed through.
    pub fn anywhere(self, top: &Self) -> Self {
        let [joints, paths] = self.watched;
        Self {
            watched: [joints.anywhere(&top.watched[0]), paths.anywhere(&top.watched[1])],
            displaced: self.displaced.anywhere(&top.displaced),
            offset: self.offset.anywhere(&top.offset),
            locked: self.locked.anywhere(&top.locked),
            independent: self.independent.anywhere(&top.independent),
            off_zero: self.off_zero.anywhere(&top.off_zero),
            beside: self.beside.anywhere(&top.beside),
        }
    }
}

impl Followed for Switched {
    fn merged(&self, other: &Self, _: &str) -> Self {
        Self {
            watched: [0, 1].map(|k| self.watched[k].merged(&other.watched[k])),
            displaced: self.displaced.merged(&other.displaced),
            offset: self.offset.merged(&other.offset),
            locked: self.locked.merged(&other.locked),
            independent: self.independent.merged(&other.independent),
            off_zero: self.off_zero.merged(&other.off_zero),
            beside: self.beside.merged(&other.beside),
        }
    }

    fn at_top(&self) -> Self {
        Self {
            watched: self.watched.each_ref().map(Switch::at_top),
            displaced: self.displaced.at_top(),
            offset: self.offset.at_top(),
            locked: self.locked.at_top(),
            independent: self.independent.at_top(),
            off_zero: self.off_zero.at_top(),
            beside: self.beside.at_top(),
        }
    }

    fn behind_call(&self, end: &Self) -> Self {
        Self {
            watched: [0, 1].map(|k| self.watched[k].behind_call(&end.watched[k])),
            displaced: self.displaced.behind_call(&end.displaced),
            offset: self.offset.behind_call(&end.offset),
            locked: self.locked.behind_call(&end.locked),
            independent: self.independent.behind_call(&end.independent),
            off_zero: self.off_zero.behind_call(&end.off_zero),
            beside: self.beside.behind_call(&end.beside),
        }
    }
}

/// The axis that an instruction names, on which the reader stands: `IndAMove UNIT,AXIS ..`, `IndReset UNIT,AXIS ..`.
pub(super) fn named_axis(reader: &Reader<'_>) -> String {
    let ends = |k: &usize| [b';', b'\\'].iter().any(|mark| reader.token_is_mark(*k, *mark));
    let is_line_end = |t: &&Token| t.kind == TokenKind::LineEnd;
    let words = (reader.at + 1..).take_while(|k| !ends(k)).map_while(|k| reader.token(k)).filter(|t| !is_line_end(t));
    let text = words.map(|t| String::from_utf8_lossy(reader.text(t)).to_ascii_uppercase()).collect::<String>();
    text.split(',').take(2).collect::<Vec<_>>().join(",")
}

/// `SingArea \LockAxis4`, `SingArea \Off`: true where axis 4 is locked; the reader stands on the name.
pub(super) fn locks(reader: &Reader<'_>) -> Option<bool> {
    let is_switch = reader.ahead_is_word(0, "SINGAREA") && reader.ahead_is_mark(1, b'\\');
    is_switch.then(|| reader.ahead_is_word(2, "LOCKAXIS4"))
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
