//! The picture near the crossing of four squares, and its derivatives.
//!
//! With d the offset of a pixel from the seed and c the corner:
//!
//! ```text
//! I = min(full scale, b + b_x d_x + b_y d_y + (a + a_x d_x + a_y d_y) P)
//! P = (1 + o) erf(w1) erf(w2) - o erf(w1 / h) erf(w2 / h)
//! w1 = u1 + k erf(u2),  w2 = u2 + k erf(u1),  u_i = n_i . (d - c) / (sqrt(2) s_i)
//! ```
//!
//! Two blurred edges with normals n_i and blurs s_i cross at c; the linear terms carry uneven light, k the growth of the
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

/// A pixel of the window.
#[derive(Debug, Clone, Copy)]
pub(super) struct Pixel {
    /// Offset from the seed, px.
    pub x: f64,
    pub y: f64,
    /// Counts.
    pub value: f64,
}

/// Value of the model and its derivatives at one pixel.
pub(super) struct Prediction {
    pub value: f64,
    pub gradient: Vector,
}

/// What the pixels of one evaluation share.
pub(super) struct Edges<'a> {
    state: &'a Vector,
    tangents: [[f64; 2]; 2],
    /// 1 / (sqrt(2) s)
    sharpness: [f64; 2],
    /// Whether the halo is part of the model.
    halo: bool,
}

/// The product P with its derivatives by w1, w2 and o.
struct Product {
    value: f64,
    by_w: [f64; 2],
    by_halo: f64,
}

impl<'a> Edges<'a> {
    pub fn new(state: &'a Vector, halo: bool) -> Self {
        Self {
            state,
            tangents: THETA.map(|i| [state[i].cos(), state[i].sin()]),
            sharpness: LN_BLUR.map(|i| (-state[i]).exp() * FRAC_1_SQRT_2),
            halo,
        }
    }

    pub fn predict(&self, pixel: &Pixel) -> Prediction {
        let state = self.state;
        let (x, y) = (pixel.x - state[0], pixel.y - state[1]);
        let along = self.tangents.map(|t| t[0] * x + t[1] * y);
        let across = self.tangents.map(|t| t[0] * y - t[1] * x);
        let u = [across[0] * self.sharpness[0], across[1] * self.sharpness[1]];
        let [(e1, g1), (e2, g2)] = u.map(erf_with_slope);
        let k = state[GROWTH];
        let product = self.product([u[0] + k * e2, u[1] + k * e1]);
        let [p1, p2] = product.by_w;
        let amplitude = state[STEP] + state[STEP_SLOPE[0]] * pixel.x + state[STEP_SLOPE[1]] * pixel.y;
        // Derivatives by u1 and u2.
        let (d1, d2) = (amplitude * (p1 + p2 * k * g1), amplitude * (p2 + p1 * k * g2));
        let mut gradient = Vector::zeros();
        gradient[0] = d1 * self.sharpness[0] * self.tangents[0][1] + d2 * self.sharpness[1] * self.tangents[1][1];
        gradient[1] = -d1 * self.sharpness[0] * self.tangents[0][0] - d2 * self.sharpness[1] * self.tangents[1][0];
        gradient[THETA[0]] = -d1 * self.sharpness[0] * along[0];
        gradient[THETA[1]] = -d2 * self.sharpness[1] * along[1];
        gradient[LN_BLUR[0]] = -d1 * u[0];
        gradient[LN_BLUR[1]] = -d2 * u[1];
        gradient[GROWTH] = amplitude * (p1 * e2 + p2 * e1);
        gradient[HALO] = amplitude * product.by_halo;
        gradient[LEVEL] = 1.0;
        gradient[LEVEL_SLOPE[0]] = pixel.x;
        gradient[LEVEL_SLOPE[1]] = pixel.y;
        gradient[STEP] = product.value;
        gradient[STEP_SLOPE[0]] = product.value * pixel.x;
        gradient[STEP_SLOPE[1]] = product.value * pixel.y;
        let level = state[LEVEL] + state[LEVEL_SLOPE[0]] * pixel.x + state[LEVEL_SLOPE[1]] * pixel.y;
        Prediction { value: level + amplitude * product.value, gradient }
    }

    fn product(&self, w: [f64; 2]) -> Product {
        let [(f1, s1), (f2, s2)] = w.map(erf_with_slope);
        if !self.halo {
            return Product { value: f1 * f2, by_w: [s1 * f2, f1 * s2], by_halo: 0.0 };
        }
        let o = self.state[HALO];
        let [(h1, t1), (h2, t2)] = w.map(|w| erf_with_slope(w / HALO_BLUR));
        Product {
            value: (1.0 + o) * f1 * f2 - o * h1 * h2,
            by_w: [
                (1.0 + o) * s1 * f2 - o * t1 * h2 / HALO_BLUR,
                (1.0 + o) * f1 * s2 - o * h1 * t2 / HALO_BLUR,
            ],
            by_halo: f1 * f2 - h1 * h2,
        }
    }
}

/// erf and its derivative; Abramowitz and Stegun 7.1.26, absolute error below 1.5e-7.
fn erf_with_slope(u: f64) -> (f64, f64) {
    const C: [f64; 5] = [0.254829592, -0.284496736, 1.421413741, -1.453152027, 1.061405429];
    let gauss = (-u * u).exp();
    let t = 1.0 / (1.0 + 0.3275911 * u.abs());
    let tail = t * (C[0] + t * (C[1] + t * (C[2] + t * (C[3] + t * C[4])))) * gauss;
    ((1.0 - tail).copysign(u), FRAC_2_SQRT_PI * gauss)
}
