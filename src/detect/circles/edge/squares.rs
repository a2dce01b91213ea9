//! How well the blurred-edge model fits: sums of squared residuals over the pixels of a band.

use super::model::{Pixels, dot};
use crate::linalg::wide;

/// Sums over the pixels of a band.
#[derive(Debug, Default)]
pub struct Squares {
    /// Squared residuals, counts^2.
    pub plain: f64,
    /// The same in units of the noise.
    pub weighted: f64,
    /// Squared residuals on paper and on ink, away from the edge, with their pixel counts.
    pub off_edge: [(f64, f64); 2],
}

/// Coverage by ink up to which a pixel is paper, and from one less which on it is ink.
const OFF_EDGE: f32 = 0.02;

impl Squares {
    /// Of the residuals of the last evaluation.
    pub fn of(pixels: &mut Pixels) -> Self {
        wide(
            #[inline(always)]
            || Self::lanes(pixels),
        )
    }

    #[inline(always)]
    fn lanes(pixels: &mut Pixels) -> Self {
        let n = pixels.x.len();
        let (ink, mask, residual) = (&pixels.ink[..n], &pixels.mask[..n], &pixels.residual[..n]);
        let [on_paper, on_ink] = &mut pixels.work;
        let (on_paper, on_ink) = (&mut on_paper[..n], &mut on_ink[..n]);
        for i in 0..n {
            on_paper[i] = if ink[i] < OFF_EDGE { mask[i] } else { 0.0 };
            on_ink[i] = if ink[i] > 1.0 - OFF_EDGE { mask[i] } else { 0.0 };
        }
        let counts = [dot(on_paper, on_paper), dot(on_ink, on_ink)];
        for i in 0..n {
            on_paper[i] *= residual[i];
            on_ink[i] *= residual[i];
        }
        Self {
            plain: dot(residual, residual),
            weighted: dot(&pixels.weighted, &pixels.weighted),
            off_edge: [(dot(on_paper, on_paper), counts[0]), (dot(on_ink, on_ink), counts[1])],
        }
    }
}
