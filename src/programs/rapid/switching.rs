//! What instructions of RAPID switch for all behind them, followed through routines, branches and loops.

use super::switched::{DISPLACES, OFFSETS, Switched, Watched, switch};
use crate::programs::flow::{Branching, Flow, Followed, Places};
use crate::programs::itinerary::{Itinerary, Stands};
use crate::programs::routines::Routines;
use crate::programs::scan::{Reader, TokenKind};

/// Beginnings of routines.
pub(super) const ROUTINES: [&str; 3] = ["PROC", "FUNC", "TRAP"];

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
    now: Now,
    /// What held where the routine began, and what it has passed through since.
    top: Switched,
    flow: Flow<Now>,
}

impl Switching {
    /// With what the reading before found, and the routines of the files.
    pub fn new(known: Places<Now>, routines: &Routines) -> Self {
        let top = Switched::new([Watched::On; 2], false, false);
        let (now, flow) = ((top.clone(), Stands::default()), Flow::new(known).among(routines));
        Self { switched_off: [false; 2], displaces: false, offsets: false, now, top, flow }
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
        while !reader.done() {
            if let Some((which, Watched::Off)) = switch(&reader) {
                self.switched_off[which] = true;
            }
            let name = reader.name();
            let is_of = |all: [&str; 2]| name.as_ref().is_some_and(|word| all.contains(&word.as_str()));
            self.displaces |= is_of(DISPLACES);
            self.offsets |= is_of(OFFSETS);
            reader.at += 1;
        }
    }

    /// A statement that begins with a word.
    pub fn statement(&mut self, reader: &Reader<'_>, word: &str, way: &mut Itinerary) {
        let line_has = |wanted: &[u8]| {
            let line = (1..).map_while(|k| reader.ahead(k).filter(|t| t.kind != TokenKind::LineEnd));
            line.into_iter().any(|t| reader.text(t).eq_ignore_ascii_case(wanted))
        };
        if let Some((which, state)) = switch(reader) {
            self.now.0.watched[which].set(state);
        }
        match word {
            w if ROUTINES.contains(&w) => {
                way.start_afresh();
                let uncalled = (self.anything(!line_has(b"main")), Stands::default());
                self.flow.all_end(&mut self.now);
                self.flow.routine_begins(routine_name(reader), &mut self.now, &uncalled);
                // Modules that are not given may call it, too.
                self.now = self.now.merged(&uncalled, "");
                self.top = self.now.0.clone();
            }
            "ENDPROC" | "ENDFUNC" | "ENDTRAP" => self.flow.routine_ends(&mut self.now),
            "IF" => self.begin(Branching::If, way),
            "TEST" => self.begin(Branching::Cases, way),
            "WHILE" | "FOR" => self.begin(Branching::Loop, way),
            "ELSE" | "ELSEIF" | "CASE" | "DEFAULT" => {
                way.next_branch();
                self.flow.next(&mut self.now, matches!(word, "ELSE" | "DEFAULT"));
            }
            "ERROR" | "UNDO" | "BACKWARD" => {
                // From anywhere in the routine.
                self.flow.returns(&self.now);
                self.now.0 = self.now.0.clone().anywhere(&self.top);
                way.lose(&mut self.now.1);
            }
            "ENDIF" | "ENDTEST" | "ENDWHILE" | "ENDFOR" => self.branches_end(way),
            _ => self.step(word, way),
        }
        self.top.note(&self.now.0);
    }

    /// All that the routines of the files may have switched.
    fn anything(&self, is_displaced: bool) -> Switched {
        let state = |off: bool| if off { Watched::Unknown } else { Watched::On };
        Switched::new(self.switched_off.map(state), self.displaces && is_displaced, self.offsets && is_displaced)
    }

    /// `name:`, to which GOTO may come from anywhere in the routine.
    pub fn label(&mut self, way: &mut Itinerary) {
        let any = (self.anything(true), Stands::default());
        self.now = self.now.merged(&any, "");
        self.flow.arrives();
        way.lose(&mut self.now.1);
    }

    /// Behind a statement with branches, or a loop.
    pub fn branches_end(&mut self, way: &mut Itinerary) {
        way.branches_end();
        self.flow.end(&mut self.now);
    }

    /// A word within a statement: what it names may take place.
    pub fn within(&mut self, word: &str, way: &mut Itinerary) {
        let before = self.now.clone();
        self.step(word, way);
        self.now = self.now.merged(&before, "");
        self.top.note(&self.now.0);
    }

    /// A statement without branches.
    fn step(&mut self, word: &str, way: &mut Itinerary) {
        match word {
            "RETURN" => self.flow.returns(&self.now),
            "GOTO" => self.flow.goes_elsewhere(),
            w if DISPLACES.contains(&w) => self.now.0.displaced.set(true),
            w if OFFSETS.contains(&w) => self.now.0.offset.set(true),
            "PDISPOFF" => self.now.0.displaced.set(false),
            "EOFFSOFF" => self.now.0.offset.set(false),
            _ => way.call(word.to_owned(), &mut self.flow, &mut self.now),
        }
    }

    fn begin(&mut self, kind: Branching, way: &mut Itinerary) {
        way.branches_begin();
        self.flow.begin(&mut self.now, kind);
    }
}
