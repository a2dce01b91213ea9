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
//! Windows of few pixels need more than that: [`LagProducts::unfollowed`].

use nalgebra::Matrix2;

use super::fit::Saddle;
use super::model::PARAMETERS;
use crate::detect::correlated::{Correlation, LAGS, LagProducts, NONE, OddPart, Raster, Residuals, sound};
use crate::detect::shared::SYSTEMATIC_PX;

/// Where a fit follows more than this share of noise that reaches over all lags, its residuals say nothing about it.
const MOST_FOLLOWED: f64 = 0.6;
/// Windows whose response to noise is computed.
const RESPONSES: usize = 4;
/// Least pixels of a window, on average, beside which the lags are small.
const LEAST_PIXELS: f64 = 100.0;

/// Of the residuals of fitted corners in a picture that was smoothed so, if at all.
pub(super) fn correlation(corners: &[&Saddle], smoothing_px: Option<f64>) -> Correlation {
    let parts: Vec<OddPart> = corners.iter().map(|corner| OddPart::of(residuals(corner), corner.uv)).collect();
    let (mut seen, mut followed) = (LagProducts::NOTHING, [0.0; LAGS]);
    for (corner, part) in corners.iter().zip(&parts) {
        part.add_to(&mut seen, 1.0 / (corner.noise * corner.noise).max(f64::MIN_POSITIVE));
        part.add_followed(&mut followed);
    }
    let LagProducts { products, counts } = &seen;
    let mean = |sums: &[f64; LAGS], lag: usize| if counts[lag] > 0.0 { sums[lag] / counts[lag] } else { 0.0 };
    let means =
        |sums: &[f64; LAGS]| Correlation(std::array::from_fn(|lag| if lag < NONE { 0.0 } else { mean(sums, lag) }));
    let expected = smoothing_px.map_or(Correlation::WHITE, Correlation::smoothed);
    if counts[NONE] < LEAST_PIXELS * corners.len() as f64 {
        let some = parts.iter().step_by(parts.len().div_ceil(RESPONSES).max(1));
        return seen.unfollowed(some, &expected).map_or(expected, |found| found.correlation());
    }
    let all_followed = means(&followed).of_a_mean();
    if all_followed >= MOST_FOLLOWED {
        return expected;
    }
    let reach = (means(products).of_a_mean() / (1.0 - all_followed)).max(0.0);
    Correlation(std::array::from_fn(|lag| mean(products, lag) + reach * mean(&followed, lag)))
}

fn residuals(corner: &Saddle) -> Residuals {
    let (terms, leverages) = (corner.terms(), corner.leverages());
    Residuals {
        at: terms.iter().map(|term| term.at).collect(),
        values: terms.iter().map(|term| term.residual).collect(),
        followed: (0..PARAMETERS).map(|i| leverages.iter().map(|l| l[i]).collect()).collect(),
        beside: None,
    }
}

/// Covariance uu, uv, vv of a corner in px^2, with what the noise does not explain.
pub(super) fn covariance(correlation: &Correlation, corner: &Saddle) -> [f64; 3] {
    let [uu, uv, vv] = corner.white_covariance().unwrap_or([0.0; 3]);
    let white = Matrix2::new(uu, uv, uv, vv);
    let found = if *correlation == Correlation::WHITE { white } else { of_terms(correlation, corner) };
    let variance = corner.noise * corner.noise;
    let chosen = sound(white, found) * variance;
    let floor = SYSTEMATIC_PX * SYSTEMATIC_PX;
    [chosen[(0, 0)] + floor, chosen[(0, 1)], chosen[(1, 1)] + floor]
}

/// Of a corner's terms at a noise of 1.
fn of_terms(correlation: &Correlation, corner: &Saddle) -> Matrix2<f64> {
    let terms = corner.terms();
    let at: Vec<[i32; 2]> = terms.iter().map(|term| term.at).collect();
    correlation.covariance(&Raster::new(&at), |k| terms[k].influence)
}
