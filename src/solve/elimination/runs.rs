//! Places one after the other that go to places one after the other.

use nalgebra::DMatrix;

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

/// The upper triangle of the part of a square matrix that runs of places are taken to.
pub(super) fn upper_part(runs: &[Run], all: &DMatrix<f64>) -> DMatrix<f64> {
    let n = runs.iter().map(|run| run.length).sum();
    let mut part = DMatrix::zeros(n, n);
    let columns = runs.iter().flat_map(|run| run.into..run.into + run.length);
    for (j, (mut own, column)) in part.column_iter_mut().zip(columns).enumerate() {
        let of = all.column(column);
        for Run { from, into, length } in runs.iter().take_while(|run| run.from <= j) {
            let length = (*length).min(j + 1 - from);
            own.rows_mut(*from, length).copy_from(&of.rows(*into, length));
        }
    }
    part
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
