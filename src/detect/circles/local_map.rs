//! The map from the plate to the image around one marker, from the markers next to it.

use super::ellipse::Ellipse;

/// Second-order map from the plate (in units of the pitch, relative to the marker, rows down) to the image.
#[derive(Debug, Clone, Copy)]
pub(super) struct LocalMap {
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
                for j in 0..N {
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

    /// How far the area centroid of the image of a circle moves per squared radius (in units of the pitch).
    ///
    /// To second order the mean of the map over a disc, weighted with the area that it becomes in the image, is
    /// `origin + r^2/4 (trace(G)/2 + F h)`: G the second derivatives, F the first, `h = grad ln |det F|`.
    pub fn centroid_shift(&self) -> [f64; 2] {
        let f = self.slope;
        let det = f[0][0] * f[1][1] - f[0][1] * f[1][0];
        let inverse = [[f[1][1] / det, -f[0][1] / det], [-f[1][0] / det, f[0][0] / det]];
        // h_k = trace(F^-1 dF/dx_k)
        let change = |k: usize| [0, 1].map(|a| [self.bend[a][k], self.bend[a][k + 1]]);
        let h = [0, 1].map(|k| {
            let g = change(k);
            inverse[0][0] * g[0][0] + inverse[0][1] * g[1][0] + inverse[1][0] * g[0][1] + inverse[1][1] * g[1][1]
        });
        [0, 1].map(|a| 0.25 * (0.5 * (self.bend[a][0] + self.bend[a][2]) + f[a][0] * h[0] + f[a][1] * h[1]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_shift_of_the_centroid_is_that_of_a_strongly_perspective_disc() {
        // projective map with 10 % change of scale per pitch
        let map = |[x, y]: [f64; 2]| {
            let w = 1.0 + 0.1 * x - 0.04 * y;
            [(50.0 * x + 3.0 * y) / w, (30.0 * y - 2.0 * x) / w]
        };
        let grid = |d: f64| (-2..=2).flat_map(move |i| (-2..=2).map(move |j| [f64::from(i) * d, f64::from(j) * d]));
        let pairs: Vec<_> = grid(0.1).map(|p| (p, map(p))).collect();
        // normal equations of a narrow stencil are judged at unit scale
        let scaled: Vec<_> = pairs.iter().map(|(p, q)| (p.map(|v| v * 10.0), *q)).collect();
        let shift = LocalMap::fit(&scaled).unwrap().centroid_shift().map(|v| v * 100.0);
        let radius = 0.3;
        let ring: Vec<[f64; 2]> = (0..720)
            .map(|k| (f64::from(k) * 0.5f64.to_radians()).sin_cos())
            .map(|(s, c)| map([radius * c, radius * s]))
            .collect();
        let (mut area, mut sum) = (0.0, [0.0; 2]);
        for (p, q) in ring.iter().zip(ring.iter().cycle().skip(1)) {
            let cross = p[0] * q[1] - q[0] * p[1];
            area += cross / 2.0;
            (0..2).for_each(|a| sum[a] += (p[a] + q[a]) * cross / 6.0);
        }
        for a in 0..2 {
            let predicted = shift[a] * radius * radius;
            let truth = sum[a] / area;
            assert!((predicted - truth).abs() < 0.02 * truth.abs() + 2e-3, "{predicted} {truth}");
        }
    }

    #[test]
    fn collinear_pairs_determine_nothing() {
        let pairs: Vec<_> = (0..9).map(|k| ([f64::from(k - 4), 0.0], [f64::from(k), 1.0])).collect();
        assert!(LocalMap::fit(&pairs).is_none());
    }
}
