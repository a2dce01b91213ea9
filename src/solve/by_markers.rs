//! Markers eliminated: the dense columns and what is latent at stops stay.
//!
//! With the information `V = F F'` of a marker (all images and the prior) and its coupling `B` with what stays, `Y = B F^-T`: the reduced
//! information is the information without the elimination less `sum Y Y'`, one Gram product.

use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

use super::blocks::{DenseCoupling, PoseRows, STOPS_A_PRODUCT, SeenMarkers, latents_with_markers, times_right};
use super::distances::Distances;
use super::linear::Carried;
use super::linear::LinearProblem;
use crate::linalg::{mirror_upper, orthonormal, product, subtract_gram};
use crate::model::plate_modes::MODES;
use crate::problem::Step;

/// Every marker that was seen, with its elimination.
#[derive(Debug, Clone)]
pub(super) struct MarkersEliminated {
    seen: SeenMarkers,
    /// First unknown of what is latent at each stop in use.
    pub latent_start: Vec<usize>,
    /// `F^-1` of each that was seen.
    inverse_factors: Vec<Matrix3<f64>>,
    /// `Y`, unknowns that stay x 3 markers; without what is held.
    y: DMatrix<f64>,
    /// Orthonormal combinations of the whitened markers that are held, 3 markers x held.
    held: DMatrix<f64>,
    /// `F^-1` times the right-hand side.
    rhs: DVector<f64>,
}

impl MarkersEliminated {
    /// Information with the priors of latents and markers, without those of the dense columns.
    pub fn build(linear: LinearProblem, lambda: f64) -> (DMatrix<f64>, Self) {
        let mut n = linear.adjustment.problem.layout.len();
        let latent_start: Vec<usize> = (linear.stops())
            .map(|stop| {
                let own = stop.unknowns();
                n += own;
                n - own
            })
            .collect();
        let mut a = DMatrix::zeros(n, n);
        let mut starts = latent_start.iter();
        for stops in linear.lin.stops.chunks(STOPS_A_PRODUCT) {
            let rows = PoseRows::new(linear, stops);
            rows.add_to(&mut a);
            for (stop, &start) in linear.stops_of(stops).zip(&mut starts) {
                for pose in stop.poses() {
                    let with_dense = rows.of(pose.place).tr_mul(&pose.chain.d_latent);
                    for (row, own) in pose.latents.into_iter().zip(with_dense.column_iter()) {
                        let mut column = a.view_mut((0, start + row), (with_dense.nrows(), 1));
                        column += own;
                    }
                }
                let own = stop.information();
                a.view_mut((start, start), own.shape()).copy_from(&own);
            }
        }
        let seen = SeenMarkers::of(linear);
        let damped = |mut v: Matrix3<f64>| {
            (0..3).for_each(|d| v[(d, d)] *= 1.0 + lambda);
            v.cholesky().and_then(|c| c.l().try_inverse()).unwrap_or_else(Matrix3::zeros)
        };
        let inverse_factors: Vec<Matrix3<f64>> = seen.information(linear).into_iter().map(damped).collect();
        let y = whitened_coupling(linear, &seen, &inverse_factors, (n, &latent_start));
        subtract_gram(&mut a, &y);
        mirror_upper(&mut a);
        let rhs = DVector::zeros(3 * seen.order.len());
        let held = DMatrix::zeros(rhs.len(), 0);
        (a, Self { seen, latent_start, inverse_factors, y, held, rhs })
    }

    /// Holds combinations of markers (3 markers x held): `Y` becomes `Y (1 - O O')` with the orthonormal basis `O` of `F^-1` times the
    /// combinations. Returns `Y O`, by whose Gram product the reduced information grows.
    pub fn hold(&mut self, combinations: &DMatrix<f64>) -> DMatrix<f64> {
        let mut whitened = combinations.clone();
        for (at, inverse) in self.inverse_factors.iter().enumerate() {
            let own = inverse * whitened.rows(3 * at, 3);
            whitened.rows_mut(3 * at, 3).copy_from(&own);
        }
        self.held = orthonormal(whitened);
        let taken = product(&self.y, &self.held);
        self.y -= product(&taken, &self.held.transpose());
        taken
    }

    /// Takes the rows from `from` on times `by` to those from `to` on: unknowns `to` move those `from` along.
    pub fn carry(&mut self, from: usize, to: usize, by: &DMatrix<f64>) {
        let carried = by.tr_mul(&self.y.rows(from, by.nrows()));
        let mut rows = self.y.rows_mut(to, by.ncols());
        rows += carried;
    }

    /// Takes over the right-hand side of the markers at a linearisation; returns the reduced one, without the priors of the dense columns.
    pub fn reduce_gradient(&mut self, linear: LinearProblem) -> DVector<f64> {
        let mut reduced = linear.dense_gradient().resize_vertically(self.y.nrows(), 0.0);
        for (stop, &start) in linear.stops().zip(&self.latent_start) {
            let own = stop.gradient();
            reduced.rows_mut(start, own.len()).copy_from(&own);
        }
        self.rhs = self.seen.gradient(linear);
        for (at, inverse) in self.inverse_factors.iter().enumerate() {
            let own = inverse * self.rhs.fixed_rows::<3>(3 * at);
            self.rhs.fixed_rows_mut::<3>(3 * at).copy_from(&own);
        }
        reduced.gemv(-1.0, &self.y, &self.rhs, 1.0);
        reduced
    }

    /// `F^-1` times the right-hand side of the markers.
    pub fn whitened_gradient(&self) -> &DVector<f64> {
        &self.rhs
    }

    /// `U = F^-1 H_m` of measured distances, less what is held, from whose rows `H_x` by what stays `Y U` is taken.
    pub fn reduce_rows(&self, linear: LinearProblem, rows: &mut DMatrix<f64>) -> DMatrix<f64> {
        let mut whitened = self.seen.by_distances(linear);
        for (at, inverse) in self.inverse_factors.iter().enumerate() {
            let own = inverse * whitened.rows(3 * at, 3);
            whitened.rows_mut(3 * at, 3).copy_from(&own);
        }
        whitened -= &self.held * self.held.tr_mul(&whitened);
        *rows -= product(&self.y, &whitened);
        whitened
    }

    /// `b' V^-1 b` of the right-hand sides of the markers.
    pub fn squares(&self) -> f64 {
        self.rhs.norm_squared()
    }

    /// The whole step from the solution `x` of the reduced system, with what measured distances add to that of the whitened markers.
    pub fn step(&self, linear: LinearProblem, x: &DVector<f64>, by_distances: Option<DVector<f64>>) -> Step {
        let dense = x.rows(0, linear.adjustment.problem.layout.len()).into_owned();
        let mut own = self.rhs.clone();
        own.gemv_tr(-1.0, &self.y, x, 1.0);
        by_distances.iter().for_each(|added| own += added);
        let of = |at: usize| self.inverse_factors[at].transpose() * own.fixed_rows::<3>(3 * at);
        let step = |at: &Option<usize>| at.map_or(Vector3::zeros(), of);
        let markers = self.seen.number.iter().map(|plate| plate.iter().map(step).collect()).collect();
        let mut step = Step::of(dense, markers, &linear.adjustment.state);
        for (stop, &start) in linear.stops().zip(&self.latent_start) {
            stop.put(x.rows(start, stop.unknowns()).as_slice(), &mut step);
        }
        step
    }

    /// Covariance of every marker that was seen: `V^-1 + D cov(x) D'` with `D = V^-1 B'`, less what moves the marker with `x`
    /// for a position instead of a correction.
    pub fn marker_covariances(
        &self,
        reduced: &DMatrix<f64>,
        distances: &Distances,
        carried: Option<&Carried>,
    ) -> Vec<Vec<Option<Matrix3<f64>>>> {
        let mut d = self.y.clone();
        distances.add_to_coupling(&mut d);
        for (p, plate) in self.seen.number.iter().enumerate() {
            for (m, at) in plate.iter().enumerate().filter_map(|(m, at)| at.map(|at| (m, at))) {
                times_right(&mut d, 3 * at, &self.inverse_factors[at]);
                for (start, modes) in carried.into_iter().flat_map(|c| c(p, m)) {
                    let mut own = d.view_mut((start, 3 * at), (MODES, 3));
                    own -= modes.transpose();
                }
            }
        }
        let cd = product(reduced, &d);
        let of = |at: usize| {
            let c = d.columns(3 * at, 3).tr_mul(&cd.columns(3 * at, 3));
            let (f, held) = (self.inverse_factors[at], self.held.rows(3 * at, 3));
            let held = Matrix3::from_column_slice((held * held.transpose()).as_slice());
            let left = Matrix3::identity() - held - distances.of_marker(at);
            f.transpose() * left * f + Matrix3::from_column_slice(c.as_slice())
        };
        self.seen.number.iter().map(|plate| plate.iter().map(|at| at.map(of)).collect()).collect()
    }
}

/// `Y`, unknowns that stay x 3 markers.
fn whitened_coupling(
    linear: LinearProblem,
    seen: &SeenMarkers,
    inverse_factors: &[Matrix3<f64>],
    (n, latent_start): (usize, &[usize]),
) -> DMatrix<f64> {
    let mut y = DMatrix::zeros(n, 3 * seen.order.len());
    let mut dense = DenseCoupling::new(&linear.adjustment.problem, seen);
    for own in linear.images() {
        let start = latent_start[own.stop];
        let Some(equations) = own.equations() else { continue };
        dense.add(own, seen, &equations);
        let number = &seen.number[own.image.plate];
        let [joints, tie] = own.latents();
        let (markers, mut coupling) = latents_with_markers(&own.chain.d_latent, &equations);
        for (m, &marker) in markers.iter().enumerate() {
            let Some(at) = number[marker] else { continue };
            times_right(&mut coupling, 3 * m, &inverse_factors[at].transpose());
            let coupling = coupling.columns(3 * m, 3);
            let mut of_joints = y.view_mut((start + joints.start, 3 * at), (joints.len(), 3));
            of_joints += coupling.rows(0, joints.len());
            let mut of_tie = y.view_mut((start + tie.start, 3 * at), (tie.len(), 3));
            of_tie += coupling.rows(joints.len(), tie.len());
        }
    }
    dense.times_right(inverse_factors.iter().map(Matrix3::transpose));
    dense.copy_to(&mut y, 0);
    y
}
