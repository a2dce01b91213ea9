//! What interrupts and triggers run beside the text, at a time that it does not tell: `INTERRUPT DECL n WHEN .. DO ..`, `TRIGGER WHEN .. DO ..`.

use super::assigned::assigned;
use super::frames::{FrameIs, Frames};
use super::{Module, Now};
use crate::programs::flow::{Followed, Held};
use crate::programs::scan::Reader;

/// Frames that such a statement sets itself (`DO $BASE=..`), without a routine.
const FRAMES: [&str; 2] = ["$TOOL", "$BASE"];
/// Statements during which time passes, beside motions and calls.
const WAITS: [&str; 2] = ["WAIT", "HALT"];
/// Why something is not known.
const ANY_TIME: &str = "an interrupt or a trigger may set it at any time";
const RUN_AT_ANY_TIME: &str = "an interrupt or a trigger runs the routine at any time";

/// The frame that such a line sets itself.
fn frame_set(reader: &mut Reader<'_>) -> Option<String> {
    let start = reader.at;
    while !reader.at_line_end() && !reader.ahead_is_word(-1, "DO") {
        reader.at += 1;
    }
    let set = assigned(reader).map(|(name, _)| name);
    reader.at = start;
    set.filter(|name| FRAMES.contains(&name.as_str()))
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
        active.set(Frames { tool, base, tool_in_room: active.tool_in_room.value });
        names.iter().for_each(|name| _ = active.beside.value.remove(name));
        (active, stands)
    }

    /// A statement that sets a frame at any time.
    pub(super) fn sets_beside(&mut self, reader: &mut Reader<'_>) {
        frame_set(reader).into_iter().for_each(|name| self.goes_on_beside(name));
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
                routine => {
                    // The event may come here.
                    let top = self.top_beside(std::slice::from_ref(&name));
                    self.flow.begins_beside(routine, &top);
                    if let Some((behind, _)) = self.flow.behind(routine, &self.now) {
                        self.now.0 = self.now.0.merged(&behind, ANY_TIME);
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
