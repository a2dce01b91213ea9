//! Rational distortion: `(1 + k1 r^2 + k2 r^4 + k3 r^6) / (1 + k4 r^2 + k5 r^4 + k6 r^6)` with two tangential coefficients.

use nalgebra::Vector2;

use super::formula::{Coefficients, Distorted, Formula};
use super::radial::{grows_to, radial_tangential, tangential_columns};

/// Numerator, denominator and their derivatives by r^2.
fn parts(c: &[f64], r2: f64) -> [f64; 4] {
    let cubic = |[a, b, d]: [f64; 3]| (1.0 + r2 * (a + r2 * (b + r2 * d)), a + r2 * (2.0 * b + r2 * 3.0 * d));
    let ((n, dn), (m, dm)) = (cubic([c[0], c[1], c[4]]), cubic([c[5], c[6], c[7]]));
    [n, m, dn, dm]
}

/// The formula.
pub(super) struct Rational;

impl Formula for Rational {
    const COEFFICIENTS: &'static [&'static str] = &["k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"];
    const ROS: Option<&'static str> = Some("rational_polynomial");
    const COMMON: &'static [f64] = &[0.42, 0.06, 3e-4, -2e-4, 0.002, 0.78, 0.18, 0.012];

    fn prior_sigma(coefficient: usize) -> f64 {
        match coefficient {
            5.. => 1.0,
            _ => f64::INFINITY,
        }
    }

    #[inline(always)]
    fn distort(c: &[f64], point: &Vector2<f64>, _inverse_depth: f64) -> Distorted {
        distort(c, point)
    }

    fn is_monotonic_to(c: &[f64], r2: f64, _inverse_depth: f64) -> bool {
        is_monotonic_to(c, r2)
    }
}

/// Distorts a point of the plane z = 1.
fn distort(c: &[f64], point: &Vector2<f64>) -> Distorted {
    let (x, y) = (point.x, point.y);
    let r2 = x * x + y * y;
    let [n, m, dn, dm] = parts(c, r2);
    let radial = n / m;
    let slope = 2.0 * (dn * m - n * dm) / (m * m);
    let (image, d_point) = radial_tangential(point, radial, slope, [c[2], c[3]]);
    let mut d_coefficients = Coefficients::zeros();
    let [a, b] = tangential_columns(x, y);
    for (k, [u, v]) in [(2, a), (3, b)] {
        (d_coefficients[(0, k)], d_coefficients[(1, k)]) = (u, v);
    }
    let powers = [r2, r2 * r2, r2 * r2 * r2];
    for (power, (top, bottom)) in powers.iter().zip([(0, 5), (1, 6), (4, 7)]) {
        for (k, factor) in [(top, power / m), (bottom, -radial * power / m)] {
            (d_coefficients[(0, k)], d_coefficients[(1, k)]) = (x * factor, y * factor);
        }
    }
    Distorted::flat(image, d_point, d_coefficients)
}

/// True while the image still moves outwards from the axis to `r2 = r^2`.
fn is_monotonic_to(c: &[f64], r2: f64) -> bool {
    grows_to(r2.sqrt(), |r| {
        let [n, m, ..] = parts(c, r * r);
        if m > 0.0 { r * n / m } else { f64::NAN }
    })
}
