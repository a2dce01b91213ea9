//! Steps from the start of a fit to its end.
//!
//! Gauss-Newton steps are quick where the start is near. Edges that are no Gaussian (a camera that stores gamma) put the contours of a thin ring
//! so far from those of the start that they overshoot: such a fit is begun by damped steps, of which each lessens the cost.

use super::model::Pixels;
use super::normal::{Normal, cholesky, solve};
use super::prior::Prior;
use super::squares::Squares;
use super::start::{Descent, Start};
use super::state::{ANNULUS, DARK, INNER, LN_BLUR, LN_RATIO, LONGEST_LN_RATIO, SHAPE, State, THIRD, WHITE};
use crate::detect::circles::types::Reason;

const ITERATIONS: usize = 14;
/// Damped steps at most, how often what the closed form misses is taken, and the damping after the first step that is refused and beyond which none is tried.
const DAMPED_STEPS: usize = 40;
const CORRECTIONS: usize = 3;
const FIRST_DAMPING: f64 = 1e-3;
const MOST_DAMPING: f64 = 1e6;
/// Whole steps go on from where a damped one takes less off the cost, in squares of the noise, and moves contours by less, px.
const LITTLE_GAIN: f64 = 0.1;
const LITTLE_PX: f64 = 0.1;

/// Gauss-Newton steps until the centre rests; returns the factor of the last normal matrix.
pub(super) fn iterate(state: &mut State, prior: &Prior, start: &Start, pixels: &mut Pixels) -> Result<Normal, Reason> {
    let parameters = state.parameters();
    let mut travelled = match start.descent {
        Descent::Whole => [0.0; ANNULUS],
        Descent::Damped => approach(state, prior, start, pixels),
    };
    let mut factor: Normal = [[0.0; ANNULUS]; ANNULUS];
    let mut last = f64::MAX;
    // how far the contours have moved since the normal matrix and since the correction, px
    let (mut since_factor, mut since_correction) = (f64::MAX, f64::MAX);
    let size = start.ellipse.semi_axes()[0];
    // a predicted contour is near the end from the beginning
    let near = if start.shape_sigma.is_some() { f64::MAX } else { 0.1 };
    for _ in 0..ITERATIONS {
        // What the closed form misses moves with the contour: taken near the end, and again when that moved on.
        let stale = if state.is_badly_resolved() { 0.01 } else { 0.05 };
        if last <= near && since_correction > stale {
            if pixels.correct(state) {
                since_factor = f64::MAX;
            }
            since_correction = 0.0;
        }
        pixels.evaluate(state, start.noise);
        if since_factor > 0.1 {
            pixels.normal(parameters, &mut factor);
            pixels.flat.add_normal(state, start.noise, &mut factor);
            prior.add_normal(&mut factor);
            cholesky(&mut factor, parameters).ok_or(Reason::NoConvergence)?;
            since_factor = 0.0;
        }
        let mut delta = [0.0; ANNULUS];
        pixels.gradient(parameters, &mut delta);
        pixels.flat.add_gradient(state, start.noise, &mut delta);
        prior.add_gradient(&travelled, &mut delta);
        solve(&factor, parameters, &mut delta);
        let damp = limit(&delta, size, start);
        delta.iter_mut().for_each(|d| *d *= damp);
        // no more than the state takes: what is travelled counts against what is known
        delta[LN_RATIO] = delta[LN_RATIO].clamp(-LONGEST_LN_RATIO, LONGEST_LN_RATIO);
        state.step(&delta);
        (0..parameters).for_each(|i| travelled[i] += delta[i]);
        last = magnitude(&delta, state, size);
        if !last.is_finite() || out_of_bounds(state, &travelled, size) {
            return Err(Reason::NoConvergence);
        }
        since_factor += last;
        since_correction += last;
        if last < 1e-3 && since_correction < 0.1 {
            return Ok(factor);
        }
    }
    if last < 5e-3 { Ok(factor) } else { Err(Reason::NoConvergence) }
}

/// A state with what was travelled to it and the cost there, in squares of the noise.
struct Point {
    state: State,
    travelled: [f64; ANNULUS],
    cost: f64,
}

impl Point {
    /// Leaves the pixels evaluated at the state.
    fn at(state: State, travelled: [f64; ANNULUS], prior: &Prior, noise: [f64; 2], pixels: &mut Pixels) -> Self {
        pixels.evaluate(&state, noise);
        let even = pixels.flat.squares(&state);
        let cost = Squares::of(pixels).weighted + even[0] / noise[0] + even[1] / noise[1] + prior.squares(&travelled);
        Self { state, travelled, cost }
    }

    fn moved(&self, delta: &[f64; ANNULUS], prior: &Prior, noise: [f64; 2], pixels: &mut Pixels) -> Self {
        let mut state = self.state;
        state.step(delta);
        let travelled = std::array::from_fn(|i| self.travelled[i] + delta[i]);
        Self::at(state, travelled, prior, noise, pixels)
    }

    /// Normal matrix and right side of pixels that are evaluated here.
    fn equations(&self, prior: &Prior, noise: [f64; 2], pixels: &Pixels) -> (Normal, [f64; ANNULUS]) {
        let parameters = self.state.parameters();
        let (mut normal, mut right) = ([[0.0; ANNULUS]; ANNULUS], [0.0; ANNULUS]);
        pixels.normal(parameters, &mut normal);
        pixels.flat.add_normal(&self.state, noise, &mut normal);
        prior.add_normal(&mut normal);
        pixels.gradient(parameters, &mut right);
        pixels.flat.add_gradient(&self.state, noise, &mut right);
        prior.add_gradient(&self.travelled, &mut right);
        (normal, right)
    }
}

/// Damped steps (Levenberg and Marquardt) to near the least cost; what was travelled.
///
/// Paper and ink have one noise here: weights that depend on the state lead to another place than that of the least cost. What the closed form
/// misses moves the levels of a thin ring far: it is taken after the first steps, and again after those that follow.
fn approach(state: &mut State, prior: &Prior, start: &Start, pixels: &mut Pixels) -> [f64; ANNULUS] {
    let noise = [0.5 * (start.noise[0] + start.noise[1]); 2];
    let mut point = Point::at(*state, [0.0; ANNULUS], prior, noise, pixels);
    for _ in 0..CORRECTIONS {
        point = descend(point, prior, (start, noise), pixels);
        if !pixels.correct(&point.state) {
            break;
        }
        point = Point::at(point.state, point.travelled, prior, noise, pixels);
    }
    *state = point.state;
    point.travelled
}

/// From a point at which the pixels are evaluated.
fn descend(from: Point, prior: &Prior, (start, noise): (&Start, [f64; 2]), pixels: &mut Pixels) -> Point {
    let (parameters, size) = (from.state.parameters(), start.ellipse.semi_axes()[0]);
    let (mut point, mut damping) = (from, 0.0);
    for _ in 0..DAMPED_STEPS {
        let equations = point.equations(prior, noise, pixels);
        let mut taken = None;
        while taken.is_none() && damping <= MOST_DAMPING {
            let delta = damped(&equations, parameters, damping, |delta| limit(delta, size, start));
            let trial = delta.map(|delta| (point.moved(&delta, prior, noise, pixels), delta));
            let is_better =
                |(to, _): &(Point, _)| to.cost <= point.cost && !out_of_bounds(&to.state, &to.travelled, size);
            taken = trial.filter(is_better);
            damping = if taken.is_some() { 0.1 * damping } else { f64::max(10.0 * damping, FIRST_DAMPING) };
        }
        let Some((next, delta)) = taken else { break };
        let gain = point.cost - next.cost;
        point = next;
        if gain < LITTLE_GAIN && magnitude(&delta, &point.state, size) < LITTLE_PX {
            break;
        }
    }
    point
}

/// The step of damped equations, shortened to what a state takes as a whole; `None` where they have no solution.
fn damped(
    (normal, right): &(Normal, [f64; ANNULUS]),
    parameters: usize,
    damping: f64,
    limit: impl Fn(&[f64; ANNULUS]) -> f64,
) -> Option<[f64; ANNULUS]> {
    let (mut factor, mut delta) = (*normal, *right);
    (0..parameters).for_each(|i| factor[i][i] *= 1.0 + damping);
    cholesky(&mut factor, parameters)?;
    solve(&factor, parameters, &mut delta);
    let share = limit(&delta).min(LONGEST_LN_RATIO / delta[LN_RATIO].abs().max(LONGEST_LN_RATIO));
    delta.iter_mut().for_each(|d| *d *= share);
    Some(delta)
}

/// Shortens a step that leaves the range where the model is nearly linear.
fn limit(delta: &[f64; ANNULUS], size: f64, start: &Start) -> f64 {
    let contrast = (start.paper - start.ink).abs().max(1e-6);
    let centre = delta[0].hypot(delta[1]) / (0.5 * start.blur_px + 0.05 * size);
    let shape = delta[SHAPE..SHAPE + 3].iter().fold(0.0f64, |m, v| m.max(v.abs())) / 0.15;
    let blur = delta[LN_BLUR].abs() / 0.4;
    let level = delta[WHITE].abs().max(delta[DARK].abs()) / contrast;
    1.0 / centre.max(shape).max(blur).max(level).max(1.0)
}

/// Size of a step as a displacement of the contours, px.
fn magnitude(delta: &[f64; ANNULUS], state: &State, size: f64) -> f64 {
    let shape = delta[SHAPE..THIRD + 2].iter().map(|v| v.abs()).sum::<f64>() * 0.1 * size;
    let inner = if state.inner.is_some() { delta[INNER].abs() + delta[INNER + 1].abs() } else { 0.0 };
    delta[0].abs() + delta[1].abs() + inner + shape.min(1.0) + 0.02 * delta[LN_BLUR].abs()
}

fn out_of_bounds(state: &State, travelled: &[f64; ANNULUS], size: f64) -> bool {
    let far = travelled[0].hypot(travelled[1]) > 1.0 + 0.25 * size;
    let inner = state.inner.is_some_and(|(c, k)| {
        !(0.1..0.95).contains(&k) || (c[0] - state.centre[0]).hypot(c[1] - state.centre[1]) > 0.5 + 0.25 * size
    });
    far || inner || !(0.2..8.0).contains(&state.blur)
}
