//! Covariance of corners where the noise of neighbouring pixels is correlated: smoothing, sharpening, compression.
//!
//! A corner moves by the sum over its pixels of influence times noise, c = sum psi_p n_p. With the correlation rho of two
//! pixels at a lag, its covariance is
//!
//! ```text
//! C = sigma^2 sum_p sum_l psi_p psi_(p + l)' rho(l)
//! ```
//!
//! rho is measured on the residuals of all corners of the picture together.

use super::fit::{Saddle, Term};

/// Lags looked at, px.
const REACH: i32 = 3;
const SIDE: usize = 2 * REACH as usize + 1;
const LAGS: usize = (REACH as usize + 1) * SIDE;

/// What print, lens and blur of other shapes leave beyond the noise, px per axis; seen on real boards after their
/// printing errors are taken out.
const SYSTEMATIC_PX: f64 = 0.015;

/// Correlation of the noise of two pixels by their lag; rows 0 to `REACH`, columns from -`REACH`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Correlation([f64; LAGS]);

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

    /// Calls `pair` with every two terms at a lag that is not zero, and its index.
    fn for_pairs(&self, mut pair: impl FnMut(usize, &Term, &Term)) {
        for term in self.terms {
            let cell = (term.at[1] - self.low[1]) * self.width + term.at[0] - self.low[0];
            for lag in REACH as usize + 1..LAGS {
                let (down, right) = ((lag / SIDE) as i32, (lag % SIDE) as i32 - REACH);
                let other = self.cells[(cell + down * self.width + right) as usize] as usize;
                if other > 0 {
                    pair(lag, term, &self.terms[other - 1]);
                }
            }
        }
    }
}

impl Correlation {
    /// Of the residuals of fitted corners.
    pub fn of<'a>(corners: impl Iterator<Item = &'a Saddle>) -> Self {
        let (mut sums, mut counts) = ([0.0; LAGS], [0.0; LAGS]);
        let (mut squares, mut pixels) = (0.0, 0.0);
        for corner in corners {
            let scale = 1.0 / (corner.noise * corner.noise).max(f64::MIN_POSITIVE);
            squares += scale * corner.terms.iter().map(|t| t.residual * t.residual).sum::<f64>();
            pixels += corner.terms.len() as f64;
            Raster::new(&corner.terms).for_pairs(|lag, a, b| {
                sums[lag] += scale * a.residual * b.residual;
                counts[lag] += 1.0;
            });
        }
        let mut correlation = [0.0; LAGS];
        for lag in REACH as usize + 1..LAGS {
            if counts[lag] > 0.0 && squares > 0.0 {
                correlation[lag] = sums[lag] / counts[lag] / (squares / pixels);
            }
        }
        Self(correlation)
    }

    /// Covariance uu, uv, vv of a corner in px^2, with what the noise does not explain.
    pub fn covariance(&self, corner: &Saddle) -> [f64; 3] {
        let mut sum = [0.0; 3];
        let mut add = |weight: f64, a: &Term, b: &Term| {
            let ([p, q], [r, s]) = (a.influence, b.influence);
            sum[0] += weight * p * r;
            sum[1] += weight * 0.5 * (p * s + q * r);
            sum[2] += weight * q * s;
        };
        corner.terms.iter().for_each(|t| add(1.0, t, t));
        Raster::new(&corner.terms).for_pairs(|lag, a, b| add(2.0 * self.0[lag], a, b));
        let variance = corner.noise * corner.noise;
        let floor = SYSTEMATIC_PX * SYSTEMATIC_PX;
        [variance * sum[0] + floor, variance * sum[1], variance * sum[2] + floor]
    }
}
