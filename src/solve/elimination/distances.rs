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

use nalgebra::{DMatrix, DMatrixView, DVector, Matrix3};

use crate::linalg::product;
use crate::solve::linear::LinearProblem;

/// Measured distances, with markers eliminated or not.
#[derive(Debug, Clone)]
pub struct Distances {
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

    /// What they add to reduced right-hand sides that are none of theirs, with `F^-1 b` of the markers: `-W S^-1 U' F^-1 b`.
    pub fn reduced_by(&self, markers: &DMatrix<f64>) -> Option<DMatrix<f64>> {
        (!self.are_none()).then(|| &self.by_reduced * (&self.weight * self.by_markers.tr_mul(markers)) * -1.0)
    }

    /// As [`Distances::of_markers`] for right-hand sides that are none of theirs: `-U S^-1 (U' F^-1 b + W' x)`.
    pub fn markers_by(&self, markers: &DMatrix<f64>, x: &DMatrix<f64>) -> Option<DMatrix<f64>> {
        let left = || self.by_markers.tr_mul(markers) + self.by_reduced.tr_mul(x);
        (!self.are_none()).then(|| &self.by_markers * (&self.weight * left()) * -1.0)
    }

    /// What they add to the square of the Newton decrement: `r' r` less what the markers cannot take of it.
    pub fn squares(&self) -> f64 {
        self.residual.norm_squared() - self.reduced.dot(&(&self.weight * &self.reduced))
    }

    /// How they take part in the covariance of the markers, given that of the reduced unknowns, `cov(x)`, and what these move by `T`.
    pub fn with_markers(
        &self,
        reduced: &DMatrix<f64>,
        times: impl Fn(&DMatrix<f64>) -> DMatrix<f64>,
    ) -> Option<WithMarkers<'_>> {
        let of_reduced = || product(reduced, &self.by_reduced);
        let parts = |of_reduced: DMatrix<f64>| WithMarkers {
            distances: self,
            moved: times(&of_reduced),
            own: self.by_reduced.tr_mul(&of_reduced),
        };
        (!self.are_none()).then(|| parts(of_reduced()))
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

/// Part of measured distances in the covariance of markers: these follow the reduced unknowns by `D' = d' T + K' W'`, with the `d` of the
/// images and `K = S^-1 U' F^-1`.
pub struct WithMarkers<'a> {
    distances: &'a Distances,
    /// `T cov(x) W`.
    moved: DMatrix<f64>,
    /// `W' cov(x) W`.
    own: DMatrix<f64>,
}

impl WithMarkers<'_> {
    /// `d' T cov(x) W K`, its transposed, and `K' W' cov(x) W K` of a marker with this `d` and `F^-1`.
    pub fn of_marker(&self, at: usize, d: &DMatrixView<f64>, inverse_factor: &Matrix3<f64>) -> Matrix3<f64> {
        let Distances { by_markers, weight, .. } = self.distances;
        let k = weight * by_markers.rows(3 * at, 3).transpose() * inverse_factor;
        let with = d.tr_mul(&self.moved) * &k;
        let sum = &with + with.transpose() + k.tr_mul(&(&self.own * &k));
        Matrix3::from_column_slice(sum.as_slice())
    }
}
