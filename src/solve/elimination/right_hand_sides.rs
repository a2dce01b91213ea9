//! Several right-hand sides of the normal equations at once.

use nalgebra::{DMatrix, Vector2, Vector6};

use super::seen_markers::SeenMarkers;
use crate::problem::{E, Equations};
use crate::solve::linear::{BodyPart, LinearImage, LinearProblem};

/// Right-hand sides of all unknowns before any is eliminated, one column each.
pub struct RightHandSides {
    /// Of the dense columns.
    pub dense: DMatrix<f64>,
    /// Of the markers that were seen, three rows each.
    pub markers: DMatrix<f64>,
    /// Of what is latent at each stop in use.
    pub stops: Vec<DMatrix<f64>>,
}

impl RightHandSides {
    /// So many of nothing.
    pub fn none(linear: LinearProblem, seen: &SeenMarkers, count: usize) -> Self {
        Self {
            dense: DMatrix::zeros(linear.adjustment.problem.layout.len(), count),
            markers: DMatrix::zeros(3 * seen.order.len(), count),
            stops: linear.stops().map(|stop| DMatrix::zeros(stop.unknowns(), count)).collect(),
        }
    }

    /// Adds what an image says.
    pub fn add(&mut self, seen: &SeenMarkers, image: &LinearImage, own: &OfImage) {
        let theta = image.chain.d_theta.ncols();
        let mut by_theta = self.dense.rows_mut(0, theta);
        by_theta += image.chain.d_theta.tr_mul(&own.pose);
        for (k, column) in image.columns().into_iter().enumerate() {
            if let Some(column) = column {
                let mut row = self.dense.row_mut(column);
                row += own.intrinsics.row(k);
            }
        }
        let of_latents = image.chain.d_latent.tr_mul(&own.pose);
        for (row, from) in image.latents().into_iter().flatten().zip(of_latents.row_iter()) {
            let mut row = self.stops[image.stop].row_mut(row);
            row += from;
        }
        let number = &seen.number[image.image.plate];
        for (k, at) in own.seen.iter().enumerate().filter_map(|(k, m)| Some((k, number[*m]?))) {
            let mut rows = self.markers.rows_mut(3 * at, 3);
            rows += own.markers.rows(3 * k, 3);
        }
    }

    /// Adds what a measurement of a body says in the first column, given that by its pose.
    pub fn add_body(
        &mut self,
        linear: LinearProblem,
        BodyPart { index, chain, .. }: &BodyPart,
        by_pose: &Vector6<f64>,
    ) {
        let stop = linear.adjustment.problem.body_measurements[*index].stop;
        let at = linear.lin.stops.partition_point(|s| s.stop < stop);
        for (whole, derivatives) in [(&mut self.dense, &chain.d_theta), (&mut self.stops[at], &chain.d_latent)] {
            let mut own = whole.view_mut((0, 0), (derivatives.ncols(), 1));
            own += derivatives.tr_mul(by_pose);
        }
    }
}

/// What one image says: the products of its equations with some columns.
pub struct OfImage {
    /// 6 x columns.
    pose: DMatrix<f64>,
    /// Of the intrinsics, field included.
    intrinsics: DMatrix<f64>,
    /// Its markers, and three rows of each.
    seen: Vec<usize>,
    markers: DMatrix<f64>,
}

impl OfImage {
    /// Of an image with so many `intrinsics`, for columns with one row an equation.
    pub fn new(equations: &Equations, columns: &DMatrix<f64>, intrinsics: usize) -> Self {
        let mut seen = equations.markers.clone();
        seen.dedup();
        let sums = equations.with_columns(columns);
        let count = columns.ncols();
        let mut own = Self {
            pose: DMatrix::from_fn(6, count, |row, k| sums.pose(k)[row]),
            intrinsics: DMatrix::zeros(intrinsics, count),
            markers: DMatrix::zeros(3 * seen.len(), count),
            seen,
        };
        own.intrinsics.rows_mut(0, E).copy_from(&DMatrix::from_fn(E, count, |e, k| sums.intrinsic(e, k)));
        for (k, column) in columns.as_slice().chunks_exact(columns.nrows().max(1)).enumerate() {
            own.add_markers_and_field(equations, column, k);
        }
        own
    }

    fn add_markers_and_field(&mut self, equations: &Equations, column: &[f64], k: usize) {
        let mut at = 0;
        for ((sight, e), &marker) in equations.sights().zip(column.chunks_exact(2)).zip(&equations.markers) {
            at += usize::from(self.seen[at] != marker);
            let e = Vector2::new(e[0], e[1]);
            let mut of_marker = self.markers.fixed_view_mut::<3, 1>(3 * at, k);
            of_marker += sight.by_marker() * e;
            for (point, d) in sight.by_field() {
                let mut field = self.intrinsics.fixed_view_mut::<2, 1>(E + 2 * point, k);
                field += d.transpose() * e;
            }
        }
    }
}
