//! Sub-pixel place of one side of a dark figure on light ground: a nearly straight blurred edge.
//!
//! With x along the side from its middle and y across it, towards the light, px:
//!
//! ```text
//! I = min(full scale, d(x) + h(x) (Phi((y - e(x)) / s) + B(x, e(x) - y)))
//! e(x) = o + a x + c x^2 + c3 x^3 + c4 x^4,  h(x) = h0 + h1 x,  d(x) = d0 + d1 x + d2 x^2
//! B(x, t) = sum of step (Phi((x - x0) / s) - Phi((x - x1) / s)) (Phi((t - t0) / s) - Phi((t - t1) / s))
//! ```
//!
//! `B` is what lies beside the side, in rectangles: light modules of the code within a border of one module, and the next tag. It counts where
//! the blur is a fifth of the border, or about that, or more, and is laid again, for the side and the blur that were found, until these rest.
//!
//! `c`, `c3` and `c4` carry what lens distortion bends, with priors of [`BENDS`] per picture width: of short sides nothing but `c`. Everything
//! else is free but for wide priors. The pixels are those of a band about the side: about the line between its ends at first, wider by
//! what the lens may bend, and laid again until it lies about what was found.
//!
//! Glare adds the same to ink and paper: where it clips the paper, the curve of the ink says where half of the step is, and the area of
//! the pixel is in the shape of the edge ([`super::edge_shape`]). The ends
//! are left out, where the next side rounds the corner off. Two sides cross at the corner; its covariance is that of their
//! `(o, a, c, c3, c4)` at the noise that the residuals show.

use nalgebra::{Matrix2, SMatrix, Vector2};

use super::edge_shape::{PixelShape, SHARPEST_SQUARE};
use super::edge_sums::{
    BLUR, Column, DARK, FAR_BLURS, FEW_PARAMETERS, Normal, Pixel, SHAPE, STEP, Shape, Sums, powers, sums,
};
use crate::detect::Picture;
use crate::detect::circles::normal_tail;
use crate::detect::shared::{SATURATED, SYSTEMATIC_PX};

/// Prior sigmas of the terms of second to fifth order of what the lens bends times the first to fourth power of the width of the picture: k1 =
/// 0.3 half way to the corner gives 0.15; the square of such a k1, and a k2 of that size, at a focal length of 0.6 widths give the last two.
const BENDS: [f64; 4] = [0.15, 0.3, 0.3, 2.0];
/// Least part of these, but the first, that a straight side is allowed: the bend `c` of a side, in sigmas of its own, tells how far its line is
/// from the axis of the lens, and all that the lens bends is in proportion to that.
const LEAST_BENT: f64 = 0.01;
/// What a lens bends at most, in sigmas of the first of these.
const BENT_SIGMAS: f64 = 2.0;
/// A side that is bent by less, px, lies in the band about the line between its ends.
const BENT_PX: f64 = 1.0;
/// Times that levels and bend are told from each other to begin with.
const STARTS: usize = 4;
/// Most px by which one step bends a side.
const BEND_STEP_PX: f64 = 2.0;
/// A band that lies so far off, px, shows the whole edge as well.
const BAND_OFF_PX: f64 = 0.2;
/// Prior of the blur, px, and its sigma (of the logarithm).
const USUAL_BLUR_PX: f64 = 0.9;
const BLUR_SIGMA: f64 = 0.6;
/// Of the blur, px; others are no edges of a usable picture.
const BLUR_RANGE_PX: (f64, f64) = (0.2, 8.0);
const MOST_STEPS: usize = 24;
/// Beside what the next side rounds off, so much of both ends is left out, px: they are not known better.
pub(super) const ENDS_SPARE_PX: f64 = 1.0;
/// Cosine of the sharpest angle of two sides.
const SHARPEST: f64 = 0.99;
/// A step below this moves no corner visibly, px; and what is good enough where pixels pass in and out of saturation.
const AT_REST_PX: f64 = 1e-4;
const NEARLY_AT_REST_PX: f64 = 5e-3;
/// Prior sigma of a level, as a share of the contrast at the start: paper that is clipped does not tell its own.
const LEVEL: f64 = 0.3;
/// The same of the step to paper that is clipped: it is seen as the least that it may be.
const CLIPPED_LEVEL: f64 = 1.0;
/// What light that changes across a side leaves beside clipped paper, as a share of the step; it is alike all along a side, where it says so
/// many numbers.
const OTHER_SHAPE: f64 = 0.005;
const OF_AN_EDGE: f64 = 8.0;
/// Prior sigma of a slope of the light along the side, as a share of the contrast per px; it may change by itself over the side.
const SLOPE_PER_PX: f64 = 0.01;
/// What lies beyond ink and paper is seen so many blurs before it: at two by 2 % of the contrast.
const CLEAR_OF_BLURS: f64 = 2.0;
/// Blur over the width of the ink from which what lies beyond it is seen within.
const SHINES_THROUGH: f64 = 0.18;
/// Times that what lies beside a side is laid again.
const MOST_ROUNDS: usize = 12;
/// A side that moves further than this part of its length, or by more than this many px, is another edge.
const FARTHEST: f64 = 0.1;
const FARTHEST_PX: f64 = 3.0;
/// Residuals above this share of the contrast are another structure.
const WORST: f64 = 0.12;

/// Prior sigmas of the terms of second to fifth order of what the lens bends, px per power of px.
pub(super) fn bends(picture: &Picture) -> [f64; 4] {
    let width = picture.width.max(picture.height) as f64;
    [1, 2, 3, 4].map(|k| BENDS[k as usize - 1] / width.powi(k))
}

/// By how much a side of this length moves at most as a straight one, and by how much it is bent, px.
fn moved_px(state: &Column, length: f64) -> [f64; 2] {
    let terms = state.fixed_rows::<SHAPE>(0).abs().component_mul(&powers(length / 2.0));
    let straight = terms[0] + terms[1];
    [straight, terms.sum() - straight]
}

/// Where a side is looked for.
#[derive(Debug, Clone, Copy)]
pub struct Side {
    pub from: [f64; 2],
    pub to: [f64; 2],
    /// How far ink and paper reach beside it undisturbed, px.
    pub ink_px: f64,
    pub paper_px: f64,
    /// Cosines of the angles of ink between it and the next sides, where it begins and where it ends.
    pub sharpness: [f64; 2],
}

impl Side {
    /// How much of either end is left out where the next side is nearer than `clear_px`, px.
    fn spare(&self, clear_px: f64) -> [f64; 2] {
        self.sharpness.map(|cosine| clear_px / (1.0 - cosine.clamp(0.0, SHARPEST).powi(2)).sqrt())
    }
}

/// A rectangle of paper in the ink beside a side, or of ink in its paper.
#[derive(Debug, Clone, Copy)]
pub struct Beside {
    /// From and to along the side, from its middle, px.
    pub along_px: [f64; 2],
    /// From and to across it, towards the ink, px from the line through its ends.
    pub depth_px: [f64; 2],
    /// Its step over that of the side: 1 for paper, -1 for ink.
    pub step: f64,
}

impl Beside {
    /// Its part in the light of a place, that of the side being 1.
    fn light(&self, along: f64, depth: f64, blur_px: f64) -> f64 {
        let within = |at: f64, [from, to]: [f64; 2]| beyond(at - from, blur_px) - beyond(at - to, blur_px);
        self.step * within(along, self.along_px) * within(depth, self.depth_px)
    }
}

/// Share of the light so far beyond an edge.
fn beyond(px: f64, blur_px: f64) -> f64 {
    let (tail, _) = normal_tail((px / blur_px).clamp(-FAR_BLURS, FAR_BLURS) as f32);
    1.0 - f64::from(tail)
}

/// A measured side.
#[derive(Debug, Clone, Copy)]
pub struct EdgeLine {
    middle: Vector2<f64>,
    along: Vector2<f64>,
    across: Vector2<f64>,
    shape: Shape,
    fit: Fit,
}

/// A side, or why there is none.
pub type Measured = Result<EdgeLine, &'static str>;

/// How well a side is known.
#[derive(Debug, Clone, Copy)]
struct Fit {
    covariance: SMatrix<f64, SHAPE, SHAPE>,
    /// Variance of a displacement towards the light that the sides of a tag have in common, px^2.
    common: f64,
    /// Root mean square of the residuals on the paper, the step to it from the ink, and the ink, counts.
    paper_residual: f64,
    contrast: f64,
    dark: f64,
    blur_px: f64,
    /// Whether what lies beside it is seen within.
    is_lit: bool,
}

impl EdgeLine {
    /// Measures a side whose light lies to the left on the way from `from` to `to` (in the picture, rows downwards); `beside` tells what
    /// may shine through its ink, and is asked only where that is seen.
    ///
    /// # Errors
    /// Why there is no such side.
    pub fn fit(picture: &Picture, side: &Side, beside: impl Fn() -> Vec<Beside>) -> Result<Self, &'static str> {
        let (from, to) = (Vector2::from(side.from), Vector2::from(side.to));
        let length = (to - from).norm();
        let along = (to - from) / length;
        let mut line = Self {
            middle: (from + to) / 2.0,
            along,
            across: Vector2::new(along.y, -along.x),
            shape: Shape::zeros(),
            fit: Fit {
                covariance: SMatrix::zeros(),
                common: 0.0,
                paper_residual: 0.0,
                contrast: 0.0,
                dark: 0.0,
                blur_px: 0.0,
                is_lit: false,
            },
        };
        let mut state = Column::zeros();
        state[BLUR] = USUAL_BLUR_PX.ln();
        let bent_px = BENT_SIGMAS * bends(picture)[0] * (length / 2.0).powi(2);
        let mut spare_px = if bent_px > BENT_PX { bent_px } else { 0.0 };
        let mut around: Option<Vec<Beside>> = None;
        // the band is laid again where the last fit found the side, as wide as its blur asks for
        for round in 0..MOST_ROUNDS {
            let before = state;
            line.shape = state.fixed_rows::<SHAPE>(0).into_owned();
            let mut pixels = line.band(picture, side, length, [state[BLUR].exp(), spare_px])?;
            if round == 0 {
                start(&pixels, &mut state, spare_px > 0.0)?;
            } else if around.is_some() || state[BLUR].exp() > SHINES_THROUGH * side.ink_px {
                line.lighten(&mut pixels, around.get_or_insert_with(&beside), state[BLUR].exp());
            }
            let shape = PixelShape::of(&line.across, pixels.iter().any(|p| p.saturated));
            line.fit = iterate(picture, &pixels, (length, shape), &mut state)?;
            let is_lit = around.as_ref().is_some_and(|around| !around.is_empty());
            line.fit.is_lit = is_lit;
            let moved = state - before;
            let [straight, bent] = moved_px(&moved, length);
            let moved_px = straight + moved[BLUR].abs() * state[BLUR].exp();
            spare_px = 0.0;
            if round > 0 && moved_px + bent < BAND_OFF_PX && (!is_lit || moved_px < NEARLY_AT_REST_PX) {
                line.shape = state.fixed_rows::<SHAPE>(0).into_owned();
                return Ok(line);
            }
        }
        Err("no convergence")
    }

    /// Adds to pixels what shines into them from beside.
    fn lighten(&self, pixels: &mut [Pixel], around: &[Beside], blur_px: f64) {
        for p in pixels {
            let depth = self.offset(p.x) - p.y;
            p.light = around.iter().map(|one| one.light(p.x, depth, blur_px)).sum();
        }
    }

    /// Whether what lies beside the side was seen within its ink.
    pub fn is_lit(&self) -> bool {
        self.fit.is_lit
    }

    /// The side when its covariance is so many times as large.
    pub fn widened(mut self, factor: f64) -> Self {
        self.fit.covariance *= factor;
        self
    }

    /// Sigma of the blur, px.
    pub fn blur_px(&self) -> f64 {
        self.fit.blur_px
    }

    /// The same before a smoothing with this sigma, px.
    pub fn blur_before(&self, smoothing_px: f64) -> f64 {
        (self.fit.blur_px.powi(2) - smoothing_px * smoothing_px).max(SHARPEST_SQUARE).sqrt()
    }

    /// The pixels of the band: without the ends, and as far to both sides as nothing disturbs: what blur asks for, px, and what is to spare.
    fn band(
        &self,
        picture: &Picture,
        side: &Side,
        length: f64,
        [blur_px, spare_px]: [f64; 2],
    ) -> Result<Vec<Pixel>, &'static str> {
        let reach = 3.0 * blur_px + 1.0;
        let room = |px: f64| (reach + spare_px).min((px - CLEAR_OF_BLURS * blur_px).max(0.5 * px).max(1.0));
        let (inner, outer) = (room(side.ink_px), room(side.paper_px));
        let [first, last] = side.spare(2.5 * blur_px + ENDS_SPARE_PX).map(|spare| spare.min(length / 4.0));
        let [from, to] = [first - length / 2.0, length / 2.0 - last];
        let [low, high] = self.extent([from, to], reach);
        let last = Vector2::new(picture.width as f64 - 1.0, picture.height as f64 - 1.0);
        if low.min() < 0.0 || high.x > last.x || high.y > last.y {
            return Err("cut by the border");
        }
        let low = low.add_scalar(-spare_px).sup(&Vector2::zeros());
        let high = high.add_scalar(spare_px).inf(&last);
        let limit = SATURATED * picture.full_scale;
        let mut pixels = Vec::new();
        for v in low.y.ceil() as usize..=high.y.floor() as usize {
            for u in low.x.ceil() as usize..=high.x.floor() as usize {
                let d = Vector2::new(u as f64, v as f64) - self.middle;
                let (x, y) = (d.dot(&self.along), d.dot(&self.across));
                let beside = y - self.offset(x);
                if (from..=to).contains(&x) && beside >= -inner && beside <= outer {
                    let value = picture.at(u, v);
                    pixels.push(Pixel { x, y, value: f64::from(value), saturated: value >= limit, light: 0.0 });
                }
            }
        }
        if pixels.len() < 3 * FEW_PARAMETERS { Err("too small") } else { Ok(pixels) }
    }

    /// Where the side is, px to both sides of it, least and most in the picture.
    fn extent(&self, [from, to]: [f64; 2], reach: f64) -> [Vector2<f64>; 2] {
        let places = [0.0, 0.25, 0.5, 0.75, 1.0].map(|part| from + part * (to - from));
        let beside = places.map(|x| [-reach, reach].map(|y| (x, self.offset(x) + y)));
        let points = beside.into_iter().flatten().map(|(x, y)| self.middle + self.along * x + self.across * y);
        points
            .fold([Vector2::repeat(f64::MAX), Vector2::repeat(f64::MIN)], |[low, high], p| [low.inf(&p), high.sup(&p)])
    }

    fn offset(&self, x: f64) -> f64 {
        self.shape.dot(&powers(x))
    }

    fn slope(&self, x: f64) -> f64 {
        self.shape.dot(&Shape::from([0.0, 1.0, 2.0 * x, 3.0 * x * x, 4.0 * x.powi(3)]))
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

    /// How far it lies towards the light of a place beside it, px, and the variance of that.
    pub fn offset_from(&self, place: [f64; 2]) -> (f64, f64) {
        let d = Vector2::from(place) - self.middle;
        let x = d.dot(&self.along);
        (self.offset(x) - d.dot(&self.across), powers(x).dot(&(self.fit.covariance * powers(x))))
    }

    /// The side when its ink ends so many px earlier, a number with this variance that the sides of a tag have in common, px^2.
    pub fn shrunk(mut self, by_px: f64, variance: f64) -> Self {
        self.shape[0] -= by_px;
        self.fit.common = variance;
        self
    }

    /// The side with a variance of its place more, px^2.
    pub fn displaced(mut self, variance: f64) -> Self {
        self.fit.covariance[(0, 0)] += variance;
        self
    }

    /// Places beside a side of this length, a pixel apart along it and so many px to its light.
    pub fn beside(&self, length: f64, to_light: impl Iterator<Item = f64> + Clone) -> impl Iterator<Item = [f64; 2]> {
        let half = (0.5 * length).floor() as i64;
        let (side, lines) = (*self, to_light);
        (-half..=half).flat_map(move |x| {
            lines
                .clone()
                .map(move |y| (side.middle + side.along * x as f64 + side.across * (side.offset(x as f64) + y)).into())
        })
    }

    /// How many rows or columns of pixels a side of this length crosses, whichever is fewer.
    pub fn crossed(&self, length: f64) -> f64 {
        length * self.along.abs().min()
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
                let slope = line.across - line.along * line.slope(x);
                slopes.set_row(k, &slope.transpose());
                let terms = powers(x);
                variance[k] = (terms.transpose() * line.fit.covariance * terms)[0];
            }
            p -= slopes.try_inverse()? * left;
        }
        let inverse = slopes.try_inverse()?;
        let common = Matrix2::repeat(0.5 * (self.fit.common + other.fit.common));
        let of_sides = Matrix2::from_diagonal(&Vector2::from(variance)) + common;
        let covariance = inverse * of_sides * inverse.transpose();
        let floor = SYSTEMATIC_PX * SYSTEMATIC_PX;
        let all = [covariance[(0, 0)] + floor, covariance[(0, 1)], covariance[(1, 1)] + floor];
        (p.iter().chain(&all).all(|v| v.is_finite())).then(|| (p.into(), all))
    }
}

/// Levels of ink and paper to begin with, and, where asked for, how far off and how bent the side is.
fn start(pixels: &[Pixel], state: &mut Column, is_bent: bool) -> Result<(), &'static str> {
    for _ in 0..if is_bent { STARTS } else { 1 } {
        let side = state.fixed_rows::<SHAPE>(0).into_owned();
        let beside = |p: &Pixel| p.y - side.dot(&powers(p.x));
        let mean = |sign: f64| {
            let far = pixels.iter().map(|p| sign * beside(p)).fold(f64::MIN, f64::max);
            let values: Vec<f64> = pixels.iter().filter(|p| sign * beside(p) > 0.5 * far).map(|p| p.value).collect();
            values.iter().sum::<f64>() / values.len().max(1) as f64
        };
        state[DARK] = mean(-1.0);
        state[STEP] = mean(1.0) - state[DARK];
        if state[STEP] <= 0.0 {
            return Err("no contrast");
        }
        if is_bent {
            [state[0], state[2]] = bent_by_areas(pixels, [state[DARK], state[STEP]]);
        }
    }
    Ok(())
}

/// Terms of order 0 and 2 of a side, from the light that is missing beyond the line between its ends: over a band, the sum of
/// (share of the light - that of a side along the line) times a function of x is minus the integral of the side times it.
fn bent_by_areas(pixels: &[Pixel], [dark, step]: [f64; 2]) -> [f64; 2] {
    let half = pixels.iter().map(|p| p.x.abs()).fold(0.0, f64::max);
    let mut sums = [0.0; 2];
    for p in pixels {
        let excess = (p.value - dark) / step - if p.y > 0.0 { 1.0 } else { 0.0 };
        sums[0] -= excess;
        sums[1] -= excess * (p.x * p.x - half * half / 3.0);
    }
    // the second is orthogonal to the first, and the integral of its square is 8/45 half^5
    let (mean, bend) = (sums[0] / (2.0 * half), sums[1] / (8.0 / 45.0 * half.powi(5)));
    [mean - bend * half * half / 3.0, bend]
}

/// What is known of a side before it is fitted.
struct Priors {
    /// Where it begins.
    first: Column,
    /// Sigmas of parameters.
    sigmas: [(usize, f64); 9],
}

impl Priors {
    fn of([second, third, fourth, _]: [f64; 4], length: f64, first: &Column, is_clipped: bool) -> Self {
        let (level, slope) = (LEVEL * first[STEP], SLOPE_PER_PX * first[STEP]);
        let part = (first[2].abs() / second).clamp(LEAST_BENT, 1.0);
        let sigmas = [
            (2, second),
            (3, part * third),
            (4, part * fourth),
            (BLUR, BLUR_SIGMA),
            (STEP, if is_clipped { CLIPPED_LEVEL * first[STEP] } else { level }),
            (STEP + 1, slope),
            (DARK, level),
            (DARK + 1, slope),
            (DARK + 2, slope / (2.0 * length)),
        ];
        Self { first: *first, sigmas }
    }

    /// The information of pixels with this noise and of the priors, and its gradient at a state.
    fn with(&self, pixels: &Sums, noise: f64, state: &Column) -> (Normal, Column) {
        let information = 1.0 / (noise * noise);
        let (mut normal, mut gradient) = (pixels.normal * information, pixels.gradient * information);
        for (k, sigma) in self.sigmas {
            let prior = match k {
                BLUR => USUAL_BLUR_PX.ln(),
                STEP | DARK => self.first[k],
                _ => 0.0,
            };
            normal[(k, k)] += 1.0 / (sigma * sigma);
            gradient[k] -= (state[k] - prior) / (sigma * sigma);
        }
        (normal, gradient)
    }
}

/// Gauss-Newton steps to the end.
fn iterate(
    picture: &Picture,
    pixels: &[Pixel],
    (length, shape): (f64, PixelShape),
    state: &mut Column,
) -> Result<Fit, &'static str> {
    let mut noise = 0.03 * state[STEP];
    let farthest = (FARTHEST * length).max(FARTHEST_PX);
    let is_clipped = pixels.iter().any(|p| p.saturated);
    let priors = Priors::of(bends(picture), length, state, is_clipped);
    for round in 1..=MOST_STEPS {
        let all = sums(pixels, state, shape, picture.full_scale);
        if all.used < 2 * FEW_PARAMETERS {
            return Err("saturated");
        }
        let scatter = (all.square / (all.used - FEW_PARAMETERS) as f64).sqrt();
        noise = f64::max(scatter, 0.3).min(noise.max(0.3) * 2.0);
        let (normal, gradient) = priors.with(&all, noise, state);
        let mut step = normal.cholesky().ok_or("no edge")?.solve(&gradient);
        let largest = (step[0].abs() / 1.0).max(step[1].abs() * length / 2.0).max(step[BLUR].abs() / 0.5);
        let largest = largest.max(moved_px(&step, length)[1] / BEND_STEP_PX);
        // pixels that pass in and out of saturation would have it swing for ever
        let damping = if round > MOST_STEPS / 2 { 2.0 } else { 1.0 };
        step /= largest.max(1.0) * damping;
        *state += step;
        let blur = state[BLUR].exp();
        let far = moved_px(state, length)[0] > farthest;
        if far || !(BLUR_RANGE_PX.0..BLUR_RANGE_PX.1).contains(&blur) || !step.iter().all(|v| v.is_finite()) {
            return Err("no edge");
        }
        let rest = if round < MOST_STEPS { AT_REST_PX } else { NEARLY_AT_REST_PX };
        if moved_px(&step, length)[0] < rest {
            let (contrast, paper_residual) = (state[STEP], (all.paper.0 / all.paper.1.max(1.0)).sqrt());
            // Clipped pixels say that they are no darker than that, which may hold a fit, and measure nothing.
            let measured = || pixels.iter().filter(|p| !p.saturated);
            let seen = if is_clipped { sums(measured(), state, shape, picture.full_scale) } else { all };
            let covariance = covariance(&seen, shape, (&priors, noise), state)?;
            let (common, dark, is_lit) = (0.0, state[DARK], false);
            let fit = Fit { covariance, common, paper_residual, contrast, dark, blur_px: blur, is_lit };
            return if noise < WORST * contrast { Ok(fit) } else { Err("disturbed surroundings") };
        }
    }
    Err("no convergence")
}

/// Covariance of a side by the pixels that measure it.
fn covariance(
    seen: &Sums,
    shape: PixelShape,
    (priors, noise): (&Priors, f64),
    state: &Column,
) -> Result<SMatrix<f64, SHAPE, SHAPE>, &'static str> {
    let factor = priors.with(seen, noise, state).0.cholesky().ok_or("no edge")?;
    let mut covariance = factor.inverse().fixed_view::<SHAPE, SHAPE>(0, 0).into_owned();
    if !shape.is_nothing() {
        let response = factor.solve(&(seen.by_k / (noise * noise))).fixed_rows::<SHAPE>(0).into_owned();
        covariance += response * response.transpose() * shape.variance(state[BLUR].exp());
        let of_light = (OTHER_SHAPE * state[STEP] / noise).powi(2) * seen.used as f64 / OF_AN_EDGE;
        covariance[(0, 0)] *= 1.0 + of_light;
    }
    Ok(covariance)
}
