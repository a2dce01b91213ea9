//! The space in which pixels speak: six rows a camera pose, then the dense columns that act on images directly.
//!
//! What stays of the unknowns moves them by `T`: rows `[G, L]` of every pose, and the identity for the direct columns. Columns that are held are
//! zero. Where nothing is latent, the dense columns stand for the poses that they move, and `T = 1` until something is carried along.

use std::ops::Range;

use nalgebra::{DMatrix, DVectorView, Vector6};
use rayon::prelude::*;

use crate::linalg::{COLUMNS_A_BLOCK, add_combination, columns_product, product, transposed_product_with, wide};
use crate::problem::Layout;
use crate::solve::linear::LinearProblem;

/// Unknowns that are latent at the stop of an image, and how each moves its pose.
type ByLatents = Vec<(usize, Vector6<f64>)>;

/// The same, row by row of the pose.
#[derive(Debug, Clone)]
struct LatentRows {
    places: Vec<usize>,
    /// So many a row as there are places.
    rows: Vec<f64>,
}

impl LatentRows {
    fn of(latents: &ByLatents) -> Self {
        let rows = (0..6).flat_map(|row| latents.iter().map(move |(_, l)| l[row])).collect();
        Self { places: latents.iter().map(|(place, _)| *place).collect(), rows }
    }

    /// Adds what is latent of a column of `T' y`, of which those are the rows of its pose.
    #[inline(always)]
    fn add_to(&self, into: &mut [f64], y: &[f64; 6]) {
        let (Some(&first), n) = (self.places.first(), self.places.len()) else { return };
        let rows: [&[f64]; 6] = std::array::from_fn(|row| &self.rows[row * n..(row + 1) * n]);
        if self.places[n - 1] - first + 1 == n {
            return add_combination(&mut into[first..first + n], rows, *y);
        }
        for (k, &place) in self.places.iter().enumerate() {
            add_combination(&mut into[place..=place], rows.map(|row| &row[k..=k]), *y);
        }
    }
}

/// `T`, rows of the space x unknowns: the dense columns, then what is latent at the stops.
#[derive(Debug, Clone)]
pub struct PoseSpace {
    /// Dense columns that move poses.
    columns: Vec<usize>,
    /// Of the poses by these, 6 images x columns.
    by_columns: DMatrix<f64>,
    by_latents: Vec<ByLatents>,
    latent_rows: Vec<LatentRows>,
    /// The dense columns that act directly.
    direct: Range<usize>,
    unknowns: usize,
}

impl PoseSpace {
    /// Of the images in use; `latent_start` is the first unknown of what is latent at each stop, of so many unknowns in all.
    pub fn new(linear: LinearProblem, latent_start: &[usize], unknowns: usize) -> Self {
        let layout = &linear.adjustment.problem.layout;
        let columns: Vec<usize> = (0..layout.theta_len()).filter(|&c| layout.columns[c].free).collect();
        let mut by_columns = DMatrix::zeros(6 * linear.images().len(), columns.len());
        let mut by_latents = Vec::with_capacity(linear.images().len());
        for (k, own) in linear.images().enumerate() {
            for (at, &c) in columns.iter().enumerate() {
                by_columns.fixed_view_mut::<6, 1>(6 * k, at).copy_from(&own.chain.d_theta.column(c));
            }
            let start = latent_start[own.stop];
            let places = own.latents().into_iter().flatten().map(|place| start + place);
            let moves = own.chain.d_latent.fixed_rows::<6>(0);
            by_latents.push(places.zip(moves.column_iter().map(|l| l.into_owned())).collect());
        }
        let latent_rows = by_latents.iter().map(LatentRows::of).collect();
        Self { columns, by_columns, by_latents, latent_rows, direct: layout.theta_len()..layout.len(), unknowns }
    }

    /// The dense columns themselves, where nothing is latent: they are fewer than the rows of the poses.
    pub fn of_unknowns(layout: &Layout) -> Self {
        let (theta, unknowns) = (layout.theta_len(), layout.len());
        let (columns, by_columns) = ((0..theta).collect(), DMatrix::identity(theta, theta));
        let (by_latents, latent_rows) = (Vec::new(), Vec::new());
        Self { columns, by_columns, by_latents, latent_rows, direct: theta..unknowns, unknowns }
    }

    /// Number of its rows.
    pub fn rows(&self) -> usize {
        self.poses() + self.direct.len()
    }

    /// Number of the rows of poses.
    fn poses(&self) -> usize {
        self.by_columns.nrows()
    }

    /// Number of what stays.
    pub fn unknowns(&self) -> usize {
        self.unknowns
    }

    /// Row of a dense column that acts directly; `None` for one that acts through the poses.
    pub fn row_of(&self, column: usize) -> Option<usize> {
        Some(self.poses() + column.checked_sub(self.direct.start)?)
    }

    /// `T x`.
    pub fn times(&self, x: &DMatrix<f64>) -> DMatrix<f64> {
        let mut all = product(&self.by_columns, &x.select_rows(&self.columns)).resize_vertically(self.rows(), 0.0);
        for (mut into, x) in all.column_iter_mut().zip(x.column_iter()) {
            into.rows_range_mut(self.poses()..).copy_from(&x.rows_range(self.direct.clone()));
            for (k, latents) in self.by_latents.iter().enumerate() {
                let mut pose = into.fixed_rows_mut::<6>(6 * k);
                pose += latents.iter().map(|(place, l)| l * x[*place]).sum::<Vector6<f64>>();
            }
        }
        all
    }

    /// `T' y`.
    pub fn transposed_times(&self, y: &DMatrix<f64>) -> DMatrix<f64> {
        let mut all = self.without_columns(y);
        self.add_columns_of(y, &mut all, y.ncols());
        all
    }

    /// `T' y` of what is latent and of the columns that act directly.
    fn without_columns(&self, y: &DMatrix<f64>) -> DMatrix<f64> {
        let mut all = DMatrix::zeros(self.unknowns, y.ncols());
        for (mut into, y) in all.column_iter_mut().zip(y.column_iter()) {
            self.add_without_columns(y, into.as_mut_slice());
        }
        all
    }

    /// Adds to a column of `T' y` what is latent and the columns that act directly have in it.
    fn add_without_columns(&self, y: DVectorView<f64>, into: &mut [f64]) {
        let direct = into[self.direct.clone()].iter_mut().zip(&y.as_slice()[self.poses()..]);
        direct.for_each(|(into, y)| *into += y);
        wide(
            #[inline(always)]
            || {
                let poses = y.as_slice().as_chunks::<6>().0;
                self.latent_rows.iter().zip(poses).for_each(|(latents, y)| latents.add_to(into, y));
            },
        );
    }

    /// Adds to the first columns of `T' y` what those that move poses have in it.
    fn add_columns_of(&self, y: &DMatrix<f64>, all: &mut DMatrix<f64>, first: usize) {
        let own = transposed_product_with(&self.by_columns, y, 0..self.poses(), 0..first);
        for (own, &row) in own.row_iter().zip(&self.columns) {
            let mut sum = all.view_mut((row, 0), (1, first));
            sum += own;
        }
    }

    /// `a -= T' m T` of symmetric matrices.
    pub fn take_congruent(&self, m: &DMatrix<f64>, a: &mut DMatrix<f64>) {
        let (half, dense) = (self.times_space(m), self.direct.end);
        let of_columns = transposed_product_with(&self.by_columns, &half, 0..self.poses(), 0..dense);
        let rows = self.unknowns.max(1);
        a.as_mut_slice().par_chunks_mut(COLUMNS_A_BLOCK * rows).enumerate().for_each(|(block, columns)| {
            let mut own = vec![0.0; rows];
            for (c, column) in (block * COLUMNS_A_BLOCK..).zip(columns.chunks_exact_mut(rows)) {
                let half = half.column(c);
                if half.iter().all(|x| *x == 0.0) {
                    continue;
                }
                own.fill(0.0);
                self.add_without_columns(half, &mut own);
                if c < dense {
                    self.columns.iter().zip(of_columns.column(c).iter()).for_each(|(&row, sum)| own[row] += sum);
                }
                column.iter_mut().zip(&own).for_each(|(a, own)| *a -= own);
            }
        });
        for latent in dense..self.unknowns {
            (0..dense).for_each(|row| a[(row, latent)] = a[(latent, row)]);
        }
    }

    /// `T c T'` of a symmetric matrix.
    pub fn spread(&self, c: &DMatrix<f64>) -> DMatrix<f64> {
        self.times(&self.times_transposed(c))
    }

    /// `m T`.
    fn times_space(&self, m: &DMatrix<f64>) -> DMatrix<f64> {
        let mut all = DMatrix::zeros(m.nrows(), self.unknowns);
        all.columns_range_mut(self.direct.clone()).copy_from(&m.columns_range(self.poses()..));
        let own = columns_product(m, 0..self.poses(), &self.by_columns);
        for (own, &column) in own.column_iter().zip(&self.columns) {
            let mut sum = all.column_mut(column);
            sum += own;
        }
        for (k, latents) in self.by_latents.iter().enumerate() {
            let of_pose: Vec<usize> = (6 * k..6 * k + 6).collect();
            latents.iter().for_each(|(place, l)| add_columns((&mut all, *place), (m, &of_pose), l.as_slice()));
        }
        all
    }

    /// `m T'`.
    fn times_transposed(&self, m: &DMatrix<f64>) -> DMatrix<f64> {
        let of_columns = product(&m.select_columns(&self.columns), &self.by_columns.transpose());
        let mut all = of_columns.resize_horizontally(self.rows(), 0.0);
        all.columns_range_mut(self.poses()..).copy_from(&m.columns_range(self.direct.clone()));
        for (k, latents) in self.by_latents.iter().enumerate() {
            let (places, by): (Vec<usize>, Vec<Vector6<f64>>) = latents.iter().copied().unzip();
            for row in 0..6 {
                let by: Vec<f64> = by.iter().map(|l| l[row]).collect();
                add_columns((&mut all, 6 * k + row), (m, &places), &by);
            }
        }
        all
    }

    /// From now on the direct columns from `to` on move what the unknowns from `from` on move, too, times `by`.
    pub fn carry(&mut self, from: usize, to: usize, by: &DMatrix<f64>) {
        let mut moved = DMatrix::zeros(self.poses(), by.nrows());
        for (&column, own) in self.columns.iter().zip(self.by_columns.column_iter()) {
            if (from..from + by.nrows()).contains(&column) {
                moved.column_mut(column - from).copy_from(&own);
            }
        }
        for (k, latents) in self.by_latents.iter().enumerate() {
            for (place, l) in latents.iter().filter(|(place, _)| (from..from + by.nrows()).contains(place)) {
                moved.fixed_view_mut::<6, 1>(6 * k, place - from).copy_from(l);
            }
        }
        for (column, added) in (to..).zip((moved * by).column_iter()) {
            let at = self.columns.iter().position(|c| *c == column).unwrap_or_else(|| {
                self.columns.push(column);
                let width = self.columns.len();
                self.by_columns.resize_horizontally_mut(width, 0.0);
                width - 1
            });
            let mut sum = self.by_columns.column_mut(at);
            sum += added;
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
