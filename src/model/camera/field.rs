//! A displacement field on top of a lens: what is left of a real lens when its formula has said all it can.
//!
//! `uv = h + sum_k b_k(h) c_k`, where `h` is the image by the lens formula (px), `c_k` the displacement (px, two components) at a control
//! point of a square lattice over the image, and `b_k` the product of uniform cubic B-splines (C. de Boor, *A practical guide to splines*,
//! 1978). Every point touches sixteen control points. Outside the image the field goes on as it is at the border.

use nalgebra::{Matrix2, Vector2};

/// Cells of the lattice across the width of the image.
const CELLS_ACROSS: u32 = 10;

/// Control points that a point touches, per axis.
const TOUCHED: usize = 4;

/// The lattice of control points over an image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lattice {
    pub(super) cells: [usize; 2],
    pub(super) cell_px: [f64; 2],
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
    /// Number of control points that a point touches.
    pub const POINTS: usize = TOUCHED * TOUCHED;

    /// Indices of the control points with the values of their basis functions.
    pub fn points(&self) -> impl Iterator<Item = (usize, f64)> + '_ {
        (0..Self::POINTS).map(|n| {
            let (i, k) = (n % TOUCHED, n / TOUCHED);
            (self.first + k * self.across + i, self.u[i] * self.v[k])
        })
    }
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
