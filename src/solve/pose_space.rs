//! The space in which pixels speak: six rows a camera pose, then the dense columns that act on images directly.
//!
//! What stays of the unknowns moves them by `T`: rows `[G, L]` of every pose, and the identity for the direct columns. Columns that are held are
//! zero.

use std::ops::Range;

use nalgebra::DMatrix;

use super::blocks::add_combination;
use super::linear::LinearProblem;
use crate::linalg::{columns_product, wide};

/// Unknowns that are latent at the stop of an image, and how they move its pose, 6 x unknowns.
type ByLatents = (Vec<usize>, DMatrix<f64>);

/// `T`, rows of the space x unknowns: the dense columns, then what is latent at the stops.
#[derive(Debug, Clone)]
pub(super) struct PoseSpace {
    /// Of the poses by the dense columns, 6 images x dense.
    by_dense: DMatrix<f64>,
    by_latents: Vec<ByLatents>,
    /// The dense columns that act directly.
    direct: Range<usize>,
    unknowns: usize,
}

impl PoseSpace {
    /// Of the images in use; `latent_start` is the first unknown of what is latent at each stop, of so many unknowns in all.
    pub fn new(linear: LinearProblem, latent_start: &[usize], unknowns: usize) -> Self {
        let layout = &linear.adjustment.problem.layout;
        let mut by_dense = DMatrix::zeros(6 * linear.images().len(), layout.len());
        let mut by_latents = Vec::with_capacity(linear.images().len());
        for (k, own) in linear.images().enumerate() {
            for c in (0..layout.theta_len()).filter(|&c| layout.columns[c].free) {
                by_dense.fixed_view_mut::<6, 1>(6 * k, c).copy_from(&own.chain.d_theta.column(c));
            }
            let start = latent_start[own.stop];
            let places = own.latents().into_iter().flatten().map(|place| start + place).collect();
            by_latents.push((places, own.chain.d_latent.clone()));
        }
        Self { by_dense, by_latents, direct: layout.theta_len()..layout.len(), unknowns }
    }

    /// The unknowns themselves, where nothing is latent: they are fewer than the rows of the poses.
    pub fn of_unknowns(unknowns: usize) -> Self {
        Self { by_dense: DMatrix::zeros(0, unknowns), by_latents: Vec::new(), direct: 0..unknowns, unknowns }
    }

    /// Whether `T` is the identity.
    pub fn is_of_unknowns(&self) -> bool {
        self.direct.len() == self.unknowns
    }

    /// Number of its rows.
    pub fn rows(&self) -> usize {
        self.by_dense.nrows() + self.direct.len()
    }

    /// Number of what stays.
    pub fn unknowns(&self) -> usize {
        self.unknowns
    }

    /// Row of a dense column that acts directly; `None` for one that acts through the poses.
    pub fn row_of(&self, column: usize) -> Option<usize> {
        Some(self.by_dense.nrows() + column.checked_sub(self.direct.start)?)
    }

    /// `T x`.
    pub fn times(&self, x: &DMatrix<f64>) -> DMatrix<f64> {
        self.times_transposed(&x.transpose()).transpose()
    }

    /// `T' y`.
    pub fn transposed_times(&self, y: &DMatrix<f64>) -> DMatrix<f64> {
        self.times_space(&y.transpose()).transpose()
    }

    /// `T' m T` of a symmetric matrix.
    pub fn congruent(&self, m: &DMatrix<f64>) -> DMatrix<f64> {
        self.times_space(&self.times_space(m).transpose())
    }

    /// `T c T'` of a symmetric matrix.
    pub fn spread(&self, c: &DMatrix<f64>) -> DMatrix<f64> {
        self.times_transposed(&self.times_transposed(c).transpose())
    }

    /// `m T`.
    fn times_space(&self, m: &DMatrix<f64>) -> DMatrix<f64> {
        let poses = self.by_dense.nrows();
        let of_dense = columns_product(m, 0..poses, &self.by_dense);
        let mut all = of_dense.resize_horizontally(self.unknowns, 0.0);
        let mut direct = all.columns_range_mut(self.direct.clone());
        direct += m.columns_range(poses..);
        for (k, (places, l)) in self.by_latents.iter().enumerate() {
            let of_pose: Vec<usize> = (6 * k..6 * k + 6).collect();
            for (place, l) in places.iter().zip(l.column_iter()) {
                add_columns((&mut all, *place), (m, &of_pose), l.as_slice());
            }
        }
        all
    }

    /// `m T'`.
    fn times_transposed(&self, m: &DMatrix<f64>) -> DMatrix<f64> {
        let (poses, dense) = self.by_dense.shape();
        let of_dense = columns_product(m, 0..dense, &self.by_dense.transpose());
        let mut all = of_dense.resize_horizontally(self.rows(), 0.0);
        all.columns_range_mut(poses..).copy_from(&m.columns_range(self.direct.clone()));
        for (k, (places, l)) in self.by_latents.iter().enumerate() {
            for (row, l) in l.row_iter().enumerate() {
                let by: Vec<f64> = l.iter().copied().collect();
                add_columns((&mut all, 6 * k + row), (m, places), &by);
            }
        }
        all
    }

    /// From now on the direct columns from `to` on move what the unknowns from `from` on move, too, times `by`.
    pub fn carry(&mut self, from: usize, to: usize, by: &DMatrix<f64>) {
        let dense = self.by_dense.ncols();
        if from + by.nrows() <= dense {
            let moved = self.by_dense.columns(from, by.nrows()) * by;
            let mut into = self.by_dense.columns_mut(to, by.ncols());
            into += moved;
            return;
        }
        for (k, (places, l)) in self.by_latents.iter().enumerate() {
            for (place, l) in places.iter().zip(l.column_iter()) {
                if let Some(row) = place.checked_sub(from).filter(|row| *row < by.nrows()) {
                    let mut into = self.by_dense.view_mut((6 * k, to), (6, by.ncols()));
                    into += l * by.row(row);
                }
            }
        }
    }
}

/// Adds some columns of `of`, each times its own factor, to one column of `to`.
fn add_columns((to, into): (&mut DMatrix<f64>, usize), (of, columns): (&DMatrix<f64>, &[usize]), by: &[f64]) {
    let rows = to.nrows();
    let into = &mut to.as_mut_slice()[into * rows..(into + 1) * rows];
    let column = |k: usize| &of.as_slice()[k * rows..(k + 1) * rows];
    for (columns, by) in columns.chunks(2).zip(by.chunks(2)) {
        let pair = [columns[0], columns[columns.len() - 1]].map(column);
        let factors = [by[0], by.get(1).copied().unwrap_or(0.0)];
        wide(
            #[inline(always)]
            || add_combination(into, pair, factors),
        );
    }
}
