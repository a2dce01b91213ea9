//! Threads: what they set while they run, and what is set beside them.

use super::Script;
use super::active::Active;
use super::routines::called;
use crate::programs::flow::Followed;
use crate::programs::itinerary::Stands;
use crate::programs::scan::{Reader, TokenKind};

/// Statements behind which a thread runs no more; the name of its variable follows.
const ENDS: [&[u8]; 2] = [b"join", b"kill"];

/// What goes on around a thread, as one that runs beside it; no thread has a blank in its name.
fn around(thread: &str) -> String {
    format!("{thread} around")
}

/// The variable that holds the thread which is run by the call on whose name the reader stands: `variable = run name()`.
fn held_by(reader: &Reader<'_>) -> Option<String> {
    called(reader, -3).filter(|_| reader.ahead_is_mark(-2, b'='))
}

impl Script<'_> {
    /// A thread is run by the call of this name on which the reader stands.
    pub(super) fn runs(&mut self, name: String) {
        let before = self.now.clone();
        let threads = self.flow.meant(&name);
        // Beside the thread goes on what runs it.
        let mut all = before.0.beside.value.clone();
        all.extend(threads.iter().map(|thread| (around(thread), None)));
        self.now.0.beside.set(all);
        self.way.call(name, self.flow, &mut self.now);
        self.now = self.now.merged(&before, "a thread sets it");
        let mut all = self.now.0.beside.value.clone();
        let variable = held_by(&self.reader);
        // A variable holds the last one.
        all.values_mut().filter(|held| **held == variable).for_each(|held| *held = None);
        for thread in threads {
            all.remove(&around(&thread));
            let is_again = all.contains_key(&thread);
            all.insert(thread, variable.clone().filter(|_| !is_again));
        }
        self.now.0.beside.set(all);
        self.time_passes();
    }

    /// A thread has ended where its variable is joined or killed; the reader stands on the word. False for any other word.
    pub(super) fn ends_thread(&mut self, word: &[u8], next: Option<TokenKind>) -> bool {
        if !ENDS.contains(&word) || next != Some(TokenKind::Word) {
            return false;
        }
        if word == b"join" {
            self.time_passes();
        }
        let variable = called(&self.reader, 1);
        let mut all = self.now.0.beside.value.clone();
        all.retain(|_, held| held.is_none() || *held != variable);
        self.now.0.beside.set(all);
        true
    }

    /// A statement has set something that holds for all threads.
    pub(super) fn set_for_threads(&mut self) {
        for thread in self.now.0.beside.value.keys() {
            self.flow.passes(&around(thread), &self.now);
        }
    }

    /// Time passes in which all that goes on beside the text may set something.
    pub(super) fn time_passes(&mut self) {
        let nothing = (Active::new(None), Stands::default());
        for thread in self.now.0.beside.value.clone().into_keys() {
            if let Some((behind, _)) = self.flow.behind(&thread, &nothing) {
                self.now.0.or_set_by(&behind);
            }
        }
    }
}
