//! The map from the plate to the image around one marker, from the markers next to it.

use crate::detect::circles::ellipse::Ellipse;
use crate::geom::PlaneMap;

/// A map of second order that leaves less than this share of what a projective one leaves is the better one.
const BENT: f64 = 0.5;

/// Second-order map from the plate (in units of the pitch, relative to the marker, rows down) to the image.
#[derive(Debug, Clone, Copy)]
pub struct LocalMap {
    /// Image of the origin, px.
    origin: [f64; 2],
    /// First derivatives: `slope[a][k]` of image coordinate `a` along plate direction `k`.
    slope: [[f64; 2]; 2],
    /// Second derivatives (xx, xy, yy) of both image coordinates.
    bend: [[f64; 3]; 2],
}

impl LocalMap {
    /// Least-squares map through (plate offset, image point) pairs. At least 8 pairs give a quadratic map, at least
    /// 4 an affine one; `None` when the pairs do not determine it.
    pub fn fit(pairs: &[([f64; 2], [f64; 2])]) -> Option<Self> {
        if pairs.len() >= 8
            && let Some(map) = Self::with_terms::<6>(pairs)
        {
            return Some(map);
        }
        if pairs.len() >= 4 { Self::with_terms::<3>(pairs) } else { None }
    }

    fn with_terms<const N: usize>(pairs: &[([f64; 2], [f64; 2])]) -> Option<Self> {
        let mut normal = nalgebra::SMatrix::<f64, N, N>::zeros();
        let mut right = nalgebra::SMatrix::<f64, N, 2>::zeros();
        let base = pairs[0].1;
        for ([x, y], image) in pairs {
            let terms = [1.0, *x, *y, 0.5 * x * x, x * y, 0.5 * y * y];
            for i in 0..N {
                // the lower triangle is all that its factor needs
                for j in 0..=i {
                    normal[(i, j)] += terms[i] * terms[j];
                }
                for a in 0..2 {
                    right[(i, a)] += terms[i] * (image[a] - base[a]);
                }
            }
        }
        let factor = normal.cholesky()?;
        // terms are of order one per pair: a tiny pivot means that the pairs lie on a line or a conic
        if (0..N).any(|i| factor.l_dirty()[(i, i)] < 0.2) {
            return None;
        }
        let s = factor.solve(&right);
        let term = |i: usize, a: usize| if i < N { s[(i.min(N - 1), a)] } else { 0.0 };
        Some(Self {
            origin: [0, 1].map(|a| s[(0, a)] + base[a]),
            slope: [0, 1].map(|a| [s[(1, a)], s[(2, a)]]),
            bend: [0, 1].map(|a| [term(3, a), term(4, a), term(5, a)]),
        })
    }

    /// To first order what a projective map through (plate offset, image point) pairs does at the origin; for origins beyond
    /// the pairs, where perspective is what a polynomial gets wrong. `None` when the pairs do not determine it.
    pub fn projective(pairs: &[([f64; 2], [f64; 2])]) -> Option<Self> {
        let map = PlaneMap::fit(pairs)?;
        let (origin, slope) = (map.apply([0.0; 2])?, map.jacobian([0.0; 2])?);
        Some(Self { origin, slope, bend: [[0.0; 3]; 2] })
    }

    /// As [`Self::projective`], unless a lens bends what the pairs show, far more than perspective does: a fisheye.
    pub fn beyond(pairs: &[([f64; 2], [f64; 2])]) -> Option<Self> {
        let straight = PlaneMap::fit(pairs)?;
        let square = |image: &[f64; 2], [x, y]: [f64; 2]| (image[0] - x).powi(2) + (image[1] - y).powi(2);
        // Over the residuals that the parameters leave.
        let [mut by_straight, mut by_bent] = [0.0; 2];
        if let Some(bent) = Self::with_terms::<6>(pairs) {
            for (at, image) in pairs {
                by_straight += square(image, straight.apply(*at)?);
                by_bent += square(image, bent.at(*at));
            }
            let left = |parameters: usize| (2 * pairs.len() - parameters) as f64;
            if by_bent / left(12) < BENT.powi(2) * by_straight / left(8) {
                return Some(bent);
            }
        }
        Self::projective(pairs)
    }

    /// Image of a plate offset.
    pub fn at(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        [0, 1].map(|a| {
            let b = self.bend[a];
            self.origin[a]
                + self.slope[a][0] * x
                + self.slope[a][1] * y
                + 0.5 * b[0] * x * x
                + b[1] * x * y
                + 0.5 * b[2] * y * y
        })
    }

    /// Image of the circle of `radius` (in units of the pitch) around the origin.
    pub fn ellipse(&self, radius: f64) -> Option<Ellipse> {
        Ellipse::from_axes(self.origin, self.slope.map(|r| r.map(|v| v * radius)))
    }

    /// Length of the shorter step of one pitch, px.
    pub fn shorter_step(&self) -> f64 {
        (0..2).map(|k| self.slope[0][k].hypot(self.slope[1][k])).fold(f64::MAX, f64::min)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn collinear_pairs_determine_nothing() {
        let pairs: Vec<_> = (0..9).map(|k| ([f64::from(k - 4), 0.0], [f64::from(k), 1.0])).collect();
        assert!(LocalMap::fit(&pairs).is_none());
    }
}
