//! The picture near the crossing of four squares, and its derivatives.
//!
//! With d the offset of a pixel from the seed and c the corner:
//!
//! ```text
//! I = min(full scale, b + b_x d_x + b_y d_y + (a + a_x d_x + a_y d_y) P)
//! P = (1 + o) erf(w1) erf(w2) - o erf(w1 / h) erf(w2 / h)
//! w1 = u1 + k erf(u2),  w2 = u2 + k erf(u1),  u_i = (n_i . (d - c) - q_i (t_i . (d - c))^2 / 2) / (sqrt(2) s_i)
//! ```
//!
//! Two blurred edges with tangents t_i, normals n_i and blurs s_i cross at c; the lens bends them by the curvature q_i, which the corners around
//! tell; the linear terms carry uneven light, k the growth of the
//! dark squares in print (each edge steps sideways at the crossing), o the halo of sharpened pictures (what an unsharp
//! mask adds: the picture less its copy with h times the blur), and the clipping leaves over-exposed squares out of the fit.

use std::f64::consts::{FRAC_1_SQRT_2, FRAC_2_SQRT_PI};

use nalgebra::{SMatrix, SVector};

/// Parameters: c_x, c_y, theta_1, theta_2, ln s_1, ln s_2, k, o, b, b_x, b_y, a, a_x, a_y.
pub(super) const PARAMETERS: usize = 14;
pub(super) type Vector = SVector<f64, PARAMETERS>;
pub(super) type Matrix = SMatrix<f64, PARAMETERS, PARAMETERS>;

/// Places of the parameters in the state.
pub(super) const THETA: [usize; 2] = [2, 3];
pub(super) const LN_BLUR: [usize; 2] = [4, 5];
pub(super) const GROWTH: usize = 6;
pub(super) const HALO: usize = 7;
pub(super) const LEVEL: usize = 8;
pub(super) const LEVEL_SLOPE: [usize; 2] = [9, 10];
pub(super) const STEP: usize = 11;
pub(super) const STEP_SLOPE: [usize; 2] = [12, 13];

/// Blur of the halo over that of the edge.
pub(super) const HALO_BLUR: f64 = 2.0;

/// Pixels that are looked at together, for the processor's sake.
pub(super) const LANES: usize = 16;
pub(super) type Lanes = [f64; LANES];

/// Some pixels of the window.
#[derive(Debug, Clone, Copy)]
pub(super) struct Block {
    /// Offsets from the seed, px.
    pub x: Lanes,
    pub y: Lanes,
    /// Counts.
    pub value: Lanes,
    /// 1 for a pixel, 0 for none.
    pub weight: Lanes,
}

impl Block {
    pub const EMPTY: Self = Self { x: [0.0; LANES], y: [0.0; LANES], value: [0.0; LANES], weight: [0.0; LANES] };
}

/// Values of the model and their derivatives at the pixels of a block.
pub(super) struct Prediction {
    pub value: Lanes,
    pub gradient: [Lanes; PARAMETERS],
}

impl Prediction {
    pub const NONE: Self = Self { value: [0.0; LANES], gradient: [[0.0; LANES]; PARAMETERS] };

    /// The derivatives at one pixel.
    pub fn gradient_at(&self, lane: usize) -> Vector {
        Vector::from_fn(|k, _| self.gradient[k][lane])
    }
}

/// What the pixels of one evaluation share.
pub(super) struct Edges<'a> {
    state: &'a Vector,
    tangents: [[f64; 2]; 2],
    /// 1 / (sqrt(2) s)
    sharpness: [f64; 2],
    /// 1 / px
    curvature: [f64; 2],
    /// Whether the halo is part of the model.
    halo: bool,
}

impl<'a> Edges<'a> {
    pub fn new(state: &'a Vector, curvature: [f64; 2], halo: bool) -> Self {
        Self {
            state,
            tangents: THETA.map(|i| [state[i].cos(), state[i].sin()]),
            sharpness: LN_BLUR.map(|i| (-state[i]).exp() * FRAC_1_SQRT_2),
            curvature,
            halo,
        }
    }

    #[inline(always)]
    pub fn predict(&self, block: &Block, out: &mut Prediction) {
        match (self.halo, self.curvature != [0.0; 2]) {
            (false, false) => self.fill::<false, false>(block, out),
            (false, true) => self.fill::<false, true>(block, out),
            (true, false) => self.fill::<true, false>(block, out),
            (true, true) => self.fill::<true, true>(block, out),
        }
    }

    #[inline(always)]
    #[allow(clippy::needless_range_loop, reason = "lanes of many arrays beside each other")]
    fn fill<const HALOED: bool, const BENT: bool>(&self, block: &Block, out: &mut Prediction) {
        let state = self.state;
        let [[t1x, t1y], [t2x, t2y]] = self.tangents;
        let [q1, q2] = self.sharpness;
        let (k, o) = (state[GROWTH], state[HALO]);
        let g = &mut out.gradient;
        for lane in 0..LANES {
            let (px, py) = (block.x[lane], block.y[lane]);
            let (x, y) = (px - state[0], py - state[1]);
            let (mut a1, mut a2) = (t1x * y - t1y * x, t2x * y - t2y * x);
            let (s1, s2) = (t1x * x + t1y * y, t2x * x + t2y * y);
            // Slopes of the edges against their tangents at the crossing, and how far they move as the tangents turn.
            let (mut b1, mut b2, mut l1, mut l2) = (0.0, 0.0, s1, s2);
            if BENT {
                (b1, b2) = (self.curvature[0] * s1, self.curvature[1] * s2);
                (l1, l2) = (s1 + b1 * a1, s2 + b2 * a2);
                (a1, a2) = (a1 - 0.5 * b1 * s1, a2 - 0.5 * b2 * s2);
            }
            let (u1, u2) = (a1 * q1, a2 * q2);
            let ((e1, g1), (e2, g2)) = (erf_with_slope(u1), erf_with_slope(u2));
            let (w1, w2) = (u1 + k * e2, u2 + k * e1);
            let ((f1, r1), (f2, r2)) = (erf_with_slope(w1), erf_with_slope(w2));
            // The product P with its derivatives by w1, w2 and o.
            let (mut value, mut p1, mut p2, mut by_halo) = (f1 * f2, r1 * f2, f1 * r2, 0.0);
            if HALOED {
                let ((h1, t1), (h2, t2)) = (erf_with_slope(w1 / HALO_BLUR), erf_with_slope(w2 / HALO_BLUR));
                by_halo = value - h1 * h2;
                value += o * by_halo;
                p1 += o * (p1 - t1 * h2 / HALO_BLUR);
                p2 += o * (p2 - h1 * t2 / HALO_BLUR);
            }
            let amplitude = state[STEP] + state[STEP_SLOPE[0]] * px + state[STEP_SLOPE[1]] * py;
            // Derivatives by u1 and u2.
            let (d1, d2) = (amplitude * (p1 + p2 * k * g1), amplitude * (p2 + p1 * k * g2));
            let (m1, m2) = (d1 * q1, d2 * q2);
            g[0][lane] = m1 * (t1y + b1 * t1x) + m2 * (t2y + b2 * t2x);
            g[1][lane] = -m1 * (t1x - b1 * t1y) - m2 * (t2x - b2 * t2y);
            g[THETA[0]][lane] = -m1 * l1;
            g[THETA[1]][lane] = -m2 * l2;
            g[LN_BLUR[0]][lane] = -d1 * u1;
            g[LN_BLUR[1]][lane] = -d2 * u2;
            g[GROWTH][lane] = amplitude * (p1 * e2 + p2 * e1);
            g[HALO][lane] = amplitude * by_halo;
            g[LEVEL][lane] = 1.0;
            g[LEVEL_SLOPE[0]][lane] = px;
            g[LEVEL_SLOPE[1]][lane] = py;
            g[STEP][lane] = value;
            g[STEP_SLOPE[0]][lane] = value * px;
            g[STEP_SLOPE[1]][lane] = value * py;
            let level = state[LEVEL] + state[LEVEL_SLOPE[0]] * px + state[LEVEL_SLOPE[1]] * py;
            out.value[lane] = level + amplitude * value;
        }
    }
}

/// exp(-x) for x >= 0, relative error below 1e-8: a power of two, and a polynomial over half an octave to either side.
#[inline(always)]
fn decay(x: f64) -> f64 {
    /// Adding it leaves whole numbers in the low bits of a sum.
    const WHOLE: f64 = 6_755_399_441_055_744.0;
    let x = if x < 700.0 { x } else { 700.0 };
    let shifted = WHOLE - x * std::f64::consts::LOG2_E;
    let power = f64::from_bits(shifted.to_bits().wrapping_add(1023) << 52);
    let r = -x - (shifted - WHOLE) * std::f64::consts::LN_2;
    let tail = 1.0 / 6.0 + r * (1.0 / 24.0 + r * (1.0 / 120.0 + r * (1.0 / 720.0 + r / 5040.0)));
    power * (1.0 + r * (1.0 + r * (0.5 + r * tail)))
}

/// erf and its derivative; Abramowitz and Stegun 7.1.26, absolute error below 1.5e-7.
#[inline(always)]
fn erf_with_slope(u: f64) -> (f64, f64) {
    const C: [f64; 5] = [0.254829592, -0.284496736, 1.421413741, -1.453152027, 1.061405429];
    let gauss = decay(u * u);
    let t = 1.0 / (1.0 + 0.3275911 * u.abs());
    let tail = t * (C[0] + t * (C[1] + t * (C[2] + t * (C[3] + t * C[4])))) * gauss;
    ((1.0 - tail).copysign(u), FRAC_2_SQRT_PI * gauss)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn decay_is_the_exponential() {
        let largest = (0..70_000).map(|k| f64::from(k) * 0.01).map(|x| (decay(x) / (-x).exp() - 1.0).abs());
        // The rest of the series: 0.35^8 / 8!.
        assert!(largest.fold(0.0, f64::max) < 1e-8);
    }

    #[test]
    fn derivatives_agree_with_differences() {
        let mut state = Vector::zeros();
        let values = [0.3, -0.2, 0.1, 1.4, -0.2, 0.3, 0.15, 0.2, 90.0, 0.1, -0.2, 60.0, 0.05, 0.02];
        state.iter_mut().zip(values).for_each(|(s, v)| *s = v);
        let bends = [[0.0; 2], [0.02, -0.03]];
        for ((x, y), bent) in [(1.0, 0.5), (-0.7, 2.0), (3.0, -1.0)].into_iter().flat_map(|at| bends.map(|b| (at, b))) {
            let block = Block { x: [x; LANES], y: [y; LANES], ..Block::EMPTY };
            let predicted = |state: &Vector| {
                let mut prediction = Prediction::NONE;
                Edges::new(state, bent, true).predict(&block, &mut prediction);
                prediction
            };
            let gradient = predicted(&state).gradient_at(0);
            for k in 0..PARAMETERS {
                let at = |sign: f64| {
                    let mut moved = state;
                    moved[k] += sign * 1e-4;
                    predicted(&moved).value[0]
                };
                let numeric = (at(1.0) - at(-1.0)) / 2e-4;
                // The rational approximation of erf jumps by 1e-7 of the step between two arguments.
                assert!((numeric - gradient[k]).abs() < 0.01 + 1e-4 * numeric.abs(), "{k}: {numeric} {}", gradient[k]);
            }
        }
    }
}
