//! Copies of variables: `P1=P2` gives what `P2` holds there, whatever it gets later.

use super::{Module, Value};
use crate::programs::reason::{LeftReason, Why};

impl Module<'_> {
    /// What a statement gives `name`.
    pub(super) fn copied(&mut self, name: &str, value: Value) -> Value {
        self.outdated(name);
        let Value::Name(other) = &value else { return value };
        let held = self.resolved(&value).map(|(data, origin)| (data.clone(), origin.unwrap_or(other).to_owned()));
        match held {
            // A routine further on in the text may give it a value before.
            Err(why) if why.reason == LeftReason::Undeclared => {
                self.copies.entry(other.clone()).or_default().push(name.to_owned());
                value
            }
            held => Value::Copied(held),
        }
    }

    /// Copies of a name that gets its value behind them, in the same routine: what it held before, the text does not tell.
    fn outdated(&mut self, name: &str) {
        for copy in self.copies.remove(name).into_iter().flatten() {
            let words = format!("{copy} has what {name} held before it was set: the text does not tell what");
            let why = Why::of(&copy, LeftReason::Computed, words);
            if matches!(self.values.get(&copy), Some(Value::Name(other)) if other == name) {
                self.values.insert(copy, Value::Copied(Err(why)));
            }
        }
    }
}
