//! Brown-Conrady with a thin prism: `+ s1 r^2 + s2 r^4` in x, `+ s3 r^2 + s4 r^4` in y (as in OpenCV).

use nalgebra::{Matrix2, Vector2};

use super::brown::{self, Brown};
use super::formula::{Distorted, Formula};

/// Prior sigma of `s1` and `s3`. To first order `s1 r^2` is a shift of the principal point with a turn of the camera and `p2`: at a width of 50
/// degrees 1e-3 of it is 0.32 px, of which 0.012 px are left when these follow, and takes the principal point along by 4.6 px.
const PRISM_SIGMA: f64 = 3e-4;

/// Prior sigma of `s2` and `s4`.
const PRISM_FOURTH_ORDER_SIGMA: f64 = 0.01;

/// The formula.
pub(super) struct ThinPrism;

impl Formula for ThinPrism {
    const COEFFICIENTS: &'static [&'static str] = &["k1", "k2", "p1", "p2", "k3", "s1", "s2", "s3", "s4"];
    const ROS: Option<&'static str> = None;
    const COMMON: &'static [f64] = &[-0.11, 0.09, 4e-4, -3e-4, -0.02, 3e-3, -2e-3, -2.5e-3, 1.5e-3];

    fn prior_sigma(coefficient: usize) -> f64 {
        match coefficient {
            5 | 7 => PRISM_SIGMA,
            5.. => PRISM_FOURTH_ORDER_SIGMA,
            _ => f64::INFINITY,
        }
    }

    #[inline(always)]
    fn distort(c: &[f64], point: &Vector2<f64>, _inverse_depth: f64) -> Distorted {
        distort(c, point)
    }

    fn is_monotonic_to(c: &[f64], r2: f64, inverse_depth: f64) -> bool {
        Brown::is_monotonic_to(c, r2, inverse_depth)
    }
}

/// Distorts a point of the plane z = 1.
fn distort(c: &[f64], point: &Vector2<f64>) -> Distorted {
    let mut d = brown::distort(c, point);
    let r2 = point.norm_squared();
    let s = &c[5..9];
    d.point += Vector2::new(r2 * (s[0] + r2 * s[1]), r2 * (s[2] + r2 * s[3]));
    let by_r2 = Vector2::new(s[0] + 2.0 * r2 * s[1], s[2] + 2.0 * r2 * s[3]);
    d.d_point += Matrix2::new(
        2.0 * point.x * by_r2.x,
        2.0 * point.y * by_r2.x,
        2.0 * point.x * by_r2.y,
        2.0 * point.y * by_r2.y,
    );
    for (row, first) in [(0, 5), (1, 7)] {
        d.d_coefficients[(row, first)] = r2;
        d.d_coefficients[(row, first + 1)] = r2 * r2;
    }
    d
}
