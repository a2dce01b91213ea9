//! Slopes of values by two quantities at once, by least squares about their means.

use nalgebra::{Matrix2, Vector2};

/// Share of their squares that two quantities leave of each other, below which it is rounding.
const TOLD_APART: f64 = 1e-12;

/// By how much values grow with each of two quantities.
pub(super) struct Slopes {
    /// The slopes.
    pub of: Vector2<f64>,
    /// Their covariance, of values of unit variance.
    pub covariance: Matrix2<f64>,
}

/// Of pairs of quantities, each with its value; `None` where they do not tell the two apart.
pub(super) fn slopes(samples: &[(Vector2<f64>, f64)]) -> Option<Slopes> {
    let count = samples.len().max(1) as f64;
    let middle = samples.iter().map(|(at, _)| at).sum::<Vector2<f64>>() / count;
    let (mut normal, mut rhs, mut squares) = (Matrix2::zeros(), Vector2::zeros(), Vector2::zeros());
    for (at, value) in samples {
        squares += at.component_mul(at);
        let at = at - middle;
        normal += at * at.transpose();
        rhs += at * *value;
    }
    let is_told = normal.determinant() > TOLD_APART * squares.product();
    let covariance = normal.cholesky().filter(|_| is_told)?.inverse();
    Some(Slopes { of: covariance * rhs, covariance })
}
