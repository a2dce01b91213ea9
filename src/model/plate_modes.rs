//! Low-order deformations of a plate: what a printer, a roll of paper or a warped board does to all markers together.

use nalgebra::{SMatrix, SVector, Vector3};

use crate::series::Edge;

/// Number of modes.
pub const MODES: usize = 7;

/// The mode by which everything on the plate grows, radii of circles as well.
pub const SCALE: usize = 0;

/// The mode by which the plate is longer along x and shorter along y.
pub const ASPECT: usize = 1;

/// The mode by which the radii of circles grow, those of inner edges shrink; it moves no marker. Ink spreads by hundredths of a millimetre.
pub const DOT_GAIN: usize = 6;

/// Names of the modes. Scale, aspect and skew are dimensionless; bows are heights in metres at the half-diagonal, the dot gain is in metres.
pub const NAMES: [&str; MODES] = ["scale", "aspect", "skew", "bow_xx", "bow_xy", "bow_yy", "dot_gain"];

/// Default prior sigma of each mode.
pub const PRIOR_SIGMA: [f64; MODES] = [1e-4, 1e-4, 1e-4, 3e-4, 3e-4, 3e-4, 1e-4];

/// Share of its radius that a circle keeps, whatever the dot gain.
const SMALLEST_RADIUS: f64 = 0.1;

/// Radius of a circle (m) on a plate with these modes, and its derivative by them: it grows with the plate and by the dot gain, by which inner
/// edges shrink. 0 for a point.
#[inline(always)]
pub fn radius(radius_m: f64, edge: Edge, modes: &[f64; MODES]) -> (f64, SVector<f64, MODES>) {
    let mut by_modes = SVector::<f64, MODES>::zeros();
    if radius_m == 0.0 {
        return (0.0, by_modes);
    }
    by_modes[SCALE] = radius_m;
    by_modes[DOT_GAIN] = match edge {
        Edge::Outer => 1.0,
        Edge::Inner => -1.0,
    };
    let grown_m = radius_m + by_modes.dot(&SVector::from(*modes));
    (grown_m.max(SMALLEST_RADIUS * radius_m), by_modes)
}

/// Displacement of a marker (m) per unit of each mode, one column a mode.
///
/// `half_diagonal_m` is the largest distance of a marker from the centre of the plate.
#[inline(always)]
pub fn basis(nominal: &Vector3<f64>, half_diagonal_m: f64) -> SMatrix<f64, 3, MODES> {
    let (x, y) = (nominal.x, nominal.y);
    let per_square = half_diagonal_m.max(1e-9).powi(-2);
    let mut b = SMatrix::<f64, 3, MODES>::zeros();
    b.set_column(0, nominal);
    b.set_column(1, &(Vector3::new(x, -y, 0.0) / 2.0));
    b.set_column(2, &(Vector3::new(y, x, 0.0) / 2.0));
    b[(2, 3)] = x * x * per_square;
    b[(2, 4)] = x * y * per_square;
    b[(2, 5)] = y * y * per_square;
    b
}
