//! Markers eliminated: the dense columns and what is latent at stops stay.
//!
//! With the information `V = F F'` of a marker (all images and the prior) and its coupling `B` with camera poses and intrinsics, `Y = B F^-T`:
//! the reduced information is the information without the elimination less `T' (sum Y Y') T`, one Gram product in the space of poses and
//! intrinsics, which what stays moves by `T` ([`PoseSpace`]). Where nothing is latent what stays is less than the poses, and `B` is taken
//! with it at once (`T = 1`).

use nalgebra::{DMatrix, DVector, DVectorView, Matrix3};

use super::blocks::{DenseCoupling, ImageRows, MarkerRows, PoseRows, STOPS_A_PRODUCT, SeenMarkers};
use super::distances::Distances;
use super::linear::Carried;
use super::linear::LinearProblem;
use super::pose_space::PoseSpace;
use super::right_hand_sides::RightHandSides;
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
    /// `T`.
    space: PoseSpace,
    /// `Y`, rows of the space x 3 markers; without what is held.
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
        let (space, mut coupling) = if n == linear.adjustment.problem.layout.len() {
            (PoseSpace::of_unknowns(n), coupling_of_unknowns(linear, &seen))
        } else {
            let space = PoseSpace::new(linear, &latent_start, n);
            let coupling = coupling_of_poses(linear, &seen, &space);
            (space, coupling)
        };
        coupling.times_right(&inverse_factors.iter().map(Matrix3::transpose).collect::<Vec<_>>());
        let y = coupling.values;
        let mut taken = DMatrix::zeros(y.nrows(), y.nrows());
        subtract_gram(&mut taken, &y);
        mirror_upper(&mut taken);
        a += space.congruent(&taken);
        mirror_upper(&mut a);
        let rhs = DVector::zeros(3 * seen.order.len());
        let held = DMatrix::zeros(rhs.len(), 0);
        (a, Self { seen, latent_start, inverse_factors, space, y, held, rhs })
    }

    /// Holds combinations of markers (3 markers x held): `Y` becomes `Y (1 - O O')` with the orthonormal basis `O` of `F^-1` times the
    /// combinations. Returns `T' Y O`, by whose Gram product the reduced information grows.
    pub fn hold(&mut self, combinations: &DMatrix<f64>) -> DMatrix<f64> {
        self.held = orthonormal(self.whitened(combinations.clone()));
        let taken = product(&self.y, &self.held);
        self.y -= product(&taken, &self.held.transpose());
        self.space.transposed_times(&taken)
    }

    /// Unknowns from `to` on move those from `from` on along, times `by`.
    pub fn carry(&mut self, from: usize, to: usize, by: &DMatrix<f64>) {
        if self.space.is_of_unknowns() {
            let moved = by.tr_mul(&self.y.rows(from, by.nrows()));
            let mut into = self.y.rows_mut(to, by.ncols());
            into += moved;
        } else {
            self.space.carry(from, to, by);
        }
    }

    /// Takes over the right-hand side of the markers at a linearisation; returns the reduced one, without the priors of the dense columns.
    pub fn reduce_gradient(&mut self, linear: LinearProblem) -> DVector<f64> {
        let mut reduced = linear.dense_gradient().resize_vertically(self.space.unknowns(), 0.0);
        for (stop, &start) in linear.stops().zip(&self.latent_start) {
            let own = stop.gradient();
            reduced.rows_mut(start, own.len()).copy_from(&own);
        }
        self.rhs = self.whitened(column(self.seen.gradient(linear))).column(0).into_owned();
        reduced - self.space.transposed_times(&column(&self.y * &self.rhs)).column(0)
    }

    /// `F^-1` times the right-hand side of the markers.
    pub fn whitened_gradient(&self) -> &DVector<f64> {
        &self.rhs
    }

    /// `U = F^-1 H_m` of measured distances, less what is held, from whose rows `H_x` by what stays `Y U` is taken.
    pub fn reduce_rows(&self, linear: LinearProblem, rows: &mut DMatrix<f64>) -> DMatrix<f64> {
        let mut whitened = self.whitened(self.seen.by_distances(linear));
        whitened -= &self.held * self.held.tr_mul(&whitened);
        *rows -= self.space.transposed_times(&product(&self.y, &whitened));
        whitened
    }

    /// `b' V^-1 b` of the right-hand sides of the markers.
    pub fn squares(&self) -> f64 {
        self.rhs.norm_squared()
    }

    /// The whole step from the solution `x` of the reduced system, with what measured distances add to that of the whitened markers.
    pub fn step(&self, linear: LinearProblem, x: &DVector<f64>, by_distances: Option<DVector<f64>>) -> Step {
        let mut own = self.rhs.clone();
        own.gemv_tr(-1.0, &self.y, &self.space.times(&column(x.clone())).column(0), 1.0);
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
        reduced -= self.space.transposed_times(&product(&self.y, &whitened));
        distances.reduced_by(&whitened).iter().for_each(|added| reduced += added);
        let x = solve(reduced);
        let mut own = &whitened - product(&self.y.transpose(), &self.space.times(&x));
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
        let mut rows = MarkerRows { values: self.y.clone() };
        rows.times_right(&self.inverse_factors);
        let mut d = rows.values;
        for (at, &(p, m)) in self.seen.order.iter().enumerate() {
            for (start, modes) in carried.into_iter().flat_map(|c| c(p, m)) {
                let Some(row) = self.space.row_of(start) else { continue };
                let mut own = d.view_mut((row, 3 * at), (MODES, 3));
                own -= modes.transpose();
            }
        }
        let cd = product(&self.space.spread(reduced), &d);
        let with_distances = distances.with_markers(reduced, |r| self.space.times(r));
        let of = |at: usize| {
            let d = d.columns(3 * at, 3);
            let mut c = Matrix3::from_column_slice(d.tr_mul(&cd.columns(3 * at, 3)).as_slice());
            let (f, held) = (self.inverse_factors[at], self.held.rows(3 * at, 3));
            if let Some(with) = &with_distances {
                c += with.of_marker(at, &d, &f);
            }
            let held = Matrix3::from_column_slice((held * held.transpose()).as_slice());
            let left = Matrix3::identity() - held - distances.of_marker(at);
            f.transpose() * left * f + c
        };
        self.seen.number.iter().map(|plate| plate.iter().map(|at| at.map(of)).collect()).collect()
    }
}

/// As a matrix.
fn column(x: DVector<f64>) -> DMatrix<f64> {
    DMatrix::from_column_slice(x.len(), 1, x.as_slice())
}

/// Of poses and intrinsics, by rows of their space.
fn coupling_of_poses(linear: LinearProblem, seen: &SeenMarkers, space: &PoseSpace) -> MarkerRows {
    let mut rows = MarkerRows::new(space.rows(), seen);
    let row_of = |c: usize| linear.adjustment.problem.layout.columns[c].free.then(|| space.row_of(c)).flatten();
    let images: Vec<_> = linear.images().enumerate().filter_map(|(k, own)| Some((k, own, own.equations()?))).collect();
    let images: Vec<ImageRows> = (images.iter())
        .map(|(k, own, equations)| ImageRows {
            plate: own.image.plate,
            equations,
            pose: Some(6 * k),
            intrinsics: own.columns().into_iter().map(|c| c.and_then(row_of)).collect(),
        })
        .collect();
    rows.add(seen, &images);
    rows
}

/// Of the dense columns, where nothing is latent.
fn coupling_of_unknowns(linear: LinearProblem, seen: &SeenMarkers) -> MarkerRows {
    let problem = &linear.adjustment.problem;
    let mut coupling = DenseCoupling::new(problem, seen);
    for stops in linear.lin.stops.chunks(STOPS_A_PRODUCT) {
        let images = linear.stops_of(stops).flat_map(|stop| stop.images());
        let images: Vec<_> = images.filter_map(|own| Some((own, own.equations()?))).collect();
        coupling.add(&images.iter().map(|(own, equations)| (*own, equations.as_ref())).collect::<Vec<_>>(), seen);
    }
    let mut rows = MarkerRows::new(problem.layout.len(), seen);
    coupling.copy_to(&mut rows.values, 0);
    rows
}
