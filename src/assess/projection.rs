//! How well the camera is known over its image: the uncertainty of where a direction is imaged.
//!
//! A turn of the camera is not part of it: hand-eye transform and camera poses take it up (as in mrcal's projection uncertainty, D. Kogan). With
//! `J` the derivative of the images of directions by the parameters of the camera, `R` that by a turn, and weights `W`
//! (inverse variances, so that the turn follows where the camera is known), the covariance is `P J C J' P'`, `P = 1 - R (R' W R)^-1 R' W`.

use nalgebra::{DMatrix, DVector, Matrix2x3, Matrix3, Vector2};
use serde::{Deserialize, Serialize};

use crate::geom::skew;
use crate::linalg::{dense, product};
use crate::model::camera::{Camera, MAX_PARAMETERS};

/// Places of the map across the image.
const ACROSS: usize = 24;

/// Uncertainty of the projection over the image.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ProjectionMap {
    /// Places across the image, at equal distances from the middle of the first pixel to that of the last.
    pub columns: usize,
    /// Places down.
    pub rows: usize,
    /// Distance of the points, m: matters for a lens that sees it only.
    pub depth_m: f64,
    /// Standard deviation of the image of a direction, px per axis (root mean square of both), row by row; none where nothing is imaged.
    pub sigma_px: Vec<Option<f64>>,
}

impl ProjectionMap {
    /// The map of a camera from the covariance of its parameters, for points at `depth_m`.
    pub fn new(camera: &Camera, covariance: &DMatrix<f64>, depth_m: f64) -> Self {
        let rows = (ACROSS * camera.height_px as usize).div_ceil(camera.width_px.max(1) as usize).max(2);
        let places = (0..ACROSS * rows).map(|k| place(k, [ACROSS, rows], [camera.width_px, camera.height_px]));
        let jacobians: Vec<Option<DirectionJacobian>> =
            places.map(|uv| DirectionJacobian::at(camera, &uv, depth_m)).collect();
        let seen: Vec<&DirectionJacobian> = jacobians.iter().flatten().collect();
        let variances = without_turn(&seen, covariance);
        let mut known = variances.iter();
        let sigma = |j: &Option<DirectionJacobian>| j.as_ref().and_then(|_| known.next()).map(|v| v.max(0.0).sqrt());
        Self { columns: ACROSS, rows, depth_m, sigma_px: jacobians.iter().map(sigma).collect() }
    }

    /// Place of an entry in the image, px.
    pub fn place(&self, entry: usize, width_px: u32, height_px: u32) -> Vector2<f64> {
        place(entry, [self.columns, self.rows], [width_px, height_px])
    }

    /// Largest entry, px; none for an empty map.
    pub fn largest(&self) -> Option<f64> {
        self.sigma_px.iter().flatten().copied().reduce(f64::max)
    }

    /// Root mean square, px, of the entries nearest to places (px) in an image of this size; none without places.
    pub fn rms_at(&self, places: impl Iterator<Item = [f64; 2]>, width_px: u32, height_px: u32) -> Option<f64> {
        let nearest = |at: f64, px: u32, n: usize| {
            let step = (f64::from(px) - 1.0) / (n.max(2) - 1) as f64;
            (at / step).round().clamp(0.0, n as f64 - 1.0) as usize
        };
        let entry = |[u, v]: [f64; 2]| {
            let k = nearest(v, height_px, self.rows) * self.columns + nearest(u, width_px, self.columns);
            self.sigma_px.get(k).copied().flatten()
        };
        let (sum, count) = places.filter_map(entry).fold((0.0, 0.0), |(s, n), sigma| (s + sigma * sigma, n + 1.0));
        (count > 0.0).then(|| (sum / count).sqrt())
    }
}

/// Place of an entry of so many columns and rows in an image of this size, px.
fn place(entry: usize, [columns, rows]: [usize; 2], [width_px, height_px]: [u32; 2]) -> Vector2<f64> {
    let along = |k: usize, n: usize, px: u32| k as f64 * (f64::from(px) - 1.0) / (n.max(2) - 1) as f64;
    Vector2::new(along(entry % columns, columns, width_px), along(entry / columns, rows, height_px))
}

/// Derivatives of the image of one direction.
struct DirectionJacobian {
    by_parameters: DMatrix<f64>,
    by_turn: Matrix2x3<f64>,
}

impl DirectionJacobian {
    fn at(camera: &Camera, uv: &Vector2<f64>, depth_m: f64) -> Option<Self> {
        let x = camera.ray(uv)? * depth_m;
        let p = camera.project_with_jacobian(&x)?;
        let formula = camera.parametric();
        let mut by_parameters = DMatrix::zeros(2, camera.parameters.len());
        by_parameters.columns_mut(0, formula).copy_from(&p.d_parameters.columns(0, formula.min(MAX_PARAMETERS)));
        for (k, b) in camera.touched(&p.by_formula).iter().flat_map(|t| t.points()) {
            by_parameters[(0, formula + 2 * k)] = b;
            by_parameters[(1, formula + 2 * k + 1)] = b;
        }
        Some(Self { by_parameters, by_turn: p.d_point * skew(&x) })
    }
}

/// Mean variance of both axes of every direction, px^2.
fn without_turn(jacobians: &[&DirectionJacobian], covariance: &DMatrix<f64>) -> Vec<f64> {
    let n = 2 * jacobians.len();
    let mut j = DMatrix::zeros(n, covariance.nrows());
    let mut turn = DMatrix::zeros(n, 3);
    for (k, l) in jacobians.iter().enumerate() {
        j.rows_mut(2 * k, 2).copy_from(&l.by_parameters);
        turn.rows_mut(2 * k, 2).copy_from(&l.by_turn);
    }
    let variances = |j: &DMatrix<f64>| {
        let jc = product(j, covariance);
        DVector::from_fn(n, |k, _| jc.row(k).dot(&j.row(k)))
    };
    let raw = variances(&j);
    // Weights stay finite where the camera is known exactly.
    let floor = 1e-12 + 1e-6 * raw.max();
    let mut weighted = turn.clone();
    for (k, mut row) in weighted.row_iter_mut().enumerate() {
        row /= raw[k] + floor;
    }
    let normal = Matrix3::from_column_slice(weighted.tr_mul(&turn).as_slice());
    if let Some(inverse) = normal.try_inverse() {
        j -= &turn * (dense(&inverse) * product(&weighted.transpose(), &j));
    }
    let left = variances(&j);
    (0..jacobians.len()).map(|k| 0.5 * (left[2 * k] + left[2 * k + 1])).collect()
}
