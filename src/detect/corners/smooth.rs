//! A smoothing of known effect: Gaussian, on the raster of the pixels.

use crate::detect::Picture;
use crate::linalg::wide;

/// The picture smoothed by a Gaussian of `sigma_px`; nothing counts as clipped in it.
pub(super) fn smoothed(picture: &Picture, sigma_px: f64) -> Picture {
    let reach = (4.0 * sigma_px).ceil() as usize;
    let weight = |k: usize| (-0.5 * ((k as f64 - reach as f64) / sigma_px).powi(2)).exp();
    let total: f64 = (0..=2 * reach).map(weight).sum();
    let kernel: Vec<f32> = (0..=2 * reach).map(|k| (weight(k) / total) as f32).collect();
    let (width, height) = (picture.width, picture.height);
    let mut pixels = vec![0.0_f32; width * height];
    // A row with its ends drawn out on both sides.
    let mut row = vec![0.0_f32; width + 2 * reach];
    wide(
        #[inline(always)]
        || {
            for (y, out) in pixels.chunks_exact_mut(width).enumerate() {
                row.fill(0.0);
                for (k, weight) in kernel.iter().enumerate() {
                    let from = (y + k).saturating_sub(reach).min(height - 1) * width;
                    let values = &picture.pixels[from..from + width];
                    row[reach..].iter_mut().zip(values).for_each(|(sum, value)| *sum += weight * value);
                }
                let (first, last) = (row[reach], row[reach + width - 1]);
                row[..reach].fill(first);
                row[reach + width..].fill(last);
                for (k, weight) in kernel.iter().enumerate() {
                    out.iter_mut().zip(&row[k..]).for_each(|(sum, value)| *sum += weight * value);
                }
            }
        },
    );
    Picture { pixels, full_scale: f32::INFINITY, ..*picture }
}
