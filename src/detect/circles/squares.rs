//! How well the blurred-edge model fits: sums of squared residuals over the pixels of a band.

use super::edge_model::{LANES, Pixels};
use crate::linalg::wide;

/// Sums over the pixels of a band.
#[derive(Debug, Default)]
pub(super) struct Squares {
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
    /// Of the residuals of the last evaluation; `noise` are the variances of a pixel on paper and on ink.
    pub fn of(pixels: &Pixels, noise: [f64; 2]) -> Self {
        wide(
            #[inline(always)]
            || Self::lanes(pixels, noise),
        )
    }

    #[inline(always)]
    fn lanes(pixels: &Pixels, noise: [f64; 2]) -> Self {
        let n = pixels.x.len();
        let (v_white, v_step) = (noise[0] as f32, (noise[1] - noise[0]) as f32);
        let (ink, mask, residual) = (&pixels.ink[..n], &pixels.mask[..n], &pixels.residual[..n]);
        let (mut plain, mut weighted) = ([0.0f32; LANES], [0.0f32; LANES]);
        let (mut on_paper, mut on_ink) = ([0.0f32; LANES], [0.0f32; LANES]);
        let (mut papers, mut inks) = ([0.0f32; LANES], [0.0f32; LANES]);
        for from in (0..n).step_by(LANES) {
            let lanes = from..from + LANES;
            let (ink, mask, residual) = (&ink[lanes.clone()], &mask[lanes.clone()], &residual[lanes]);
            for k in 0..LANES {
                let square = residual[k] * residual[k];
                let paper = if ink[k] < OFF_EDGE { mask[k] } else { 0.0 };
                let dark = if ink[k] > 1.0 - OFF_EDGE { mask[k] } else { 0.0 };
                plain[k] += square;
                weighted[k] += square / (v_white + v_step * ink[k]);
                on_paper[k] += paper * square;
                papers[k] += paper;
                on_ink[k] += dark * square;
                inks[k] += dark;
            }
        }
        let sum = |lanes: [f32; LANES]| lanes.iter().map(|v| f64::from(*v)).sum();
        Self {
            plain: sum(plain),
            weighted: sum(weighted),
            off_edge: [(sum(on_paper), sum(papers)), (sum(on_ink), sum(inks))],
        }
    }
}
