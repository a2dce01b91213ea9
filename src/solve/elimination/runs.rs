//! Places one after the other that go to places one after the other.

/// So many places from one on go to those from another on.
#[derive(Debug, Clone)]
pub struct Run {
    /// First place that something is taken from.
    pub from: usize,
    /// First place that it goes to.
    pub into: usize,
    /// Number of places.
    pub length: usize,
}

/// Runs of pairs of places.
pub(super) fn runs(places: impl Iterator<Item = (usize, usize)>) -> Vec<Run> {
    let mut runs: Vec<Run> = Vec::new();
    for (from, into) in places {
        match runs.last_mut().filter(|r| (r.from + r.length, r.into + r.length) == (from, into)) {
            Some(run) => run.length += 1,
            None => runs.push(Run { from, into, length: 1 }),
        }
    }
    runs
}
