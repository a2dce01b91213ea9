//! Noise of neighbouring pixels from windows of which a fit follows much.
//!
//! Of noise `n` with the correlation `rho(l)` a fit leaves `r = (1 - H) n`, of which the odd part is `M n`, `M = D (1 - H)`. The covariance of two
//! pixels of it at lag l is
//!
//! ```text
//! c(l) = sum_l' A(l, l') rho(l'),   A(l, l') = mean over the pairs (a, b) at l of sum over the pairs (p, q) at l' of M_ap M_bq
//! ```
//!
//! linear in `rho`. With `H = U U'`, `V = D U` and `S_l`, which has a 1 where two pixels are at lag l or its opposite, the sums over pairs are
//!
//! ```text
//! tr(S_l D S_l' D') - 2 tr(V' S_l D S_l' U) + tr(V' S_l V  U' S_l' U) + tr(V' S_l V  K)
//! ```
//!
//! each pair counted twice. The last term is the noise of even pixels beside the window, in whose sums the noise of all lags adds up. What
//! `M` hides is left as it was expected.

use nalgebra::{DMatrix, DMatrixView, DVector, SMatrix, SVector};

use super::correlation::Correlation;
use super::raster::{LAGS, NONE, Raster, number};
use super::residuals::{OddPart, Residuals, Seen};

/// By how much a correlation may differ from what was expected, one sigma.
const UNEXPECTED: f64 = 0.5;
/// Share of its square that the odd part of an even column of `U` has at most.
const EVEN: f64 = 1e-6;

/// The lag of none and those after it.
const UNKNOWN: usize = LAGS - NONE;

type Response = SMatrix<f64, UNKNOWN, UNKNOWN>;
type Lags = SVector<f64, UNKNOWN>;

impl Seen {
    /// The noise that left such residuals; `parts` are some of those that did, which are much alike. `None` where the equations have no solution.
    pub fn unfollowed<'a>(
        &self,
        parts: impl Iterator<Item = &'a OddPart>,
        expected: &Correlation,
    ) -> Option<Unfollowed> {
        let (mut sums, mut counts) = (Response::zeros(), Lags::zeros());
        parts.for_each(|part| add_response(part, &mut sums, &mut counts));
        let expected = Lags::from_column_slice(&expected.0[NONE..]);
        let mut normal = Response::identity() / UNEXPECTED.powi(2);
        let mut right = Lags::zeros();
        for lag in (0..UNKNOWN).filter(|lag| counts[*lag] > 0.0 && self.counts[NONE + lag] > 0.0) {
            let row = sums.row(lag).transpose() / counts[lag];
            let (count, products) = (self.counts[NONE + lag], self.products[NONE + lag]);
            // The variance of a mean of products of white residuals is one over their number, twice that at lag 0.
            let weight = if lag == 0 { 0.5 } else { 1.0 };
            right += row * (weight * (products - count * row.dot(&expected)));
            normal += row * row.transpose() * (weight * count);
        }
        let beyond = normal.cholesky()?.solve(&right);
        Some(Unfollowed { expected, beyond, right })
    }
}

/// Noise by lag as expected, and what was seen beyond that.
pub(in crate::detect) struct Unfollowed {
    expected: Lags,
    beyond: Lags,
    right: Lags,
}

impl Unfollowed {
    /// As least squares has it.
    pub fn correlation(&self) -> Correlation {
        self.counting(1.0)
    }

    /// What was seen counts by the part that exceeds its own uncertainty (W. James and C. Stein 1961): with the squares `chi2` of it in units of
    /// that, over `d` lags, by `1 - (d - 2) / chi2`. Of white noise little more than white noise is left.
    pub fn shrunk(&self) -> Correlation {
        // Of the odd part a pixel and that opposite say the same.
        let chi2 = 0.5 * self.beyond.dot(&self.right);
        let part = 1.0 - (UNKNOWN as f64 - 2.0) / chi2.max(f64::MIN_POSITIVE);
        self.counting(part.max(0.0))
    }

    fn counting(&self, part: f64) -> Correlation {
        let found = self.expected + self.beyond * part;
        Correlation(std::array::from_fn(|lag| lag.checked_sub(NONE).map_or(0.0, |k| found[k])))
    }
}

/// Adds `M_ap M_bq` of all pairs of pixels of a window.
fn add_response(part: &OddPart, sums: &mut Response, counts: &mut Lags) {
    let columns = columns_with_odd_part(part);
    add_noise(part, sums, counts);
    // A row a column of `U`.
    let of = |Residuals { at, followed, .. }: &Residuals| {
        DMatrix::from_fn(columns.len(), at.len(), |i, p| followed[columns[i]][p])
    };
    let (u, v) = (of(&part.all), of(&part.odd));
    let (moved_u, moved_v) = (moved(&part.all.at, &u), moved(&part.odd.at, &v));
    let once = moved_v.transpose() * odd_of_all(part, columns.len(), &moved_u);
    let own = within(&v, &moved_v);
    let twice = own.tr_mul(&within(&u, &moved_u));
    let beside = part.all.beside.as_ref().map(|beside| {
        own.tr_mul(&DVector::from_fn(own.nrows(), |k, _| {
            beside[(columns[k % columns.len()], columns[k / columns.len()])]
        }))
    });
    for (lag, other) in (0..UNKNOWN).flat_map(|lag| (0..UNKNOWN).map(move |other| (lag, other))) {
        let pairs = if lag == 0 { 1.0 } else { 0.5 };
        let both = if other == 0 { 1.0 } else { 2.0 };
        let beside = beside.as_ref().map_or(0.0, |beside| both * beside[lag]);
        sums[(lag, other)] += pairs * (twice[(lag, other)] - 2.0 * once[(lag, other)] + beside);
    }
}

/// The odd part of `S_l m` for every lag, in columns.
fn odd_of_all(part: &OddPart, rows: usize, moved: &DMatrix<f64>) -> DMatrix<f64> {
    let half = std::f64::consts::FRAC_1_SQRT_2;
    let mut odd = DMatrix::zeros(rows * part.opposites.len(), UNKNOWN);
    for (lag, mut odd) in odd.column_iter_mut().enumerate() {
        let moved = &moved.as_slice()[lag * moved.nrows()..];
        for (odd, [pixel, opposite]) in odd.as_mut_slice().chunks_exact_mut(rows.max(1)).zip(&part.opposites) {
            let pairs = moved[pixel * rows..].iter().zip(&moved[opposite * rows..]);
            odd.iter_mut().zip(pairs).for_each(|(odd, (m, other))| *odd = half * (m - other));
        }
    }
    odd
}

/// `m S_l m'` for every lag, in columns.
fn within(m: &DMatrix<f64>, moved: &DMatrix<f64>) -> DMatrix<f64> {
    let mut products = DMatrix::zeros(m.nrows() * m.nrows(), UNKNOWN);
    for (mut product, moved) in products.column_iter_mut().zip(moved.column_iter()) {
        let moved = DMatrixView::from_slice(moved.as_slice(), m.nrows(), m.ncols());
        product.copy_from_slice((m * moved.transpose()).as_slice());
    }
    products
}

fn columns_with_odd_part(part: &OddPart) -> Vec<usize> {
    let square = |column: &[f64]| column.iter().map(|v| v * v).sum::<f64>();
    let is_odd = |k: &usize| square(&part.odd.followed[*k]) > EVEN * square(&part.all.followed[*k]);
    (0..part.odd.followed.len()).filter(is_odd).collect()
}

/// The part without a fit: `D S_l' D'`, in which the pixel opposite counts where it is as near.
fn add_noise(part: &OddPart, sums: &mut Response, counts: &mut Lags) {
    let at = |k: usize| part.all.at[k];
    let mut add = |lag: usize, a: usize, b: usize| {
        let ([p, _], [_, opposite]) = (part.opposites[a], part.opposites[b]);
        counts[lag] += 1.0;
        sums[(lag, lag)] += 1.0;
        if let Some(other) = number([0, 1].map(|axis| at(p)[axis] - at(opposite)[axis])) {
            sums[(lag, other - NONE)] -= 1.0;
        }
    };
    (0..part.opposites.len()).for_each(|a| add(0, a, a));
    Raster::new(&part.odd.at).for_pairs(|lag, a, b| add(lag - NONE, a, b));
}

/// `m S_l` for every lag, in columns; a column of `m` is a pixel.
fn moved(at: &[[i32; 2]], m: &DMatrix<f64>) -> DMatrix<f64> {
    let rows = m.nrows();
    let mut moved = DMatrix::zeros(m.len(), UNKNOWN);
    moved.column_mut(0).copy_from_slice(m.as_slice());
    let all = moved.as_mut_slice();
    Raster::new(at).for_pairs(|lag, p, q| {
        let moved = &mut all[(lag - NONE) * m.len()..][..m.len()];
        let mut add = |to: usize, from: usize| {
            let (into, of) = (&mut moved[to * rows..][..rows], &m.as_slice()[from * rows..][..rows]);
            into.iter_mut().zip(of).for_each(|(sum, value)| *sum += value);
        };
        add(p, q);
        add(q, p);
    });
    moved
}
