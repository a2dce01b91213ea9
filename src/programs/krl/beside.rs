//! What interrupts and triggers run beside the text, at a time that it does not tell: `INTERRUPT DECL n WHEN .. DO ..`, `TRIGGER WHEN .. DO ..`.

use super::assigned::assigned;
use super::frames::{FrameIs, Frames, IpoMode};
use super::{Module, Now, unset};
use crate::programs::flow::{Either, Followed, Held};
use crate::programs::scan::Reader;

/// What such a statement sets itself (`DO $BASE=..`), without a routine.
const SET: [&str; 4] = ["$TOOL", "$BASE", "$IPO_MODE", "$ORI_TYPE"];
/// Statements during which time passes, beside motions and calls.
const WAITS: [&str; 2] = ["WAIT", "HALT"];
/// Why something is not known.
const ANY_TIME: &str = "an interrupt or a trigger may set it at any time";
const LEFT_ANYWHERE: &str = "an interrupt may have left the routine that sets it at any of its statements (RESUME)";
const RUN_AT_ANY_TIME: &str = "an interrupt or a trigger runs the routine at any time";

/// What such a line sets itself; the reader ends before the value.
fn is_set(reader: &mut Reader<'_>) -> Option<String> {
    while !reader.at_line_end() && !reader.ahead_is_word(-1, "DO") {
        reader.at += 1;
    }
    assigned(reader).map(|(name, _)| name).filter(|name| SET.contains(&name.as_str()))
}

fn at_some_time(frame: &mut Held<FrameIs>) {
    let other = frame.value.at_some_time(ANY_TIME);
    frame.set(other);
}

impl Module<'_> {
    /// A routine that begins with frames which the text does not tell.
    pub(super) fn begins_beside(&mut self, name: String) {
        let meant = self.flow.meant(&name);
        let top = self.top_beside(&meant);
        self.flow.begins_beside(&name, &top);
        meant.into_iter().for_each(|name| self.goes_on_beside(name));
    }

    /// What such a routine, by the names that are its own, begins with where the event comes here.
    fn top_beside(&self, names: &[String]) -> Now {
        let (mut active, stands) = self.now.clone();
        let [tool, base] = [&active.tool, &active.base].map(|is| is.value.at_some_time(RUN_AT_ANY_TIME));
        active.set(Frames { tool, base, ipo_mode: active.ipo_mode.value });
        active.off_zero.set(active.off_zero.value.either(&self.off_zero_anywhere));
        names.iter().for_each(|name| _ = active.beside.value.remove(name));
        (active, stands)
    }

    /// Behind a call of a routine, begun with `before`: an interrupt may have left it at any of its statements (`RESUME`).
    pub(super) fn may_have_been_left(&mut self, routine: &str, before: &Now) {
        let is_beside = self.now.0.beside.value.iter().any(|name| !SET.contains(&name.as_str()));
        if !self.resumes || !is_beside {
            return;
        }
        if let Some((end, _)) = self.flow.behind(routine, &unset()) {
            self.now.0 = self.now.0.merged(&before.0, LEFT_ANYWHERE);
            self.now.0.or_left_by(&end, LEFT_ANYWHERE);
        }
        self.way.go_beyond(&mut self.now.1);
    }

    /// A statement that sets a frame, or how it counts, at any time.
    pub(super) fn sets_beside(&mut self, reader: &mut Reader<'_>) {
        let start = reader.at;
        let name = is_set(reader);
        let matters = match name.as_deref() {
            Some("$IPO_MODE") => self.ipo_mode(reader) != IpoMode::Base,
            Some("$ORI_TYPE") => self.keeps_orientation(reader),
            _ => true,
        };
        reader.at = start;
        name.filter(|_| matters).into_iter().for_each(|name| self.goes_on_beside(name));
    }

    fn goes_on_beside(&mut self, name: String) {
        let mut all = self.now.0.beside.value.clone();
        all.insert(name);
        self.now.0.beside.set(all);
        self.time_passes();
    }

    /// Time passes in which all that goes on beside the text may set frames; a spline block is one motion.
    pub(super) fn time_passes(&mut self) {
        if self.spline.is_some() {
            return;
        }
        for name in self.now.0.beside.value.clone() {
            match name.as_str() {
                "$TOOL" => at_some_time(&mut self.now.0.tool),
                "$BASE" => at_some_time(&mut self.now.0.base),
                "$IPO_MODE" => self.now.0.ipo_mode.set(IpoMode::Tcp),
                "$ORI_TYPE" => self.now.0.keeps_orientation.set(true),
                routine => {
                    // The event may come here.
                    let top = self.top_beside(std::slice::from_ref(&name));
                    self.flow.begins_beside(routine, &top);
                    if let Some((behind, stands)) = self.flow.behind(routine, &self.now) {
                        self.now.0 = self.now.0.merged(&behind, ANY_TIME);
                        if stands != self.now.1 {
                            self.way.may_go(&mut self.now.1);
                        }
                    }
                }
            }
        }
    }

    /// The same where a statement waits.
    pub(super) fn waits(&mut self, word: &str) {
        if WAITS.contains(&word) {
            self.time_passes();
        }
    }
}
