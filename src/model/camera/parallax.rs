//! Brown-Conrady whose radial coefficients depend on the distance: `k_i + k_iz / z`, z the depth of the point in m.
//!
//! The rays of a real lens do not meet in one point: the entrance pupil wanders with the angle, which near objects show.

use nalgebra::Vector2;

use super::brown;
use super::formula::{Distorted, Formula};

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
    fn distort(c: &[f64], point: &Vector2<f64>, inverse_depth: f64) -> Distorted {
        distort(c, point, inverse_depth)
    }

    fn is_monotonic_to(c: &[f64], r2: f64, inverse_depth: f64) -> bool {
        is_monotonic_to(c, r2, inverse_depth)
    }
}

/// Distorts a point of the plane z = 1, whose depth is `1 / inverse_depth` m.
fn distort(c: &[f64], point: &Vector2<f64>, inverse_depth: f64) -> Distorted {
    let mut d = brown::distort(&effective(c, inverse_depth), point);
    let radial = [d.d_coefficients.column(0).into_owned(), d.d_coefficients.column(1).into_owned()];
    for (k, column) in radial.iter().enumerate() {
        d.d_coefficients.set_column(5 + k, &(column * inverse_depth));
    }
    d.d_inverse_depth = radial[0] * c[5] + radial[1] * c[6];
    d
}

/// As for Brown-Conrady at this depth.
fn is_monotonic_to(c: &[f64], r2: f64, inverse_depth: f64) -> bool {
    brown::is_monotonic_to(&effective(c, inverse_depth), r2)
}
