//! Loops with the widest registers of the processor.

/// Runs `work`, compiled once for any processor and once for wide registers. It and what it calls must be `inline(always)`.
///
/// No operation is fused or reordered, so that both give the same result.
#[inline(always)]
pub fn wide<R>(work: impl FnOnce() -> R) -> R {
    pulp::Arch::new().dispatch(work)
}
