//! Sub-pixel position of the crossing of four squares: least squares over the pixels around it.

use super::model::{
    Edges, GROWTH, HALO, HALO_BLUR, LEVEL, LEVEL_SLOPE, LN_BLUR, Matrix, PARAMETERS, Pixel, STEP, STEP_SLOPE, THETA, Vector,
};
use crate::detect::Picture;

const MAX_STEPS: usize = 30;
/// A step below this moves no corner visibly, px.
const STEP_TOLERANCE_PX: f64 = 1e-4;
/// The same before the noise is known, px.
const ROUGH_TOLERANCE_PX: f64 = 1e-2;
/// Noise of the pixels over half the step of an edge, as long as it is not known.
const START_NOISE: f64 = 0.03;
/// Prior sigma of the slope of the light, share of the contrast per px.
const SLOPE_PER_PX: f64 = 0.0003;
/// Prior sigma of the growth of the dark squares, in blurs.
const GROWTH_SIGMA: f64 = 0.3;
/// Prior sigma of the halo, share of the step.
const HALO_SIGMA: f64 = 0.3;
/// Prior sigma of the logarithm of a blur about that of the picture: only a blur that the pixels leave open feels it.
const LN_BLUR_SIGMA: f64 = 1.0;
/// Blurs outside are no edges of a usable picture, px.
const BLUR_RANGE_PX: (f64, f64) = (0.2, 12.0);
/// A corner further from its seed than this share of the square's side is another structure.
const OFF_LATTICE: f64 = 0.2;
/// A corner nearer to the edge of the picture is not fitted, px.
const LEAST_MARGIN_PX: f64 = 4.0;
/// Least sine of the angle between the two edges.
const LEAST_CROSSING: f64 = 0.1;

/// Why no corner came out of a fit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Refusal {
    NoNeighbours,
    Oblique,
    AtTheEdge,
    TooFewPixels,
    /// The pixels show something else than two crossing edges.
    NoCrossing,
    /// The fit was still on its way when its steps were used up: nothing is known about the corner.
    NotConverged,
    OffTheLattice,
}

impl Refusal {
    pub fn reason(self) -> &'static str {
        match self {
            Self::NoNeighbours => "no neighbours",
            Self::Oblique => "seen too obliquely",
            Self::AtTheEdge => "at the edge of the picture",
            Self::TooFewPixels => "too few pixels",
            Self::NoCrossing => "no crossing of two edges",
            Self::NotConverged => "fit not converged",
            Self::OffTheLattice => "off the lattice",
        }
    }

    /// Whether a better start may end otherwise.
    pub fn may_pass(self) -> bool {
        matches!(self, Self::NoCrossing | Self::NotConverged | Self::OffTheLattice)
    }
}

/// A corner as the lattice predicts it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Seed {
    pub uv: [f64; 2],
    /// Image of one square's side along each of the two edges, px.
    pub sides: [[f64; 2]; 2],
}

impl Seed {
    /// Length of the shorter side, px.
    pub fn side_px(&self) -> f64 {
        self.sides.iter().map(|s| s[0].hypot(s[1])).fold(f64::INFINITY, f64::min)
    }
}

/// Which pixels are used.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::detect) struct Window {
    /// Reach along the edges as a share of the square's side.
    pub reach: f64,
    /// Largest radius, px.
    pub radius_px: f64,
    /// Pixels further from both edges than this share of the side, less `keep_off_px`, are left out: something is printed there.
    pub arm: f64,
    /// Distance to keep from what is printed there, px.
    pub keep_off_px: f64,
}

/// How the edges of a picture look.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Look {
    /// Usual blur of an edge, px: start of the fit.
    pub blur_px: f64,
    /// Whether the edges have a halo, which the model then has too.
    pub halo: bool,
}

/// A fitted corner.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Saddle {
    pub uv: [f64; 2],
    /// Half the step between the squares, counts; positive where the square towards -side 1 and +side 2 is the lighter.
    pub contrast: f64,
    /// Root mean square of the residuals, counts.
    pub noise: f64,
    /// Mean of the two blurs, px.
    pub blur_px: f64,
    /// Share of the step that the halo adds and takes.
    pub halo: f64,
    /// What each pixel of the window says.
    pub terms: Vec<Term>,
}

impl Saddle {
    /// Blur of a Gaussian edge as steep in its middle, px.
    pub fn steepness_px(&self) -> f64 {
        self.blur_px / (1.0 + self.halo * (1.0 - 1.0 / HALO_BLUR)).max(0.1)
    }
}

/// One pixel's share in a corner.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Term {
    /// Column and row of the pixel.
    pub at: [i32; 2],
    /// Counts.
    pub residual: f64,
    /// Derivative of the corner by the value of the pixel, px per count.
    pub influence: [f64; 2],
}

/// Fits the model around a seed.
pub(super) fn refine(picture: &Picture, seed: &Seed, window: Window, look: Look) -> Result<Saddle, Refusal> {
    let pixels = pixels(picture, seed, window)?;
    let full_scale = f64::from(picture.full_scale);
    let mut problem = Problem { pixels: &pixels, look, noise: 0.0, contrast: 0.0, full_scale };
    let guess = start(seed, &pixels, look);
    problem.noise = START_NOISE * guess[STEP].abs();
    problem.contrast = guess[STEP];
    let rough = problem.minimise(&guess, ROUGH_TOLERANCE_PX)?;
    problem.noise = rough.variance(pixels.len()).sqrt();
    problem.contrast = rough.state[STEP];
    problem.finish(seed, &problem.minimise(&rough.state, STEP_TOLERANCE_PX)?)
}

/// Least squares over the pixels of one corner.
struct Problem<'a> {
    pixels: &'a [Pixel],
    look: Look,
    /// Of a pixel, and half the step between the squares, counts: they weigh the priors.
    noise: f64,
    contrast: f64,
    full_scale: f64,
}

/// The minimum, with the normal matrix there.
struct Minimum {
    state: Vector,
    normal: Matrix,
    cost: f64,
}

impl Minimum {
    /// Of the residuals, counts^2.
    fn variance(&self, pixels: usize) -> f64 {
        self.cost / (pixels - PARAMETERS) as f64
    }
}

impl Problem<'_> {
    /// Levenberg-Marquardt; the end is reached where the next step would be below the tolerance, as far as the last two tell.
    fn minimise(&self, start: &Vector, tolerance_px: f64) -> Result<Minimum, Refusal> {
        let mut state = *start;
        let (mut normal, mut right, mut cost) = self.accumulate(&state);
        let mut damping = 1e-3;
        // Length of the step before.
        let mut last = 0.0;
        for _ in 0..MAX_STEPS {
            let step = solve(&normal, &right, damping).ok_or(Refusal::NoCrossing)?;
            let trial = state + step;
            let (trial_normal, trial_right, trial_cost) = self.accumulate(&trial);
            let length = step[0].hypot(step[1]);
            let accepted = trial_cost <= cost;
            if accepted {
                (state, normal, right, cost) = (trial, trial_normal, trial_right, trial_cost);
                damping = f64::max(damping * 0.1, 1e-9);
            } else {
                damping *= 10.0;
            }
            let next = if last > 0.0 { length * f64::min(length / last, 1.0) } else { length };
            if length < tolerance_px || (accepted && next < tolerance_px) || damping > 1e9 {
                return Ok(Minimum { state, normal, cost });
            }
            last = length;
        }
        Err(Refusal::NotConverged)
    }

    /// Weights and centres of the parameters that are known beforehand.
    fn priors(&self) -> [(usize, f64, f64); 8] {
        let weight = |sigma: f64| (self.noise / sigma).powi(2);
        let slope = weight(SLOPE_PER_PX * self.contrast);
        let (blur, ln_blur) = (weight(LN_BLUR_SIGMA), self.look.blur_px.ln());
        [
            (LN_BLUR[0], blur, ln_blur),
            (LN_BLUR[1], blur, ln_blur),
            (GROWTH, weight(GROWTH_SIGMA), 0.0),
            (HALO, weight(HALO_SIGMA), 0.0),
            (LEVEL_SLOPE[0], slope, 0.0),
            (LEVEL_SLOPE[1], slope, 0.0),
            (STEP_SLOPE[0], slope, 0.0),
            (STEP_SLOPE[1], slope, 0.0),
        ]
    }

    fn accumulate(&self, state: &Vector) -> (Matrix, Vector, f64) {
        let mut normal = Matrix::zeros();
        let mut right = Vector::zeros();
        let mut cost = 0.0;
        let edges = Edges::new(state, self.look.halo);
        for pixel in self.pixels {
            let predicted = edges.predict(pixel);
            let residual = pixel.value - predicted.value.min(self.full_scale);
            cost += residual * residual;
            if predicted.value >= self.full_scale {
                continue;
            }
            let g = &predicted.gradient;
            for j in 0..PARAMETERS {
                right[j] += g[j] * residual;
                for i in j..PARAMETERS {
                    normal[(i, j)] += g[i] * g[j];
                }
            }
        }
        for (i, weight, centre) in self.priors() {
            let off = state[i] - centre;
            normal[(i, i)] += weight;
            right[i] -= weight * off;
            cost += weight * off * off;
        }
        normal.fill_upper_triangle_with_lower_triangle();
        (normal, right, cost)
    }

    fn finish(&self, seed: &Seed, minimum: &Minimum) -> Result<Saddle, Refusal> {
        let Minimum { state, normal, .. } = minimum;
        let blurs = LN_BLUR.map(|i| state[i].exp());
        let crossing = (state[THETA[0]] - state[THETA[1]]).sin().abs();
        let in_range = |s: &f64| (BLUR_RANGE_PX.0..=BLUR_RANGE_PX.1).contains(s);
        if !blurs.iter().all(in_range) || crossing < LEAST_CROSSING {
            return Err(Refusal::NoCrossing);
        }
        if state[0].hypot(state[1]) > OFF_LATTICE * seed.side_px() {
            return Err(Refusal::OffTheLattice);
        }
        Ok(Saddle {
            uv: [seed.uv[0] + state[0], seed.uv[1] + state[1]],
            contrast: state[STEP],
            noise: minimum.variance(self.pixels.len()).sqrt(),
            blur_px: 0.5 * (blurs[0] + blurs[1]),
            halo: state[HALO],
            terms: self.terms(seed, state, normal).ok_or(Refusal::NoCrossing)?,
        })
    }

    /// What each pixel adds to the corner, after the other parameters have been eliminated.
    fn terms(&self, seed: &Seed, state: &Vector, normal: &Matrix) -> Option<Vec<Term>> {
        let inverse = normal.cholesky()?.inverse();
        let edges = Edges::new(state, self.look.halo);
        let place = |pixel: &Pixel| [(seed.uv[0] + pixel.x).round() as i32, (seed.uv[1] + pixel.y).round() as i32];
        let term = |pixel: &Pixel| {
            let predicted = edges.predict(pixel);
            let clipped = predicted.value >= self.full_scale;
            let influence = [0, 1].map(|i| if clipped { 0.0 } else { inverse.column(i).dot(&predicted.gradient) });
            Term { at: place(pixel), residual: pixel.value - predicted.value.min(self.full_scale), influence }
        };
        Some(self.pixels.iter().map(term).collect())
    }
}

fn pixels(picture: &Picture, seed: &Seed, window: Window) -> Result<Vec<Pixel>, Refusal> {
    let [[ax, ay], [bx, by]] = seed.sides;
    let area = ax * by - ay * bx;
    if area.abs() < LEAST_CROSSING * ax.hypot(ay) * bx.hypot(by) {
        return Err(Refusal::Oblique);
    }
    let [cx, cy] = seed.uv;
    let (last_x, last_y) = (picture.width as f64 - 1.0, picture.height as f64 - 1.0);
    if cx.min(cy).min(last_x - cx).min(last_y - cy) < LEAST_MARGIN_PX {
        return Err(Refusal::AtTheEdge);
    }
    let low = |c: f64| (c - window.radius_px).ceil().max(0.0);
    let high = |c: f64, last: f64| (c + window.radius_px).floor().min(last);
    let (x1, y1) = (high(cx, last_x), high(cy, last_y));
    // Distance from the edges per unit of the coordinates p and q.
    let (from_b, from_a) = (area.abs() / bx.hypot(by), area.abs() / ax.hypot(ay));
    let mut found = Vec::new();
    let mut y = low(cy);
    while y <= y1 {
        let mut x = low(cx);
        while x <= x1 {
            let (dx, dy) = (x - cx, y - cy);
            let (p, q) = ((dx * by - dy * bx) / area, (dy * ax - dx * ay) / area);
            let near = dx * dx + dy * dy <= window.radius_px * window.radius_px;
            let on_arm = (p.abs() - window.arm) * from_b <= -window.keep_off_px
                || (q.abs() - window.arm) * from_a <= -window.keep_off_px;
            if near && on_arm && p.abs() <= window.reach && q.abs() <= window.reach {
                found.push(Pixel { x: dx, y: dy, value: f64::from(picture.at(x as usize, y as usize)) });
            }
            x += 1.0;
        }
        y += 1.0;
    }
    if found.len() < 2 * PARAMETERS { Err(Refusal::TooFewPixels) } else { Ok(found) }
}

/// Starting values from the seed; the sign of the contrast from the pixels.
fn start(seed: &Seed, pixels: &[Pixel], look: Look) -> Vector {
    let [s1, s2] = seed.sides;
    let mut state = Vector::zeros();
    state[THETA[0]] = s1[1].atan2(s1[0]);
    state[THETA[1]] = s2[1].atan2(s2[0]);
    LN_BLUR.iter().for_each(|&i| state[i] = look.blur_px.ln());
    state[LEVEL] = pixels.iter().map(|p| p.value).sum::<f64>() / pixels.len() as f64;
    let signed: f64 = pixels
        .iter()
        .map(|pixel| {
            let side = |theta: f64| pixel.y * theta.cos() - pixel.x * theta.sin();
            (side(state[THETA[0]]) * side(state[THETA[1]])).signum() * (pixel.value - state[LEVEL])
        })
        .sum();
    state[STEP] = signed / pixels.len() as f64;
    state
}

fn solve(normal: &Matrix, right: &Vector, damping: f64) -> Option<Vector> {
    let mut damped = *normal;
    for i in 0..PARAMETERS {
        damped[(i, i)] *= 1.0 + damping;
    }
    let step = damped.cholesky()?.solve(right);
    step.iter().all(|x| x.is_finite()).then_some(step)
}
