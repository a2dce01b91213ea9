//! What instructions of RAPID switch for all behind them, followed through routines, branches and loops.

use std::collections::BTreeSet;

use super::cycle::{AGAIN, Cycle};
use super::off_zero::external_axes;
use super::switched::{
    DISPLACES, INDEPENDENT, INDEPENDENT_ENDS, OFFSETS, Switched, Watched, locks, named_axis, switch,
};
use crate::programs::external::{OffZero, PutAnywhere};
use crate::programs::flow::{Branching, Flow, Followed, Places};
use crate::programs::itinerary::{Itinerary, Stands};
use crate::programs::routines::Routines;
use crate::programs::scan::{Reader, TokenKind};

/// Beginnings of routines.
pub(super) const ROUTINES: [&str; 3] = ["PROC", "FUNC", "TRAP"];

/// Ends of a handler of errors behind which its routine goes on: where it failed, and behind that.
const RETRY: &str = "RETRY";
const TRY_NEXT: &str = "TRYNEXT";
/// Instructions that do not fail.
const SURE: [&str; 7] = ["CONFJ", "CONFL", "EOFFSOFF", "EOFFSSET", "PDISPOFF", "PDISPSET", "SINGAREA"];

/// Words between statements, at which branches and loops begin and end.
const BRANCHES: [&str; 12] =
    ["IF", "TEST", "WHILE", "FOR", "ELSE", "ELSEIF", "CASE", "DEFAULT", "ENDIF", "ENDTEST", "ENDWHILE", "ENDFOR"];

/// The trap routine in `CONNECT .. WITH NAME`, on whose first word the reader stands.
fn connected(reader: &Reader<'_>) -> Option<String> {
    if !reader.ahead_is_word(0, "CONNECT") {
        return None;
    }
    let is_there = |k: &usize| reader.token(*k).is_some_and(|t| t.kind != TokenKind::Mark(b';'));
    let is_with = |k: &usize| reader.name_of(*k).is_some_and(|word| word == "WITH");
    let with = (reader.at..).take_while(is_there).find(is_with)?;
    reader.name_of(with + 1)
}

/// Words between that with which a routine begins and its name: `PROC NAME(..)`, `FUNC TYPE NAME(..)`, `TRAP NAME`.
pub(super) fn words_before_name(word: &str) -> usize {
    usize::from(word == "FUNC")
}

/// Name of the routine on whose first word the reader stands.
pub(super) fn routine_name(reader: &Reader<'_>) -> String {
    let behind = 1 + words_before_name(&reader.name().unwrap_or_default());
    reader.name_of(reader.at + behind).unwrap_or_default()
}

/// What instructions have switched, and where the robot stands.
pub(super) type Now = (Switched, Stands);

/// What instructions switch, where the text stands.
pub(super) struct Switching {
    /// True where a routine switches the check of configurations off: for moves of the joints, and on paths.
    switched_off: [bool; 2],
    /// True where a routine begins a program displacement, which holds in those that it calls.
    displaces: bool,
    /// The same of an offset of external axes.
    offsets: bool,
    /// True where a routine locks axis 4.
    locks: bool,
    /// Axes that routines move independently of the targets.
    independents: BTreeSet<String>,
    /// Where the texts put external axes.
    pub put_anywhere: PutAnywhere,
    /// External axes that the texts put elsewhere than at zero, at places that count as not known.
    pub off_zero_anywhere: OffZero,
    /// Trap routines of all texts that interrupts run.
    connected: BTreeSet<String>,
    now: Now,
    /// What held where the routine began, and what it has passed through since.
    top: Switched,
    /// What held where the handler of errors began that is being read: it is read as a routine of its own.
    handler: Option<Now>,
    cycle: Cycle,
    /// True behind a statement of the routine that may fail.
    may_have_failed: bool,
    flow: Flow<Now>,
}

impl Switching {
    /// With what the reading before found, and the routines of the files.
    pub fn new(known: Places<Now>, routines: &Routines) -> Self {
        let top = Switched::new([Watched::On; 2], [false; 3]);
        let (now, flow) = ((top.clone(), Stands::default()), Flow::new(known).among(routines));
        Self {
            switched_off: [false; 2],
            displaces: false,
            offsets: false,
            locks: false,
            independents: BTreeSet::new(),
            put_anywhere: PutAnywhere::default(),
            off_zero_anywhere: OffZero::default(),
            connected: BTreeSet::new(),
            now,
            top,
            handler: None,
            cycle: Cycle::default(),
            may_have_failed: false,
            flow,
        }
    }

    /// A file begins.
    pub fn file_begins(&mut self, file: usize) {
        self.flow.file_begins(file);
    }

    /// True for a name that means a routine of the files here: whatever it is, it is no instruction of the controller.
    pub fn has_routine(&self, name: &str) -> bool {
        self.flow.has_routine(name)
    }

    /// What holds here.
    pub fn now(&self) -> &Switched {
        &self.now.0
    }

    /// Where a move leaves the external axes.
    pub fn axes_are(&mut self, off_zero: OffZero) {
        if off_zero != *self.now.0.off_zero.value() {
            self.now.0.off_zero.set(off_zero);
            self.top.note(&self.now.0);
        }
    }

    /// Where the robot stands.
    pub fn stands(&mut self) -> &mut Stands {
        &mut self.now.1
    }

    /// What this reading found.
    pub fn found(self) -> Places<Now> {
        self.flow.found()
    }

    /// A text ends.
    pub fn all_end(&mut self) {
        self.flow.all_end(&mut self.now);
    }

    /// Which checks of configurations are switched off anywhere in a text, and whether a displacement is begun.
    pub fn look_through(&mut self, mut reader: Reader<'_>) {
        self.flow.file_begins(reader.index);
        while !reader.done() {
            if let Some((which, Watched::Off)) = switch(&reader) {
                self.switched_off[which] = true;
            }
            let name = reader.name();
            let is_of = |all: [&str; 2]| name.as_ref().is_some_and(|word| all.contains(&word.as_str()));
            self.displaces |= is_of(DISPLACES);
            self.offsets |= is_of(OFFSETS);
            self.locks |= locks(&reader) == Some(true);
            let is_independent = name.as_ref().is_some_and(|word| INDEPENDENT.contains(&word.as_str()));
            self.independents.extend(is_independent.then(|| named_axis(&reader)));
            external_axes(&mut self.put_anywhere, &mut reader);
            if is_independent {
                self.put_anywhere.note_all();
            }
            connected(&reader).iter().for_each(|trap| self.connected.extend(self.flow.meant(trap)));
            reader.at += 1;
        }
        self.off_zero_anywhere = self.put_anywhere.off_zero();
    }

    /// A statement that begins with a word.
    pub fn statement(&mut self, reader: &Reader<'_>, word: &str, way: &mut Itinerary) {
        if let Some((which, state)) = switch(reader) {
            self.now.0.watched[which].set(state);
        }
        if let Some(is_locked) = locks(reader) {
            self.now.0.locked.set(is_locked);
        }
        if let Some(trap) = connected(reader) {
            let mut all = self.now.0.beside.value().clone();
            all.extend(self.flow.meant(&trap));
            self.now.0.beside.set(all);
        }
        if BRANCHES.contains(&word) {
            self.next_begins();
        }
        match word {
            w if ROUTINES.contains(&w) => {
                way.start_afresh();
                self.routine_begins(reader, word);
            }
            "ENDPROC" | "ENDFUNC" | "ENDTRAP" => {
                self.part_ends();
                self.flow.routine_ends(&mut self.now);
            }
            "IF" => self.begin(Branching::If, way),
            "TEST" => self.begin(Branching::Cases, way),
            "WHILE" | "FOR" => {
                self.cycle.loops(reader.ahead_is_word(1, "TRUE") && reader.ahead_is_word(2, "DO"));
                self.begin(Branching::Loop, way);
            }
            "ELSE" | "ELSEIF" | "CASE" | "DEFAULT" => {
                way.next_branch();
                self.flow.next(&mut self.now, matches!(word, "ELSE" | "DEFAULT"));
            }
            "ERROR" | "UNDO" | "BACKWARD" => self.handler_begins(word, way),
            "ENDIF" | "ENDTEST" | "ENDWHILE" | "ENDFOR" => self.branches_end(way),
            _ => self.step(reader, word, way),
        }
        self.top.note(&self.now.0);
    }

    /// A routine begins: from where the files call it, and from anywhere, as modules that are not given may call it, too.
    fn routine_begins(&mut self, reader: &Reader<'_>, word: &str) {
        let mut line = (1..).map_while(|k| reader.ahead(k).filter(|t| t.kind != TokenKind::LineEnd));
        let is_main = line.any(|t| reader.text(t).eq_ignore_ascii_case(b"main"));
        let uncalled = (self.anything(!is_main), Stands::default());
        self.flow.all_end(&mut self.now);
        self.flow.routine_begins(routine_name(reader), &mut self.now, &uncalled);
        self.now = self.now.merged(&uncalled, "");
        self.cycle.begins(is_main && !self.flow.is_called(&routine_name(reader)));
        if self.cycle.is_main {
            self.now.1 = Stands::begin();
            if let Some((left, stands)) = self.flow.passed(AGAIN) {
                self.now.0.moves_on_from(left);
                self.now.1 = self.now.1.merged(stands, "");
            }
        }
        self.top = self.now.0.clone();
        (self.handler, self.may_have_failed) = (None, false);
        if word == "TRAP" {
            // Interrupts wait for its end.
            self.now.0.beside.begin(BTreeSet::new());
        }
    }

    /// A handler begins, which is come to from anywhere in the routine.
    fn handler_begins(&mut self, word: &str, way: &mut Itinerary) {
        self.part_ends();
        self.flow.returns(&self.now);
        self.now.0 = self.now.0.clone().anywhere(&self.top);
        way.lose(&mut self.now.1);
        if word == "ERROR" {
            self.flow.arrives();
            let top = self.now.at_top();
            self.handler = Some(std::mem::replace(&mut self.now, top));
        }
    }

    /// All that the routines of the files may have switched.
    fn anything(&self, is_displaced: bool) -> Switched {
        let state = |off: bool| if off { Watched::Unknown } else { Watched::On };
        let on = [self.displaces, self.offsets, self.locks].map(|on| on && is_displaced);
        let mut any = Switched::new(self.switched_off.map(state), on);
        // What ran before may have left them anywhere.
        any.off_zero.begin(self.off_zero_anywhere.clone());
        if is_displaced {
            any.beside.begin(self.connected.clone());
            any.independent.begin(self.independents.clone());
        }
        any
    }

    /// The body of a routine, or its handler of errors, is read to its end.
    fn part_ends(&mut self) {
        let is_endless = self.cycle.is_endless && self.handler.is_none();
        self.goes_on_behind_failure();
        self.now = self.since_routine_began();
        self.handler = None;
        if !is_endless {
            self.begins_again();
        }
    }

    /// What holds here seen from the routine, in its handler as well.
    fn since_routine_began(&self) -> Now {
        self.handler.as_ref().map_or_else(|| self.now.clone(), |begun| begun.behind_call(&self.now))
    }

    /// What interrupts and the handler of errors may have done before a statement, or a move, of this name.
    pub fn before(&mut self, word: &str, way: &Itinerary) {
        self.goes_on_behind_failure();
        let may_fail = !SURE.contains(&word);
        if may_fail {
            self.goes_on_from(RETRY);
        }
        self.may_have_failed = may_fail;
        for trap in self.now.0.beside.value().clone() {
            self.flow.begins_beside(&trap, &self.now);
            if let Some((behind, stands)) = self.flow.behind(&trap, &self.now) {
                self.now.0 = self.now.0.merged(&behind, "");
                if stands != self.now.1 {
                    way.may_go(&mut self.now.1);
                }
            }
        }
        self.top.note(&self.now.0);
    }

    /// A routine of which the text does not tell which: what any of the files switches may hold behind it.
    pub fn runs_anything(&mut self) {
        self.now.0 = self.now.0.merged(&self.anything(true), "");
        self.top.note(&self.now.0);
    }

    /// What is behind the last statement begins, in the text or where a branch or a loop ends.
    fn next_begins(&mut self) {
        self.goes_on_behind_failure();
        self.may_have_failed = false;
    }

    fn goes_on_behind_failure(&mut self) {
        if self.may_have_failed {
            self.goes_on_from(TRY_NEXT);
        }
    }

    /// The handler may have led here; errors in itself are those of the caller.
    fn goes_on_from(&mut self, end: &str) {
        if self.handler.is_none()
            && let Some(behind) = self.flow.behind_part(end, &self.now)
        {
            self.now = self.now.merged(&behind, "");
        }
    }

    /// `name:`, to which GOTO may come from anywhere in the routine.
    pub fn label(&mut self, way: &mut Itinerary) {
        let any = (self.anything(true), Stands::default());
        self.now = self.now.merged(&any, "");
        self.flow.arrives();
        self.cycle.is_endless = false;
        way.lose(&mut self.now.1);
    }

    /// Behind a statement with branches, or a loop.
    pub fn branches_end(&mut self, way: &mut Itinerary) {
        self.cycle.depth = self.cycle.depth.saturating_sub(1);
        self.next_begins();
        way.branches_end();
        self.flow.end(&mut self.now);
    }

    /// A word within a statement: what it names may take place.
    pub fn within(&mut self, reader: &Reader<'_>, word: &str, way: &mut Itinerary) {
        let before = self.now.clone();
        self.step(reader, word, way);
        self.now = self.now.merged(&before, "");
        self.top.note(&self.now.0);
    }

    /// A statement without branches.
    fn step(&mut self, reader: &Reader<'_>, word: &str, way: &mut Itinerary) {
        match word {
            "RETURN" => {
                self.begins_again();
                self.flow.returns(&self.since_routine_began());
            }
            "EXIT" if self.cycle.is_main => self.flow.goes_elsewhere(),
            "EXITCYCLE" if self.cycle.is_main => {
                self.begins_again();
                self.flow.goes_elsewhere();
            }
            "EXITCYCLE" => self.flow.passes(AGAIN, &(self.now.0.clone(), Stands::unknown())),
            RETRY | TRY_NEXT if self.handler.is_some() => self.flow.part_ends(word, &self.now),
            "RAISE" if self.handler.is_some() => self.raises(),
            "GOTO" => self.flow.goes_elsewhere(),
            w if DISPLACES.contains(&w) => self.now.0.displaced.set(true),
            w if OFFSETS.contains(&w) => self.now.0.offset.set(true),
            w if INDEPENDENT.contains(&w) => self.moves_independently(&named_axis(reader), true),
            INDEPENDENT_ENDS => self.moves_independently(&named_axis(reader), false),
            "PDISPOFF" => self.now.0.displaced.set(false),
            "EOFFSOFF" => self.now.0.offset.set(false),
            _ => {
                let before = self.now.clone();
                self.may_have_failed_within(word, RETRY, &before);
                way.call(word.to_owned(), &mut self.flow, &mut self.now);
                self.may_have_failed_within(word, TRY_NEXT, &before);
            }
        }
    }

    /// One axis is moved independently of the targets, or no longer.
    fn moves_independently(&mut self, axis: &str, is_moved: bool) {
        let mut all = self.now.0.independent.value().clone();
        match is_moved {
            true => _ = all.insert(axis.to_owned()),
            false => _ = all.remove(axis),
        }
        self.now.0.independent.set(all);
    }

    /// A routine that a statement calls, and that fails, hands its error on to the handler of this one, which goes on so: with what held
    /// before the call, or with anything that the routine has switched.
    fn may_have_failed_within(&mut self, routine: &str, end: &str, before: &Now) {
        if self.handler.is_some() || !self.flow.has_routine(routine) || self.flow.behind_part(end, &self.now).is_none()
        {
            return;
        }
        let nothing = (Switched::new([Watched::On; 2], [false; 3]), Stands::default());
        if let Some((left, _)) = self.flow.behind(routine, &nothing) {
            self.now.0 = self.now.0.merged(&before.0, "");
            self.now.0.or_left_by(&left);
        }
    }

    /// The handler hands the error on to that of the caller, which may go on with what this one has switched.
    fn raises(&mut self) {
        if self.handler.as_ref().is_some_and(|begun| begun.0.at_top() != self.now.0) {
            self.flow.returns(&self.since_routine_began());
        }
        self.flow.goes_elsewhere();
    }

    /// Behind the end of `main`, the program begins again with it.
    fn begins_again(&mut self) {
        if self.cycle.is_main && self.flow.is_reached() {
            self.flow.passes(AGAIN, &self.since_routine_began());
        }
    }

    fn begin(&mut self, kind: Branching, way: &mut Itinerary) {
        self.cycle.depth += 1;
        way.branches_begin();
        self.flow.begin(&mut self.now, kind);
    }
}
