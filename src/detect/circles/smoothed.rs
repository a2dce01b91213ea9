//! A picture that is smoothed before its dots are measured, and what that does to the covariance.
//!
//! Sharpening and clipping give edges a shape that no blurred step has. A Gaussian of sigma `g` makes them one again: of a halo
//! narrower than `g` little is left, and a ramp that ends at full scale becomes round. It is isotropic, so it moves no centre.
//!
//! ```text
//! sum K^2 = 1 / (4 pi g^2)                     share of the variance of a pixel that is left
//! var     = var_white (4 pi g^2) S / sqrt(S^2 + g^2)     S: sigma of the edge in the smoothed picture
//! ```
//!
//! `var_white` is what least squares says that takes the noise for white. Its estimate is a sum of pixels with the weights `T`, the
//! derivative of the edge: a Gaussian of sigma `S` across it. Of independent noise before the smoothing its variance is
//! `sum (K * T)^2`, where white noise would give `sum K^2 sum T^2`; both sums are over Gaussians of the same area.

use std::f64::consts::PI;

use super::types::CircleDetection;
use crate::detect::Picture;

/// What a halo that clipping cuts off leaves beyond noise, px per axis; seen in rendered pictures.
const SYSTEMATIC_PX: f64 = 0.004;
/// Smoothings that are tried where edges are not blurred steps, px.
pub(super) const SMOOTHINGS_PX: [f64; 2] = [0.7, 1.0];
/// And the last one, for halos of strong sharpening, where no lattice of dots is found otherwise.
pub(super) const LAST_SMOOTHING_PX: f64 = 1.6;
/// Of the kernel, in sigmas.
const REACH: f64 = 4.0;

/// A copy of the picture, smoothed by a Gaussian of `sigma_px`; none of its pixels counts as saturated.
pub(in crate::detect) fn smoothed(picture: &Picture, sigma_px: f64) -> Picture {
    let kernel = kernel(sigma_px);
    let (width, height) = (picture.width, picture.height);
    let across = along_rows(&picture.pixels, width, &kernel);
    let pixels = transposed(&along_rows(&transposed(&across, width), height, &kernel), height);
    Picture { width, height, pixels, full_scale: f32::INFINITY }
}

/// Samples of a Gaussian with the sum 1.
fn kernel(sigma_px: f64) -> Vec<f32> {
    let reach = (REACH * sigma_px).ceil() as i32;
    let raw: Vec<f64> = (-reach..=reach).map(|k| (-0.5 * (f64::from(k) / sigma_px).powi(2)).exp()).collect();
    let sum: f64 = raw.iter().sum();
    raw.iter().map(|v| (v / sum) as f32).collect()
}

/// Every row with the kernel; beyond its ends it goes on with its last pixel.
fn along_rows(pixels: &[f32], width: usize, kernel: &[f32]) -> Vec<f32> {
    let reach = kernel.len() / 2;
    let mut padded = vec![0.0; width + 2 * reach];
    let mut out = vec![0.0; pixels.len()];
    for (row, out) in pixels.chunks_exact(width).zip(out.chunks_exact_mut(width)) {
        padded[reach..reach + width].copy_from_slice(row);
        padded[..reach].fill(row[0]);
        padded[reach + width..].fill(row[width - 1]);
        for (tap, weight) in kernel.iter().enumerate() {
            out.iter_mut().zip(&padded[tap..tap + width]).for_each(|(o, v)| *o += weight * v);
        }
    }
    out
}

fn transposed(pixels: &[f32], width: usize) -> Vec<f32> {
    let height = pixels.len() / width;
    (0..pixels.len()).map(|k| pixels[k % height * width + k / height]).collect()
}

/// By what the variance of a place exceeds that of noise that was white in the smoothed picture, where its edge has this blur.
pub(in crate::detect) fn variance_factor(edge_px: f64, sigma_px: f64) -> f64 {
    if sigma_px > 0.0 { edge_px / edge_px.hypot(sigma_px) / kept(sigma_px) } else { 1.0 }
}

/// Share of the variance of a pixel that is left.
fn kept(sigma_px: f64) -> f64 {
    1.0 / (4.0 * PI * sigma_px * sigma_px)
}

/// What was measured in the smoothed picture as it would be said of the picture itself: blur and noise are those before it, and
/// the covariances are those of noise that was white before it.
pub(super) fn as_before(mut found: CircleDetection, sigma_px: f64) -> CircleDetection {
    for f in &mut found.found {
        let edge = f.measured.blur_px;
        f.measured.widen(variance_factor(edge, sigma_px), SYSTEMATIC_PX);
        f.measured.blur_px = before(edge, sigma_px);
    }
    found.observations = found.found.iter().flat_map(super::types::Found::observations).collect();
    found.blur_px = before(found.blur_px, sigma_px);
    found.noise = found.noise.map(|n| n / kept(sigma_px).sqrt());
    found
}

fn before(blur_px: f64, sigma_px: f64) -> f64 {
    (blur_px * blur_px - sigma_px * sigma_px).max(0.0).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_edge_keeps_its_place_and_widens() {
        let step = |k: usize| if k % 40 < 17 { 20.0 } else { 220.0 };
        let picture = Picture { width: 40, height: 30, pixels: (0..1200).map(step).collect(), full_scale: 255.0 };
        let smooth = smoothed(&picture, 1.2);
        let row = &smooth.pixels[400..440];
        let (mut mass, mut first, mut second) = (0.0, 0.0, 0.0);
        for k in 8..26 {
            let (slope, at) = (f64::from(row[k + 1] - row[k]), k as f64 + 0.5);
            mass += slope;
            first += slope * at;
            second += slope * at * at;
        }
        let mean = first / mass;
        assert!((mass - 200.0).abs() < 0.1 && (mean - 16.5).abs() < 1e-3, "{mass} {mean}");
        // the sampled kernel, cut at four sigma
        assert!(((second / mass - mean * mean).sqrt() - 1.2).abs() < 0.01);
        assert_eq!(smooth.pixels[420], smooth.pixels[20]);
    }
}
