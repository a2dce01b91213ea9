//! Rational distortion: `(1 + k1 r^2 + k2 r^4 + k3 r^6) / (1 + k4 r^2 + k5 r^4 + k6 r^6)` with two tangential coefficients.

use super::formula::{Coefficients, Distorted, Formula, Ideal};
use super::radial::{grows_to, radial_tangential, tangential_columns};

/// `1 + a s + b s^2 + d s^3` and its derivative by s.
#[inline(always)]
fn cubic([a, b, d]: [f64; 3], s: f64) -> [f64; 2] {
    [1.0 + s * (a + s * (b + s * d)), a + s * (2.0 * b + s * 3.0 * d)]
}

/// Numerator, denominator and their derivatives by r^2.
#[inline(always)]
fn parts(c: &[f64], r2: f64) -> [f64; 4] {
    let ([n, dn], [m, dm]) = (cubic([c[0], c[1], c[4]], r2), cubic([c[5], c[6], c[7]], r2));
    [n, m, dn, dm]
}

/// Prior sigmas of `k4`, `k5` and `k6`: those of the nearest rational function of this order to an ideal equidistant lens (the Pade approximant
/// of `atan(r)/r`) are 21/13, 105/143 and 35/429. Where numerator and denominator nearly have a factor in common, wider priors let them go along
/// a valley towards a pole beside the image (`k6 = -1.35` for 0.012): images tell `k6` by itself to 1e-6 at a width of 75 degrees, and a prior of 1 is
/// then 1e-12 of its information, no more than rounding, so that the normal equations were singular.
const DENOMINATOR_SIGMAS: [f64; 3] = [1.0, 0.5, 0.1];

/// The formula.
pub(super) struct Rational;

impl Formula for Rational {
    const COEFFICIENTS: &'static [&'static str] = &["k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"];
    const ROS: Option<&'static str> = Some("rational_polynomial");
    const COMMON: &'static [f64] = &[0.42, 0.06, 3e-4, -2e-4, 0.002, 0.78, 0.18, 0.012];

    fn prior_sigma(coefficient: usize) -> f64 {
        let denominator = coefficient.checked_sub(5).and_then(|k| DENOMINATOR_SIGMAS.get(k));
        denominator.copied().unwrap_or(f64::INFINITY)
    }

    #[inline(always)]
    fn distort<const N: usize>(c: &Coefficients, point: Ideal, n: usize, into: &mut Distorted<N>) {
        let (Ideal { x, y, .. }, r2) = (point, point.r2());
        let [num, den, d_num, d_den] = parts(c, r2);
        let radial = num / den;
        let slope = 2.0 * (d_num * den - num * d_den) / (den * den);
        let (image, d_point) = radial_tangential(point, radial, slope, [c[2], c[3]]);
        into.put(n, image, d_point);
        let [a, b] = tangential_columns(point);
        into.put_column(n, 2, a);
        into.put_column(n, 3, b);
        let powers = [r2, r2 * r2, r2 * r2 * r2];
        for (power, (top, bottom)) in powers.into_iter().zip([(0, 5), (1, 6), (4, 7)]) {
            for (k, factor) in [(top, power / den), (bottom, -radial * power / den)] {
                into.put_column(n, k, [x * factor, y * factor]);
            }
        }
    }

    fn is_monotonic_to(c: &[f64], r2: f64, _inverse_depth: f64) -> bool {
        is_monotonic_to(c, r2)
    }
}

/// True while the image still moves outwards from the axis to `r2 = r^2`.
fn is_monotonic_to(c: &[f64], r2: f64) -> bool {
    grows_to(r2.sqrt(), |r| {
        let [n, m, ..] = parts(c, r * r);
        if m > 0.0 { r * n / m } else { f64::NAN }
    })
}
