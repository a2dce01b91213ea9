//! What the point spread makes of an edge beside the Gaussian that it is taken for, and what that does where paper is clipped.
//!
//! Of a point spread of variance `s^2` with the fourth cumulant `c4` the edge is, in its Edgeworth series with `H3 = u^3 - 3 u`,
//!
//! ```text
//! F(u) = Phi(u) + k H3(u) phi(u),  k = -c4 / (24 s^4)
//! ```
//!
//! The area of a pixel, a square at an angle `t` to the edge, has `c4 = -(cos^4 t + sin^4 t) / 120 px^4`, whatever the lens does: sharp edges have
//! a `k` of up to 0.05, at `s` = 0.42 px (a lens of 0.3 px) it is 0.011, and at 0.9 px 0.0005. The term is odd about the edge, and moves one that is seen
//! whole by nothing. Of one whose paper is clipped the foot alone is seen; it ends in `exp(-u^2 / 2)`, from which blur, step and place follow
//! together, and an error of its shape is one of all three. `d e / d k` is the least-squares response to the term over the pixels that are
//! seen: about `-2 s` where the light of paper is 1.2 times full scale, and `-12 s` at 1.8 times, whatever the blur.

use nalgebra::Vector2;

/// The fourth cumulant of the width of a pixel, px^4, over -24.
const OF_PIXEL: f64 = 1.0 / 2880.0;
/// Sigma of the width of a pixel, squared: no edge is sharper.
pub(super) const SHARPEST_SQUARE: f64 = 1.0 / 12.0;
/// Part of the term of a pixel that is not known: cumulants beyond the fourth, and pixels that do not see all of their area.
const UNKNOWN: f64 = 0.3;
/// Sigma of `k` of a lens: a disc of defocus with half of the variance of a Gaussian, or a quarter of the whole, has 0.003.
const OF_LENS: f64 = 0.001;

/// The term of the pixel in edges of a direction.
#[derive(Debug, Clone, Copy)]
pub struct PixelShape {
    /// `k s^4`, px^4; 0 where it moves nothing.
    strength: f64,
}

/// What the term adds to an edge of step 1.
#[derive(Debug, Clone, Copy)]
pub struct Added {
    pub share: f64,
    /// Derivative by `u`, and by the logarithm of the blur at this `u`.
    pub by_u: f64,
    pub by_blur: f64,
    /// Derivative by `k`.
    pub by_k: f64,
}

impl PixelShape {
    /// Of an edge with this unit vector across it, where paper is clipped.
    pub fn of(across: &Vector2<f64>, is_clipped: bool) -> Self {
        let strength = OF_PIXEL * (across.x.powi(4) + across.y.powi(4));
        Self { strength: if is_clipped { strength } else { 0.0 } }
    }

    pub fn is_nothing(&self) -> bool {
        self.strength == 0.0
    }

    /// At a blur of `s` px: `k`, and its derivative by `ln s`.
    fn strength(&self, blur_px: f64) -> (f64, f64) {
        let square = blur_px * blur_px;
        let k = self.strength / square.max(SHARPEST_SQUARE).powi(2);
        (k, if square > SHARPEST_SQUARE { -4.0 * k } else { 0.0 })
    }

    /// At `u` blurs beside the edge, where the normal density is `phi`.
    pub fn add(&self, u: f64, phi: f64, blur_px: f64) -> Added {
        let (k, k_by_blur) = self.strength(blur_px);
        let square = u * u;
        let third = u * (square - 3.0) * phi;
        let fourth = (square * (square - 6.0) + 3.0) * phi;
        Added { share: k * third, by_u: -k * fourth, by_blur: k * u * fourth + k_by_blur * third, by_k: third }
    }

    /// Variance of `k`.
    pub fn variance(&self, blur_px: f64) -> f64 {
        (UNKNOWN * self.strength(blur_px).0).powi(2) + OF_LENS * OF_LENS
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::detect::circles::normal_tail;

    fn normal(u: f64) -> (f64, f64) {
        let (tail, phi) = normal_tail(u as f32);
        (1.0 - f64::from(tail), f64::from(phi))
    }

    /// A lens of 0.4 px and a pixel along the side: the mean of the edge over the pixel. The term leaves a quarter of what is beside the normal
    /// distribution.
    #[test]
    fn the_area_of_a_pixel_is_in_the_edge() {
        let (lens, shape) = (0.4_f64, PixelShape::of(&Vector2::new(0.0, 1.0), true));
        let blur = (lens * lens + SHARPEST_SQUARE).sqrt();
        let (mut beside, mut left) = (0.0_f64, 0.0_f64);
        for k in -30..=30 {
            let y = 0.05 * f64::from(k);
            let over = (0..200).map(|j| normal((y - 0.4975 + 0.005 * f64::from(j)) / lens).0).sum::<f64>() / 200.0;
            let (gauss, phi) = normal(y / blur);
            beside = beside.max((over - gauss).abs());
            left = left.max((over - gauss - shape.add(y / blur, phi, blur).share).abs());
        }
        assert!(beside > 2e-3 && left < 0.3 * beside, "{beside} {left}");
    }

    #[test]
    fn derivatives_are_those_of_the_term() {
        let shape = PixelShape::of(&Vector2::new(0.6, 0.8), true);
        let share = |u: f64, s: f64| shape.add(u, (-0.5 * u * u).exp(), s).share;
        for (u, s, step) in [(-2.1, 0.5, 1e-5), (-0.7, 0.35, 1e-5), (1.3, 0.9, 1e-5)] {
            let added = shape.add(u, (-0.5 * u * u).exp(), s);
            let by_u = (share(u + step, s) - share(u - step, s)) / (2.0 * step);
            // at the same place
            let at = |ln: f64| share(u * (-ln).exp(), s * ln.exp());
            let by_blur = (at(step) - at(-step)) / (2.0 * step);
            assert!((added.by_u - by_u).abs() < 1e-8 && (added.by_blur - by_blur).abs() < 1e-8, "{u} {s}");
        }
    }
}
