//! Several points projected at once: place n of every array is of point n, so that loops over the points are compiled to wide registers.

use super::formula::{Distorted, MAX_PARAMETERS};

/// Images of N points as the formula gives them, with derivatives.
pub struct Projections<const N: usize> {
    /// Column and row, px.
    pub uv: [[f64; N]; 2],
    /// Of each by the point in the camera frame, px/m.
    pub d_point: [[[f64; N]; 3]; 2],
    /// Focal lengths, px.
    pub(super) focal: [f64; 2],
    /// In units of the focal lengths.
    pub(super) distorted: Distorted<N>,
}

impl<const N: usize> Projections<N> {
    /// `sum w_in d uv_n[i] / d parameter` over points and components, for every one of the first `parameters` of the formula.
    #[inline(always)]
    pub fn by_parameters(&self, weights: &[[f64; N]; 2], parameters: usize) -> [f64; MAX_PARAMETERS] {
        let mut by = [0.0; MAX_PARAMETERS];
        let mut scaled = [[0.0; N]; 2];
        for i in 0..2 {
            by[i] = weighted_sum(&weights[i], &self.distorted.point[i]);
            by[2 + i] = weighted_sum(&weights[i], &[1.0; N]);
            (0..N).for_each(|n| scaled[i][n] = self.focal[i] * weights[i][n]);
        }
        let [of_u, of_v] = &self.distorted.d_coefficients;
        for (by, (u, v)) in by[4..parameters].iter_mut().zip(of_u.iter().zip(of_v)) {
            *by = sum_of_weighted([&scaled[0], &scaled[1]], [u, v]);
        }
        by
    }
}

/// `sum w_n x_n`.
#[inline(always)]
pub fn weighted_sum<const N: usize>(weights: &[f64; N], values: &[f64; N]) -> f64 {
    sum_of_weighted([weights], [values])
}

/// `sum w_mn x_mn`.
#[inline(always)]
fn sum_of_weighted<const M: usize, const N: usize>(weights: [&[f64; N]; M], values: [&[f64; N]; M]) -> f64 {
    let mut lanes = [0.0; 4];
    for (weights, values) in weights.into_iter().zip(values) {
        for n in 0..N {
            lanes[n % 4] += weights[n] * values[n];
        }
    }
    (lanes[0] + lanes[2]) + (lanes[1] + lanes[3])
}
