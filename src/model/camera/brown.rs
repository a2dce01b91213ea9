//! Brown-Conrady distortion: three radial and two tangential coefficients.

use super::formula::{Coefficients, Distorted, Formula, Ideal};
use super::radial::{radial_tangential, tangential_columns};

/// The formula.
pub(super) struct Brown;

impl Formula for Brown {
    const COEFFICIENTS: &'static [&'static str] = &["k1", "k2", "p1", "p2", "k3"];
    const ROS: Option<&'static str> = Some("plumb_bob");
    const COMMON: &'static [f64] = &[-0.11, 0.09, 4e-4, -3e-4, -0.02];

    #[inline(always)]
    fn distort<const N: usize>(c: &Coefficients, point: Ideal, n: usize, into: &mut Distorted<N>) {
        distort([c[0], c[1], c[2], c[3], c[4]], point, n, into);
    }

    fn is_monotonic_to(c: &[f64], r2: f64, _inverse_depth: f64) -> bool {
        is_monotonic_to(c, r2)
    }
}

/// Puts a point that is distorted with k1 k2 p1 p2 k3 in place n.
#[inline(always)]
pub(super) fn distort<const N: usize>([k1, k2, p1, p2, k3]: [f64; 5], point: Ideal, n: usize, into: &mut Distorted<N>) {
    let (Ideal { x, y, .. }, r2) = (point, point.r2());
    let radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
    let slope = 2.0 * (k1 + r2 * (2.0 * k2 + r2 * 3.0 * k3));
    let (image, d_point) = radial_tangential(point, radial, slope, [p1, p2]);
    into.put(n, image, d_point);
    let (r4, r6) = (r2 * r2, r2 * r2 * r2);
    let [a, b] = tangential_columns(point);
    for (k, column) in [[x * r2, y * r2], [x * r4, y * r4], a, b, [x * r6, y * r6]].into_iter().enumerate() {
        into.put_column(n, k, column);
    }
}

/// True while `r (1 + k1 r^2 + k2 r^4 + k3 r^6)` still grows from the axis out to `r2 = r^2`.
pub(super) fn is_monotonic_to(c: &[f64], r2: f64) -> bool {
    let slope_of = |[a, b, c]: [f64; 3], s: f64| 1.0 + s * (3.0 * a + s * (5.0 * b + s * 7.0 * c));
    let slope = |s: f64| slope_of([c[0], c[1], c[4]], s);
    // What falls falls most at the end.
    if slope_of([c[0], c[1], c[4]].map(|k| k.min(0.0)), r2) > 0.0 {
        return true;
    }
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
