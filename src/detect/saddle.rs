//! Sub-pixel position of the crossing of four squares.
//!
//! Model of the picture near a corner at c, with d the offset of a pixel from it:
//!
//! ```text
//! I = min(full scale, b + b_x d_x + b_y d_y + (a + a_x d_x + a_y d_y) erf(w1) erf(w2))
//! w1 = u1 + k erf(u2),  w2 = u2 + k erf(u1),  u_i = n_i . d / (sqrt(2) s_i)
//! ```
//!
//! Two blurred edges with normals n_i and blurs s_i cross at c; the linear terms carry uneven light, k the growth of the
//! dark squares in print (each edge steps sideways at the crossing), and the clipping leaves over-exposed squares out
//! of the fit. All parameters are fitted to the pixels in full depth; the covariance is that of c after the others
//! have been eliminated, at the noise that the residuals show.

use nalgebra::{SMatrix, SVector};

use super::Picture;

/// Parameters: c_x, c_y, theta_1, theta_2, ln s_1, ln s_2, k, b, b_x, b_y, a, a_x, a_y.
const PARAMETERS: usize = 13;
type Vector = SVector<f64, PARAMETERS>;
type Matrix = SMatrix<f64, PARAMETERS, PARAMETERS>;

const MAX_STEPS: usize = 25;
/// A step below this moves no corner visibly, px.
const STEP_TOLERANCE_PX: f64 = 1e-4;
/// Noise of the pixels over half the step of an edge, as long as it is not known.
const START_NOISE: f64 = 0.03;
/// Prior sigma of the slope of the light, share of the contrast per px.
const SLOPE_PER_PX: f64 = 0.0003;
/// Prior sigma of the growth of the dark squares, in blurs.
const GROWTH: f64 = 0.3;
/// Blur of the starting value, px.
const START_BLUR_PX: f64 = 1.2;
/// Blurs outside are no edges of a usable picture, px.
const BLUR_RANGE_PX: (f64, f64) = (0.2, 12.0);
/// A corner further from its seed than this share of the square's side is another structure.
const OFF_LATTICE: f64 = 0.2;
/// What print, lens and blur of other shapes leave beyond the noise, px per axis; seen on real boards after their
/// printing errors are taken out.
const SYSTEMATIC_PX: f64 = 0.015;
/// A corner nearer to the edge of the picture is not fitted, px.
const LEAST_MARGIN_PX: f64 = 4.0;
/// Least sine of the angle between the two edges.
const LEAST_CROSSING: f64 = 0.1;

/// A corner as the lattice predicts it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Seed {
    pub uv: [f64; 2],
    /// Image of one square's side along each of the two edges, px.
    pub sides: [[f64; 2]; 2],
}

/// A fitted corner.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Saddle {
    pub uv: [f64; 2],
    /// uu, uv, vv in px^2.
    pub covariance: [f64; 3],
    /// Half the step between the squares, counts; positive where the square towards -side 1 and +side 2 is the lighter.
    pub contrast: f64,
    /// Root mean square of the residuals, counts.
    pub noise: f64,
}

/// Which pixels are used.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Window {
    /// Reach along the edges as a share of the square's side.
    pub reach: f64,
    /// Largest radius, px.
    pub radius_px: f64,
    /// Pixels further from both edges than this share of the side, less `keep_off_px`, are left out: something is printed there.
    pub arm: f64,
    /// Distance to keep from what is printed there, px.
    pub keep_off_px: f64,
}

struct Pixel {
    x: f64,
    y: f64,
    value: f64,
}

/// Value of the model and its derivatives at one pixel.
struct Prediction {
    value: f64,
    gradient: Vector,
}

/// Fits the model around a seed; the reason where that is not possible.
pub(super) fn refine(picture: &Picture, seed: &Seed, window: Window) -> Result<Saddle, &'static str> {
    let pixels = pixels(picture, seed, window)?;
    let guess = start(seed, &pixels);
    let first =
        Problem { pixels: &pixels, prior: prior(START_NOISE * guess[10], guess[10]), full_scale: picture.full_scale };
    let rough = first.minimise(&guess)?;
    let second = Problem { prior: prior(rough.variance(pixels.len()).sqrt(), rough.state[10]), ..first };
    finish(seed, &second.minimise(&rough.state)?, pixels.len())
}

/// Least squares over the pixels of one corner.
struct Problem<'a> {
    pixels: &'a [Pixel],
    prior: [(usize, f64); 5],
    full_scale: f32,
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
    /// Levenberg-Marquardt.
    fn minimise(&self, start: &Vector) -> Result<Minimum, &'static str> {
        let mut state = *start;
        let (mut normal, mut right, mut cost) = accumulate(self, &state);
        let mut damping = 1e-3;
        for _ in 0..MAX_STEPS {
            let Some(step) = solve(&normal, &right, damping) else { return Err(NO_FIT) };
            let trial = state + step;
            let (trial_normal, trial_right, trial_cost) = accumulate(self, &trial);
            if trial_cost <= cost {
                (state, normal, right, cost) = (trial, trial_normal, trial_right, trial_cost);
                damping = f64::max(damping * 0.1, 1e-9);
            } else {
                damping *= 10.0;
            }
            if step[0].hypot(step[1]) < STEP_TOLERANCE_PX || damping > 1e9 {
                return Ok(Minimum { state, normal, cost });
            }
        }
        Err(NO_FIT)
    }
}

const NO_FIT: &str = "no crossing of two edges";

fn pixels(picture: &Picture, seed: &Seed, window: Window) -> Result<Vec<Pixel>, &'static str> {
    let [[ax, ay], [bx, by]] = seed.sides;
    let area = ax * by - ay * bx;
    if area.abs() < LEAST_CROSSING * ax.hypot(ay) * bx.hypot(by) {
        return Err("seen too obliquely");
    }
    let [cx, cy] = seed.uv;
    let (last_x, last_y) = (picture.width as f64 - 1.0, picture.height as f64 - 1.0);
    if cx.min(cy).min(last_x - cx).min(last_y - cy) < LEAST_MARGIN_PX {
        return Err("at the edge of the picture");
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
    if found.len() < 2 * PARAMETERS { Err("too few pixels") } else { Ok(found) }
}

/// Starting values from the seed; the sign of the contrast from the pixels.
fn start(seed: &Seed, pixels: &[Pixel]) -> Vector {
    let [s1, s2] = seed.sides;
    let mut state = Vector::zeros();
    state[2] = s1[1].atan2(s1[0]);
    state[3] = s2[1].atan2(s2[0]);
    state[4] = START_BLUR_PX.ln();
    state[5] = START_BLUR_PX.ln();
    state[7] = pixels.iter().map(|p| p.value).sum::<f64>() / pixels.len() as f64;
    let signed: f64 = pixels
        .iter()
        .map(|pixel| {
            let side = |theta: f64| pixel.y * theta.cos() - pixel.x * theta.sin();
            (side(state[2]) * side(state[3])).signum() * (pixel.value - state[7])
        })
        .sum();
    state[10] = signed / pixels.len() as f64;
    state
}

/// Weights of the parameters that are zero in an ideal picture, at a noise and a contrast in counts.
fn prior(noise: f64, contrast: f64) -> [(usize, f64); 5] {
    let growth = (noise / GROWTH).powi(2);
    let slope = (noise / (SLOPE_PER_PX * contrast)).powi(2);
    [(6, growth), (8, slope), (9, slope), (11, slope), (12, slope)]
}

fn accumulate(problem: &Problem, state: &Vector) -> (Matrix, Vector, f64) {
    let full_scale = f64::from(problem.full_scale);
    let mut normal = Matrix::zeros();
    let mut right = Vector::zeros();
    let mut cost = 0.0;
    let edges = Edges::new(state);
    for pixel in problem.pixels {
        let predicted = edges.predict(state, pixel);
        let clipped = predicted.value >= full_scale;
        let residual = pixel.value - predicted.value.min(full_scale);
        cost += residual * residual;
        if clipped {
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
    for (i, weight) in &problem.prior {
        normal[(*i, *i)] += weight;
        right[*i] -= weight * state[*i];
        cost += weight * state[*i] * state[*i];
    }
    normal.fill_upper_triangle_with_lower_triangle();
    (normal, right, cost)
}

fn solve(normal: &Matrix, right: &Vector, damping: f64) -> Option<Vector> {
    let mut damped = *normal;
    for i in 0..PARAMETERS {
        damped[(i, i)] *= 1.0 + damping;
    }
    let step = damped.cholesky()?.solve(right);
    step.iter().all(|x| x.is_finite()).then_some(step)
}

fn finish(seed: &Seed, minimum: &Minimum, pixels: usize) -> Result<Saddle, &'static str> {
    let Minimum { state, normal, .. } = minimum;
    let blurs = [state[4].exp(), state[5].exp()];
    let crossing = (state[2] - state[3]).sin().abs();
    let in_range = |s: &f64| (BLUR_RANGE_PX.0..=BLUR_RANGE_PX.1).contains(s);
    if !blurs.iter().all(in_range) || crossing < LEAST_CROSSING {
        return Err(NO_FIT);
    }
    let side = seed.sides.iter().map(|s| s[0].hypot(s[1])).fold(f64::INFINITY, f64::min);
    if state[0].hypot(state[1]) > OFF_LATTICE * side {
        return Err("off the lattice");
    }
    let inverse = normal.cholesky().ok_or(NO_FIT)?.inverse();
    let variance = minimum.variance(pixels);
    let floor = SYSTEMATIC_PX * SYSTEMATIC_PX;
    Ok(Saddle {
        uv: [seed.uv[0] + state[0], seed.uv[1] + state[1]],
        covariance: [
            variance * inverse[(0, 0)] + floor,
            variance * inverse[(0, 1)],
            variance * inverse[(1, 1)] + floor,
        ],
        contrast: state[10],
        noise: variance.sqrt(),
    })
}

/// What the pixels of one evaluation share.
struct Edges {
    tangents: [[f64; 2]; 2],
    /// 1 / (sqrt(2) s)
    sharpness: [f64; 2],
}

impl Edges {
    fn new(state: &Vector) -> Self {
        Self {
            tangents: [state[2], state[3]].map(|t| [t.cos(), t.sin()]),
            sharpness: [state[4], state[5]].map(|s| (-s).exp() * std::f64::consts::FRAC_1_SQRT_2),
        }
    }

    fn predict(&self, state: &Vector, pixel: &Pixel) -> Prediction {
        let (x, y) = (pixel.x - state[0], pixel.y - state[1]);
        let along = self.tangents.map(|t| t[0] * x + t[1] * y);
        let across = self.tangents.map(|t| t[0] * y - t[1] * x);
        let u = [across[0] * self.sharpness[0], across[1] * self.sharpness[1]];
        let [(e1, g1), (e2, g2)] = u.map(erf_with_slope);
        let k = state[6];
        let [(f1, h1), (f2, h2)] = [u[0] + k * e2, u[1] + k * e1].map(erf_with_slope);
        let product = f1 * f2;
        // Derivatives of the product by u1, u2 and k.
        let by_u1 = h1 * f2 + f1 * h2 * k * g1;
        let by_u2 = f1 * h2 + h1 * f2 * k * g2;
        let by_k = h1 * e2 * f2 + f1 * h2 * e1;
        let amplitude = state[10] + state[11] * pixel.x + state[12] * pixel.y;
        let (d1, d2) = (amplitude * by_u1, amplitude * by_u2);
        let mut gradient = Vector::zeros();
        gradient[0] = d1 * self.sharpness[0] * self.tangents[0][1] + d2 * self.sharpness[1] * self.tangents[1][1];
        gradient[1] = -d1 * self.sharpness[0] * self.tangents[0][0] - d2 * self.sharpness[1] * self.tangents[1][0];
        gradient[2] = -d1 * self.sharpness[0] * along[0];
        gradient[3] = -d2 * self.sharpness[1] * along[1];
        gradient[4] = -d1 * u[0];
        gradient[5] = -d2 * u[1];
        gradient[6] = amplitude * by_k;
        gradient[7] = 1.0;
        gradient[8] = pixel.x;
        gradient[9] = pixel.y;
        gradient[10] = product;
        gradient[11] = product * pixel.x;
        gradient[12] = product * pixel.y;
        let value = state[7] + state[8] * pixel.x + state[9] * pixel.y + amplitude * product;
        Prediction { value, gradient }
    }
}

/// erf and its derivative; Abramowitz and Stegun 7.1.26, absolute error below 1.5e-7.
fn erf_with_slope(u: f64) -> (f64, f64) {
    const C: [f64; 5] = [0.254829592, -0.284496736, 1.421413741, -1.453152027, 1.061405429];
    let gauss = (-u * u).exp();
    let t = 1.0 / (1.0 + 0.3275911 * u.abs());
    let tail = t * (C[0] + t * (C[1] + t * (C[2] + t * (C[3] + t * C[4])))) * gauss;
    ((1.0 - tail).copysign(u), std::f64::consts::FRAC_2_SQRT_PI * gauss)
}
