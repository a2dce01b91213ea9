//! One thing that statements set, and what they have set it to.

/// One thing that statements set.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Held<V> {
    /// What holds.
    pub value: V,
    /// True where the routine has set it.
    is_set: bool,
    /// What the routine, and those that it has called, have set it to at one time or another.
    passed: Passed<V>,
}

impl<V: Clone + PartialEq> Held<V> {
    /// Not set by the routine.
    pub fn new(value: V) -> Self {
        Self { value, is_set: false, passed: Passed::nothing() }
    }

    /// A statement sets it.
    pub fn set(&mut self, value: V) {
        self.passed.note(&value);
        (self.value, self.is_set) = (value, true);
    }

    /// Where either holds, with what `differing` values leave.
    pub fn merged(&self, other: &Self, differing: impl FnOnce(&V, &V) -> V) -> Self {
        let value = if self.value == other.value { self.value.clone() } else { differing(&self.value, &other.value) };
        Self { value, is_set: self.is_set || other.is_set, passed: self.passed.with(&other.passed) }
    }

    /// The same at the top of a routine.
    pub fn at_top(&self) -> Self {
        Self::new(self.value.clone())
    }

    /// Behind a call of a routine that ended with `end`.
    pub fn behind_call(&self, end: &Self) -> Self {
        let last = if end.is_set { end } else { self };
        Self { passed: self.passed.with(&end.passed), ..last.clone() }
    }

    /// Notes what another has passed through.
    pub fn note(&mut self, other: &Self) {
        self.passed = self.passed.with(&other.passed);
    }

    /// What the routine, and those that it has called, have set it to, each value once.
    pub fn passed(&self) -> &[V] {
        &self.passed.values
    }

    /// The same where a routine that ends so may have been left at any statement, or goes on beside the text.
    pub fn or_passed_by(&mut self, end: &Self, differing: impl Fn(&V, &V) -> V) {
        for passed in &end.passed.values {
            let value = if self.value == *passed { passed.clone() } else { differing(&self.value, passed) };
            self.set(value);
        }
    }
}

/// Most values that are told apart.
const MOST_PASSED: usize = 64;

/// Values in whatever order, each of them once.
#[derive(Debug, Clone, Eq)]
struct Passed<V> {
    values: Vec<V>,
    /// True where there are more.
    has_more: bool,
}

impl<V: PartialEq> PartialEq for Passed<V> {
    fn eq(&self, other: &Self) -> bool {
        let has_same =
            || self.values.len() == other.values.len() && self.values.iter().all(|value| other.values.contains(value));
        self.has_more == other.has_more && (self.has_more || has_same())
    }
}

impl<V: Clone + PartialEq> Passed<V> {
    fn nothing() -> Self {
        Self { values: Vec::new(), has_more: false }
    }

    fn note(&mut self, value: &V) {
        if self.has_more || self.values.contains(value) {
            return;
        }
        match self.values.len() < MOST_PASSED {
            true => self.values.push(value.clone()),
            false => self.has_more = true,
        }
    }

    fn with(&self, other: &Self) -> Self {
        let mut all = self.clone();
        other.values.iter().for_each(|value| all.note(value));
        Self { has_more: all.has_more || other.has_more, ..all }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_routine_that_may_be_left_anywhere_leaves_any_of_what_it_has_set() {
        let either = |_: &Option<u8>, _: &Option<u8>| None;
        let mut end = Held::new(Some(0));
        for tool in [1, 2, 1] {
            end.set(Some(tool));
        }
        let held = |start: u8, end: &Held<Option<u8>>| {
            let mut held = Held::new(Some(start));
            held.or_passed_by(end, either);
            held.value
        };
        assert_eq!([held(1, &end), held(0, &end)], [None, None]);
        assert_eq!([held(1, &end.at_top()), held(0, &end.at_top())], [Some(1), Some(0)]);
        let mut once = Held::new(Some(0));
        once.set(Some(1));
        assert_eq!([held(1, &once), held(0, &once)], [Some(1), None]);
        assert_eq!(held(2, &Held::new(Some(3)).behind_call(&once)), None);
        assert_eq!(once.merged(&end, either), end.merged(&once, either));
    }
}
