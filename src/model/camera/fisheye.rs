//! Kannala-Brandt: a point at the angle t from the axis is imaged at the distance `t (1 + k1 t^2 + k2 t^4 + k3 t^6 + k4 t^8)`.
//!
//! J. Kannala, S. Brandt, *A generic camera model and calibration method* (2006), as in OpenCV's fisheye and ROS `equidistant`.
//! Points must lie before the camera (less than a right angle from the axis).

use super::formula::{Coefficients, Distorted, Formula, Ideal};
use super::radial::grows_to;

/// Below this distance from the axis the series is exact to rounding.
const NEAR_AXIS: f64 = 1e-4;

/// Image distance and its derivative by the angle.
#[inline(always)]
fn image_of(c: &[f64], t: f64) -> (f64, f64) {
    let s = t * t;
    let even = 1.0 + s * (c[0] + s * (c[1] + s * (c[2] + s * c[3])));
    (t * even, 1.0 + s * (3.0 * c[0] + s * (5.0 * c[1] + s * (7.0 * c[2] + s * 9.0 * c[3]))))
}

/// The formula.
pub(super) struct Fisheye;

impl Formula for Fisheye {
    const COEFFICIENTS: &'static [&'static str] = &["k1", "k2", "k3", "k4"];
    const ROS: Option<&'static str> = Some("equidistant");
    const COMMON: &'static [f64] = &[0.03, -0.015, 0.006, -0.002];

    fn ideal_radius(angle: f64) -> f64 {
        angle
    }

    #[inline(always)]
    fn distort<const N: usize>(c: &Coefficients, point: Ideal, n: usize, into: &mut Distorted<N>) {
        let (Ideal { x, y, .. }, r2) = (point, point.r2());
        let r = r2.sqrt();
        let t = r.atan();
        // The factor on the point, and its derivative by r over r.
        let (factor, by_r) = if r < NEAR_AXIS {
            let second = c[0] - 1.0 / 3.0;
            (1.0 + second * r2, 2.0 * second)
        } else {
            let (image, slope) = image_of(c, t);
            (image / r, (slope / (1.0 + r2) - image / r) / r2)
        };
        let cross = x * y * by_r;
        into.put(n, [x * factor, y * factor], [[factor + x * x * by_r, cross], [cross, factor + y * y * by_r]]);
        let mut power = if r < NEAR_AXIS { 1.0 } else { t / r };
        for k in 0..Self::COEFFICIENTS.len() {
            power *= t * t;
            into.put_column(n, k, [x * power, y * power]);
        }
    }

    fn is_monotonic_to(c: &[f64], r2: f64, _inverse_depth: f64) -> bool {
        is_monotonic_to(c, r2)
    }
}

/// True while the image still moves outwards from the axis to `r2 = r^2`.
fn is_monotonic_to(c: &[f64], r2: f64) -> bool {
    grows_to(r2.sqrt().atan(), |t| image_of(c, t).0)
}
