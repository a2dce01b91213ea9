//! Sub-pixel position of the crossing of four squares: least squares over the pixels around it.

use super::model::{
    Block, Edges, GROWTH, HALO, HALO_BLUR, LANES, LEVEL, LEVEL_SLOPE, LN_BLUR, Matrix, PARAMETERS, Prediction, STEP,
    STEP_SLOPE, THETA, Vector,
};
use super::refusal::Refusal;
use super::smooth::Source;
use super::sums::{RunningSums, Sum};
use crate::detect::shared::GLARE_SLOPE;
use crate::linalg::wide;

const MAX_STEPS: usize = 30;
/// Before the noise is known.
const ROUGH: Descent = Descent { tolerance_px: 1e-2, damping: 1e-3, least_share: 1.0, rest: f64::MAX };
/// A step below the tolerance moves no corner visibly. Slopes of the light and place of the corner are alike in a small window: damping would
/// slow both down.
const FINE: Descent = Descent { tolerance_px: 1e-4, damping: 1e-8, least_share: 0.1, rest: 1e-5 };
/// A greater share of a step is as good as the whole.
const NEARLY_WHOLE: f64 = 0.8;
/// Noise of the pixels over half the step of an edge, as long as it is not known.
const START_NOISE: f64 = 0.03;
/// Prior sigma of the slope of the light, share of the contrast per px.
const SLOPE_PER_PX: f64 = 0.0003;
/// A slope this many times further from its prior than it and the noise explain may be that of glare ...
const STRAINED: f64 = 4.0;
/// ... if it is steeper than this share of the contrast per px: print and rough edges of real boards look like 0.0094 and less.
const LEAST_GLARE: f64 = 0.01;
/// Prior sigma of the growth of the dark squares, in blurs.
const GROWTH_SIGMA: f64 = 0.3;
/// Prior sigma of the halo, share of the step.
const HALO_SIGMA: f64 = 0.3;
/// Prior sigma of the logarithm of a blur about that of the picture: only a blur that the pixels leave open feels it.
const LN_BLUR_SIGMA: f64 = 1.0;
/// Blurs outside are no edges of a usable picture, px.
const BLUR_RANGE_PX: (f64, f64) = (0.2, 12.0);
/// What a halo of 1 adds to the slope of an edge, over that slope.
const STEEPENING: f64 = 1.0 - 1.0 / HALO_BLUR;
/// A corner further from its seed than this share of the square's side is another structure.
const OFF_LATTICE: f64 = 0.2;
/// A corner nearer to the edge of the picture is not fitted, px.
pub(super) const LEAST_MARGIN_PX: f64 = 4.0;
/// Least reach along the edges of small squares, px, as long as it is below this share of their side.
const LEAST_REACH_PX: f64 = 3.3;
const MOST_REACH: f64 = 0.55;
/// Least sine of the angle between the two edges.
const LEAST_CROSSING: f64 = 0.1;

/// How a minimum is sought.
#[derive(Debug, Clone, Copy)]
struct Descent {
    /// Length of a step of the corner, px.
    tolerance_px: f64,
    /// Damping to begin with.
    damping: f64,
    /// No smaller share of a step is taken.
    least_share: f64,
    /// What a step may still take off the mean square of the residuals over the contrast: amid symmetric pixels a corner rests at once.
    rest: f64,
}

/// How a bent edge runs through a corner.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Bend {
    /// 1 / px, positive where the edge bends from the one axis towards the other. Perspective bends no edge.
    pub curvature: f64,
    /// Image of a square's side along the edge, px.
    pub side: [f64; 2],
}

/// A corner as the lattice predicts it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Seed {
    pub uv: [f64; 2],
    /// Image of one square's side along each of the two edges, px.
    pub sides: [[f64; 2]; 2],
    /// How the two edges run, where a lens may bend them.
    pub bends: [Option<Bend>; 2],
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
    /// Pixels nearer to the middle of an edge than this share of the side, and `keep_off_px`, are left out, too; 0 where no dot is there.
    pub dot: f64,
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
    /// The fit, for what its pixels say.
    problem: Problem,
    end: Point,
    seed_uv: [f64; 2],
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

/// Fits the model around a seed: roughly to the nearer pixels, then to all.
pub(super) fn refine(source: &Source, seed: &Seed, window: Window, look: Look) -> Result<Saddle, Refusal> {
    let pixels = Pixels::within(source, seed, window)?;
    let guess = start(seed, &pixels, look);
    let contrast = guess[STEP];
    let (noise, full_scale) = (START_NOISE * contrast.abs(), source.full_scale());
    let curvature = seed.bends.map(|bend| bend.map_or(0.0, |bend| bend.curvature));
    let mut problem = Problem { pixels, curvature, look, noise, contrast, full_scale, level_slope: SLOPE_PER_PX };
    let near = problem.pixels.near;
    let rough = problem.minimise(problem.at(&guess, near), near, ROUGH)?;
    problem.noise = problem.noise_of(rough.sum.squares, &rough, near);
    problem.contrast = rough.state[STEP];
    let all = problem.pixels.all;
    let start = if near.blocks == all.blocks { rough } else { problem.at(&rough.state, all) };
    let usual = problem.minimise(start, all, FINE)?;
    let end = problem.lit(usual)?;
    problem.finish(seed, end)
}

/// The pixels of a window, the nearer ones first.
struct Pixels {
    blocks: Vec<Block>,
    near: Part,
    all: Part,
}

/// The first blocks.
#[derive(Debug, Clone, Copy)]
struct Part {
    blocks: usize,
    pixels: usize,
}

impl Pixels {
    fn of(near: &[[f64; 3]], far: &[[f64; 3]]) -> Self {
        let block = |chunk: &[[f64; 3]]| {
            let mut block = Block::EMPTY;
            for (lane, [x, y, value]) in chunk.iter().enumerate() {
                (block.x[lane], block.y[lane], block.value[lane], block.weight[lane]) = (*x, *y, *value, 1.0);
            }
            block
        };
        let mut blocks: Vec<Block> = near.chunks(LANES).map(block).collect();
        let first = Part { blocks: blocks.len(), pixels: near.len() };
        blocks.extend(far.chunks(LANES).map(block));
        let all = Part { blocks: blocks.len(), pixels: near.len() + far.len() };
        Self { blocks, near: if first.pixels < 4 * PARAMETERS { all } else { first }, all }
    }

    /// Offsets and values.
    fn iter(&self) -> impl Iterator<Item = [f64; 3]> {
        let pixels = |b: &Block| {
            let Block { x, y, value, weight } = *b;
            (0..LANES).filter(move |&lane| weight[lane] > 0.0).map(move |lane| [x[lane], y[lane], value[lane]])
        };
        self.blocks.iter().flat_map(pixels)
    }
}

/// Least squares over the pixels of one corner.
struct Problem {
    pixels: Pixels,
    curvature: [f64; 2],
    look: Look,
    /// Of a pixel, and half the step between the squares, counts: they weigh the priors.
    noise: f64,
    contrast: f64,
    full_scale: f64,
    /// Prior sigma of the slope of the level, share of the contrast per px.
    level_slope: f64,
}

/// A state with the sums there.
#[derive(Clone, Copy)]
struct Point {
    state: Vector,
    sum: Sum,
}

impl Problem {
    /// Levenberg-Marquardt; the end is reached where the next step would be below the tolerance, as far as the last two tell.
    fn minimise(&self, start: Point, part: Part, descent: Descent) -> Result<Point, Refusal> {
        let mut point = start;
        let mut damping = descent.damping;
        // Length of the step before, and which share of a step is taken.
        let (mut last, mut share) = (0.0, 1.0);
        for _ in 0..MAX_STEPS {
            let (normal, right, cost) = self.with_priors(&point);
            let whole = solve(&normal, &right, damping).ok_or(Refusal::NoCrossing)?;
            let step = whole * share;
            let trial = self.at(&(point.state + step), part);
            let length = whole[0].hypot(whole[1]);
            let change = self.cost(&trial) - cost;
            let accepted = change <= 0.0;
            share = shortened(share, 2.0 * right.dot(&step), change).max(descent.least_share);
            if accepted {
                point = trial;
                damping = f64::max(damping * 0.1, 1e-9);
            } else {
                damping *= 10.0;
            }
            let rests = right.dot(&whole) <= descent.rest * self.contrast.powi(2) * part.pixels as f64;
            let next = if last > 0.0 { length * f64::min(length / last, 1.0) } else { length };
            let close = length < descent.tolerance_px || (accepted && next < descent.tolerance_px);
            if (close && rests) || damping > 1e9 {
                return Ok(point);
            }
            last = length;
        }
        Err(Refusal::NotConverged)
    }

    /// The minimum where glare, which adds the same light to dark and light squares, is allowed for, if there is any. In a smoothed picture,
    /// whose noise is correlated, nothing tells it from noise.
    fn lit(&mut self, usual: Point) -> Result<Point, Refusal> {
        if self.full_scale.is_infinite() || self.strain(&usual) <= STRAINED {
            return Ok(usual);
        }
        let (all, noise, mut lit) = (self.pixels.all, self.noise, usual);
        self.level_slope = GLARE_SLOPE;
        // Light that the usual fit lacks is no noise, the second time.
        for _ in 0..2 {
            self.noise = self.noise_of(lit.sum.squares, &lit, all);
            lit = self.minimise(lit, all, FINE)?;
        }
        let [x, y] = LEVEL_SLOPE.map(|i| lit.state[i]);
        if x.hypot(y) > LEAST_GLARE * lit.state[STEP].abs() {
            return Ok(lit);
        }
        (self.level_slope, self.noise) = (SLOPE_PER_PX, noise);
        Ok(usual)
    }

    /// How far the slope of the level is from its prior, in sigmas of what prior and noise together let expect: with the variance `p` of the
    /// prior and `q` after the fit, a slope is `(1 - q / p)` of what the pixels say, whose variance is then `p / (1 - q / p)`.
    fn strain(&self, point: &Point) -> f64 {
        let Some(factor) = self.with_priors(point).0.cholesky() else { return 0.0 };
        let sigma = self.level_slope * self.contrast.abs();
        let of = |i: usize| {
            let variance = factor.solve(&unit(i))[i];
            let open = 1.0 - variance * (self.noise / sigma).powi(2);
            point.state[i].abs() / (sigma * open.max(f64::EPSILON).sqrt())
        };
        LEVEL_SLOPE.map(of).into_iter().fold(0.0, f64::max)
    }

    /// Weights and centres of the parameters that are known beforehand.
    fn priors(&self) -> [(usize, f64, f64); 8] {
        let weight = |sigma: f64| (self.noise / sigma).powi(2);
        let [level_slope, slope] = [self.level_slope, SLOPE_PER_PX].map(|share| weight(share * self.contrast));
        let (blur, ln_blur) = (weight(LN_BLUR_SIGMA), self.look.blur_px.ln());
        [
            (LN_BLUR[0], blur, ln_blur),
            (LN_BLUR[1], blur, ln_blur),
            (GROWTH, weight(GROWTH_SIGMA), 0.0),
            (HALO, weight(HALO_SIGMA), 0.0),
            (LEVEL_SLOPE[0], level_slope, 0.0),
            (LEVEL_SLOPE[1], level_slope, 0.0),
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

    /// Noise of a pixel whose squares leave this sum at a minimum, counts. With the normal matrix `N` of the pixels and `W` of the priors the
    /// fit takes `tr((N + W)^-1 N)` of them, not one a parameter: priors hold most slopes.
    fn noise_of(&self, squares: f64, point: &Point, part: Part) -> f64 {
        let (normal, _, _) = self.with_priors(point);
        let held = normal.cholesky().map_or(0.0, |factor| {
            let variance =
                |i: usize| factor.l_dirty().solve_lower_triangular(&unit(i)).map_or(0.0, |x| x.norm_squared());
            self.priors().iter().map(|&(i, weight, _)| weight * variance(i)).sum()
        });
        let taken = PARAMETERS as f64 - held;
        (squares / (part.pixels as f64 - taken)).sqrt()
    }

    fn at(&self, state: &Vector, part: Part) -> Point {
        let mut sums = RunningSums::ZERO;
        let edges = Edges::new(state, self.curvature, self.look.halo);
        let mut predicted = Prediction::NONE;
        wide(
            #[inline(always)]
            || {
                for block in &self.pixels.blocks[..part.blocks] {
                    edges.predict(block, &mut predicted);
                    sums.add(block, &predicted, self.full_scale);
                }
            },
        );
        Point { state: *state, sum: sums.total() }
    }

    fn finish(self, seed: &Seed, end: Point) -> Result<Saddle, Refusal> {
        let state = &end.state;
        let blurs = LN_BLUR.map(|i| state[i].exp());
        let crossing = (state[THETA[0]] - state[THETA[1]]).sin().abs();
        // Where the halo is negative, most of an edge has the blur of the halo.
        let in_range = |s: &f64| (BLUR_RANGE_PX.0..=BLUR_RANGE_PX.1).contains(&(s / steepening(state[HALO]).min(1.0)));
        if !blurs.iter().all(in_range) || crossing < LEAST_CROSSING {
            return Err(Refusal::NoCrossing);
        }
        if state[0].hypot(state[1]) > OFF_LATTICE * seed.side_px() {
            return Err(Refusal::OffTheLattice);
        }
        Ok(Saddle {
            uv: [seed.uv[0] + state[0], seed.uv[1] + state[1]],
            contrast: state[STEP],
            noise: self.noise_of(self.cost(&end), &end, self.pixels.all),
            blur_px: 0.5 * (blurs[0] + blurs[1]),
            halo: state[HALO],
            problem: self,
            end,
            seed_uv: seed.uv,
        })
    }

    /// Calls `pixel` for every pixel with its block and lane and the prediction of the block.
    fn for_pixels(&self, state: &Vector, mut pixel: impl FnMut(&Block, usize, &Prediction)) {
        let edges = Edges::new(state, self.curvature, self.look.halo);
        let mut predicted = Prediction::NONE;
        for block in &self.pixels.blocks {
            wide(
                #[inline(always)]
                || edges.predict(block, &mut predicted),
            );
            for lane in (0..LANES).filter(|&lane| block.weight[lane] > 0.0) {
                // A clipped pixel depends on nothing.
                if predicted.value[lane] >= self.full_scale {
                    predicted.value[lane] = self.full_scale;
                    predicted.gradient.iter_mut().for_each(|g| g[lane] = 0.0);
                }
                pixel(block, lane, &predicted);
            }
        }
    }
}

impl Saddle {
    /// Blur of a Gaussian edge as steep in its middle, px, with its sigma.
    pub fn steepness_px(&self) -> [f64; 2] {
        let steepness = self.blur_px / steepening(self.halo);
        let Some(factor) = self.problem.with_priors(&self.end).0.cholesky() else { return [steepness, f64::INFINITY] };
        let mut gradient = Vector::zeros();
        LN_BLUR.iter().for_each(|&i| gradient[i] = 0.5 * self.end.state[i].exp() / self.blur_px);
        gradient[HALO] = -STEEPENING / steepening(self.halo);
        let relative = (gradient.dot(&factor.solve(&gradient))).sqrt() * self.noise;
        [steepness, steepness * relative]
    }

    /// Pixels of its window.
    pub fn pixels(&self) -> usize {
        self.problem.pixels.all.pixels
    }

    /// Largest share of either dark square's pixels that reach a level.
    pub fn dark_share_from(&self, level: f64) -> f64 {
        if self.problem.pixels.iter().all(|[_, _, value]| value < level) {
            return 0.0;
        }
        let state = &self.end.state;
        let tangents = THETA.map(|i| [state[i].cos(), state[i].sin()]);
        let (mut reached, mut all) = ([0.0; 2], [1.0_f64; 2]);
        for [px, py, value] in self.problem.pixels.iter() {
            let [side1, side2] = tangents.map(|[c, s]| (py - state[1]) * c - (px - state[0]) * s);
            if side1 * side2 * state[STEP] < 0.0 {
                let square = usize::from(side1 > 0.0);
                all[square] += 1.0;
                reached[square] += f64::from(u8::from(value >= level));
            }
        }
        f64::max(reached[0] / all[0], reached[1] / all[1])
    }

    /// uu, uv and vv of the corner for pixels of variance 1 that are not correlated.
    pub fn white_covariance(&self) -> Option<[f64; 3]> {
        let factor = self.problem.with_priors(&self.end).0.cholesky()?;
        let normal = &self.end.sum.normal;
        let of_pixels = Matrix::from_fn(|i, j| normal[i.max(j)][i.min(j)]);
        let [u, v] = [0, 1].map(|axis| factor.solve(&unit(axis)));
        Some([u.dot(&(of_pixels * u)), u.dot(&(of_pixels * v)), v.dot(&(of_pixels * v))])
    }

    /// What each pixel adds to the corner, after the other parameters have been eliminated; none for a normal matrix without inverse.
    pub fn terms(&self) -> Vec<Term> {
        let Some(factor) = self.problem.with_priors(&self.end).0.cholesky() else { return Vec::new() };
        let columns = [0, 1].map(|axis| factor.solve(&unit(axis)));
        let mut terms = Vec::with_capacity(self.problem.pixels.all.pixels);
        self.problem.for_pixels(&self.end.state, |block, lane, predicted| {
            terms.push(Term {
                at: [self.seed_uv[0] + block.x[lane], self.seed_uv[1] + block.y[lane]].map(|c| c.round() as i32),
                residual: block.value[lane] - predicted.value[lane],
                influence: columns.map(|column| predicted.gradient.iter().zip(&column).map(|(g, c)| g[lane] * c).sum()),
            });
        });
        terms
    }

    /// A vector for each of the terms: the product of two is the derivative of the fitted value at one pixel by the value at the other.
    pub fn leverages(&self) -> Vec<Vector> {
        let Some(factor) = self.problem.with_priors(&self.end).0.cholesky() else { return Vec::new() };
        let lower = factor.l();
        let mut leverages = Vec::with_capacity(self.problem.pixels.all.pixels);
        self.problem.for_pixels(&self.end.state, |_, lane, predicted| {
            leverages.push(lower.solve_lower_triangular(&predicted.gradient_at(lane)).unwrap_or_else(Vector::zeros));
        });
        leverages
    }
}

impl Pixels {
    fn within(source: &Source, seed: &Seed, window: Window) -> Result<Self, Refusal> {
        let [[ax, ay], [bx, by]] = seed.sides;
        let area = ax * by - ay * bx;
        if area.abs() < LEAST_CROSSING * ax.hypot(ay) * bx.hypot(by) {
            return Err(Refusal::Oblique);
        }
        let [cx, cy] = seed.uv;
        let (last_x, last_y) = (source.picture().width as f64 - 1.0, source.picture().height as f64 - 1.0);
        if cx.min(cy).min(last_x - cx).min(last_y - cy) < LEAST_MARGIN_PX {
            return Err(Refusal::AtTheEdge);
        }
        // Distance from the edges per unit of the coordinates p and q.
        let (from_b, from_a) = (area.abs() / bx.hypot(by), area.abs() / ax.hypot(ay));
        let near_px = (0.5 * window.radius_px).powi(2);
        let reach = window.reach.max((LEAST_REACH_PX / seed.side_px()).min(MOST_REACH));
        let off = window.dot + window.keep_off_px / seed.side_px();
        let free =
            |p: f64, q: f64| window.dot == 0.0 || ((p.abs() - 0.5).hypot(q) >= off && p.hypot(q.abs() - 0.5) >= off);
        // All that may be within reach along the edges.
        let extent = |a: f64, b: f64| (reach * (a.abs() + b.abs()) + 1.0).min(window.radius_px);
        let range = |c: f64, extent: f64, last: f64| {
            (c - extent).ceil().max(0.0) as usize..=(c + extent).floor().min(last) as usize
        };
        let (columns, rows) = (range(cx, extent(ax, bx), last_x), range(cy, extent(ay, by), last_y));
        let patch = source.patch(columns.clone(), rows.clone());
        let (mut nearer, mut farther) = (Vec::new(), Vec::new());
        for (x, y) in rows.flat_map(|y| columns.clone().map(move |x| (x, y))) {
            let (dx, dy) = (x as f64 - cx, y as f64 - cy);
            let (p, q) = ((dx * by - dy * bx) / area, (dy * ax - dx * ay) / area);
            let near = dx * dx + dy * dy <= window.radius_px * window.radius_px;
            let on_arm = (p.abs() - window.arm) * from_b <= -window.keep_off_px
                || (q.abs() - window.arm) * from_a <= -window.keep_off_px;
            if near && on_arm && free(p, q) && p.abs() <= reach && q.abs() <= reach {
                let pixel = [dx, dy, f64::from(patch.at(x, y))];
                if dx * dx + dy * dy <= near_px { nearer.push(pixel) } else { farther.push(pixel) }
            }
        }
        let count = nearer.len() + farther.len();
        if count < 2 * PARAMETERS { Err(Refusal::TooFewPixels) } else { Ok(Self::of(&nearer, &farther)) }
    }
}

/// Starting values from the seed; the sign of the contrast from the pixels.
fn start(seed: &Seed, pixels: &Pixels, look: Look) -> Vector {
    let [s1, s2] = seed.sides;
    let mut state = Vector::zeros();
    state[THETA[0]] = s1[1].atan2(s1[0]);
    state[THETA[1]] = s2[1].atan2(s2[0]);
    LN_BLUR.iter().for_each(|&i| state[i] = look.blur_px.ln());
    state[LEVEL] = pixels.iter().map(|[_, _, value]| value).sum::<f64>() / pixels.all.pixels as f64;
    let tangents = THETA.map(|i| [state[i].cos(), state[i].sin()]);
    let signed: f64 = pixels
        .iter()
        .map(|[x, y, value]| {
            let [side1, side2] = tangents.map(|[c, s]| y * c - x * s);
            (side1 * side2).signum() * (value - state[LEVEL])
        })
        .sum();
    state[STEP] = signed / pixels.all.pixels as f64;
    state
}

/// The share of a step at which the parabola through the cost and its slope before a step and the cost after it is least; `share` of it was
/// taken. Where residuals and model are curved (edges that are no Gaussian), whole steps overshoot by nearly their own length, time and again.
fn shortened(share: f64, descent: f64, change: f64) -> f64 {
    let curvature = change + descent;
    let least = if curvature > 0.0 { 0.5 * share * descent / curvature } else { 1.0 };
    if least > NEARLY_WHOLE { 1.0 } else { least }
}

/// Slope of an edge in its middle over that without halo.
fn steepening(halo: f64) -> f64 {
    (1.0 + STEEPENING * halo).max(0.1)
}

/// 1 at one parameter, 0 at the others.
fn unit(parameter: usize) -> Vector {
    Vector::from_fn(|k, _| if k == parameter { 1.0 } else { 0.0 })
}

fn solve(normal: &Matrix, right: &Vector, damping: f64) -> Option<Vector> {
    let mut damped = *normal;
    for i in 0..PARAMETERS {
        damped[(i, i)] *= 1.0 + damping;
    }
    let step = damped.cholesky()?.solve(right);
    step.iter().all(|x| x.is_finite()).then_some(step)
}
