//! What the formula of a lens has to say of itself, and distorted points with their derivatives.

/// Most parameters that the formula of any camera has (pinhole and lens; a displacement field comes on top).
pub const MAX_PARAMETERS: usize = 13;

/// Most coefficients of a lens.
pub(super) const MOST: usize = MAX_PARAMETERS - 4;

/// Coefficients of a lens; zero behind those that it has.
pub(super) type Coefficients = [f64; MOST];

/// A point of the plane z = 1, as the formula of a lens takes it.
#[derive(Clone, Copy)]
pub(super) struct Ideal {
    pub x: f64,
    pub y: f64,
    /// 1 / depth, 1/m.
    pub inverse_depth: f64,
}

impl Ideal {
    /// Squared distance from the axis.
    #[inline(always)]
    pub(super) fn r2(&self) -> f64 {
        self.x * self.x + self.y * self.y
    }
}

/// N points of the plane z = 1: place n of every array is of point n, so that loops over the points are compiled to wide registers.
pub(super) struct Points<const N: usize> {
    /// Two components.
    pub at: [[f64; N]; 2],
    /// 1 / depth, 1/m.
    pub inverse_depth: [f64; N],
}

impl<const N: usize> Points<N> {
    #[inline(always)]
    pub(super) fn ideal(&self, n: usize) -> Ideal {
        Ideal { x: self.at[0][n], y: self.at[1][n], inverse_depth: self.inverse_depth[n] }
    }
}

/// N distorted points of the plane z = 1 with their derivatives, in the layout of [`Points`].
pub(super) struct Distorted<const N: usize> {
    /// Two components.
    pub point: [[f64; N]; 2],
    /// Of each component by each.
    pub d_point: [[[f64; N]; 2]; 2],
    /// Of each component by each coefficient.
    pub d_coefficients: [[[f64; N]; MOST]; 2],
    /// With respect to 1 / depth (1/m).
    pub d_inverse_depth: [[f64; N]; 2],
}

impl<const N: usize> Distorted<N> {
    #[inline(always)]
    pub(super) fn zeros() -> Self {
        Self {
            point: [[0.0; N]; 2],
            d_point: [[[0.0; N]; 2]; 2],
            d_coefficients: [[[0.0; N]; MOST]; 2],
            d_inverse_depth: [[0.0; N]; 2],
        }
    }

    /// Puts point n, and its derivatives by the undistorted point.
    #[inline(always)]
    pub(super) fn put(&mut self, n: usize, point: [f64; 2], d_point: [[f64; 2]; 2]) {
        for i in 0..2 {
            self.point[i][n] = point[i];
            (0..2).for_each(|j| self.d_point[i][j][n] = d_point[i][j]);
        }
    }

    /// Puts the derivatives of point n by coefficient k.
    #[inline(always)]
    pub(super) fn put_column(&mut self, n: usize, k: usize, column: [f64; 2]) {
        (0..2).for_each(|i| self.d_coefficients[i][k][n] = column[i]);
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

    /// Distorts a point and puts it, with its derivatives, in place n. To be `inline(always)`.
    fn distort<const N: usize>(c: &Coefficients, point: Ideal, n: usize, into: &mut Distorted<N>);

    /// True while the image still moves outwards from the axis to `r2 = r^2`.
    fn is_monotonic_to(c: &[f64], r2: f64, inverse_depth: f64) -> bool;
}
