//! Several points projected at once: place n of every array is of point n, so that loops over the points are compiled to wide registers.

use super::formula::{DistortedPoints, MAX_PARAMETERS};

/// Images of N points as the formula gives them, with derivatives.
pub struct Projections<const N: usize> {
    /// Column and row, px.
    pub uv: [[f64; N]; 2],
    /// Of each by the point in the camera frame, px/m.
    pub d_point: [[[f64; N]; 3]; 2],
    /// Focal lengths, px.
    pub(super) focal: [f64; 2],
    /// In units of the focal lengths.
    pub(super) distorted: DistortedPoints<N>,
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
