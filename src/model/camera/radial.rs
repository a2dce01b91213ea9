//! What several lenses share: a radial factor with two tangential (decentring) terms.

use super::formula::Ideal;

/// `x radial + tangential` and its derivative; `slope` is twice the derivative of the radial factor by r^2.
#[inline(always)]
pub(super) fn radial_tangential(
    point: Ideal,
    radial: f64,
    slope: f64,
    [p1, p2]: [f64; 2],
) -> ([f64; 2], [[f64; 2]; 2]) {
    let Ideal { x, y, .. } = point;
    let [a, b] = tangential_columns(point);
    let cross = x * y * slope + 2.0 * (p1 * x + p2 * y);
    (
        [x * radial + p1 * a[0] + p2 * b[0], y * radial + p1 * a[1] + p2 * b[1]],
        [
            [radial + x * x * slope + 2.0 * p1 * y + 6.0 * p2 * x, cross],
            [cross, radial + y * y * slope + 6.0 * p1 * y + 2.0 * p2 * x],
        ],
    )
}

/// Derivatives by p1 and p2.
#[inline(always)]
pub(super) fn tangential_columns(point: Ideal) -> [[f64; 2]; 2] {
    let (Ideal { x, y, .. }, r2) = (point, point.r2());
    [[2.0 * x * y, r2 + 2.0 * y * y], [r2 + 2.0 * x * x, 2.0 * x * y]]
}

/// True while `value(r)` still grows from the axis out to `r`, looked at in 48 steps.
pub(super) fn grows_to(r: f64, value: impl Fn(f64) -> f64) -> bool {
    const STEPS: usize = 48;
    let mut last = value(0.0);
    for k in 1..=STEPS {
        let next = value(r * k as f64 / STEPS as f64);
        if !(next > last || r == 0.0) {
            return false;
        }
        last = next;
    }
    true
}
