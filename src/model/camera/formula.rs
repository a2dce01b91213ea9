//! What the formula of a lens has to say of itself, and a distorted point with its derivatives.

use nalgebra::{Matrix2, SMatrix, Vector2};

/// Most parameters that the formula of any camera has (pinhole and lens; a displacement field comes on top).
pub const MAX_PARAMETERS: usize = 13;

/// Most coefficients of a lens.
const MOST: usize = MAX_PARAMETERS - 4;

/// Derivatives of a distorted point by the coefficients of a lens, one column each.
pub(super) type Coefficients = SMatrix<f64, 2, MOST>;

/// A distorted point of the plane z = 1 with its derivatives.
pub(super) struct Distorted {
    pub point: Vector2<f64>,
    pub d_point: Matrix2<f64>,
    /// One column per lens coefficient.
    pub d_coefficients: Coefficients,
    /// With respect to 1 / depth (1/m).
    pub d_inverse_depth: Vector2<f64>,
}

impl Distorted {
    /// Of a lens that does not see the distance.
    #[inline(always)]
    pub(super) fn flat(point: Vector2<f64>, d_point: Matrix2<f64>, d_coefficients: Coefficients) -> Self {
        Self { point, d_point, d_coefficients, d_inverse_depth: Vector2::zeros() }
    }
}

/// The formula of a lens, one file each.
pub(super) trait Formula {
    /// Names of the coefficients (dimensionless), in the order of OpenCV.
    const COEFFICIENTS: &'static [&'static str];

    /// Name of the distortion model in a ROS camera_info, which then takes the coefficients as they are; `None` where ROS has no such lens.
    const ROS: Option<&'static str>;

    /// Coefficients of a common lens, for simulated cameras.
    const COMMON: &'static [f64];

    /// Prior sigma of a coefficient about zero. Where numerator and denominator (or prism and tilt) nearly say the same, a wide prior keeps the
    /// result finite; elsewhere there is none (infinite).
    fn prior_sigma(_coefficient: usize) -> f64 {
        f64::INFINITY
    }

    /// Distance from the axis, on the plane z = 1, of the image of a ray at an angle (rad) from it, where all coefficients are zero.
    fn ideal_radius(angle: f64) -> f64 {
        angle.tan()
    }

    /// Distorts a point of the plane z = 1, whose depth is `1 / inverse_depth` m; `c` are the coefficients.
    fn distort(c: &[f64], point: &Vector2<f64>, inverse_depth: f64) -> Distorted;

    /// True while the image still moves outwards from the axis to `r2 = r^2`.
    fn is_monotonic_to(c: &[f64], r2: f64, inverse_depth: f64) -> bool;
}

/// N distorted points of the plane z = 1 with their derivatives: place n of every array is of point n.
pub(super) struct DistortedPoints<const N: usize> {
    /// Two components.
    pub point: [[f64; N]; 2],
    /// Of each component by each.
    pub d_point: [[[f64; N]; 2]; 2],
    /// Of each component by each coefficient.
    pub d_coefficients: [[[f64; N]; MOST]; 2],
    /// With respect to 1 / depth (1/m).
    pub d_inverse_depth: [[f64; N]; 2],
}

/// Distorts N points of the plane z = 1 by a formula with the coefficients `c`.
#[inline(always)]
pub(super) fn distorted<F: Formula, const N: usize>(
    c: &[f64],
    x: &[[f64; N]; 2],
    inverse_depth: &[f64; N],
) -> DistortedPoints<N> {
    let mut all = DistortedPoints {
        point: [[0.0; N]; 2],
        d_point: [[[0.0; N]; 2]; 2],
        d_coefficients: [[[0.0; N]; MOST]; 2],
        d_inverse_depth: [[0.0; N]; 2],
    };
    for n in 0..N {
        let d = F::distort(c, &Vector2::new(x[0][n], x[1][n]), inverse_depth[n]);
        for i in 0..2 {
            all.point[i][n] = d.point[i];
            all.d_inverse_depth[i][n] = d.d_inverse_depth[i];
            (0..2).for_each(|j| all.d_point[i][j][n] = d.d_point[(i, j)]);
            (0..F::COEFFICIENTS.len()).for_each(|k| all.d_coefficients[i][k][n] = d.d_coefficients[(i, k)]);
        }
    }
    all
}
