//! Correlation of noise by lag, and what it makes of a covariance.

use nalgebra::{DMatrix, SMatrix};

use super::raster::{LAGS, NONE, REACH, Raster, SIDE, UNKNOWN};
use crate::linalg::{sum_of_products, wide};

/// Least variance of a place in any direction over that with noise of the same size that is not correlated.
const LEAST_SHARE: f64 = 0.25;

/// Noise of two pixels by their lag (rows 0 to `REACH`, columns from -`REACH`), over the mean square of the residuals of a fit; the variance of
/// a pixel at the lag of none.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Correlation(pub(in crate::detect) [f64; LAGS]);

impl Correlation {
    /// Of noise that is not correlated.
    pub const WHITE: Self = {
        let mut lags = [0.0; LAGS];
        lags[NONE] = 1.0;
        Self(lags)
    };

    /// Of noise that was not correlated before a Gaussian smoothing.
    pub(in crate::detect) fn smoothed(sigma_px: f64) -> Self {
        let lag = |l: usize| {
            let (down, right) = ((l / SIDE) as f64, (l % SIDE) as f64 - f64::from(REACH));
            if l >= NONE { (-(down * down + right * right) / (4.0 * sigma_px * sigma_px)).exp() } else { 0.0 }
        };
        Self(std::array::from_fn(lag))
    }

    /// What it has beyond noise that is not correlated.
    pub(in crate::detect) fn less_white(mut self) -> Self {
        self.0[NONE] -= 1.0;
        self
    }

    /// `sum_l rho(l)` over all lags: the variance of the mean of many pixels, times their number.
    pub(in crate::detect) fn of_a_mean(&self) -> f64 {
        self.0[NONE] + 2.0 * self.0[NONE + 1..].iter().sum::<f64>()
    }

    /// `sum_p sum_l psi_p psi_(p + l)' rho(l)` over the influences `psi` of pixels: the covariance of what they are the influences on.
    pub(in crate::detect) fn covariance<const N: usize>(
        &self,
        raster: &Raster,
        psi: impl Fn(usize) -> [f64; N],
    ) -> SMatrix<f64, N, N> {
        let plane = raster.with_room(0, [0.0; N], psi);
        // Of each lag and its opposite, one stands for both.
        let weights: [(usize, f64); UNKNOWN] = std::array::from_fn(|lag| {
            (raster.ahead(NONE + lag), if lag == 0 { self.0[NONE] } else { 2.0 * self.0[NONE + lag] })
        });
        let mut sums = [[0.0; N]; N];
        wide(
            #[inline(always)]
            || raster.cells_of_pixels().for_each(|cell| add_pairs(&mut sums, &plane[cell..], &weights)),
        );
        let one_sided = SMatrix::<f64, N, N>::from_fn(|i, j| sums[i][j]);
        (one_sided + one_sided.transpose()) * 0.5
    }
}

/// Adds the products of the first row and the sum of those ahead of it by these weights.
#[inline(always)]
fn add_pairs<const N: usize>(sums: &mut [[f64; N]; N], rows: &[[f64; N]], weights: &[(usize, f64)]) {
    let mut ahead = [0.0; N];
    for (at, weight) in weights {
        let row = &rows[*at];
        (0..N).for_each(|i| ahead[i] += weight * row[i]);
    }
    for (sums, own) in sums.iter_mut().zip(&rows[0]) {
        (0..N).for_each(|i| sums[i] += own * ahead[i]);
    }
}

impl Raster<'_> {
    /// Adds the sum of the products of every two values of a plane at each lag, times `scale`.
    pub(super) fn add_products(&self, sums: &mut [f64; LAGS], scale: f64, plane: &[f64]) {
        wide(
            #[inline(always)]
            || {
                for (lag, sum) in sums.iter_mut().enumerate().skip(NONE) {
                    let ahead = &plane[self.ahead(lag)..];
                    *sum += scale * sum_of_products(&plane[..ahead.len()], ahead);
                }
            },
        );
    }
}

/// The covariance found, in no direction below [`LEAST_SHARE`] of that with noise that is not correlated: what a few windows say about large lags is
/// uncertain.
pub(in crate::detect) fn sound<const N: usize>(
    white: SMatrix<f64, N, N>,
    found: SMatrix<f64, N, N>,
) -> SMatrix<f64, N, N> {
    if (found - white * LEAST_SHARE).cholesky().is_some() {
        return found;
    }
    let [white, found] = [white, found].map(|m| DMatrix::from_iterator(N, N, m.iter().copied()));
    let root = white.cholesky().map_or_else(|| DMatrix::zeros(N, N), |factor| factor.l());
    let Some(inverse) = root.clone().try_inverse() else { return SMatrix::zeros() };
    let mut ratio = (&inverse * found * inverse.transpose()).symmetric_eigen();
    ratio.eigenvalues.iter_mut().for_each(|value| *value = value.max(LEAST_SHARE));
    let chosen = &root * ratio.recompose() * root.transpose();
    SMatrix::from_fn(|i, j| chosen[(i, j)])
}

#[cfg(test)]
mod tests {
    use nalgebra::Matrix2;

    use super::*;

    #[test]
    fn no_direction_is_below_a_share_of_white_noise() {
        let white = Matrix2::new(4.0, 1.0, 1.0, 2.0);
        // Right along one axis, negative along the other: as sums over measured lags may come out.
        let left = sound(white, Matrix2::new(8.0, 2.0, 2.0, -1.0)) - white * 0.25;
        assert!(left[(0, 0)] > 0.0 && left.determinant().abs() < 1e-12, "{left}");
        let kept = Matrix2::new(8.0, 2.0, 2.0, 4.0);
        assert!((sound(white, kept) - kept).norm() < 1e-12);
    }
}
