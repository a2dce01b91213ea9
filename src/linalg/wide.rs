//! Loops with the widest registers of the processor.

/// Runs `work`, compiled once for any processor and once for wide registers. It and what it calls must be `inline(always)`.
///
/// No operation is fused or reordered, so that both give the same result.
#[inline(always)]
pub fn wide<R>(work: impl FnOnce() -> R) -> R {
    pulp::Arch::new().dispatch(work)
}

/// `into += a s + b t + ..`, over the length of the shortest.
#[inline(always)]
pub fn add_combination<const N: usize>(into: &mut [f64], of: [&[f64]; N], by: [f64; N]) {
    let length = of.iter().fold(into.len(), |least, row| least.min(row.len()));
    // All of one length, so that no index is looked at in the loop.
    let of = of.map(|row| &row[..length]);
    for (k, x) in into[..length].iter_mut().enumerate() {
        *x += (1..N).fold(of[0][k] * by[0], |sum, n| sum + of[n][k] * by[n]);
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
