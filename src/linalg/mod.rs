//! Dense factorisations, quadratic programmes and the median; the only room that imports `faer` and `clarabel`.
//!
//! Every call of `faer` runs on one thread and says so itself; its setting for the whole process belongs to the caller and is neither read nor
//! changed. Parallelism lies outside, over images, stops and blocks of columns, whose bounds do not depend on the number of threads.

mod median;
mod quadratic;
mod wide;

pub use median::{lower_median, median, median_by};
pub use quadratic::{LinearRow, NotSolved, minimise_quadratic};
pub use wide::{add_combination, sum_of_products, wide};

use std::ops::Range;

use faer::diag::Diag;
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt::{factor, inverse, solve};
use faer::linalg::evd;
use faer::linalg::matmul::matmul;
use faer::linalg::matmul::triangular::{self, BlockStructure};
use faer::{Accum, Conj, MatMut, MatRef, Par};
use nalgebra::{DMatrix, DVector, SMatrix};
use rayon::prelude::*;

/// A matrix of fixed size as one of any size.
pub fn dense<const R: usize, const C: usize>(fixed: &SMatrix<f64, R, C>) -> DMatrix<f64> {
    DMatrix::from_column_slice(R, C, fixed.as_slice())
}

/// Cholesky factor of a symmetric positive definite matrix, with the diagonal scaled to one first.
#[derive(Debug, Clone)]
pub struct SymmetricFactor {
    scale: DVector<f64>,
    /// Rows with anything beside the diagonal, ascending: the others need no factor.
    coupled: Vec<usize>,
    /// Of these, in the lower triangle; what lies above is not read.
    factor: DMatrix<f64>,
}

/// The matrix is not positive definite, or not finite.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct NotPositiveDefinite {
    /// The first row whose pivot is not positive: what it stands for follows from what the rows before it stand for.
    pub row: usize,
}

fn view(m: &DMatrix<f64>) -> MatRef<'_, f64> {
    MatRef::from_column_major_slice(m.as_slice(), m.nrows(), m.ncols())
}

fn view_mut(m: &mut DMatrix<f64>) -> MatMut<'_, f64> {
    let (rows, columns) = m.shape();
    MatMut::from_column_major_slice_mut(m.as_mut_slice(), rows, columns)
}

impl SymmetricFactor {
    /// Factorises `m` (its lower triangle is read).
    pub fn new(m: &DMatrix<f64>) -> Result<Self, NotPositiveDefinite> {
        let is_told = |d: &f64| *d > 0.0 && d.is_finite();
        if let Some(row) = m.diagonal().iter().position(|d| !is_told(d)) {
            return Err(NotPositiveDefinite { row });
        }
        if m.nrows() != m.ncols() {
            return Err(NotPositiveDefinite { row: m.nrows().min(m.ncols()) });
        }
        let scale = m.diagonal().map(|d| 1.0 / d.sqrt());
        let coupled = coupled_rows(m);
        let Some(mut scaled) = scaled_lower(m, &scale, &coupled) else {
            let is_finite = |i: usize| (0..m.ncols()).all(|j| (m[(i, j)] * scale[i] * scale[j]).is_finite());
            return Err(NotPositiveDefinite { row: (0..m.nrows()).find(|i| !is_finite(*i)).unwrap_or_default() });
        };
        let needed = factor::cholesky_in_place_scratch::<f64>(coupled.len(), Par::Seq, Default::default());
        let (mut memory, options) = (MemBuffer::new(needed), Default::default());
        factor::cholesky_in_place(
            view_mut(&mut scaled),
            Default::default(),
            Par::Seq,
            MemStack::new(&mut memory),
            options,
        )
        .map_err(|factor::LltError::NonPositivePivot { index }| NotPositiveDefinite { row: coupled[index] })?;
        Ok(Self { scale, coupled, factor: scaled })
    }

    /// Solves `m x = b`.
    pub fn solve(&self, b: &DVector<f64>) -> DVector<f64> {
        let columns = DMatrix::from_column_slice(b.len(), 1, b.as_slice());
        self.solve_many(&columns).column(0).into_owned()
    }

    /// Solves `m x = b` for every column of `b`.
    pub fn solve_many(&self, b: &DMatrix<f64>) -> DMatrix<f64> {
        let Self { scale, coupled, factor } = self;
        let mut x = DMatrix::from_fn(coupled.len(), b.ncols(), |i, j| b[(coupled[i], j)] * scale[coupled[i]]);
        let mut memory = MemBuffer::new(solve::solve_in_place_scratch::<f64>(x.nrows(), x.ncols(), Par::Seq));
        let stack = MemStack::new(&mut memory);
        solve::solve_in_place_with_conj(view(factor), Conj::No, view_mut(&mut x), Par::Seq, stack);
        let mut all = DMatrix::from_fn(b.nrows(), b.ncols(), |i, j| b[(i, j)] * scale[i] * scale[i]);
        for (mut all, x) in all.column_iter_mut().zip(x.column_iter()) {
            coupled.iter().zip(x.iter()).for_each(|(&row, x)| all[row] = x * scale[row]);
        }
        all
    }

    /// The inverse, symmetric to the last bit.
    pub fn inverse(&self) -> DMatrix<f64> {
        let Self { scale, coupled, factor } = self;
        let n = coupled.len();
        let mut lower = DMatrix::zeros(n, n);
        let mut memory = MemBuffer::new(inverse::inverse_scratch::<f64>(n, Par::Seq));
        inverse::inverse(view_mut(&mut lower), view(factor), Par::Seq, MemStack::new(&mut memory));
        let mut all = match n == scale.len() {
            true => DMatrix::zeros(0, 0),
            false => DMatrix::from_diagonal(&scale.map(|own| own * own)),
        };
        for (j, column) in lower.as_mut_slice().chunks_exact_mut(n.max(1)).enumerate() {
            let of = scale[coupled[j]];
            column[j..].iter_mut().zip(&coupled[j..]).for_each(|(x, &row)| *x *= scale[row] * of);
            if !all.is_empty() {
                let mut all = all.column_mut(coupled[j]);
                column[j..].iter().zip(&coupled[j..]).for_each(|(x, &row)| all[row] = *x);
            }
        }
        if all.is_empty() {
            all = lower;
        }
        mirror_lower(&mut all);
        all
    }

    /// Natural logarithm of the determinant.
    pub fn log_determinant(&self) -> f64 {
        let l = &self.factor;
        let factor: f64 = (0..l.nrows()).map(|i| 2.0 * l[(i, i)].ln()).sum();
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

/// `a' b` of twists.
pub fn dot(a: &[f64; 6], b: &[f64; 6]) -> f64 {
    (a[0] * b[0] + a[1] * b[1]) + (a[2] * b[2] + a[3] * b[3]) + (a[4] * b[4] + a[5] * b[5])
}

/// `F^-1` of `F F'`, lower triangular; `None` where that is not positive definite.
pub fn inverse_factor(m: DMatrix<f64>) -> Option<DMatrix<f64>> {
    let n = m.nrows();
    m.cholesky()?.l_dirty().solve_lower_triangular(&DMatrix::identity(n, n))
}

/// Product of dense matrices.
pub fn product(a: &DMatrix<f64>, b: &DMatrix<f64>) -> DMatrix<f64> {
    multiply(view(a), view(b))
}

/// Product of the upper triangle of the square matrix `a` with `b`; what lies below is not read.
pub fn upper_product(a: &DMatrix<f64>, b: &DMatrix<f64>) -> DMatrix<f64> {
    let (upper, full) = (BlockStructure::TriangularUpper, BlockStructure::Rectangular);
    let mut c = DMatrix::zeros(a.nrows(), b.ncols());
    triangular::matmul(view_mut(&mut c), full, Accum::Replace, view(a), upper, view(b), full, 1.0, Par::Seq);
    c
}

/// Product of the transpose of `a` with `b`.
pub fn transposed_product(a: &DMatrix<f64>, b: &DMatrix<f64>) -> DMatrix<f64> {
    multiply(view(a).transpose(), view(b))
}

/// Product of the transpose of `a` with a part of `b`.
pub fn transposed_product_with(
    a: &DMatrix<f64>,
    b: &DMatrix<f64>,
    rows: Range<usize>,
    columns: Range<usize>,
) -> DMatrix<f64> {
    multiply(view(a).transpose(), view(b).get(rows, columns))
}

/// Product of `a` with some rows of `b`.
pub fn product_with_rows(a: &DMatrix<f64>, b: &DMatrix<f64>, rows: Range<usize>) -> DMatrix<f64> {
    multiply(view(a), view(b).get(rows, ..))
}

/// Product of some columns of `a` with `b`.
pub fn columns_product(a: &DMatrix<f64>, columns: Range<usize>, b: &DMatrix<f64>) -> DMatrix<f64> {
    multiply(view(a).get(.., columns), view(b))
}

fn multiply(a: MatRef<'_, f64>, b: MatRef<'_, f64>) -> DMatrix<f64> {
    let mut c = DMatrix::zeros(a.nrows(), b.ncols());
    multiply_into(&mut c, Accum::Replace, a, b);
    c
}

/// Multiplications of a product from which on its blocks of columns are worth being made side by side.
const LARGE: usize = 20_000_000;

/// `a b` into the first rows of `c`.
fn multiply_into(c: &mut DMatrix<f64>, how: Accum, a: MatRef<'_, f64>, b: MatRef<'_, f64>) {
    let rows = c.nrows();
    if a.nrows() * a.ncols() * b.ncols() < LARGE {
        return matmul(view_mut(c).get_mut(..a.nrows(), ..), how, a, b, 1.0, Par::Seq);
    }
    c.as_mut_slice().par_chunks_mut(COLUMNS_A_BLOCK * rows).enumerate().for_each(|(block, columns)| {
        let (first, own) = (block * COLUMNS_A_BLOCK, columns.len() / rows);
        let (into, _) = MatMut::from_column_major_slice_mut(columns, rows, own).split_at_row_mut(a.nrows());
        matmul(into, how, a, b.get(.., first..first + own), 1.0, Par::Seq);
    });
}

/// `y y'` in some of its columns down to the diagonal, to the first rows and columns of `into`; what lies below is left as it is.
pub fn part_of_gram(into: &mut DMatrix<f64>, y: &DMatrix<f64>, columns: Range<usize>) {
    let (upper, full) = (BlockStructure::TriangularUpper, BlockStructure::Rectangular);
    let into = view_mut(into).get_mut(..columns.end, ..columns.len());
    let (above, diagonal) = into.split_at_row_mut(columns.start);
    let (above_columns, of_columns) = (view(y).get(..columns.start, ..), view(y).get(columns, ..));
    matmul(above, Accum::Replace, above_columns, of_columns.transpose(), 1.0, Par::Seq);
    let how = Accum::Replace;
    triangular::matmul(diagonal, upper, how, of_columns, full, of_columns.transpose(), full, 1.0, Par::Seq);
}

/// `y y'`.
pub fn gram(y: &DMatrix<f64>) -> DMatrix<f64> {
    multiply(view(y), view(y).transpose())
}

/// Columns of a product that are made together.
pub const COLUMNS_A_BLOCK: usize = 192;

/// `a += factor y y'` in the upper triangle of the square matrix `a`; what lies below the diagonal is left as it is. Blocks of columns side by side.
pub fn add_gram(a: &mut DMatrix<f64>, y: &DMatrix<f64>, factor: f64) {
    let (upper, full) = (BlockStructure::TriangularUpper, BlockStructure::Rectangular);
    let rows = a.nrows();
    a.as_mut_slice().par_chunks_mut(COLUMNS_A_BLOCK * rows.max(1)).enumerate().for_each(|(block, columns)| {
        let (first, y) = (block * COLUMNS_A_BLOCK, view(y));
        let own = columns.len() / rows;
        let columns = MatMut::from_column_major_slice_mut(columns, rows, own);
        let (above, rest) = columns.split_at_row_mut(first);
        let (diagonal, _) = rest.split_at_row_mut(own);
        let of_columns = y.get(first..first + own, ..);
        let (how, transposed) = (Accum::Add, of_columns.transpose());
        matmul(above, how, y.get(..first, ..), transposed, factor, Par::Seq);
        triangular::matmul(diagonal, upper, how, of_columns, full, transposed, full, factor, Par::Seq);
    });
}

/// Rows of a symmetric matrix, by its lower triangle, with anything beside the diagonal.
fn coupled_rows(m: &DMatrix<f64>) -> Vec<usize> {
    let n = m.nrows();
    let below = |j: usize| &m.as_slice()[j * n + j + 1..(j + 1) * n];
    let is_alone = |j: &usize| below(*j).iter().all(|x| *x == 0.0) && (0..*j).all(|k| m[(*j, k)] == 0.0);
    (0..n).filter(|j| !is_alone(j)).collect()
}

/// Some rows and columns of `m` with its diagonal scaled to one: lower triangle, zeros above. `None` where something in it is not finite.
fn scaled_lower(m: &DMatrix<f64>, scale: &DVector<f64>, rows: &[usize]) -> Option<DMatrix<f64>> {
    let n = rows.len();
    let (mut scaled, mut is_finite) = (DMatrix::<f64>::zeros(n, n), true);
    let columns = scaled.as_mut_slice().chunks_exact_mut(n.max(1)).zip(rows);
    for (j, (into, &column)) in columns.enumerate() {
        let of = &m.as_slice()[column * m.nrows()..][..m.nrows()];
        let values = rows[j..].iter().map(|&row| of[row] * scale[row] * scale[column]);
        into[j..].iter_mut().zip(values).for_each(|(x, value)| *x = value);
        is_finite &= into[j..].iter().fold(true, |all, x| all & x.is_finite());
    }
    is_finite.then_some(scaled)
}

/// Rows and columns of the squares in which a triangle is copied to the other: both stay in the nearest cache.
const SQUARE: usize = 32;

/// Copies the upper triangle to the lower one.
pub fn mirror_upper(a: &mut DMatrix<f64>) {
    let rows = a.nrows();
    mirror_upper_rows(a, rows);
}

/// Copies the first rows of the upper triangle to the lower one.
pub fn mirror_upper_rows(a: &mut DMatrix<f64>, rows: usize) {
    each_square(a, rows, copy_transposed);
}

/// Copies the lower triangle to the upper one.
fn mirror_lower(a: &mut DMatrix<f64>) {
    let rows = a.nrows();
    each_square(a, rows, |values, n, above, columns| copy_transposed(values, n, columns, above));
}

/// Goes through the part of a square matrix above the diagonal that lies in its first rows: rows and columns of squares, with its values and size. On
/// the diagonal they are what stands above it in one column.
fn each_square(a: &mut DMatrix<f64>, rows: usize, copy: impl Fn(&mut [f64], usize, Range<usize>, Range<usize>)) {
    let n = a.ncols();
    let values = a.as_mut_slice();
    for first in (0..n).step_by(SQUARE) {
        let columns = first..(first + SQUARE).min(n);
        for row in (0..rows.min(first)).step_by(SQUARE) {
            copy(values, n, row..(row + SQUARE).min(rows), columns.clone());
        }
        columns.for_each(|j| copy(values, n, first..rows.min(j).max(first), j..j + 1));
    }
}

/// Copies some rows (at most a square) of some columns of a matrix of `n` rows to the columns and rows of the same numbers.
fn copy_transposed(values: &mut [f64], n: usize, rows: Range<usize>, columns: Range<usize>) {
    if rows.len() == 1 || columns.len() == 1 {
        let places = columns.flat_map(|column| rows.clone().map(move |row| (row, column)));
        return places.for_each(|(row, column)| values[row * n + column] = values[column * n + row]);
    }
    let mut square = [[0.0; SQUARE]; SQUARE];
    for (k, column) in columns.clone().enumerate() {
        let of = &values[column * n..][rows.clone()];
        of.iter().zip(&mut square).for_each(|(value, row)| row[k] = *value);
    }
    for (row, of) in rows.zip(&square) {
        values[row * n..][columns.clone()].copy_from_slice(&of[..columns.len()]);
    }
}

/// Eigenvalues (ascending) and eigenvectors (columns) of a symmetric matrix; `None` when it has no finite ones.
pub fn symmetric_eigen(m: &DMatrix<f64>) -> Option<(DVector<f64>, DMatrix<f64>)> {
    if !m.iter().all(|x| x.is_finite()) {
        return None;
    }
    let n = m.nrows();
    if n == 0 {
        return Some((DVector::zeros(0), DMatrix::zeros(0, 0)));
    }
    let wanted = evd::ComputeEigenvectors::Yes;
    let needed = evd::self_adjoint_evd_scratch::<f64>(n, wanted, Par::Seq, Default::default());
    let (mut values, mut vectors) = (Diag::zeros(n), DMatrix::zeros(n, n));
    let (mut memory, into) = (MemBuffer::new(needed), Some(view_mut(&mut vectors)));
    let stack = MemStack::new(&mut memory);
    evd::self_adjoint_evd(view(m), values.as_mut(), into, Par::Seq, stack, Default::default()).ok()?;
    Some((DVector::from_fn(n, |i, _| values[i]), vectors))
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
    fn rows_by_themselves_need_no_factor_and_change_nothing() {
        let own = matrix();
        let places = [1, 2, 4, 5, 6, 8, 9];
        let mut whole = DMatrix::from_diagonal(&DVector::from_fn(11, |i, _| (i + 2) as f64));
        places.iter().enumerate().for_each(|(j, &column)| {
            places.iter().enumerate().for_each(|(i, &row)| whole[(row, column)] = own[(i, j)]);
        });
        let (factor, of_own) = (SymmetricFactor::new(&whole).unwrap(), SymmetricFactor::new(&own).unwrap());
        let (inverse, inverse_of_own) = (factor.inverse(), of_own.inverse());
        let x = factor.solve(&DVector::from_element(11, 1.0));
        let x_of_own = of_own.solve(&DVector::from_element(7, 1.0));
        for (i, j) in (0..11).flat_map(|i| (0..11).map(move |j| (i, j))) {
            let place = |row: usize| places.iter().position(|p| *p == row);
            let expected = match (place(i), place(j)) {
                (Some(i), Some(j)) => inverse_of_own[(i, j)],
                _ if i == j => 1.0 / (i + 2) as f64,
                _ => 0.0,
            };
            assert!((inverse[(i, j)] - expected).abs() <= 1e-15 * expected.abs(), "{i} {j}");
            let alone = 1.0 / (i + 2) as f64;
            let expected = place(i).map_or(alone, |i| x_of_own[i]);
            assert!((x[i] - expected).abs() <= 1e-15 * expected.abs(), "{i}");
        }
        let alone: f64 = [2.0, 5.0, 9.0, 12.0].iter().map(|d: &f64| d.ln()).sum();
        assert!((factor.log_determinant() - of_own.log_determinant() - alone).abs() < 1e-12);
        let mut singular = whole;
        (0..11).for_each(|k| singular[(9, k)] = singular[(8, k)]);
        (0..11).for_each(|k| singular[(k, 9)] = singular[(k, 8)]);
        singular[(9, 9)] -= 1e-9 * singular[(9, 9)];
        assert_eq!(SymmetricFactor::new(&singular).err(), Some(NotPositiveDefinite { row: 9 }));
        assert!(SymmetricFactor::new(&DMatrix::from_diagonal_element(3, 3, 4.0)).unwrap().inverse()[(1, 1)] == 0.25);
    }

    /// Larger than the squares in which triangles are mirrored, and not a multiple of them.
    #[test]
    fn both_triangles_of_a_large_inverse_are_filled() {
        for n in [31, 33, 70] {
            let m = DMatrix::from_fn(n, n, |i, j| match i.abs_diff(j) {
                0 => 3.0 + i as f64,
                apart => ((i + j) as f64).sin() * 0.5_f64.powi(apart as i32),
            });
            let mut lower = m.clone();
            lower.fill_upper_triangle(f64::NAN, 1);
            let inverse = SymmetricFactor::new(&lower).unwrap().inverse();
            assert!((&inverse * &m - DMatrix::identity(n, n)).amax() < 1e-12, "{n}");
        }
    }

    #[test]
    fn the_product_of_a_triangle_does_not_read_the_other() {
        let mut a = DMatrix::from_fn(37, 37, |i, j| ((3 * i + 5 * j) as f64).sin());
        let b = DMatrix::from_fn(37, 5, |i, j| ((i + 7 * j) as f64).cos());
        let expected = a.upper_triangle() * &b;
        a.fill_lower_triangle(f64::NAN, 1);
        assert!((upper_product(&a, &b) - expected).amax() < 1e-13);
    }

    #[test]
    fn an_indefinite_or_infinite_matrix_is_refused() {
        assert!(SymmetricFactor::new(&DMatrix::from_row_slice(2, 2, &[1.0, 2.0, 2.0, 1.0])).is_err());
        assert!(SymmetricFactor::new(&DMatrix::from_row_slice(2, 2, &[1.0, f64::NAN, f64::NAN, 1.0])).is_err());
        assert!(SymmetricFactor::new(&DMatrix::zeros(2, 2)).is_err());
    }

    #[test]
    fn a_row_that_follows_from_those_before_is_named() {
        for (n, bad) in [(5, 3), (300, 200), (300, 7)] {
            let mut m = DMatrix::from_fn(n, n, |i, j| if i == j { 2.0 } else { 0.5_f64.powi(i.abs_diff(j) as i32) });
            for k in 0..n {
                m[(bad, k)] = m[(bad - 1, k)];
            }
            for k in 0..n {
                m[(k, bad)] = m[(k, bad - 1)];
            }
            m[(bad, bad)] -= 1e-9;
            assert_eq!(SymmetricFactor::new(&m).err(), Some(NotPositiveDefinite { row: bad }));
        }
    }

    #[test]
    fn the_parallelism_of_the_caller_is_left_as_it_was() {
        faer::set_global_parallelism(Par::rayon(3));
        SymmetricFactor::new(&matrix()).unwrap().inverse();
        symmetric_eigen(&matrix()).unwrap();
        assert_eq!(faer::get_global_parallelism(), Par::rayon(3));
    }

    #[test]
    fn eigenvalues_are_ascending() {
        let (values, vectors) = symmetric_eigen(&matrix()).unwrap();
        assert!(values.as_slice().windows(2).all(|w| w[0] <= w[1]));
        let rebuilt = &vectors * DMatrix::from_diagonal(&values) * vectors.transpose();
        assert!((rebuilt - matrix()).amax() < 1e-9 * matrix().amax());
    }
}
