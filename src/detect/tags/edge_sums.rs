//! Normal equations of one side of a dark figure, over the pixels of its band.

use nalgebra::{SMatrix, SVector};

use super::edge_shape::PixelShape;
use crate::detect::circles::normal_tail;
use crate::detect::shared::SATURATED;

/// Of a side: o, a, c, c3, c4.
pub const SHAPE: usize = 5;
/// Parameters: those of a side, ln s, h0, h1, d0, d1, d2.
pub const PARAMETERS: usize = SHAPE + 6;
/// Of these, `c3` and `c4` are known beforehand where pixels are few.
pub const FEW_PARAMETERS: usize = PARAMETERS - 2;
pub const BLUR: usize = SHAPE;
pub const STEP: usize = SHAPE + 1;
pub const DARK: usize = SHAPE + 3;
pub type Normal = SMatrix<f64, PARAMETERS, PARAMETERS>;
pub type Column = SVector<f64, PARAMETERS>;
pub type Shape = SVector<f64, SHAPE>;

/// Beyond so many blurs an edge is over.
pub const FAR_BLURS: f64 = 8.0;

pub struct Pixel {
    pub x: f64,
    pub y: f64,
    pub value: f64,
    pub saturated: bool,
    /// Share of the step that comes from beside.
    pub light: f64,
}

/// Powers of a place along a side.
pub fn powers(x: f64) -> Shape {
    Shape::from([1.0, x, x * x, x.powi(3), x.powi(4)])
}

pub struct Sums {
    /// Its lower triangle.
    pub normal: Normal,
    pub gradient: Column,
    /// Products with the derivative by the shape of the edge.
    pub by_k: Column,
    pub square: f64,
    pub used: usize,
    /// Squares of the residuals on the paper, and their number.
    pub paper: (f64, f64),
}

/// What a state says of a pixel.
struct Said {
    /// Blurs beside the edge.
    u: f64,
    step: f64,
    value: f64,
    row: Column,
    /// Derivative of the share of the step by the shape of the edge.
    by_k: f64,
}

impl Said {
    #[inline(always)]
    fn of(p: &Pixel, state: &Column, blur: f64, shape: PixelShape) -> Self {
        let terms = powers(p.x);
        let u = ((p.y - state.fixed_rows::<SHAPE>(0).dot(&terms)) / blur).clamp(-FAR_BLURS, FAR_BLURS);
        let (step, dark) =
            (state[STEP] + state[STEP + 1] * p.x, state[DARK] + p.x * (state[DARK + 1] + p.x * state[DARK + 2]));
        let (tail, phi) = normal_tail(u as f32);
        let phi = f64::from(phi);
        let (mut share, mut by_u, mut by_blur, mut by_k) = (1.0 - f64::from(tail) + p.light, phi, -phi * u, 0.0);
        if !shape.is_nothing() {
            let added = shape.add(u, phi, blur);
            share += added.share;
            by_u += added.by_u;
            by_blur += added.by_blur;
            by_k = added.by_k;
        }
        let density = step * by_u / blur;
        let row = Column::from([
            -density,
            -density * terms[1],
            -density * terms[2],
            -density * terms[3],
            -density * terms[4],
            step * by_blur,
            share,
            share * p.x,
            1.0,
            p.x,
            p.x * p.x,
        ]);
        Self { u, step, value: dark + step * share, row, by_k }
    }
}

/// Adds `row row^T` to a lower triangle.
#[inline(always)]
fn add_square(normal: &mut Normal, row: &Column) {
    for j in 0..PARAMETERS {
        for i in j..PARAMETERS {
            normal[(i, j)] += row[i] * row[j];
        }
    }
}

pub fn sums<'a>(
    pixels: impl IntoIterator<Item = &'a Pixel>,
    state: &Column,
    shape: PixelShape,
    full_scale: f32,
) -> Sums {
    let (normal, zeros) = (Normal::zeros(), Column::zeros());
    let mut out = Sums { normal, gradient: zeros, by_k: zeros, square: 0.0, used: 0, paper: (0.0, 0.0) };
    let blur = state[BLUR].exp();
    let limit = f64::from(SATURATED * full_scale);
    for p in pixels {
        let said = Said::of(p, state, blur, shape);
        if p.saturated && said.value >= limit {
            continue; // says no more than that
        }
        let residual = p.value - said.value;
        add_square(&mut out.normal, &said.row);
        out.gradient += said.row * residual;
        if !shape.is_nothing() {
            out.by_k += said.row * (said.step * said.by_k);
        }
        out.square += residual * residual;
        out.used += 1;
        if said.u > 0.0 {
            out.paper = (out.paper.0 + residual * residual, out.paper.1 + 1.0);
        }
    }
    out
}
