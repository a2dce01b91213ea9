//! State of the blurred-edge model and the places of its parameters.

use super::exact::Contour;
use crate::detect::circles::ellipse::Ellipse;

/// Parameters of a disc.
pub(super) const DISC: usize = 14;
/// Parameters of an annulus: those of a disc and (centre, ln radius ratio) of the inner circle.
pub(super) const ANNULUS: usize = 17;

pub(super) const CENTRE: usize = 0;
pub(super) const SHAPE: usize = 2;
pub(super) const THIRD: usize = 5;
pub(super) const LN_BLUR: usize = 7;
pub(super) const WHITE: usize = 8;
pub(super) const DARK: usize = 11;
pub(super) const INNER: usize = 14;
pub(super) const LN_RATIO: usize = 16;

/// Longest step of the logarithm of the radius ratio.
pub(super) const LONGEST_LN_RATIO: f64 = 0.2;

/// State of the model; positions are relative to an anchor pixel.
#[derive(Debug, Clone, Copy)]
pub struct State {
    pub centre: [f64; 2],
    /// `N`: offsets from the centre to the unit circle.
    pub to_unit: [[f64; 2]; 2],
    pub third: [f64; 2],
    pub blur: f64,
    /// Level and gradient of the paper.
    pub white: [f64; 3],
    /// Level of the ink, and its gradient beyond that of the paper in proportion.
    pub dark: [f64; 3],
    /// Centre and radius ratio of the inner circle.
    pub inner: Option<([f64; 2], f64)>,
}

impl State {
    pub fn parameters(&self) -> usize {
        if self.inner.is_some() { ANNULUS } else { DISC }
    }

    /// Adds a step of the parameters.
    pub fn step(&mut self, delta: &[f64]) {
        (0..2).for_each(|a| self.centre[a] += delta[CENTRE + a]);
        let [e0, ec, es] = [delta[SHAPE], delta[SHAPE + 1], delta[SHAPE + 2]];
        let n = self.to_unit;
        self.to_unit = [0, 1].map(|r| {
            let diagonal = if r == 0 { e0 + ec } else { e0 - ec };
            [0, 1].map(|c| n[r][c] + diagonal * n[r][c] + es * n[1 - r][c])
        });
        (0..2).for_each(|a| self.third[a] += delta[THIRD + a]);
        self.blur *= delta[LN_BLUR].clamp(-0.4, 0.4).exp();
        (0..3).for_each(|a| self.white[a] += delta[WHITE + a]);
        (0..3).for_each(|a| self.dark[a] += delta[DARK + a]);
        if let Some((centre, ratio)) = &mut self.inner {
            (0..2).for_each(|a| centre[a] += delta[INNER + a]);
            *ratio *= delta[LN_RATIO].clamp(-LONGEST_LN_RATIO, LONGEST_LN_RATIO).exp();
        }
    }

    /// The outer contour, moved by what blur makes of the gradient of the light.
    pub fn outer_contour(&self) -> Contour {
        let s2 = self.blur * self.blur;
        let level = self.white[0].abs().max(1e-6);
        let centre = [0, 1].map(|a| self.centre[a] - s2 * self.white[a + 1] / level);
        Contour { centre, to_unit: self.to_unit, third: self.third, blur: self.blur }
    }

    /// A contour is hardly larger than the blur.
    pub fn is_badly_resolved(&self) -> bool {
        let contour = self.inner_contour().unwrap_or_else(|| self.outer_contour());
        contour.curvature() > 0.3
    }

    /// The inner contour, moved in the same way.
    pub fn inner_contour(&self) -> Option<Contour> {
        let (centre, ratio) = self.inner?;
        let outer = self.outer_contour();
        let centre = [0, 1].map(|a| outer.centre[a] + centre[a] - self.centre[a]);
        let to_unit = self.to_unit.map(|r| r.map(|v| v / ratio));
        Some(Contour { centre, to_unit, third: self.third.map(|v| v * ratio), ..outer })
    }

    /// Ellipse of the outer circle relative to the anchor.
    pub fn ellipse(&self) -> Ellipse {
        let n = self.to_unit;
        let q = |i: usize, j: usize| n[0][i] * n[0][j] + n[1][i] * n[1][j];
        Ellipse { centre: self.centre, shape: [q(0, 0), q(0, 1), q(1, 1)] }
    }

    /// Share of the paper's gradient that the ink has.
    pub fn tie(&self) -> f64 {
        (self.dark[0] / self.white[0]).clamp(0.0, 1.0)
    }

    /// Ellipse of the inner circle relative to the anchor.
    pub fn inner_ellipse(&self) -> Option<Ellipse> {
        let (centre, ratio) = self.inner?;
        Some(Ellipse { centre, shape: self.ellipse().shape.map(|v| v / (ratio * ratio)) })
    }
}
