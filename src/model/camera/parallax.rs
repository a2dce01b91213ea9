//! Brown-Conrady whose radial coefficients depend on the distance: `k_i + k_iz / z`, z the depth of the point in m.
//!
//! The rays of a real lens do not meet in one point: the entrance pupil wanders with the angle, which near objects show.

use super::brown;
use super::formula::{Coefficients, Distorted, Formula, Ideal};

#[inline(always)]
fn effective(c: &[f64], inverse_depth: f64) -> [f64; 5] {
    [c[0] + c[5] * inverse_depth, c[1] + c[6] * inverse_depth, c[2], c[3], c[4]]
}

/// The formula.
pub(super) struct Parallax;

impl Formula for Parallax {
    const COEFFICIENTS: &'static [&'static str] = &["k1", "k2", "p1", "p2", "k3", "k1z", "k2z"];
    const ROS: Option<&'static str> = None;
    const COMMON: &'static [f64] = &[-0.11, 0.09, 4e-4, -3e-4, -0.02, 0.012, -0.008];

    fn prior_sigma(coefficient: usize) -> f64 {
        match coefficient {
            5.. => 0.1,
            _ => f64::INFINITY,
        }
    }

    #[inline(always)]
    fn distort<const N: usize>(c: &Coefficients, point: Ideal, n: usize, into: &mut Distorted<N>) {
        brown::distort(effective(c, point.inverse_depth), point, n, into);
        for i in 0..2 {
            let [by_k1, by_k2] = [into.d_coefficients[i][0][n], into.d_coefficients[i][1][n]];
            into.d_coefficients[i][5][n] = by_k1 * point.inverse_depth;
            into.d_coefficients[i][6][n] = by_k2 * point.inverse_depth;
            into.d_inverse_depth[i][n] = by_k1 * c[5] + by_k2 * c[6];
        }
    }

    fn is_monotonic_to(c: &[f64], r2: f64, inverse_depth: f64) -> bool {
        is_monotonic_to(c, r2, inverse_depth)
    }
}

/// As for Brown-Conrady at this depth.
fn is_monotonic_to(c: &[f64], r2: f64, inverse_depth: f64) -> bool {
    brown::is_monotonic_to(&effective(c, inverse_depth), r2)
}
