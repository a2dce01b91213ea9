//! Brown-Conrady with a thin prism: `+ s1 r^2 + s2 r^4` in x, `+ s3 r^2 + s4 r^4` in y (as in OpenCV).

use nalgebra::{Matrix2, Vector2};

use super::{Distorted, brown};

pub(super) const NAMES: [&str; 9] = ["k1", "k2", "p1", "p2", "k3", "s1", "s2", "s3", "s4"];

/// Distorts a point of the plane z = 1.
pub(super) fn distort(c: &[f64], point: &Vector2<f64>) -> Distorted {
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
