//! Routines, branches, loops and calls of RAPID, and what instructions switch in them.

use super::Task;
use super::switched::{DISPLACES, OFFSETS, Switched, Watched, switch};
use crate::programs::flow::{Branching, Followed};
use crate::programs::scan::{Reader, TokenKind};

/// Beginnings of routines.
pub(super) const ROUTINES: [&str; 3] = ["PROC", "FUNC", "TRAP"];

/// Name of the routine that the reader stands on, and its place behind the first word: `PROC NAME(..)`, `FUNC TYPE NAME(..)`, `TRAP NAME`.
fn routine_name(reader: &Reader<'_>) -> (usize, String) {
    let behind = if reader.name().as_deref() == Some("FUNC") { 2 } else { 1 };
    let name = reader.ahead(behind).map(|t| String::from_utf8_lossy(reader.text(t)).to_ascii_uppercase());
    (behind as usize, name.unwrap_or_default())
}

impl Task<'_> {
    /// Routines, branches, program displacements and the check of configurations.
    ///
    /// Returns how many words behind the first belong to it.
    pub fn flow(&mut self, reader: &Reader<'_>, word: &str) -> usize {
        let line_has = |wanted: &[u8]| {
            let line = (1..).map_while(|k| reader.ahead(k).filter(|t| t.kind != TokenKind::LineEnd));
            line.into_iter().any(|t| reader.text(t).eq_ignore_ascii_case(wanted))
        };
        if let Some((which, state)) = switch(reader) {
            self.now.watched[which].set(state);
        }
        match word {
            w if ROUTINES.contains(&w) => {
                self.way.start_afresh();
                let state = |off: bool| if off { Watched::Unknown } else { Watched::On };
                let is_called = !line_has(b"main");
                let uncalled =
                    Switched::new(self.switched_off.map(state), self.displaces && is_called, self.offsets && is_called);
                self.flow.all_end(&mut self.now);
                let (behind, name) = routine_name(reader);
                self.flow.routine_begins(name, &mut self.now, &uncalled);
                // Modules that are not given may call it, too.
                self.now = self.now.merged(&uncalled, "");
                return behind;
            }
            "ENDPROC" | "ENDFUNC" | "ENDTRAP" => self.flow.routine_ends(&mut self.now),
            // Without THEN it is a statement of one line.
            "IF" if line_has(b"THEN") => self.begin(Branching::If),
            "TEST" => self.begin(Branching::Cases),
            "WHILE" | "FOR" => self.begin(Branching::Loop),
            "ELSE" | "ELSEIF" | "CASE" | "DEFAULT" => {
                self.way.next_branch();
                self.flow.next(&mut self.now, matches!(word, "ELSE" | "DEFAULT"));
            }
            "ENDIF" | "ENDTEST" | "ENDWHILE" | "ENDFOR" => {
                self.way.branches_end();
                self.flow.end(&mut self.now);
            }
            _ => self.step(word),
        }
        0
    }

    /// A statement without branches.
    pub fn step(&mut self, word: &str) {
        match word {
            "RETURN" => self.flow.returns(&self.now),
            w if DISPLACES.contains(&w) => self.now.displaced.set(true),
            w if OFFSETS.contains(&w) => self.now.offset.set(true),
            "PDISPOFF" => self.now.displaced.set(false),
            "EOFFSOFF" => self.now.offset.set(false),
            _ => self.flow.call(word.to_owned(), &mut self.now),
        }
    }

    fn begin(&mut self, kind: Branching) {
        self.way.branches_begin();
        self.flow.begin(&mut self.now, kind);
    }
}
