//! Sub-pixel place of one side of a dark figure on light ground: a nearly straight blurred edge.
//!
//! With x along the side from its middle and y across it, towards the light, px:
//!
//! ```text
//! I = min(full scale, d(x) + h(x) Phi((y - e(x)) / s))
//! e(x) = o + a x + c x^2,  h(x) = h0 + h1 x,  d(x) = d0 + d1 x + d2 x^2
//! ```
//!
//! `c` carries what lens distortion bends, with a prior of [`BEND`] per picture width; everything else is free but for wide priors.
//! Glare adds the same to ink and paper: where it clips the paper, the curve of the ink says where half of the step is. The ends
//! are left out, where the next side rounds the corner off. Two sides cross at the corner; its covariance is that of their
//! `(o, a, c)` at the noise that the residuals show.

use nalgebra::{Matrix2, SMatrix, SVector, Vector2, Vector3};

use crate::detect::Picture;
use crate::detect::circles::normal_tail;
use crate::detect::shared::{SATURATED, SYSTEMATIC_PX};

/// Parameters: o, a, c, ln s, h0, h1, d0, d1, d2.
const PARAMETERS: usize = 9;
type Normal = SMatrix<f64, PARAMETERS, PARAMETERS>;
type Column = SVector<f64, PARAMETERS>;

/// Prior sigma of the curvature of a side times the width of the picture: k1 = 0.3 half way to the corner gives 0.15.
const BEND: f64 = 0.15;
/// Prior of the blur, px, and its sigma (of the logarithm).
const USUAL_BLUR_PX: f64 = 0.9;
const BLUR_SIGMA: f64 = 0.6;
/// Of the blur, px; others are no edges of a usable picture.
const BLUR_RANGE_PX: (f64, f64) = (0.2, 8.0);
const MOST_STEPS: usize = 24;
/// A step below this moves no corner visibly, px; and what is good enough where pixels pass in and out of saturation.
const AT_REST_PX: f64 = 1e-4;
const NEARLY_AT_REST_PX: f64 = 5e-3;
/// Prior sigma of a level, as a share of the contrast at the start: paper that is clipped does not tell its own.
const LEVEL: f64 = 0.3;
/// Prior sigma of a slope of the light along the side, as a share of the contrast per px; it may change by itself over the side.
const SLOPE_PER_PX: f64 = 0.01;
/// What lies beyond ink and paper is seen so many blurs before it: at two by 2 % of the contrast.
const CLEAR_OF_BLURS: f64 = 2.0;
/// A side that moves further than this part of its length, or by more than this many px, is another edge.
const FARTHEST: f64 = 0.1;
const FARTHEST_PX: f64 = 3.0;
/// Residuals above this share of the contrast are another structure.
const WORST: f64 = 0.12;

/// Where a side is looked for.
#[derive(Debug, Clone, Copy)]
pub struct Side {
    pub from: [f64; 2],
    pub to: [f64; 2],
    /// How far ink and paper reach beside it undisturbed, px.
    pub ink_px: f64,
    pub paper_px: f64,
}

/// A measured side.
#[derive(Debug, Clone, Copy)]
pub struct EdgeLine {
    middle: Vector2<f64>,
    along: Vector2<f64>,
    across: Vector2<f64>,
    shape: Vector3<f64>,
    fit: Fit,
}

/// A side, or why there is none.
pub type Measured = Result<EdgeLine, &'static str>;

/// How well a side is known.
#[derive(Debug, Clone, Copy)]
struct Fit {
    covariance: SMatrix<f64, 3, 3>,
    /// Root mean square of the residuals on the paper, the step to it from the ink, and the ink, counts.
    paper_residual: f64,
    contrast: f64,
    dark: f64,
}

struct Pixel {
    x: f64,
    y: f64,
    value: f64,
    saturated: bool,
}

impl EdgeLine {
    /// Measures a side whose light lies to the left on the way from `from` to `to` (in the picture, rows downwards).
    ///
    /// # Errors
    /// Why there is no such side.
    pub fn fit(picture: &Picture, side: &Side) -> Result<Self, &'static str> {
        let (from, to) = (Vector2::from(side.from), Vector2::from(side.to));
        let length = (to - from).norm();
        let along = (to - from) / length;
        let mut line = Self {
            middle: (from + to) / 2.0,
            along,
            across: Vector2::new(along.y, -along.x),
            shape: Vector3::zeros(),
            fit: Fit { covariance: SMatrix::zeros(), paper_residual: 0.0, contrast: 0.0, dark: 0.0 },
        };
        let mut state = Column::zeros();
        state[3] = USUAL_BLUR_PX.ln();
        // the band is laid again where the first fit found the side, as wide as its blur asks for
        for round in 0..2 {
            line.shape = Vector3::new(state[0], state[1], state[2]);
            let pixels = line.band(picture, side, length, state[3].exp())?;
            if round == 0 {
                start(&pixels, &mut state)?;
            }
            line.fit = iterate(picture, &pixels, length, &mut state)?;
        }
        line.shape = Vector3::new(state[0], state[1], state[2]);
        Ok(line)
    }

    /// The pixels of the band: without the ends, and as far to both sides as nothing disturbs.
    fn band(&self, picture: &Picture, side: &Side, length: f64, blur_px: f64) -> Result<Vec<Pixel>, &'static str> {
        let half = length / 2.0 - (2.5 * blur_px + 1.0).min(length / 4.0);
        let reach = 3.0 * blur_px + 1.0;
        let room = |px: f64| reach.min((px - CLEAR_OF_BLURS * blur_px).max(0.5 * px).max(1.0));
        let (inner, outer) = (room(side.ink_px), room(side.paper_px));
        let far = self.across * reach.max(1.0);
        let ends = [self.middle - self.along * half, self.middle + self.along * half];
        let corners = [ends[0] - far, ends[0] + far, ends[1] - far, ends[1] + far];
        let low = corners.iter().fold(Vector2::repeat(f64::MAX), |m, p| m.inf(p));
        let high = corners.iter().fold(Vector2::repeat(f64::MIN), |m, p| m.sup(p));
        if low.min() < 0.0 || high.x > picture.width as f64 - 1.0 || high.y > picture.height as f64 - 1.0 {
            return Err("cut by the border");
        }
        let limit = SATURATED * picture.full_scale;
        let mut pixels = Vec::new();
        for v in low.y.ceil() as usize..=high.y.floor() as usize {
            for u in low.x.ceil() as usize..=high.x.floor() as usize {
                let d = Vector2::new(u as f64, v as f64) - self.middle;
                let (x, y) = (d.dot(&self.along), d.dot(&self.across));
                let beside = y - self.offset(x);
                if x.abs() <= half && beside >= -inner && beside <= outer {
                    let value = picture.at(u, v);
                    pixels.push(Pixel { x, y, value: f64::from(value), saturated: value >= limit });
                }
            }
        }
        if pixels.len() < 3 * PARAMETERS { Err("too small") } else { Ok(pixels) }
    }

    fn offset(&self, x: f64) -> f64 {
        self.shape[0] + x * (self.shape[1] + x * self.shape[2])
    }

    /// Root mean square of the residuals on the paper, counts.
    pub fn paper_residual(&self) -> f64 {
        self.fit.paper_residual
    }

    /// Step between ink and paper, counts.
    pub fn contrast(&self) -> f64 {
        self.fit.contrast
    }

    /// Level of the ink, counts.
    pub fn dark(&self) -> f64 {
        self.fit.dark
    }

    /// How far a side that goes on in the line of this one, with its ink on the other side, lies to the light of it, px.
    pub fn step_to(&self, other: &Self) -> f64 {
        let d = other.middle + other.across * other.shape[0] - self.middle;
        d.dot(&self.across) - self.offset(d.dot(&self.along))
    }

    /// The side when its ink ends so many px earlier.
    pub fn shrunk(mut self, by_px: f64) -> Self {
        self.shape[0] -= by_px;
        self
    }

    /// Where two sides cross near `start`, with the covariance (uu, uv, vv), px^2.
    pub fn crossing(&self, other: &Self, start: [f64; 2]) -> Option<([f64; 2], [f64; 3])> {
        let mut p = Vector2::from(start);
        let mut slopes = Matrix2::zeros();
        let mut variance = [0.0; 2];
        for _ in 0..8 {
            let mut left = Vector2::zeros();
            for (k, line) in [self, other].into_iter().enumerate() {
                let d = p - line.middle;
                let (x, y) = (d.dot(&line.along), d.dot(&line.across));
                left[k] = y - line.offset(x);
                let slope = line.across - line.along * (line.shape[1] + 2.0 * line.shape[2] * x);
                slopes.set_row(k, &slope.transpose());
                let terms = Vector3::new(1.0, x, x * x);
                variance[k] = (terms.transpose() * line.fit.covariance * terms)[0];
            }
            p -= slopes.try_inverse()? * left;
        }
        let inverse = slopes.try_inverse()?;
        let covariance = inverse * Matrix2::from_diagonal(&Vector2::from(variance)) * inverse.transpose();
        let floor = SYSTEMATIC_PX * SYSTEMATIC_PX;
        let all = [covariance[(0, 0)] + floor, covariance[(0, 1)], covariance[(1, 1)] + floor];
        (p.iter().chain(&all).all(|v| v.is_finite())).then(|| (p.into(), all))
    }
}

/// Levels of ink and paper to begin with.
fn start(pixels: &[Pixel], state: &mut Column) -> Result<(), &'static str> {
    let mean = |sign: f64| {
        let far = pixels.iter().map(|p| sign * p.y).fold(f64::MIN, f64::max);
        let values: Vec<f64> = pixels.iter().filter(|p| sign * p.y > 0.5 * far).map(|p| p.value).collect();
        values.iter().sum::<f64>() / values.len().max(1) as f64
    };
    state[6] = mean(-1.0);
    state[4] = mean(1.0) - state[6];
    if state[4] > 0.0 { Ok(()) } else { Err("no contrast") }
}

/// Gauss-Newton steps to the end.
fn iterate(picture: &Picture, pixels: &[Pixel], length: f64, state: &mut Column) -> Result<Fit, &'static str> {
    let mut noise = 0.03 * state[4];
    let bend = BEND / picture.width.max(picture.height) as f64;
    let farthest = (FARTHEST * length).max(FARTHEST_PX);
    let first = *state;
    let (level, slope) = (LEVEL * first[4], SLOPE_PER_PX * first[4]);
    let priors = [
        (2, 0.0, bend),
        (3, USUAL_BLUR_PX.ln(), BLUR_SIGMA),
        (4, first[4], level),
        (5, 0.0, slope),
        (6, first[6], level),
        (7, 0.0, slope),
        (8, 0.0, slope / (2.0 * length)),
    ];
    for round in 1..=MOST_STEPS {
        let Sums { mut normal, mut gradient, square, used, paper } = sums(pixels, state, picture.full_scale);
        if used < 2 * PARAMETERS {
            return Err("saturated");
        }
        noise = f64::max((square / (used - PARAMETERS) as f64).sqrt(), 0.3).min(noise.max(0.3) * 2.0);
        let information = 1.0 / (noise * noise);
        normal *= information;
        gradient *= information;
        for (k, prior, sigma) in priors {
            normal[(k, k)] += 1.0 / (sigma * sigma);
            gradient[k] -= (state[k] - prior) / (sigma * sigma);
        }
        let factor = normal.cholesky().ok_or("no edge")?;
        let mut step = factor.solve(&gradient);
        let largest = (step[0].abs() / 1.0).max(step[1].abs() * length / 2.0).max(step[3].abs() / 0.5);
        // pixels that pass in and out of saturation would have it swing for ever
        let damping = if round > MOST_STEPS / 2 { 2.0 } else { 1.0 };
        step /= largest.max(1.0) * damping;
        *state += step;
        let blur = state[3].exp();
        let far = state[0].abs() + state[1].abs() * length / 2.0 > farthest;
        if far || !(BLUR_RANGE_PX.0..BLUR_RANGE_PX.1).contains(&blur) || !step.iter().all(|v| v.is_finite()) {
            return Err("no edge");
        }
        let rest = if round < MOST_STEPS { AT_REST_PX } else { NEARLY_AT_REST_PX };
        if step[0].abs() + step[1].abs() * length / 2.0 < rest {
            let (contrast, paper_residual) = (state[4], (paper.0 / paper.1.max(1.0)).sqrt());
            let covariance = factor.inverse().fixed_view::<3, 3>(0, 0).into_owned();
            let fit = Fit { covariance, paper_residual, contrast, dark: state[6] };
            return if noise < WORST * contrast { Ok(fit) } else { Err("disturbed surroundings") };
        }
    }
    Err("no convergence")
}

struct Sums {
    normal: Normal,
    gradient: Column,
    square: f64,
    used: usize,
    /// Squares of the residuals on the paper, and their number.
    paper: (f64, f64),
}

fn sums(pixels: &[Pixel], state: &Column, full_scale: f32) -> Sums {
    let mut out = Sums { normal: Normal::zeros(), gradient: Column::zeros(), square: 0.0, used: 0, paper: (0.0, 0.0) };
    let blur = state[3].exp();
    let limit = f64::from(SATURATED * full_scale);
    for p in pixels {
        let u = (p.y - state[0] - p.x * (state[1] + p.x * state[2])) / blur;
        let (step, dark) = (state[4] + state[5] * p.x, state[6] + p.x * (state[7] + p.x * state[8]));
        let (tail, phi) = normal_tail(u as f32);
        let share = 1.0 - f64::from(tail);
        let value = dark + step * share;
        if p.saturated && value >= limit {
            continue; // says no more than that
        }
        let residual = p.value - value;
        let density = step * f64::from(phi) / blur;
        let row = Column::from([
            -density,
            -density * p.x,
            -density * p.x * p.x,
            -density * u * blur,
            share,
            share * p.x,
            1.0,
            p.x,
            p.x * p.x,
        ]);
        out.normal += row * row.transpose();
        out.gradient += row * residual;
        out.square += residual * residual;
        out.used += 1;
        if u > 0.0 {
            out.paper = (out.paper.0 + residual * residual, out.paper.1 + 1.0);
        }
    }
    out
}
