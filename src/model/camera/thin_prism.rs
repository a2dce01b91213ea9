//! Brown-Conrady with a thin prism: `+ s1 r^2 + s2 r^4` in x, `+ s3 r^2 + s4 r^4` in y (as in OpenCV).

use super::brown::Brown;
use super::formula::{Coefficients, Distorted, Formula, Ideal};

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
    fn distort<const N: usize>(c: &Coefficients, point: Ideal, n: usize, into: &mut Distorted<N>) {
        Brown::distort(c, point, n, into);
        let r2 = point.r2();
        for (i, s) in [[c[5], c[6]], [c[7], c[8]]].into_iter().enumerate() {
            into.point[i][n] += r2 * (s[0] + r2 * s[1]);
            let by_r2 = s[0] + 2.0 * r2 * s[1];
            into.d_point[i][0][n] += 2.0 * point.x * by_r2;
            into.d_point[i][1][n] += 2.0 * point.y * by_r2;
            into.d_coefficients[i][5 + 2 * i][n] = r2;
            into.d_coefficients[i][6 + 2 * i][n] = r2 * r2;
        }
    }

    fn is_monotonic_to(c: &[f64], r2: f64, inverse_depth: f64) -> bool {
        Brown::is_monotonic_to(c, r2, inverse_depth)
    }
}
