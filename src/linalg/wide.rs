//! Loops with the widest registers of the processor.

/// Runs `work`, compiled once for any processor and once for wide registers. It and what it calls must be `inline(always)`.
///
/// No operation is fused or reordered, so that both give the same result.
#[inline(always)]
pub fn wide<R>(work: impl FnOnce() -> R) -> R {
    pulp::Arch::new().dispatch(work)
}

/// `into += a s + b t`.
#[inline(always)]
pub fn add_combination(into: &mut [f64], [a, b]: [&[f64]; 2], [s, t]: [f64; 2]) {
    for ((x, a), b) in into.iter_mut().zip(a).zip(b) {
        *x += a * s + b * t;
    }
}

/// Sum of the products of two rows of one length, in a fixed order, eight beside each other.
#[inline(always)]
#[allow(clippy::needless_range_loop, reason = "lanes of many arrays beside each other")]
pub fn sum_of_products(a: &[f64], b: &[f64]) -> f64 {
    let ((a, a_rest), (b, b_rest)) = (a.as_chunks::<8>(), b.as_chunks::<8>());
    let mut sums = [0.0; 8];
    for (a, b) in a.iter().zip(b) {
        for k in 0..8 {
            sums[k] += a[k] * b[k];
        }
    }
    sums.iter().sum::<f64>() + a_rest.iter().zip(b_rest).map(|(a, b)| a * b).sum::<f64>()
}

/// `into += a s`.
#[inline(always)]
pub fn add_scaled(into: &mut [f64], a: &[f64], s: f64) {
    into.iter_mut().zip(a).for_each(|(x, a)| *x += a * s);
}
