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

use super::fit::{Saddle, Term};
use super::model::Vector;

/// Lags looked at, px.
const REACH: i32 = 3;
const SIDE: usize = 2 * REACH as usize + 1;
const LAGS: usize = (REACH as usize + 1) * SIDE;

/// What print, lens and blur of other shapes leave beyond the noise, px per axis; seen on real boards after their
/// printing errors are taken out.
const SYSTEMATIC_PX: f64 = 0.015;

/// Where a fit follows more than this share of noise that reaches over all lags, its residuals say nothing about it.
const MOST_FOLLOWED: f64 = 0.6;
/// Least pixels of a window, on average: the lags must be small beside it.
const LEAST_PIXELS: f64 = 100.0;
/// Least variance of a corner over that with noise of the same size that is not correlated.
const LEAST_SHARE: f64 = 0.25;

/// Noise of two pixels by their lag (rows 0 to `REACH`, columns from -`REACH`), over the mean square of the residuals of a fit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Correlation {
    /// Variance of a pixel.
    variance: f64,
    /// Covariance by lag.
    lags: [f64; LAGS],
}

/// A window's pixels on their raster.
struct Raster<'a> {
    terms: &'a [Term],
    low: [i32; 2],
    width: i32,
    /// Index of the term plus one; 0 where the window has no pixel.
    cells: Vec<u32>,
}

impl<'a> Raster<'a> {
    fn new(terms: &'a [Term]) -> Self {
        let least = |axis: usize| terms.iter().map(|t| t.at[axis]).min().unwrap_or(0);
        let most = |axis: usize| terms.iter().map(|t| t.at[axis]).max().unwrap_or(0);
        // A margin on every side: no lag leaves the raster.
        let low = [least(0) - REACH, least(1)];
        let (width, height) = (most(0) - low[0] + REACH + 1, most(1) - low[1] + REACH + 1);
        let mut cells = vec![0; (width * height) as usize];
        for (k, term) in terms.iter().enumerate() {
            cells[((term.at[1] - low[1]) * width + term.at[0] - low[0]) as usize] = k as u32 + 1;
        }
        Self { terms, low, width, cells }
    }

    /// Index of the term of a pixel.
    fn find(&self, [x, y]: [i32; 2]) -> Option<usize> {
        let (i, j) = (x - self.low[0], y - self.low[1]);
        let inside = (0..self.width).contains(&i) && j >= 0;
        let cell = inside.then(|| self.cells.get((j * self.width + i) as usize)).flatten()?;
        (*cell as usize).checked_sub(1)
    }

    /// Calls `pair` with the index of a lag that is not zero and those of every two terms at it.
    fn for_pairs(&self, mut pair: impl FnMut(usize, usize, usize)) {
        for (k, term) in self.terms.iter().enumerate() {
            let cell = (term.at[1] - self.low[1]) * self.width + term.at[0] - self.low[0];
            for lag in REACH as usize + 1..LAGS {
                let (down, right) = ((lag / SIDE) as i32, (lag % SIDE) as i32 - REACH);
                let other = self.cells[(cell + down * self.width + right) as usize] as usize;
                if other > 0 {
                    pair(lag, k, other - 1);
                }
            }
        }
    }
}

impl Correlation {
    /// Of noise that is not correlated.
    pub const WHITE: Self = Self { variance: 1.0, lags: [0.0; LAGS] };

    /// Of noise that was not correlated before a Gaussian smoothing.
    fn smoothed(sigma_px: f64) -> Self {
        let lag = |l: usize| {
            let (down, right) = ((l / SIDE) as f64, (l % SIDE) as f64 - f64::from(REACH));
            if l > REACH as usize { (-(down * down + right * right) / (4.0 * sigma_px * sigma_px)).exp() } else { 0.0 }
        };
        Self { variance: 1.0, lags: std::array::from_fn(lag) }
    }

    /// Of the residuals of fitted corners in a picture that was smoothed; as the smoothing alone leaves it where they are too few.
    pub fn of<'a>(corners: impl Iterator<Item = &'a Saddle>, smoothing_px: f64) -> Self {
        let (mut covariance, mut followed, mut counts) = ([0.0; LAGS], [0.0; LAGS], [0.0; LAGS]);
        let (mut square, mut own, mut pixels, mut number) = (0.0, 0.0, 0.0, 1.0);
        for corner in corners {
            let scale = 1.0 / (corner.noise * corner.noise).max(f64::MIN_POSITIVE);
            let (terms, leverages) = odd_part(corner);
            number += 1.0;
            let product = |a: usize, b: usize| leverages[a].dot(&leverages[b]);
            for (k, term) in terms.iter().enumerate() {
                square += scale * term.residual * term.residual;
                own += product(k, k);
                pixels += 1.0;
            }
            Raster::new(&terms).for_pairs(|lag, a, b| {
                covariance[lag] += scale * terms[a].residual * terms[b].residual;
                followed[lag] += product(a, b);
                counts[lag] += 1.0;
            });
        }
        let mean = |sums: &[f64; LAGS], lag: usize| if counts[lag] > 0.0 { sums[lag] / counts[lag] } else { 0.0 };
        let all =
            |at_zero: f64, sums: &[f64; LAGS]| at_zero / pixels + 2.0 * (0..LAGS).map(|l| mean(sums, l)).sum::<f64>();
        let all_followed = all(own, &followed);
        if pixels < LEAST_PIXELS * number || all_followed >= MOST_FOLLOWED {
            return Self::smoothed(smoothing_px);
        }
        let reach = (all(square, &covariance) / (1.0 - all_followed)).max(0.0);
        let lag = |l: usize| mean(&covariance, l) + reach * mean(&followed, l);
        Self { variance: (square + reach * own) / pixels, lags: std::array::from_fn(lag) }
    }

    /// Covariance uu, uv, vv of a corner in px^2, with what the noise does not explain.
    pub fn covariance(&self, corner: &Saddle) -> [f64; 3] {
        let white = corner.white_covariance().unwrap_or([0.0; 3]);
        let found = if *self == Self::WHITE { white } else { sum(&corner.terms(), self) };
        // Never far below noise without correlation: what a few corners say about large lags is uncertain.
        let [white_trace, trace] = [white, found].map(|c| c[0] + c[2]);
        let chosen = if trace < LEAST_SHARE * white_trace { white.map(|c| LEAST_SHARE * c) } else { found };
        let variance = corner.noise * corner.noise;
        let floor = SYSTEMATIC_PX * SYSTEMATIC_PX;
        [variance * chosen[0] + floor, variance * chosen[1], variance * chosen[2] + floor]
    }
}

/// What is left of the residuals of a corner, and of their leverages, where those of the pixels opposite are taken off: another
/// shape of the edges than that of the model is the same on both sides and does not move the corner; noise is not.
fn odd_part(corner: &Saddle) -> (Vec<Term>, Vec<Vector>) {
    let (terms, leverages) = (corner.terms(), corner.leverages());
    let raster = Raster::new(&terms);
    let [sum_x, sum_y] = corner.uv.map(|c| (2.0 * c).round() as i32);
    let odd = terms.iter().zip(&leverages).filter_map(|(term, leverage)| {
        let other = raster.find([sum_x - term.at[0], sum_y - term.at[1]])?;
        let half = std::f64::consts::FRAC_1_SQRT_2;
        let residual = half * (term.residual - terms[other].residual);
        Some((Term { residual, ..*term }, half * (leverage - leverages.get(other)?)))
    });
    odd.unzip()
}

/// uu, uv and vv of a corner's terms at a noise of 1.
fn sum(terms: &[Term], noise: &Correlation) -> [f64; 3] {
    let mut sum = [0.0; 3];
    let mut add = |weight: f64, a: &Term, b: &Term| {
        let ([p, q], [r, s]) = (a.influence, b.influence);
        sum[0] += weight * p * r;
        sum[1] += weight * 0.5 * (p * s + q * r);
        sum[2] += weight * q * s;
    };
    terms.iter().for_each(|t| add(noise.variance, t, t));
    Raster::new(terms).for_pairs(|lag, a, b| add(2.0 * noise.lags[lag], &terms[a], &terms[b]));
    sum
}
