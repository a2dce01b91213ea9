//! What the formula of a camera says of its displacement field.

use nalgebra::{DMatrix, Vector2, Vector3};

use super::field::Lattice;
use super::projection::Camera;
use crate::geom::skew;

/// Sample points per cell and axis on which the parametric part is expressed as a field.
const SAMPLES: usize = 3;

/// Share of a direction that must be new beside those before it, so that it counts.
const NEW: f64 = 1e-3;

impl Camera {
    /// What the formula and a turn of the camera can say, as displacement fields: orthonormal columns over the parameters of the field;
    /// `None` for a lens without one.
    pub fn parametric_directions(&self) -> Option<DMatrix<f64>> {
        self.lattice().map(|lattice| parametric_directions(&self.without_field(), &lattice))
    }
}

/// What the parameters of a lens and a turn of the camera do to the image, as fields: orthonormal columns over u and v of all control
/// points. Fields across these columns say nothing that those say.
///
/// They are taken at the camera without distortion whose focal length is the width of the image: to first order about no distortion the
/// space that they span does not depend on the focal length, since each is a homogeneous polynomial of the place in the image.
fn parametric_directions(camera: &Camera, lattice: &Lattice) -> DMatrix<f64> {
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
