//! One thing that statements set, and what they have set it to.

use std::collections::BTreeSet;

/// Values of which either may hold.
pub(super) trait Either {
    /// What is known where one or the other holds.
    fn either(&self, other: &Self) -> Self;
}

/// What may be so.
impl Either for bool {
    fn either(&self, other: &Self) -> Self {
        *self || *other
    }
}

/// Names, of which all may hold.
impl Either for BTreeSet<String> {
    fn either(&self, other: &Self) -> Self {
        self | other
    }
}

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

impl<V: Either + Clone + PartialEq> Held<V> {
    /// Not set by the routine.
    pub fn new(value: V) -> Self {
        Self { value, is_set: false, passed: Passed::nothing() }
    }

    /// A statement sets it.
    pub fn set(&mut self, value: V) {
        self.passed.note(&value);
        (self.value, self.is_set) = (value, true);
    }

    /// It may hold another value than the last one that it was set to: no statement sets this one.
    pub fn becomes(&mut self, value: V) {
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

    /// What the routine, and those that it has called, have set it to: each value once, or of very many what is known where any of them holds.
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

/// Values in whatever order, each of them once; of more than can be told apart what is known where any of them holds.
#[derive(Debug, Clone, Eq)]
struct Passed<V> {
    values: Vec<V>,
    /// True where the only value stands for more.
    is_folded: bool,
}

impl<V: PartialEq> PartialEq for Passed<V> {
    fn eq(&self, other: &Self) -> bool {
        let has_same =
            || self.values.len() == other.values.len() && self.values.iter().all(|value| other.values.contains(value));
        self.is_folded == other.is_folded && has_same()
    }
}

impl<V: Either + Clone + PartialEq> Passed<V> {
    fn nothing() -> Self {
        Self { values: Vec::new(), is_folded: false }
    }

    fn note(&mut self, value: &V) {
        if self.values.contains(value) {
            return;
        }
        self.values.push(value.clone());
        if self.is_folded || self.values.len() > MOST_PASSED {
            self.fold();
        }
    }

    fn fold(&mut self) {
        let values = std::mem::take(&mut self.values).into_iter();
        self.values.extend(values.reduce(|one, other| if one == other { one } else { one.either(&other) }));
        self.is_folded = true;
    }

    fn with(&self, other: &Self) -> Self {
        let mut all = self.clone();
        other.values.iter().for_each(|value| all.note(value));
        if other.is_folded && !all.is_folded {
            all.fold();
        }
        all
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `None` where it is not known.
    impl<V: Clone + PartialEq> Either for Option<V> {
        fn either(&self, other: &Self) -> Self {
            self.clone().filter(|own| other.as_ref() == Some(own))
        }
    }

    #[test]
    fn none_of_very_many_values_is_lost() {
        let names = |count: usize| (0..count).map(|k| format!("t{k}")).collect::<BTreeSet<_>>();
        let mut end = Held::new(BTreeSet::new());
        // Each alone, as where a program connects and disconnects one after another.
        (0..70).for_each(|k| end.set(BTreeSet::from([format!("t{k}")])));
        let union = |held: &Held<BTreeSet<String>>| held.passed().iter().flatten().cloned().collect::<BTreeSet<_>>();
        assert_eq!(union(&end), names(70));
        assert_eq!(union(&Held::new(BTreeSet::new()).behind_call(&end)), names(70));
        let mut more = Held::new(BTreeSet::from(["own".to_owned()]));
        more.or_passed_by(&end, |one, other| one | other);
        assert!(more.value.is_superset(&names(70)) && more.value.contains("own"), "{:?}", more.value);
        // What comes later is another thing passed.
        let mut later = end.clone();
        later.set(BTreeSet::from(["t99".to_owned()]));
        assert_ne!(later.at_top().behind_call(&later), end.at_top().behind_call(&end));
        assert_eq!(union(&later).len(), 71);
    }

    #[test]
    fn what_may_hold_is_nothing_that_was_passed() {
        let mut end = Held::new(true);
        end.set(false);
        end.becomes(true);
        assert_eq!((end.value, end.passed()), (true, &[false][..]));
        assert!(Held::new(false).behind_call(&end).value);
    }

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
