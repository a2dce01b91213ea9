//! The standard normal distribution in single precision, without branches, for vectorised loops.

/// Lanes of the vectorised loops; the number of pixels is padded to a multiple.
pub(super) const LANES: usize = 8;

/// Upper tail and density of the standard normal distribution, without branches.
///
/// NearbyInk: M. Abramowitz and I. Stegun, Handbook of Mathematical Functions, 26.2.17 (error below 7.5e-8).
#[inline(always)]
pub(in crate::detect) fn normal_tail(u: f32) -> (f32, f32) {
    let a = u.abs();
    let phi = 0.398_942_3 * exp_negative(-0.5 * a * a);
    let t = 1.0 / (1.0 + 0.231_641_9 * a);
    let series = t * (0.319_381_53 + t * (-0.356_563_78 + t * (1.781_477_9 + t * (-1.821_255_9 + t * 1.330_274_4))));
    let tail = phi * series;
    (if u < 0.0 { 1.0 - tail } else { tail }, phi)
}

/// `exp(x)` for -80 < x <= 0 by splitting off the power of two; relative error 3e-7 + 1.2e-7 |x|.
#[inline(always)]
pub(super) fn exp_negative(x: f32) -> f32 {
    const ROUND: f32 = 12_582_912.0; // 1.5 * 2^23: adding it rounds to an integer in the low bits
    let z = x * std::f32::consts::LOG2_E;
    let shifted = z + ROUND;
    let f = (z - (shifted - ROUND)) * std::f32::consts::LN_2;
    let power = f32::from_bits(shifted.to_bits().wrapping_add(127).wrapping_shl(23));
    power * (1.0 + f * (1.0 + f * (0.5 + f * (1.0 / 6.0 + f * (1.0 / 24.0 + f * (1.0 / 120.0 + f * (1.0 / 720.0)))))))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_normal_tail_is_right() {
        // values of Q(u) from tables
        for (u, q) in
            [(0.0f32, 0.5f64), (1.0, 0.158_655_25), (2.0, 0.022_750_13), (-1.5, 0.933_192_8), (5.0, 2.866_5e-7)]
        {
            assert!((f64::from(normal_tail(u).0) - q).abs() < 2e-7, "{u}");
        }
        assert!((f64::from(normal_tail(1.0).1) - 0.241_970_7).abs() < 1e-7);
        for k in 0..300 {
            let x = -0.25 * k as f32;
            // the polynomial, and the rounding of x log2(e) in single precision
            let tolerance = 3e-7 + 1.2e-7 * f64::from(x.abs());
            assert!((f64::from(exp_negative(x)) / f64::from(x).exp() - 1.0).abs() < tolerance, "{x}");
        }
    }
}
