//! Noise of neighbouring pixels from windows of which a fit follows much: least squares of what [`super::response`] says.

use super::correlation::Correlation;
use super::raster::{NONE, UNKNOWN};
use super::residuals::{LagProducts, OddPart};
use super::response::{Lags, Response, Sums};

/// By how much a correlation may differ from what was expected, one sigma.
const UNEXPECTED: f64 = 0.5;
/// Squares, in units of their uncertainty, up to which what was seen counts nothing ([`Unfollowed::shrunk`]).
const NOTHING: f64 = UNKNOWN as f64 - 2.0;

impl LagProducts {
    /// The noise that left such residuals; `parts` are some of those that did, which are much alike. `None` where the equations have no solution.
    pub fn unfollowed<'a>(
        &self,
        parts: impl Iterator<Item = &'a OddPart>,
        expected: &Correlation,
    ) -> Option<Unfollowed> {
        let mut of_windows = Sums::NOTHING;
        parts.for_each(|part| of_windows.add(part));
        let expected = Lags::from_column_slice(&expected.0[NONE..]);
        let mut normal = Response::identity() / UNEXPECTED.powi(2);
        let mut right = Lags::zeros();
        self.compare(&of_windows, |row, (weight, count), products| {
            right += row * (weight * (products - count * row.dot(&expected)));
            normal += row * row.transpose() * (weight * count);
        });
        let beyond = normal.cholesky()?.solve(&right);
        Some(Unfollowed { expected, beyond, right })
    }

    /// True only where [`Self::unfollowed`] of white noise, shrunk, is white noise: what no noise explains of the squares is no less than nothing.
    pub fn is_white<'a>(&self, mut parts: impl Iterator<Item = &'a OddPart>) -> bool {
        let mut of_windows = Sums::NOTHING;
        let is_known = parts.all(|part| of_windows.add_white(part).is_some());
        let mut squares = 0.0;
        self.compare(&of_windows, |row, (weight, count), products| {
            squares += weight * (products - count * row[0]).powi(2) / count;
        });
        is_known && 0.5 * squares <= NOTHING
    }

    /// Calls `equation` for every lag with a mean pair of the windows, and the weight, number and products of those seen.
    fn compare(&self, of_windows: &Sums, mut equation: impl FnMut(Lags, (f64, f64), f64)) {
        let Sums { products, counts } = of_windows;
        for lag in (0..UNKNOWN).filter(|lag| counts[*lag] > 0.0 && self.counts[NONE + lag] > 0.0) {
            // The variance of a mean of products of white residuals is one over their number, twice that at lag 0.
            let weight = if lag == 0 { 0.5 } else { 1.0 };
            let row = products.row(lag).transpose() / counts[lag];
            equation(row, (weight, self.counts[NONE + lag]), self.products[NONE + lag]);
        }
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
        let part = 1.0 - NOTHING / chi2.max(f64::MIN_POSITIVE);
        self.counting(part.max(0.0))
    }

    fn counting(&self, part: f64) -> Correlation {
        let found = self.expected + self.beyond * part;
        Correlation(std::array::from_fn(|lag| lag.checked_sub(NONE).map_or(0.0, |k| found[k])))
    }
}
