//! A displacement field on top of a lens: what is left of a real lens when its formula has said all it can.
//!
//! `uv = h + sum_k b_k(h) c_k`, where `h` is the image by the lens formula (px), `c_k` the displacement (px, two components) at a control
//! point of a square lattice over the image, and `b_k` the product of uniform cubic B-splines (C. de Boor, *A practical guide to splines*,
//! 1978). Every point touches sixteen control points. Outside the image the field goes on as it is at the border.

use nalgebra::{DMatrix, Matrix2, Vector2, Vector3};

use super::Camera;
use crate::geom::skew;

/// Cells of the lattice across the width of the image.
const CELLS_ACROSS: u32 = 10;

/// Control points that a point touches, per axis.
const TOUCHED: usize = 4;

/// Sample points per cell and axis on which the parametric part is expressed as a field.
const SAMPLES: usize = 3;

/// Share of a direction that must be new beside those before it, so that it counts.
const NEW: f64 = 1e-3;

/// The lattice of control points over an image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lattice {
    cells: [usize; 2],
    cell_px: [f64; 2],
}

/// Basis functions at one point: the first control point that it touches, and their values along u and v.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Touched {
    first: usize,
    across: usize,
    u: [f64; TOUCHED],
    v: [f64; TOUCHED],
}

/// The four B-splines over a cell at `t` in it, 0 to 1.
fn splines(t: f64) -> [f64; TOUCHED] {
    let s = 1.0 - t;
    let inner = |x: f64| (4.0 + 3.0 * x * x * (x - 2.0)) / 6.0;
    [s * s * s / 6.0, inner(t), inner(s), t * t * t / 6.0]
}

fn slopes(t: f64) -> [f64; TOUCHED] {
    let s = 1.0 - t;
    [-0.5 * s * s, 0.5 * t * (3.0 * t - 4.0), 0.5 * s * (4.0 - 3.0 * s), 0.5 * t * t]
}

impl Lattice {
    /// The lattice of an image.
    pub fn over(width_px: u32, height_px: u32) -> Self {
        let down = (CELLS_ACROSS * height_px + width_px / 2) / width_px.max(1);
        let cells = [CELLS_ACROSS, down.max(1)];
        let side = |n: u32, px: u32| f64::from(px) / f64::from(n);
        Self { cells: cells.map(|n| n as usize), cell_px: [side(cells[0], width_px), side(cells[1], height_px)] }
    }

    /// Control points across and down.
    pub fn size(&self) -> [usize; 2] {
        self.cells.map(|n| n + TOUCHED - 1)
    }

    /// Number of control points.
    pub fn points(&self) -> usize {
        self.size().iter().product()
    }

    /// Cell, place in it (0 to 1) and whether the point is inside, along one axis.
    fn cell(&self, axis: usize, px: f64) -> (usize, f64, bool) {
        let along = (px + 0.5) / self.cell_px[axis];
        let most = self.cells[axis] as f64;
        let inside = along.clamp(0.0, most);
        let cell = (inside as usize).min(self.cells[axis] - 1);
        (cell, inside - cell as f64, along == inside)
    }

    /// What an image point (px) touches.
    pub fn touched(&self, h: &Vector2<f64>) -> Touched {
        let ((i, s, _), (k, t, _)) = (self.cell(0, h.x), self.cell(1, h.y));
        let across = self.size()[0];
        Touched { first: k * across + i, across, u: splines(s), v: splines(t) }
    }

    /// Displacement at `h` and its derivative by `h`; `c` holds u and v of every control point.
    pub(super) fn displacement(&self, c: &[f64], h: &Vector2<f64>) -> (Vector2<f64>, Matrix2<f64>) {
        let ((_, s, moves_u), (_, t, moves_v)) = (self.cell(0, h.x), self.cell(1, h.y));
        let touched = self.touched(h);
        let sum = |t: &Touched| {
            t.points().fold(Vector2::zeros(), |sum, (k, b)| sum + b * Vector2::new(c[2 * k], c[2 * k + 1]))
        };
        let by = |moves: bool, axis: usize, t: Touched| match moves {
            true => sum(&t) / self.cell_px[axis],
            false => Vector2::zeros(),
        };
        let by_u = by(moves_u, 0, Touched { u: slopes(s), ..touched });
        let by_v = by(moves_v, 1, Touched { v: slopes(t), ..touched });
        (sum(&touched), Matrix2::from_columns(&[by_u, by_v]))
    }
}

impl Touched {
    /// Indices of the control points with the values of their basis functions.
    pub fn points(&self) -> impl Iterator<Item = (usize, f64)> + '_ {
        (0..TOUCHED * TOUCHED).map(|n| {
            let (i, k) = (n % TOUCHED, n / TOUCHED);
            (self.first + k * self.across + i, self.u[i] * self.v[k])
        })
    }
}

/// What the parameters of a lens and a turn of the camera do to the image, as fields: orthonormal columns over u and v of all control
/// points. Fields across these columns say nothing that those say.
///
/// They are taken at the camera without distortion whose focal length is the width of the image: to first order about no distortion the
/// space that they span does not depend on the focal length, since each is a homogeneous polynomial of the place in the image.
pub(super) fn parametric_directions(camera: &Camera, lattice: &Lattice) -> DMatrix<f64> {
    let n = lattice.points();
    let reference = Camera::pinhole(camera.lens, camera.width_px, camera.height_px, f64::from(camera.width_px));
    let parameters = camera.parametric();
    let mut normal = DMatrix::zeros(n, n);
    let mut sums = DMatrix::zeros(n, 2 * (parameters + 3));
    for (i, k) in (0..lattice.cells[0] * SAMPLES).flat_map(|i| (0..lattice.cells[1] * SAMPLES).map(move |k| (i, k))) {
        let place = |at: usize, axis: usize| (at as f64 + 0.5) / SAMPLES as f64 * lattice.cell_px[axis] - 0.5;
        let h = Vector2::new(place(i, 0), place(k, 1));
        let Some(p) = reference.ray(&h).and_then(|ray| Some((ray, reference.project_with_jacobian(&ray)?))) else {
            continue;
        };
        let turn = p.1.d_point * skew(&Vector3::new(p.0.x, p.0.y, p.0.z));
        let touched = lattice.touched(&h);
        for (a, b) in touched.points() {
            touched.points().for_each(|(other, value)| normal[(a, other)] += b * value);
            for axis in 0..2 {
                (0..parameters).for_each(|d| sums[(a, 2 * d + axis)] += b * p.1.d_parameters[(axis, d)]);
                (0..3).for_each(|d| sums[(a, 2 * (parameters + d) + axis)] += b * turn[(axis, d)]);
            }
        }
    }
    // Corner splines reach into the image by a little only.
    (0..n).for_each(|k| normal[(k, k)] += 1e-9);
    let Some(factor) = normal.cholesky() else { return DMatrix::zeros(2 * n, 0) };
    let fitted = factor.solve(&sums);
    let mut basis: Vec<nalgebra::DVector<f64>> = Vec::new();
    for d in 0..parameters + 3 {
        let whole = nalgebra::DVector::from_fn(2 * n, |k, _| fitted[(k / 2, 2 * d + k % 2)]);
        let mut rest = whole.clone();
        // Twice is enough (Kahan).
        for _ in 0..2 {
            basis.iter().for_each(|b| rest -= b * b.dot(&rest));
        }
        if rest.norm() > NEW * whole.norm() {
            basis.push(rest.normalize());
        }
    }
    if basis.is_empty() { DMatrix::zeros(2 * n, 0) } else { DMatrix::from_columns(&basis) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_splines_sum_to_one_and_their_slopes_are_their_derivatives() {
        for t in [0.0, 0.2, 0.5, 0.9, 1.0] {
            assert!((splines(t).iter().sum::<f64>() - 1.0).abs() < 1e-15);
            for k in 0..TOUCHED {
                let h = 1e-6;
                let central = (splines(t + h)[k] - splines(t - h)[k]) / (2.0 * h);
                assert!((slopes(t)[k] - central).abs() < 1e-9, "{k} at {t}");
            }
        }
        // The cubic B-spline at its knots: 1/6, 4/6, 1/6.
        assert!((splines(0.0)[1] - 4.0 / 6.0).abs() < 1e-15 && (splines(1.0)[1] - 1.0 / 6.0).abs() < 1e-15);
    }
}
