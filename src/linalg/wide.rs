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
