//! Measured distances of markers in the reduced normal equations.
//!
//! They are rows `h` of unit variance with residuals `r`, and tie markers together, which are eliminated one by one. With `V = F F'` and
//! `Y = B F^-T` of the markers without them, `b` their right-hand side and the rows apart, `h = (H_x, H_m)`:
//!
//! ```text
//! U = F^-1 H_m     W = H_x - Y U     S = 1 + U' U     r' = r - U' F^-1 b
//! ```
//!
//! the reduced information grows by `W S^-1 W'`, its right-hand side by `W S^-1 r'`, and the markers by `F^-T U S^-1 (r' - W' x)`
//! (Woodbury). Where the markers stay, there is no `U`, and `W` holds their rows, too.

use nalgebra::{DMatrix, DVector, Matrix3};

use super::linear::LinearProblem;
use crate::linalg::product;

/// Measured distances, with markers eliminated or not.
#[derive(Debug, Clone)]
pub(super) struct Distances {
    /// `W`, reduced unknowns x distances.
    by_reduced: DMatrix<f64>,
    /// `U`, 3 markers x distances; no rows where the markers stay.
    by_markers: DMatrix<f64>,
    /// `S^-1`.
    weight: DMatrix<f64>,
    /// `ln det S`.
    pub log_determinant: f64,
    /// `r`.
    residual: DVector<f64>,
    /// `r'`.
    reduced: DVector<f64>,
}

impl Distances {
    /// None.
    pub fn none() -> Self {
        Self::new(DMatrix::zeros(0, 0), DMatrix::zeros(0, 0))
    }

    /// From `W` and `U`.
    pub fn new(by_reduced: DMatrix<f64>, by_markers: DMatrix<f64>) -> Self {
        let count = by_reduced.ncols();
        let spread = DMatrix::identity(count, count) + by_markers.tr_mul(&by_markers);
        let log_determinant = spread.determinant().ln();
        // At least one in every direction.
        let weight = spread.try_inverse().unwrap_or_else(|| DMatrix::identity(count, count));
        let none = DVector::zeros(count);
        Self { by_reduced, by_markers, weight, log_determinant, residual: none.clone(), reduced: none }
    }

    fn are_none(&self) -> bool {
        self.weight.is_empty()
    }

    /// `W S^-1 W'`.
    pub fn information(&self) -> Option<DMatrix<f64>> {
        let whole = || product(&(&self.by_reduced * &self.weight), &self.by_reduced.transpose());
        (!self.are_none()).then(whole)
    }

    /// Takes over the residuals, with `F^-1 b` of the markers; adds to the reduced right-hand side.
    pub fn take_residuals(&mut self, linear: LinearProblem, markers: Option<&DVector<f64>>, rhs: &mut DVector<f64>) {
        if self.are_none() {
            return;
        }
        self.residual = DVector::from_iterator(self.weight.nrows(), linear.lin.distances.iter().map(|d| d.residual));
        self.reduced = match markers {
            Some(markers) => &self.residual - self.by_markers.tr_mul(markers),
            None => self.residual.clone(),
        };
        *rhs += &self.by_reduced * (&self.weight * &self.reduced);
    }

    /// `F' dm` that they add to the step of the markers at the reduced solution `x`: `U S^-1 (r' - W' x)`.
    pub fn of_markers(&self, x: &DVector<f64>) -> Option<DVector<f64>> {
        let left = || &self.reduced - self.by_reduced.tr_mul(x);
        (!self.are_none()).then(|| &self.by_markers * (&self.weight * left()))
    }

    /// What they add to the square of the Newton decrement: `r' r` less what the markers cannot take of it.
    pub fn squares(&self) -> f64 {
        self.residual.norm_squared() - self.reduced.dot(&(&self.weight * &self.reduced))
    }

    /// Adds `W S^-1 U'` to how the markers follow the reduced unknowns, unknowns x 3 markers.
    pub fn add_to_coupling(&self, coupling: &mut DMatrix<f64>) {
        if !self.are_none() {
            *coupling += product(&(&self.by_reduced * &self.weight), &self.by_markers.transpose());
        }
    }

    /// `U S^-1 U'` of one marker: by how much less it can give way.
    pub fn of_marker(&self, at: usize) -> Matrix3<f64> {
        if self.are_none() {
            return Matrix3::zeros();
        }
        let own = self.by_markers.rows(3 * at, 3);
        Matrix3::from_column_slice((own * &self.weight * own.transpose()).as_slice())
    }

    /// Variance of the k-th distance as all other data predict it, in units of its own, from the covariance of the reduced unknowns; `None`
    /// where they do not.
    pub fn predicted_variance(&self, reduced: &DMatrix<f64>, k: usize) -> Option<f64> {
        let (w, s) = (self.by_reduced.column(k), self.weight[(k, k)].recip());
        let with = w.dot(&(reduced * w));
        (with < s).then(|| with * s / (s - with) + s - 1.0)
    }
}
