//! Several points projected at once: place n of every array is of point n, so that loops over the points are compiled to wide registers.

use super::formula::{DistortedPoints, MAX_PARAMETERS};
use super::projection::Camera;

/// Images of N points as the formula gives them, with derivatives.
pub struct Projections<const N: usize> {
    /// Column and row, px.
    pub uv: [[f64; N]; 2],
    /// Of each by the point in the camera frame, px/m.
    pub d_point: [[[f64; N]; 3]; 2],
    /// Focal lengths, px.
    focal: [f64; 2],
    distorted: DistortedPoints<N>,
}

impl Camera {
    /// Projects N points in the camera frame (m) by the formula alone; `None` where one is behind the camera.
    #[inline(always)]
    pub fn project_together<const N: usize>(&self, points: &[[f64; N]; 3]) -> Option<Projections<N>> {
        let [x, y, z] = points;
        if z.iter().any(|z| !Self::is_before(*z)) {
            return None;
        }
        let mut inverse_depth = [0.0; N];
        let mut normalised = [[0.0; N]; 2];
        for n in 0..N {
            inverse_depth[n] = 1.0 / z[n];
            normalised[0][n] = x[n] / z[n];
            normalised[1][n] = y[n] / z[n];
        }
        let distorted = self.lens.distorted(&self.parameters[4..], &normalised, &inverse_depth);
        let focal = [self.parameters[0], self.parameters[1]];
        let (mut uv, mut d_point) = ([[0.0; N]; 2], [[[0.0; N]; 3]; 2]);
        for (i, focal) in focal.into_iter().enumerate() {
            for n in 0..N {
                let scale = focal * inverse_depth[n];
                let [by_x, by_y] = [scale * distorted.d_point[i][0][n], scale * distorted.d_point[i][1][n]];
                uv[i][n] = focal * distorted.point[i][n] + self.parameters[2 + i];
                d_point[i][0][n] = by_x;
                d_point[i][1][n] = by_y;
                d_point[i][2][n] = -by_x * normalised[0][n]
                    - by_y * normalised[1][n]
                    - scale * inverse_depth[n] * distorted.d_inverse_depth[i][n];
            }
        }
        Some(Projections { uv, d_point, focal, distorted })
    }
}

impl<const N: usize> Projections<N> {
    /// `sum w_n d uv_n[i] / d parameter` over the points, for every one of the first `parameters` of the formula.
    #[inline(always)]
    pub fn by_parameters(&self, i: usize, weights: &[f64; N], parameters: usize) -> [f64; MAX_PARAMETERS] {
        let mut by = [0.0; MAX_PARAMETERS];
        by[i] = weighted_sum(weights, &self.distorted.point[i]);
        by[2 + i] = weights.iter().sum();
        for (by, column) in by[4..parameters].iter_mut().zip(&self.distorted.d_coefficients[i]) {
            *by = self.focal[i] * weighted_sum(weights, column);
        }
        by
    }
}

/// `sum w_n x_n`.
#[inline(always)]
pub fn weighted_sum<const N: usize>(weights: &[f64; N], values: &[f64; N]) -> f64 {
    let mut products = [0.0; N];
    (0..N).for_each(|n| products[n] = weights[n] * values[n]);
    let mut width = N;
    // Halves onto each other, as wide registers add.
    while width > 1 && width.is_multiple_of(2) {
        width /= 2;
        (0..width).for_each(|n| products[n] += products[n + width]);
    }
    products[..width].iter().sum()
}
