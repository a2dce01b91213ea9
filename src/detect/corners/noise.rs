//! Covariance of corners where the noise of neighbouring pixels is correlated: smoothing, sharpening, compression.
//!
//! A corner moves by the sum over its pixels of influence times noise, c = sum psi_p n_p. With the correlation rho of two
//! pixels at a lag, its covariance is
//!
//! ```text
//! C = sigma^2 sum_p sum_l psi_p psi_(p + l)' rho(l)
//! ```
//!
//! rho is measured on the odd part of the residuals of some corners of the picture together. A fit follows the noise, the more so where it is
//! correlated: with the derivatives h of fitted values by pixel values, whose mean at lag l is h(l), residuals have the covariance
//! c(l) = sigma^2 (rho(l) - L h(l)) for noise of a short range, L = sum_l rho(l), from which
//!
//! ```text
//! sigma^2 L = sum_l c(l) / (1 - sum_l h(l))
//! ```
//!
//! Windows of few pixels need more than that: [`super::small_windows`].

use nalgebra::Matrix2;

use super::fit::{Saddle, Term};
use super::model::PARAMETERS;
use super::raster::{LAGS, NONE, OddPart, REACH, Raster, SIDE};
use super::small_windows::{Seen, unfollowed};
use crate::detect::shared::SYSTEMATIC_PX;
use crate::linalg::{add_combination, sum_of_products, wide};

/// Where a fit follows more than this share of noise that reaches over all lags, its residuals say nothing about it.
const MOST_FOLLOWED: f64 = 0.6;
/// Least pixels of a window, on average, beside which the lags are small.
const LEAST_PIXELS: f64 = 100.0;
/// Least variance of a corner in any direction over that with noise of the same size that is not correlated.
const LEAST_SHARE: f64 = 0.25;

/// Noise of two pixels by their lag (rows 0 to `REACH`, columns from -`REACH`), over the mean square of the residuals of a fit; the variance of
/// a pixel at the lag of none.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Correlation([f64; LAGS]);

impl Correlation {
    /// Of noise that is not correlated.
    pub const WHITE: Self = {
        let mut lags = [0.0; LAGS];
        lags[NONE] = 1.0;
        Self(lags)
    };

    /// Of noise that was not correlated before a Gaussian smoothing.
    fn smoothed(sigma_px: f64) -> Self {
        let lag = |l: usize| {
            let (down, right) = ((l / SIDE) as f64, (l % SIDE) as f64 - f64::from(REACH));
            if l >= NONE { (-(down * down + right * right) / (4.0 * sigma_px * sigma_px)).exp() } else { 0.0 }
        };
        Self(std::array::from_fn(lag))
    }

    /// Of the residuals of fitted corners in a picture that was smoothed so, if at all.
    pub fn of(corners: &[&Saddle], smoothing_px: Option<f64>) -> Self {
        let (mut products, mut followed, mut counts) = ([0.0; LAGS], [0.0; LAGS], [0.0; LAGS]);
        let parts: Vec<OddPart> = corners.iter().map(|corner| OddPart::of(corner)).collect();
        for (corner, OddPart { terms, leverages, .. }) in corners.iter().zip(&parts) {
            let scale = 1.0 / (corner.noise * corner.noise).max(f64::MIN_POSITIVE);
            let raster = Raster::new(terms);
            let add = |sums: &mut [f64; LAGS], scale: f64, plane: &[f64]| add_products(sums, scale, plane, &raster);
            add(&mut products, scale, &raster.plane(|k| terms[k].residual));
            (0..PARAMETERS).for_each(|i| add(&mut followed, 1.0, &raster.plane(|k| leverages[k][i])));
            add(&mut counts, 1.0, &raster.plane(|_| 1.0));
        }
        let mean = |sums: &[f64; LAGS], lag: usize| if counts[lag] > 0.0 { sums[lag] / counts[lag] } else { 0.0 };
        let all = |sums: &[f64; LAGS]| mean(sums, NONE) + 2.0 * (NONE + 1..LAGS).map(|l| mean(sums, l)).sum::<f64>();
        let expected = smoothing_px.map_or(Self::WHITE, Self::smoothed);
        if counts[NONE] < LEAST_PIXELS * corners.len() as f64 {
            return unfollowed(&parts, &Seen { products, counts }, &expected.0).map_or(expected, Self);
        }
        let all_followed = all(&followed);
        if all_followed >= MOST_FOLLOWED {
            return expected;
        }
        let reach = (all(&products) / (1.0 - all_followed)).max(0.0);
        Self(std::array::from_fn(|lag| mean(&products, lag) + reach * mean(&followed, lag)))
    }

    /// Covariance uu, uv, vv of a corner in px^2, with what the noise does not explain.
    pub fn covariance(&self, corner: &Saddle) -> [f64; 3] {
        let white = corner.white_covariance().unwrap_or([0.0; 3]);
        let found = if *self == Self::WHITE { white } else { sum(&corner.terms(), self) };
        let chosen = at_least(LEAST_SHARE, white, found);
        let variance = corner.noise * corner.noise;
        let floor = SYSTEMATIC_PX * SYSTEMATIC_PX;
        [variance * chosen[0] + floor, variance * chosen[1], variance * chosen[2] + floor]
    }
}

/// A covariance that is in no direction below a share of that with noise that is not correlated: what a few corners say about large lags is
/// uncertain.
fn at_least(share: f64, white: [f64; 3], found: [f64; 3]) -> [f64; 3] {
    let [white, found] = [white, found].map(|[uu, uv, vv]| Matrix2::new(uu, uv, uv, vv));
    let root = white.cholesky().map_or_else(Matrix2::zeros, |factor| factor.l());
    let Some(inverse) = root.try_inverse() else { return [0.0; 3] };
    let mut ratio = (inverse * found * inverse.transpose()).symmetric_eigen();
    ratio.eigenvalues.iter_mut().for_each(|value| *value = value.max(share));
    let m = root * ratio.recompose() * root.transpose();
    [m[(0, 0)], m[(0, 1)], m[(1, 1)]]
}

/// Adds the sum of the products of every two values at each lag.
fn add_products(sums: &mut [f64; LAGS], scale: f64, plane: &[f64], raster: &Raster) {
    wide(
        #[inline(always)]
        || {
            for (lag, sum) in sums.iter_mut().enumerate().skip(NONE) {
                let ahead = &plane[raster.ahead(lag)..];
                *sum += scale * sum_of_products(&plane[..ahead.len()], ahead);
            }
        },
    );
}

/// uu, uv and vv of a corner's terms at a noise of 1.
fn sum(terms: &[Term], noise: &Correlation) -> [f64; 3] {
    let raster = Raster::new(terms);
    let [u, v] = [0, 1].map(|axis| raster.plane(|k| terms[k].influence[axis]));
    // Of each lag and its opposite, one stands for both.
    let mut moved = [&u, &v].map(|plane| vec![0.0; plane.len()]);
    wide(
        #[inline(always)]
        || {
            for (lag, correlation) in noise.0.iter().enumerate().skip(NONE) {
                let (ahead, weight) = (raster.ahead(lag), if lag == NONE { *correlation } else { 2.0 * correlation });
                add_combination(&mut moved[0], [&u[ahead..]], [weight]);
                add_combination(&mut moved[1], [&v[ahead..]], [weight]);
            }
            let mixed = sum_of_products(&u, &moved[1]) + sum_of_products(&v, &moved[0]);
            [sum_of_products(&u, &moved[0]), 0.5 * mixed, sum_of_products(&v, &moved[1])]
        },
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_direction_is_below_a_share_of_white_noise() {
        let white = [4.0, 1.0, 2.0];
        // Right along one axis, negative along the other: as sums over measured lags may come out.
        let [uu, uv, vv] = at_least(0.25, white, [8.0, 2.0, -1.0]);
        let left = [uu - 0.25 * white[0], uv - 0.25 * white[1], vv - 0.25 * white[2]];
        assert!(left[0] > 0.0 && (left[0] * left[2] - left[1] * left[1]).abs() < 1e-12, "{left:?}");
        let kept = at_least(0.25, white, [8.0, 2.0, 4.0]);
        assert!(kept.iter().zip([8.0, 2.0, 4.0]).all(|(a, b)| (a - b).abs() < 1e-12), "{kept:?}");
    }
}
