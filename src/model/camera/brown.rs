//! Brown-Conrady distortion: three radial and two tangential coefficients.

use nalgebra::{Matrix2, SMatrix, Vector2};

use super::{Distorted, MAX_PARAMETERS};

pub(super) const NAMES: [&str; 5] = ["k1", "k2", "p1", "p2", "k3"];

/// Distorts a point of the plane z = 1; `c` = k1 k2 p1 p2 k3.
pub(super) fn distort(c: &[f64], point: &Vector2<f64>) -> Distorted {
    let (x, y) = (point.x, point.y);
    let [k1, k2, p1, p2, k3] = [c[0], c[1], c[2], c[3], c[4]];
    let r2 = x * x + y * y;
    let radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
    let slope = 2.0 * (k1 + r2 * (2.0 * k2 + r2 * 3.0 * k3));
    let (xy2, xx2, yy2) = (2.0 * x * y, r2 + 2.0 * x * x, r2 + 2.0 * y * y);
    let cross = x * y * slope + 2.0 * (p1 * x + p2 * y);
    let mut d_coefficients = SMatrix::<f64, 2, { MAX_PARAMETERS - 4 }>::zeros();
    let (r4, r6) = (r2 * r2, r2 * r2 * r2);
    for (k, column) in [[x * r2, y * r2], [x * r4, y * r4], [xy2, yy2], [xx2, xy2], [x * r6, y * r6]].iter().enumerate()
    {
        d_coefficients[(0, k)] = column[0];
        d_coefficients[(1, k)] = column[1];
    }
    Distorted {
        point: Vector2::new(x * radial + p1 * xy2 + p2 * xx2, y * radial + p1 * yy2 + p2 * xy2),
        d_point: Matrix2::new(
            radial + x * x * slope + 2.0 * p1 * y + 6.0 * p2 * x,
            cross,
            cross,
            radial + y * y * slope + 6.0 * p1 * y + 2.0 * p2 * x,
        ),
        d_coefficients,
    }
}

/// True while `r (1 + k1 r^2 + k2 r^4 + k3 r^6)` still grows from the axis out to `r2 = r^2`.
pub(super) fn is_monotonic_to(c: &[f64], r2: f64) -> bool {
    let slope = |s: f64| 1.0 + s * (3.0 * c[0] + s * (5.0 * c[1] + s * 7.0 * c[4]));
    if slope(r2) <= 0.0 {
        return false;
    }
    // The minimum inside (0, r2) lies at a root of the derivative, a quadratic in s.
    let (a, b, c0) = (21.0 * c[4], 10.0 * c[1], 3.0 * c[0]);
    let roots = if a.abs() < 1e-12 {
        [-c0 / b, f64::NAN]
    } else {
        let q = (b * b - 4.0 * a * c0).sqrt();
        [(-b + q) / (2.0 * a), (-b - q) / (2.0 * a)]
    };
    roots.iter().filter(|s| s.is_finite() && **s > 0.0 && **s < r2).all(|&s| slope(s) > 0.0)
}
