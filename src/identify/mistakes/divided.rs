//! Rows that are divided where something may have changed.

/// Parts of the rows at whose ends they are divided at first.
const PARTS: usize = 8;

/// Where `n` rows are divided: at the first row of every part, the first part included.
pub(in crate::identify) fn ends_of_parts(n: usize) -> impl Iterator<Item = usize> {
    (0..PARTS).map(move |k| k * n / PARTS)
}

/// Where rows are divided best, those that fit before it where `is_first`, else behind it, with how many stand on the wrong side.
pub(in crate::identify) fn divided(fits: &[bool], is_first: bool) -> (usize, usize) {
    let n = fits.len();
    let missed = |at: usize| fits.iter().enumerate().filter(|(k, fits)| **fits != ((*k < at) == is_first)).count();
    (0..=n).map(|at| (missed(at), at)).min().unwrap_or((n, n))
}
