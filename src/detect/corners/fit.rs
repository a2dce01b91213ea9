//! Sub-pixel position of the crossing of four squares: least squares over the pixels around it.

use super::model::{
    Block, Edges, GROWTH, HALO, HALO_BLUR, LANES, LEVEL, LEVEL_SLOPE, LN_BLUR, Matrix, PARAMETERS, Prediction, STEP,
    STEP_SLOPE, THETA, Vector,
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
pub(super) const LEAST_MARGIN_PX: f64 = 4.0;
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
    /// Its product with that of another pixel is the derivative of the fitted value there by the value here.
    pub leverage: [f64; PARAMETERS],
}

/// Fits the model around a seed.
pub(super) fn refine(picture: &Picture, seed: &Seed, window: Window, look: Look) -> Result<Saddle, Refusal> {
    let pixels = Pixels::within(picture, seed, window)?;
    let full_scale = f64::from(picture.full_scale);
    let guess = start(seed, &pixels, look);
    let contrast = guess[STEP];
    let mut problem = Problem { pixels: &pixels, look, noise: START_NOISE * contrast.abs(), contrast, full_scale };
    let rough = problem.minimise(problem.at(&guess), ROUGH_TOLERANCE_PX)?;
    problem.noise = (rough.sum.squares / pixels.degrees_of_freedom()).sqrt();
    problem.contrast = rough.state[STEP];
    problem.finish(seed, &problem.minimise(rough, STEP_TOLERANCE_PX)?)
}

/// The pixels of a window.
struct Pixels {
    blocks: Vec<Block>,
    count: usize,
}

impl Pixels {
    fn of(list: &[[f64; 3]]) -> Self {
        let block = |chunk: &[[f64; 3]]| {
            let mut block = Block::EMPTY;
            for (lane, [x, y, value]) in chunk.iter().enumerate() {
                (block.x[lane], block.y[lane], block.value[lane], block.weight[lane]) = (*x, *y, *value, 1.0);
            }
            block
        };
        Self { blocks: list.chunks(LANES).map(block).collect(), count: list.len() }
    }

    fn degrees_of_freedom(&self) -> f64 {
        (self.count - PARAMETERS) as f64
    }

    /// Offsets and values.
    fn iter(&self) -> impl Iterator<Item = [f64; 3]> {
        let all = self.blocks.iter().flat_map(|b| (0..LANES).map(|lane| [b.x[lane], b.y[lane], b.value[lane]]));
        all.take(self.count)
    }
}

/// Least squares over the pixels of one corner.
struct Problem<'a> {
    pixels: &'a Pixels,
    look: Look,
    /// Of a pixel, and half the step between the squares, counts: they weigh the priors.
    noise: f64,
    contrast: f64,
    full_scale: f64,
}

/// Sums over the pixels at a state: normal matrix (lower triangle), right side, squares of the residuals.
#[derive(Clone, Copy)]
struct Sum {
    normal: [[f64; PARAMETERS]; PARAMETERS],
    right: [f64; PARAMETERS],
    squares: f64,
}

/// A state with the sums there.
#[derive(Clone, Copy)]
struct Point {
    state: Vector,
    sum: Sum,
}

impl Problem<'_> {
    /// Levenberg-Marquardt; the end is reached where the next step would be below the tolerance, as far as the last two tell.
    fn minimise(&self, start: Point, tolerance_px: f64) -> Result<Point, Refusal> {
        let mut point = start;
        let mut damping = 1e-3;
        // Length of the step before.
        let mut last = 0.0;
        for _ in 0..MAX_STEPS {
            let (normal, right, cost) = self.with_priors(&point);
            let step = solve(&normal, &right, damping).ok_or(Refusal::NoCrossing)?;
            let trial = self.at(&(point.state + step));
            let length = step[0].hypot(step[1]);
            let accepted = self.cost(&trial) <= cost;
            if accepted {
                point = trial;
                damping = f64::max(damping * 0.1, 1e-9);
            } else {
                damping *= 10.0;
            }
            let next = if last > 0.0 { length * f64::min(length / last, 1.0) } else { length };
            if length < tolerance_px || (accepted && next < tolerance_px) || damping > 1e9 {
                return Ok(point);
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

    fn cost(&self, point: &Point) -> f64 {
        let off = |(i, weight, centre): (usize, f64, f64)| weight * (point.state[i] - centre).powi(2);
        point.sum.squares + self.priors().into_iter().map(off).sum::<f64>()
    }

    /// Normal matrix, right side and cost of pixels and priors.
    fn with_priors(&self, point: &Point) -> (Matrix, Vector, f64) {
        let mut normal = Matrix::from_fn(|i, j| point.sum.normal[i.max(j)][i.min(j)]);
        let mut right = Vector::from(point.sum.right);
        for (i, weight, centre) in self.priors() {
            normal[(i, i)] += weight;
            right[i] -= weight * (point.state[i] - centre);
        }
        (normal, right, self.cost(point))
    }

    fn at(&self, state: &Vector) -> Point {
        let mut sum = Sum { normal: [[0.0; PARAMETERS]; PARAMETERS], right: [0.0; PARAMETERS], squares: 0.0 };
        let edges = Edges::new(state, self.look.halo);
        let mut predicted = Prediction::NONE;
        for block in &self.pixels.blocks {
            edges.predict(block, &mut predicted);
            sum.add(block, &predicted, self.full_scale);
        }
        Point { state: *state, sum }
    }

    fn finish(&self, seed: &Seed, point: &Point) -> Result<Saddle, Refusal> {
        let state = &point.state;
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
            noise: (self.cost(point) / self.pixels.degrees_of_freedom()).sqrt(),
            blur_px: 0.5 * (blurs[0] + blurs[1]),
            halo: state[HALO],
            terms: self.terms(seed, point).ok_or(Refusal::NoCrossing)?,
        })
    }

    /// What each pixel adds to the corner, after the other parameters have been eliminated.
    fn terms(&self, seed: &Seed, point: &Point) -> Option<Vec<Term>> {
        let factor = self.with_priors(point).0.cholesky()?;
        let (inverse, lower) = (factor.inverse(), factor.l());
        let edges = Edges::new(&point.state, self.look.halo);
        let mut predicted = Prediction::NONE;
        let mut terms = Vec::with_capacity(self.pixels.count);
        for block in &self.pixels.blocks {
            edges.predict(block, &mut predicted);
            for lane in (0..LANES).filter(|&lane| block.weight[lane] > 0.0) {
                let clipped = predicted.value[lane] >= self.full_scale;
                let gradient = if clipped { Vector::zeros() } else { predicted.gradient_at(lane) };
                terms.push(Term {
                    at: [seed.uv[0] + block.x[lane], seed.uv[1] + block.y[lane]].map(|c| c.round() as i32),
                    residual: block.value[lane] - predicted.value[lane].min(self.full_scale),
                    influence: [0, 1].map(|i| inverse.column(i).dot(&gradient)),
                    leverage: lower.solve_lower_triangular(&gradient)?.into(),
                });
            }
        }
        Some(terms)
    }
}

impl Sum {
    fn add(&mut self, block: &Block, predicted: &Prediction, full_scale: f64) {
        let (mut residual, mut open) = ([0.0; LANES], [0.0; LANES]);
        for lane in 0..LANES {
            let value = predicted.value[lane];
            let clipped = value >= full_scale;
            residual[lane] = block.weight[lane] * (block.value[lane] - if clipped { full_scale } else { value });
            open[lane] = if clipped { 0.0 } else { block.weight[lane] };
        }
        self.squares += dot(&residual, &residual);
        for i in 0..PARAMETERS {
            let mut row = predicted.gradient[i];
            row.iter_mut().zip(&open).for_each(|(g, open)| *g *= open);
            self.right[i] += dot(&row, &residual);
            for j in 0..=i {
                self.normal[i][j] += dot(&row, &predicted.gradient[j]);
            }
        }
    }
}

/// With sums in a fixed order, two lanes beside each other.
#[inline(always)]
fn dot(a: &[f64; LANES], b: &[f64; LANES]) -> f64 {
    let mut sums = [0.0; 4];
    for k in 0..LANES / 4 {
        for lane in 0..4 {
            sums[lane] += a[4 * k + lane] * b[4 * k + lane];
        }
    }
    (sums[0] + sums[2]) + (sums[1] + sums[3])
}

impl Pixels {
    fn within(picture: &Picture, seed: &Seed, window: Window) -> Result<Self, Refusal> {
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
                    found.push([dx, dy, f64::from(picture.at(x as usize, y as usize))]);
                }
                x += 1.0;
            }
            y += 1.0;
        }
        if found.len() < 2 * PARAMETERS { Err(Refusal::TooFewPixels) } else { Ok(Self::of(&found)) }
    }
}

/// Starting values from the seed; the sign of the contrast from the pixels.
fn start(seed: &Seed, pixels: &Pixels, look: Look) -> Vector {
    let [s1, s2] = seed.sides;
    let mut state = Vector::zeros();
    state[THETA[0]] = s1[1].atan2(s1[0]);
    state[THETA[1]] = s2[1].atan2(s2[0]);
    LN_BLUR.iter().for_each(|&i| state[i] = look.blur_px.ln());
    state[LEVEL] = pixels.iter().map(|[_, _, value]| value).sum::<f64>() / pixels.count as f64;
    let tangents = THETA.map(|i| [state[i].cos(), state[i].sin()]);
    let signed: f64 = pixels
        .iter()
        .map(|[x, y, value]| {
            let [side1, side2] = tangents.map(|[c, s]| y * c - x * s);
            (side1 * side2).signum() * (value - state[LEVEL])
        })
        .sum();
    state[STEP] = signed / pixels.count as f64;
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
