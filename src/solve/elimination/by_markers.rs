//! Markers eliminated: the dense columns and what is latent at stops stay.
//!
//! With the information `V = F F'` of a marker (all images and the prior) and its coupling `B` with camera poses and intrinsics, `Y = B F^-T`:
//! the reduced information is the information without the elimination less `T' (sum Y Y') T`, one Gram product in the space of poses and
//! intrinsics, which what stays moves by `T` ([`PoseSpace`]). Where nothing is latent what stays is less than the poses, and `B` is taken
//! with it at once (`T = 1`).

use std::borrow::Cow;

use nalgebra::{DMatrix, DVector, DVectorView, Matrix3};
use rayon::prelude::*;

use super::blocks::{DenseCoupling, PoseRows, STOPS_A_PRODUCT};
use super::distances::Distances;
use super::marker_rows::{ImageRows, MarkerBlock, MarkerRows, times_right};
use super::pose_space::PoseSpace;
use super::right_hand_sides::RightHandSides;
use super::seen_markers::SeenMarkers;
use crate::linalg::{mirror_upper_rows, orthonormal, upper_product};
use crate::model::plate_modes::MODES;
use crate::problem::Step;
use crate::solve::linear::{Carried, LinearImage, LinearPose, LinearProblem, LinearStop};

/// Every marker that was seen, with its elimination.
#[derive(Debug, Clone)]
pub struct MarkersEliminated {
    seen: SeenMarkers,
    /// First unknown of what is latent at each stop in use.
    pub latent_start: Vec<usize>,
    /// `F^-1` of each that was seen.
    inverse_factors: Vec<Matrix3<f64>>,
    /// `T`.
    space: PoseSpace,
    /// `Y`, rows of the space x 3 markers, of which what is held is to be taken away.
    y: MarkerRows,
    /// `O`, orthonormal combinations of the whitened markers that are held, 3 markers x held.
    held: DMatrix<f64>,
    /// `Y O`.
    taken: DMatrix<f64>,
    /// `F^-1` times the right-hand side.
    rhs: DVector<f64>,
}

impl MarkersEliminated {
    /// Information with the priors of latents and markers, without those of the dense columns.
    pub fn build(linear: LinearProblem, lambda: f64) -> (DMatrix<f64>, Self) {
        let (layout, seen) = (&linear.adjustment.problem.layout, SeenMarkers::of(linear));
        let (latent_start, n) = latent_starts(linear);
        let mut a = DMatrix::zeros(n, n);
        let mut of_unknowns = (n == layout.len()).then(|| DenseCoupling::new(layout, &seen));
        let mut starts = latent_start.iter();
        for stops in linear.lin.stops.chunks(STOPS_A_PRODUCT) {
            let rows = PoseRows::new(linear, stops);
            rows.add_to(&mut a);
            if let Some(coupling) = &mut of_unknowns {
                let images: Vec<_> = linear.stops_of(stops).flat_map(|stop| stop.images()).collect();
                let equations: Vec<_> = images.iter().filter_map(LinearImage::equations).collect();
                let of_images: Vec<_> = images.into_iter().zip(equations.iter().map(Cow::as_ref)).collect();
                coupling.add(&rows, &of_images, &seen);
            }
            linear.stops_of(stops).zip(&mut starts).for_each(|(stop, &start)| add_latents(&mut a, &rows, &stop, start));
        }
        let of_markers = seen.information(linear).into_iter();
        let inverse_factors: Vec<Matrix3<f64>> = of_markers.map(|v| damped_inverse_factor(v, lambda)).collect();
        let (space, mut y) = match of_unknowns {
            Some(coupling) => (PoseSpace::of_unknowns(layout), coupling.of_all(layout)),
            None => {
                let space = PoseSpace::new(linear, &latent_start, n);
                let coupling = coupling_of_poses(linear, &seen, &space);
                (space, coupling)
            }
        };
        y.times_right(&inverse_factors.iter().map(Matrix3::transpose).collect::<Vec<_>>());
        mirror_upper_rows(&mut a, layout.len());
        space.take_congruent(&y.gram(), &mut a);
        let rhs = DVector::zeros(3 * seen.order.len());
        let (held, taken) = (DMatrix::zeros(rhs.len(), 0), DMatrix::zeros(space.rows(), 0));
        (a, Self { seen, latent_start, inverse_factors, space, y, held, taken, rhs })
    }

    /// Holds combinations of markers (3 markers x held): `Y` becomes `Y (1 - O O')` with the orthonormal basis `O` of `F^-1` times the
    /// combinations. Returns `T' Y O`, by whose Gram product the reduced information grows.
    pub fn hold(&mut self, combinations: &DMatrix<f64>) -> DMatrix<f64> {
        self.held = orthonormal(self.whitened(combinations.clone()));
        self.taken = self.y.times(&self.held);
        self.space.transposed_times(&self.taken)
    }

    /// `Y` without what is held, times a matrix of 3 markers rows.
    fn times(&self, right: &DMatrix<f64>) -> DMatrix<f64> {
        self.y.times(right) - &self.taken * self.held.tr_mul(right)
    }

    /// Its transpose times a matrix over the rows of the space.
    fn transposed_times(&self, right: &DMatrix<f64>) -> DMatrix<f64> {
        self.y.transposed_times(right) - &self.held * self.taken.tr_mul(right)
    }

    /// Unknowns from `to` on move those from `from` on along, times `by`.
    pub fn carry(&mut self, from: usize, to: usize, by: &DMatrix<f64>) {
        self.space.carry(from, to, by);
    }

    /// Takes over the right-hand side of the markers at a linearisation; returns the reduced one, without the priors of the dense columns.
    pub fn reduce_gradient(&mut self, linear: LinearProblem) -> DVector<f64> {
        let mut reduced = linear.dense_gradient(linear.lin.bodies.iter()).resize_vertically(self.space.unknowns(), 0.0);
        for (stop, &start) in linear.stops().zip(&self.latent_start) {
            let own = stop.gradient();
            reduced.rows_mut(start, own.len()).copy_from(&own);
        }
        self.rhs = self.whitened(column(self.seen.gradient(linear))).column(0).into_owned();
        reduced - self.space.transposed_times(&self.times(&column(self.rhs.clone()))).column(0)
    }

    /// `F^-1` times the right-hand side of the markers.
    pub fn whitened_gradient(&self) -> &DVector<f64> {
        &self.rhs
    }

    /// `U = F^-1 H_m` of measured distances, less what is held, from whose rows `H_x` by what stays `Y U` is taken.
    pub fn reduce_rows(&self, linear: LinearProblem, rows: &mut DMatrix<f64>) -> DMatrix<f64> {
        let mut whitened = self.whitened(self.seen.by_distances(linear));
        whitened -= &self.held * self.held.tr_mul(&whitened);
        *rows -= self.space.transposed_times(&self.times(&whitened));
        whitened
    }

    /// `b' V^-1 b` of the right-hand sides of the markers.
    pub fn squares(&self) -> f64 {
        self.rhs.norm_squared()
    }

    /// Covariance of a pose at a stop, as its body twist.
    pub fn pose_covariance(&self, reduced: &DMatrix<f64>, stop: &LinearStop, pose: &LinearPose) -> DMatrix<f64> {
        let (start, n, theta) = (self.latent_start[stop.at], stop.unknowns(), pose.chain.d_theta.ncols());
        let rows: Vec<usize> = (0..theta).chain(start..start + n).collect();
        let mut by = pose.chain.d_theta.clone().resize_horizontally(theta + n, 0.0);
        by.columns_mut(theta, n).copy_from(&pose.by_latents(n));
        &by * reduced.select_rows(&rows).select_columns(&rows) * by.transpose()
    }

    /// The whole step from the solution `x` of the reduced system, with what measured distances add to that of the whitened markers.
    pub fn step(&self, linear: LinearProblem, x: &DVector<f64>, by_distances: Option<DVector<f64>>) -> Step {
        let mut own = self.rhs.clone();
        own -= self.transposed_times(&self.space.times(&column(x.clone()))).column(0);
        by_distances.iter().for_each(|added| own += added);
        self.whole(linear, x.column(0), own.column(0))
    }

    /// The step from the solution `x` of the reduced system and that of the whitened markers.
    fn whole(&self, linear: LinearProblem, x: DVectorView<f64>, own: DVectorView<f64>) -> Step {
        let markers = self.seen.steps(|at| self.inverse_factors[at].transpose() * own.fixed_rows::<3>(3 * at));
        let dense = x.rows(0, linear.adjustment.problem.layout.len()).into_owned();
        let mut step = Step::of(dense, markers, &linear.adjustment.state);
        for (stop, &start) in linear.stops().zip(&self.latent_start) {
            stop.put(x.rows(start, stop.unknowns()).as_slice(), &mut step);
        }
        step
    }

    /// `F^-1` times the rows of every marker.
    fn whitened(&self, mut rows: DMatrix<f64>) -> DMatrix<f64> {
        for (at, inverse) in self.inverse_factors.iter().enumerate() {
            let own = inverse * rows.fixed_rows::<3>(3 * at);
            rows.fixed_rows_mut::<3>(3 * at).copy_from(&own);
        }
        rows
    }

    /// Whole steps for right-hand sides of their own, by what solves the reduced system.
    pub fn steps(
        &self,
        linear: LinearProblem,
        of: &RightHandSides,
        distances: &Distances,
        solve: impl Fn(DMatrix<f64>) -> DMatrix<f64>,
    ) -> Vec<Step> {
        let whitened = self.whitened(of.markers.clone());
        let mut reduced = of.dense.clone().resize_vertically(self.space.unknowns(), 0.0);
        for (own, &start) in of.stops.iter().zip(&self.latent_start) {
            reduced.rows_mut(start, own.nrows()).copy_from(own);
        }
        reduced -= self.space.transposed_times(&self.times(&whitened));
        distances.reduced_by(&whitened).iter().for_each(|added| reduced += added);
        let x = solve(reduced);
        let mut own = &whitened - self.transposed_times(&self.space.times(&x));
        distances.markers_by(&whitened, &x).iter().for_each(|added| own += added);
        x.column_iter().zip(own.column_iter()).map(|(x, own)| self.whole(linear, x, own)).collect()
    }

    /// Covariance of every marker that was seen: `V^-1 + D cov(x) D'` with `D = V^-1 B' T`, less what moves the marker with `x`
    /// for a position instead of a correction.
    pub fn marker_covariances(
        &self,
        reduced: &DMatrix<f64>,
        distances: &Distances,
        carried: Option<&Carried>,
    ) -> Vec<Vec<Option<Matrix3<f64>>>> {
        let mut half = self.space.spread(reduced);
        (0..half.nrows()).for_each(|row| half[(row, row)] *= 0.5);
        let with_distances = distances.with_markers(reduced, |r| self.space.times(r));
        let has_all_rows = self.held.ncols() > 0 || carried.is_some() || with_distances.is_some();
        let of_block = |block: &MarkerBlock| {
            let markers = block.markers.clone();
            let (mut d, of_rows) = match has_all_rows {
                true => (self.all_rows(block), Cow::Borrowed(&half)),
                false => (block.values.clone(), Cow::Owned(block.upper_part_of(&half))),
            };
            times_right(&mut d, &self.inverse_factors[markers.clone()]);
            for (k, at) in markers.clone().enumerate() {
                let (p, m) = self.seen.order[at];
                for (start, modes) in carried.into_iter().flat_map(|c| c(p, m)) {
                    let Some(row) = self.space.row_of(start) else { continue };
                    let mut own = d.view_mut((row, 3 * k), (MODES, 3));
                    own -= modes.transpose();
                }
            }
            // Half of the symmetric one, which it and its transpose add up to.
            let cd = upper_product(&of_rows, &d);
            let of = |(k, at): (usize, usize)| {
                let d = d.columns(3 * k, 3);
                let half = Matrix3::from_column_slice(d.tr_mul(&cd.columns(3 * k, 3)).as_slice());
                let mut c = half + half.transpose();
                let (f, held) = (self.inverse_factors[at], self.held.rows(3 * at, 3));
                if let Some(with) = &with_distances {
                    c += with.of_marker(at, &d, &f);
                }
                let held = Matrix3::from_column_slice((held * held.transpose()).as_slice());
                let left = Matrix3::identity() - held - distances.of_marker(at);
                f.transpose() * left * f + c
            };
            markers.enumerate().map(of).collect::<Vec<_>>()
        };
        let all: Vec<Vec<Matrix3<f64>>> = self.y.blocks.par_iter().map(of_block).collect();
        let all = all.concat();
        self.seen.number.iter().map(|plate| plate.iter().map(|at| at.map(|at| all[at])).collect()).collect()
    }

    /// All rows of a block of `Y`, without what is held.
    fn all_rows(&self, block: &MarkerBlock) -> DMatrix<f64> {
        let held = self.held.rows(3 * block.markers.start, 3 * block.markers.len());
        block.whole(self.space.rows()) - &self.taken * held.transpose()
    }
}

/// Where the latents of every stop start behind the dense columns, and where they end.
fn latent_starts(linear: LinearProblem) -> (Vec<usize>, usize) {
    let mut n = linear.adjustment.problem.layout.len();
    let start = |own: usize| {
        n += own;
        n - own
    };
    let starts = linear.stops().map(|stop| stop.unknowns()).map(start).collect();
    (starts, n)
}

/// Information of the latents of a stop, and of them with the dense columns.
fn add_latents(a: &mut DMatrix<f64>, rows: &PoseRows, stop: &LinearStop, start: usize) {
    for pose in stop.poses() {
        let with_dense = rows.of(pose.place).tr_mul(&pose.chain.d_latent);
        for (row, own) in pose.latents.into_iter().zip(with_dense.column_iter()) {
            let mut column = a.view_mut((0, start + row), (with_dense.nrows(), 1));
            column += own;
        }
    }
    let mut own = stop.information();
    own.fill_lower_triangle_with_upper_triangle();
    a.view_mut((start, start), own.shape()).copy_from(&own);
}

/// `F^-1` of the damped information of a marker; zero where it has none.
fn damped_inverse_factor(mut v: Matrix3<f64>, lambda: f64) -> Matrix3<f64> {
    (0..3).for_each(|d| v[(d, d)] *= 1.0 + lambda);
    v.cholesky().and_then(|c| c.l().try_inverse()).unwrap_or_else(Matrix3::zeros)
}

/// As a matrix.
fn column(x: DVector<f64>) -> DMatrix<f64> {
    DMatrix::from_column_slice(x.len(), 1, x.as_slice())
}

/// Of poses and intrinsics, by rows of their space.
fn coupling_of_poses(linear: LinearProblem, seen: &SeenMarkers, space: &PoseSpace) -> MarkerRows {
    let row_of = |c: usize| linear.adjustment.problem.layout.columns[c].free.then(|| space.row_of(c)).flatten();
    let images: Vec<_> = linear.images().enumerate().filter_map(|(k, own)| Some((k, own, own.equations()?))).collect();
    let images: Vec<ImageRows> =
        images.iter().map(|(k, own, equations)| ImageRows::of(own, equations, 6 * k, row_of)).collect();
    MarkerRows::of(space.rows(), seen, &images)
}
