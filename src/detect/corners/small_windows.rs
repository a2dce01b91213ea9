//! Noise of neighbouring pixels from windows of which a fit follows much.
//!
//! Of noise `n` with the correlation `rho(l)` a fit leaves `r = (1 - H) n`, of which the odd part is `M n`, `M = D (1 - H)`. The covariance of two
//! pixels of it at lag l is
//!
//! ```text
//! c(l) = sum_l' A(l, l') rho(l'),   A(l, l') = mean over the pairs (a, b) at l of sum over the pairs (p, q) at l' of M_ap M_bq
//! ```
//!
//! linear in `rho`. What `M` hides is left as it was expected.

use nalgebra::{DMatrix, SMatrix, SVector};

use super::raster::{LAGS, NONE, OddPart, Raster};

/// Windows whose `A` is computed: they are much alike.
const RESPONSES: usize = 4;
/// By how much a correlation may differ from what was expected, one sigma.
const UNEXPECTED: f64 = 0.5;

/// The lag of none and those after it.
const UNKNOWN: usize = LAGS - NONE;

/// Sums over the pairs of pixels at every lag.
pub(super) struct Seen {
    /// Products of residuals.
    pub products: [f64; LAGS],
    /// How many.
    pub counts: [f64; LAGS],
}

/// Covariance by lag of the noise that left such residuals.
pub(super) fn unfollowed(parts: &[OddPart], seen: &Seen, expected: &[f64; LAGS]) -> Option<[f64; LAGS]> {
    let (mut sums, mut counts) = (SMatrix::<f64, UNKNOWN, UNKNOWN>::zeros(), SVector::<f64, UNKNOWN>::zeros());
    for part in parts.iter().step_by(parts.len().div_ceil(RESPONSES).max(1)) {
        add_response(part, &mut sums, &mut counts);
    }
    let expected = SVector::<f64, UNKNOWN>::from_column_slice(&expected[NONE..]);
    let mut normal = SMatrix::<f64, UNKNOWN, UNKNOWN>::identity() / UNEXPECTED.powi(2);
    let mut right = SVector::<f64, UNKNOWN>::zeros();
    for lag in (0..UNKNOWN).filter(|lag| counts[*lag] > 0.0 && seen.counts[NONE + lag] > 0.0) {
        let row = sums.row(lag).transpose() / counts[lag];
        let (count, products) = (seen.counts[NONE + lag], seen.products[NONE + lag]);
        // The variance of a mean of products of white residuals is one over their number, twice that at lag 0.
        let weight = if lag == 0 { 0.5 } else { 1.0 };
        right += row * (weight * (products - count * row.dot(&expected)));
        normal += row * row.transpose() * (weight * count);
    }
    let found = expected + normal.cholesky()?.solve(&right);
    Some(std::array::from_fn(|lag| lag.checked_sub(NONE).map_or(0.0, |k| found[k])))
}

/// Adds `M_ap M_bq` of all pairs of pixels of a corner.
fn add_response(part: &OddPart, sums: &mut SMatrix<f64, UNKNOWN, UNKNOWN>, counts: &mut SVector<f64, UNKNOWN>) {
    let ((all, leverages), odd) = (&part.all, &part.terms);
    let half = std::f64::consts::FRAC_1_SQRT_2;
    // `M'`: a column a pixel of the odd part.
    let mut m = DMatrix::from_fn(all.len(), odd.len(), |p, a| -part.leverages[a].dot(&leverages[p]));
    for (a, &[k, other]) in part.opposites.iter().enumerate() {
        m[(k, a)] += half;
        m[(other, a)] -= half;
    }
    let pixels = Raster::new(all);
    let pairs = Raster::new(odd);
    let mut add = |lag: usize, moved: &DMatrix<f64>| {
        for a in 0..odd.len() {
            sums[(0, lag)] += m.column(a).dot(&moved.column(a));
        }
        pairs.for_pairs(|at, a, b| sums[(at - NONE, lag)] += m.column(b).dot(&moved.column(a)));
    };
    add(0, &m);
    let mut moved = vec![DMatrix::zeros(all.len(), odd.len()); UNKNOWN];
    pixels.for_pairs(|lag, p, q| {
        let moved = &mut moved[lag - NONE];
        for a in 0..odd.len() {
            moved[(p, a)] += m[(q, a)];
            moved[(q, a)] += m[(p, a)];
        }
    });
    moved.iter().enumerate().skip(1).for_each(|(lag, moved)| add(lag, moved));
    counts[0] += odd.len() as f64;
    pairs.for_pairs(|at, _, _| counts[at - NONE] += 1.0);
}
