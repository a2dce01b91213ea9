//! What is known of a marker before its fit.

use super::normal::Normal;
use super::start::Start;
use super::state::{ANNULUS, CENTRE, DARK, INNER, LN_BLUR, LN_RATIO, SHAPE, THIRD};
use crate::detect::Picture;

/// Part of a predicted third harmonic to which it is good.
const THIRD_PART: f64 = 0.25;

/// Weights of what is known beforehand.
pub(super) struct Prior {
    weight: [f64; ANNULUS],
    /// Weight of the distance between the centres of inner and outer circle, which only perspective separates.
    concentric: f64,
}

impl Prior {
    pub fn of(start: &Start, picture: &Picture) -> Self {
        let mut weight = [0.0; ANNULUS];
        let inverse = |sigma: f64| 1.0 / (sigma * sigma);
        // The third harmonic of a distorted or foreshortened circle grows with its radius: half a radius per picture
        // width is that of a strongly distorted wide-angle lens.
        let third = match start.third {
            Some([a, b]) => THIRD_PART * a.hypot(b),
            None => 0.5 * start.ellipse.semi_axes()[0] / picture.width.max(picture.height) as f64,
        };
        let contrast = (start.paper - start.ink).abs().max(1.0);
        weight[THIRD..THIRD + 2].fill(inverse(third.max(1e-4)));
        weight[LN_BLUR] = inverse(start.blur_sigma);
        // a black offset changes the ink's share of the gradient by a part of it
        weight[DARK + 1..DARK + 3].fill(inverse(start.ink_slope * contrast));
        weight[LN_RATIO] = inverse(if start.tie_sigma.is_some() { 0.02 } else { 0.05 });
        if let Some(sigma) = start.shape_sigma {
            weight[SHAPE..SHAPE + 3].fill(inverse(sigma));
        }
        let apart = start.tie_sigma.unwrap_or(0.02 + 0.012 * start.ellipse.semi_axes()[0]);
        let concentric = if start.ratio.is_some() { inverse(apart) } else { 0.0 };
        Self { weight, concentric }
    }

    pub fn add_normal(&self, normal: &mut Normal) {
        (0..ANNULUS).for_each(|i| normal[i][i] += self.weight[i]);
        for a in 0..2 {
            normal[CENTRE + a][CENTRE + a] += self.concentric;
            normal[INNER + a][INNER + a] += self.concentric;
            normal[INNER + a][CENTRE + a] -= self.concentric;
        }
    }

    pub fn add_gradient(&self, travelled: &[f64; ANNULUS], gradient: &mut [f64; ANNULUS]) {
        (0..ANNULUS).for_each(|i| gradient[i] -= self.weight[i] * travelled[i]);
        for a in 0..2 {
            // the start is where they are expected
            let apart = self.concentric * (travelled[INNER + a] - travelled[CENTRE + a]);
            gradient[INNER + a] -= apart;
            gradient[CENTRE + a] += apart;
        }
    }
    /// Squares of what was travelled since the start, in units of what is known beforehand.
    pub fn squares(&self, travelled: &[f64; ANNULUS]) -> f64 {
        let own: f64 = self.weight.iter().zip(travelled).map(|(w, t)| w * t * t).sum();
        own + (0..2).map(|a| self.concentric * (travelled[INNER + a] - travelled[CENTRE + a]).powi(2)).sum::<f64>()
    }
}
