//! Dense factorisations and quadratic programmes; the only room that imports `faer` and `clarabel`.
//!
//! Everything runs on one thread: parallelism lies outside, over images.

mod quadratic;
mod wide;

pub use quadratic::{LinearRow, NotSolved, minimise_quadratic};
pub use wide::wide;

use std::ops::Range;

use faer::linalg::matmul::matmul;
use faer::linalg::matmul::triangular::{self, BlockStructure};
use faer::linalg::solvers::{Llt, Solve};
use faer::{Accum, MatMut, MatRef, Par, Side};
use nalgebra::{DMatrix, DVector};

/// Cholesky factor of a symmetric positive definite matrix, with the diagonal scaled to one first.
pub struct SymmetricFactor {
    scale: DVector<f64>,
    factor: Llt<f64>,
}

/// The matrix is not positive definite, or not finite.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct NotPositiveDefinite;

fn view(m: &DMatrix<f64>) -> MatRef<'_, f64> {
    MatRef::from_column_major_slice(m.as_slice(), m.nrows(), m.ncols())
}

fn sequential() {
    faer::set_global_parallelism(Par::Seq);
}

impl SymmetricFactor {
    /// Factorises `m` (its lower triangle is read).
    pub fn new(m: &DMatrix<f64>) -> Result<Self, NotPositiveDefinite> {
        sequential();
        let diagonal_is_positive = m.diagonal().iter().all(|d| *d > 0.0 && d.is_finite());
        if !diagonal_is_positive || m.nrows() != m.ncols() {
            return Err(NotPositiveDefinite);
        }
        let scale = m.diagonal().map(|d| 1.0 / d.sqrt());
        let scaled = DMatrix::from_fn(m.nrows(), m.ncols(), |i, j| m[(i, j)] * scale[i] * scale[j]);
        if !scaled.iter().all(|x| x.is_finite()) {
            return Err(NotPositiveDefinite);
        }
        match Llt::new(view(&scaled), Side::Lower) {
            Ok(factor) => Ok(Self { scale, factor }),
            Err(_) => Err(NotPositiveDefinite),
        }
    }

    /// Solves `m x = b`.
    pub fn solve(&self, b: &DVector<f64>) -> DVector<f64> {
        let columns = DMatrix::from_column_slice(b.len(), 1, b.as_slice());
        self.solve_many(&columns).column(0).into_owned()
    }

    /// Solves `m x = b` for every column of `b`.
    pub fn solve_many(&self, b: &DMatrix<f64>) -> DMatrix<f64> {
        let scaled = DMatrix::from_fn(b.nrows(), b.ncols(), |i, j| b[(i, j)] * self.scale[i]);
        let x = self.factor.solve(view(&scaled));
        DMatrix::from_fn(b.nrows(), b.ncols(), |i, j| x[(i, j)] * self.scale[i])
    }

    /// The inverse, symmetric to the last bit.
    pub fn inverse(&self) -> DMatrix<f64> {
        let n = self.scale.len();
        let x = self.solve_many(&DMatrix::identity(n, n));
        DMatrix::from_fn(n, n, |i, j| 0.5 * (x[(i, j)] + x[(j, i)]))
    }

    /// Natural logarithm of the determinant.
    pub fn log_determinant(&self) -> f64 {
        let l = self.factor.L();
        let factor: f64 = (0..self.scale.len()).map(|i| 2.0 * l[(i, i)].ln()).sum();
        factor - 2.0 * self.scale.iter().map(|s| s.ln()).sum::<f64>()
    }
}

/// Orthonormal basis of the columns.
pub fn orthonormal(mut columns: DMatrix<f64>) -> DMatrix<f64> {
    for mut column in columns.column_iter_mut() {
        let length = column.norm();
        column.unscale_mut(if length > 0.0 { length } else { 1.0 });
    }
    columns.qr().q()
}

/// Product of dense matrices.
pub fn product(a: &DMatrix<f64>, b: &DMatrix<f64>) -> DMatrix<f64> {
    multiply(view(a), view(b))
}

/// Product of `a` with some rows of `b`.
pub fn product_with_rows(a: &DMatrix<f64>, b: &DMatrix<f64>, rows: Range<usize>) -> DMatrix<f64> {
    multiply(view(a), view(b).get(rows, ..))
}

fn multiply(a: MatRef<'_, f64>, b: MatRef<'_, f64>) -> DMatrix<f64> {
    let mut c = DMatrix::zeros(a.nrows(), b.ncols());
    let into = MatMut::from_column_major_slice_mut(c.as_mut_slice(), a.nrows(), b.ncols());
    matmul(into, Accum::Replace, a, b, 1.0, Par::Seq);
    c
}

/// `y y'`.
pub fn gram(y: &DMatrix<f64>) -> DMatrix<f64> {
    multiply(view(y), view(y).transpose())
}

/// `a -= y y'` in the upper triangle of `a`; what lies below the diagonal is left as it is.
pub fn subtract_gram(a: &mut DMatrix<f64>, y: &DMatrix<f64>) {
    let n = a.nrows();
    let (upper, full) = (BlockStructure::TriangularUpper, BlockStructure::Rectangular);
    let into = MatMut::from_column_major_slice_mut(a.as_mut_slice(), n, n);
    triangular::matmul(into, upper, Accum::Add, view(y), full, view(y).transpose(), full, -1.0, Par::Seq);
}

/// Copies the upper triangle to the lower one.
pub fn mirror_upper(a: &mut DMatrix<f64>) {
    for j in 0..a.ncols() {
        for i in 0..j {
            a[(j, i)] = a[(i, j)];
        }
    }
}

/// Eigenvalues (ascending) and eigenvectors (columns) of a symmetric matrix; `None` when it has no finite ones.
pub fn symmetric_eigen(m: &DMatrix<f64>) -> Option<(DVector<f64>, DMatrix<f64>)> {
    sequential();
    if !m.iter().all(|x| x.is_finite()) {
        return None;
    }
    let n = m.nrows();
    let eigen = view(m).self_adjoint_eigen(Side::Lower).ok()?;
    let values = DVector::from_fn(n, |i, _| eigen.S()[i]);
    let vectors = DMatrix::from_fn(n, n, |i, j| eigen.U()[(i, j)]);
    Some((values, vectors))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A badly scaled positive definite matrix.
    fn matrix() -> DMatrix<f64> {
        let a = DMatrix::from_fn(9, 7, |i, j| {
            ((7 * i * i + 13 * j * j + 5 * i * j) as f64).sin() * 10f64.powi(j as i32 - 3)
        });
        a.transpose() * a
    }

    #[test]
    fn solve_and_inverse_undo_the_matrix() {
        let m = matrix();
        let f = SymmetricFactor::new(&m).unwrap();
        let x = DVector::from_fn(7, |i, _| (i + 1) as f64);
        assert!((f.solve(&(&m * &x)) - &x).amax() < 1e-8);
        let scaled = DMatrix::from_diagonal(&m.diagonal().map(f64::sqrt));
        let identity = &scaled * f.inverse() * &m * scaled.clone().try_inverse().unwrap();
        assert!((identity - DMatrix::identity(7, 7)).amax() < 1e-9);
        assert!((f.log_determinant() - m.determinant().ln()).abs() < 1e-6);
    }

    #[test]
    fn an_indefinite_or_infinite_matrix_is_refused() {
        assert!(SymmetricFactor::new(&DMatrix::from_row_slice(2, 2, &[1.0, 2.0, 2.0, 1.0])).is_err());
        assert!(SymmetricFactor::new(&DMatrix::from_row_slice(2, 2, &[1.0, f64::NAN, f64::NAN, 1.0])).is_err());
        assert!(SymmetricFactor::new(&DMatrix::zeros(2, 2)).is_err());
    }

    #[test]
    fn eigenvalues_are_ascending() {
        let (values, vectors) = symmetric_eigen(&matrix()).unwrap();
        assert!(values.as_slice().windows(2).all(|w| w[0] <= w[1]));
        let rebuilt = &vectors * DMatrix::from_diagonal(&values) * vectors.transpose();
        assert!((rebuilt - matrix()).amax() < 1e-9 * matrix().amax());
    }
}
