//! Sub-pixel measurement of one marker: least squares of the blurred-edge model on a thin band of pixels.

use super::edge_model::{ANNULUS, DARK, DISC, INNER, LN_BLUR, LN_RATIO, Pixels, SHAPE, State, THIRD, WHITE};
use super::ellipse::Ellipse;
use super::types::{Imaged, Measured, Reason};
use crate::detect::Picture;
use crate::series::Edge;

/// Where to start and what to assume.
#[derive(Debug, Clone, Copy)]
pub(super) struct Start {
    pub ellipse: Ellipse,
    /// Inner over outer radius of an annulus.
    pub ratio: Option<f64>,
    pub paper: f64,
    pub ink: f64,
    pub blur_px: f64,
    /// Prior sigma of ln blur.
    pub blur_sigma: f64,
    /// Prior sigma of the relative shape, where the ellipse is a prediction.
    pub shape_sigma: Option<f64>,
    /// Relative radius that stays clear of other markers.
    pub clear: f64,
    /// Variance of a pixel on paper and on ink, counts^2.
    pub noise: [f64; 2],
}

/// A fit with what the caller needs to go on.
#[derive(Debug, Clone, Copy)]
pub(super) struct Fit {
    pub measured: Measured,
    /// Cross-covariance of outer and inner centre per axis, px^2.
    pub cross: [f64; 2],
    /// Mean square of the residuals on paper and on ink, away from the edge, with their pixel counts.
    pub plain: [(f64, f64); 2],
}

const ITERATIONS: usize = 14;
/// A pixel at this part of the range or above counts as saturated.
const SATURATED: f32 = 0.995;

/// Measures one marker. The work arrays `pixels` are reused from call to call.
pub(super) fn refine(picture: &Picture, start: &Start, pixels: &mut Pixels) -> Result<Fit, Reason> {
    let anchor = start.ellipse.centre.map(f64::round);
    let (wanted, saturated) = gather(picture, start, anchor, pixels);
    let parameters = if start.ratio.is_some() { ANNULUS } else { DISC };
    if saturated * 5 > wanted {
        return Err(Reason::Saturated);
    }
    let visible = pixels.count as f64 / wanted.max(1) as f64;
    if pixels.count < 2 * parameters || (visible < 0.98 && start.shape_sigma.is_none()) || visible < 0.35 {
        return Err(Reason::CutByBorder);
    }
    let mut state = initial(start, anchor);
    let prior = Prior::of(start, picture);
    let normal = iterate(&mut state, &prior, start, pixels)?;
    finish(&state, start, anchor, visible, pixels, &normal)
}

fn initial(start: &Start, anchor: [f64; 2]) -> State {
    let centre = [0, 1].map(|a| start.ellipse.centre[a] - anchor[a]);
    State {
        centre,
        to_unit: start.ellipse.normaliser(),
        third: [0.0; 2],
        blur: start.blur_px,
        white: [start.paper, 0.0, 0.0],
        dark: [start.ink, 0.0, 0.0],
        inner: start.ratio.map(|r| (centre, r)),
    }
}

/// Weights of what is known beforehand, and the parameters accumulated since the start.
struct Prior {
    weight: [f64; ANNULUS],
}

impl Prior {
    fn of(start: &Start, picture: &Picture) -> Self {
        let mut weight = [0.0; ANNULUS];
        let inverse = |sigma: f64| 1.0 / (sigma * sigma);
        // The third harmonic of a distorted or foreshortened circle grows with its radius: half a radius per picture
        // width is that of a strongly distorted wide-angle lens.
        let third = 0.5 * start.ellipse.semi_axes()[0] / picture.width.max(picture.height) as f64;
        let contrast = (start.paper - start.ink).abs().max(1.0);
        weight[THIRD..THIRD + 2].fill(inverse(third.max(1e-4)));
        weight[LN_BLUR] = inverse(start.blur_sigma);
        // a black offset changes the ink's share of the gradient by a part of it
        weight[DARK + 1..DARK + 3].fill(inverse(1e-3 * contrast));
        weight[LN_RATIO] = inverse(0.1);
        if let Some(sigma) = start.shape_sigma {
            weight[SHAPE..SHAPE + 3].fill(inverse(sigma));
        }
        Self { weight }
    }
}

type Normal = [[f64; ANNULUS]; ANNULUS];

/// Gauss-Newton steps until the centre rests; returns the factor of the last normal matrix.
fn iterate(state: &mut State, prior: &Prior, start: &Start, pixels: &mut Pixels) -> Result<Normal, Reason> {
    let parameters = state.parameters();
    let mut travelled = [0.0; ANNULUS];
    let mut factor: Normal = [[0.0; ANNULUS]; ANNULUS];
    let mut fresh = 0usize;
    let mut last = f64::MAX;
    let size = start.ellipse.semi_axes()[0];
    for iteration in 0..ITERATIONS {
        pixels.evaluate(state, start.noise);
        // A new normal matrix at the start, whenever the steps do not shrink well, and once near the end.
        let renew = iteration == 0 || last > 0.02 || (fresh < 2 && last < 0.02);
        if renew {
            pixels.normal(parameters, &mut factor);
            (0..parameters).for_each(|i| factor[i][i] += prior.weight[i]);
            cholesky(&mut factor, parameters).ok_or(Reason::NoConvergence)?;
            fresh = if last < 0.02 { 2 } else { 1 };
        }
        let mut delta = [0.0; ANNULUS];
        pixels.gradient(parameters, &mut delta);
        (0..parameters).for_each(|i| delta[i] -= prior.weight[i] * travelled[i]);
        solve(&factor, parameters, &mut delta);
        let damp = limit(&delta, size, start);
        delta.iter_mut().for_each(|d| *d *= damp);
        state.step(&delta);
        (0..parameters).for_each(|i| travelled[i] += delta[i]);
        last = magnitude(&delta, state, size);
        if !last.is_finite() || out_of_bounds(state, &travelled, size) {
            return Err(Reason::NoConvergence);
        }
        if last < 2e-4 && fresh == 2 {
            return Ok(factor);
        }
    }
    if last < 5e-3 { Ok(factor) } else { Err(Reason::NoConvergence) }
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

fn finish(
    state: &State,
    start: &Start,
    anchor: [f64; 2],
    visible: f64,
    pixels: &Pixels,
    factor: &Normal,
) -> Result<Fit, Reason> {
    let parameters = state.parameters();
    let n = pixels.count;
    let square = |i: usize| f64::from(pixels.residual[i]).powi(2);
    let weighted = |i: usize| {
        let d = f64::from(pixels.ink[i]);
        square(i) / (start.noise[0] + (start.noise[1] - start.noise[0]) * d)
    };
    let rms = ((0..n).map(square).sum::<f64>() / n as f64).sqrt();
    let freedom = (n - parameters) as f64;
    let scale = (0..n).map(weighted).sum::<f64>() / freedom;
    let contrast = state.white[0] - state.dark[0];
    let expected = start.noise[0].max(start.noise[1]);
    if contrast <= 0.0 || rms * rms > 6.0 * expected + (0.03 * contrast).powi(2) {
        return Err(Reason::EdgeModel);
    }
    let mut plain = [(0.0, 0.0); 2];
    for i in 0..n {
        let side = if pixels.ink[i] < 0.02 { 0 } else { usize::from(pixels.ink[i] > 0.98) };
        if side == 1 || pixels.ink[i] < 0.02 {
            plain[side].0 += square(i);
            plain[side].1 += 1.0;
        }
    }
    let covariance = Covariance::of(factor, parameters, scale);
    let place = |e: Ellipse| Ellipse { centre: [0, 1].map(|a| e.centre[a] + anchor[a]), ..e };
    let outer = Imaged { edge: Edge::Outer, ellipse: place(state.ellipse()), covariance: covariance.block(0) };
    let inner =
        state.inner_ellipse().map(|e| Imaged { edge: Edge::Inner, ellipse: place(e), covariance: covariance.block(2) });
    let measured = Measured {
        outer,
        inner,
        blur_px: state.blur,
        paper: state.white[0],
        ink: state.dark[0],
        rms,
        gradient: [state.white[1] / state.white[0], state.white[2] / state.white[0]],
        visible,
    };
    Ok(Fit { measured, cross: covariance.cross(), plain })
}

/// Covariance of the two centres.
struct Covariance {
    columns: [[f64; 4]; 4],
}

impl Covariance {
    fn of(factor: &Normal, parameters: usize, scale: f64) -> Self {
        let rows = [0, 1, INNER, INNER + 1];
        let used = if parameters == ANNULUS { 4 } else { 2 };
        let mut columns = [[0.0; 4]; 4];
        for k in 0..used {
            let mut unit = [0.0; ANNULUS];
            unit[rows[k]] = 1.0;
            solve(factor, parameters, &mut unit);
            for l in 0..used {
                columns[k][l] = unit[rows[l]] * scale;
            }
        }
        Self { columns }
    }

    fn block(&self, at: usize) -> [f64; 3] {
        [self.columns[at][at], self.columns[at][at + 1], self.columns[at + 1][at + 1]]
    }

    fn cross(&self) -> [f64; 2] {
        [self.columns[0][2], self.columns[1][3]]
    }
}

/// Collects the pixels of the band; returns how many there would be in an unlimited picture, and how many of the
/// missing ones are saturated.
fn gather(picture: &Picture, start: &Start, anchor: [f64; 2], pixels: &mut Pixels) -> (usize, usize) {
    pixels.clear();
    let reach = 2.6 * start.blur_px + 0.8;
    let minor = start.ellipse.semi_axes()[1];
    let outside = reach.min((start.clear - 1.0) * minor).max(0.9);
    let (mut wanted, mut saturated) = (0, 0);
    let outer = start.ellipse.offset(outside);
    let [inside, core, core_inside] = match start.ratio {
        None => [start.ellipse.offset(-reach), None, None],
        Some(ratio) => {
            let inner = Ellipse { shape: start.ellipse.shape.map(|v| v / (ratio * ratio)), ..start.ellipse };
            let gap = start.ellipse.offset(-reach);
            let core = inner.offset(reach);
            let apart = match (&gap, &core) {
                (Some(g), Some(c)) => g.semi_axes()[1] > c.semi_axes()[1],
                _ => false,
            };
            if apart { [gap, core, inner.offset(-reach)] } else { [inner.offset(-reach), None, None] }
        }
    };
    let Some(outer) = outer else { return (0, 0) };
    let half = outer.half_extent();
    let limit = SATURATED * picture.full_scale;
    let centre = start.ellipse.centre;
    let rows = (centre[1] - half[1]).ceil() as i64..=(centre[1] + half[1]).floor() as i64;
    for y in rows {
        let Some((first, last)) = outer.chord(y as f64) else { continue };
        let hole = inside.as_ref().and_then(|e| e.chord(y as f64));
        let plug = core.as_ref().and_then(|e| e.chord(y as f64));
        let void = core_inside.as_ref().and_then(|e| e.chord(y as f64));
        let within = |x: f64, span: Option<(f64, f64)>| span.is_some_and(|(a, b)| x >= a && x <= b);
        for x in first.ceil() as i64..=last.floor() as i64 {
            let xf = x as f64;
            if within(xf, hole) && (!within(xf, plug) || within(xf, void)) {
                continue;
            }
            wanted += 1;
            if x < 0 || y < 0 || x as usize >= picture.width || y as usize >= picture.height {
                continue;
            }
            let value = picture.at(x as usize, y as usize);
            if value >= limit {
                saturated += 1;
                continue;
            }
            pixels.push((xf - anchor[0]) as f32, (y as f64 - anchor[1]) as f32, value);
        }
    }
    pixels.finish();
    (wanted, saturated)
}

/// Cholesky factor in place (lower triangle).
fn cholesky(m: &mut Normal, n: usize) -> Option<()> {
    for j in 0..n {
        let (pivots, below) = m[j..].split_first_mut()?;
        let dot = |a: &[f64; ANNULUS], b: &[f64; ANNULUS]| a[..j].iter().zip(&b[..j]).map(|(x, y)| x * y).sum::<f64>();
        let pivot = pivots[j] - dot(pivots, pivots);
        if pivot.is_nan() || pivot <= 1e-12 * pivots[j].abs() {
            return None;
        }
        let root = pivot.sqrt();
        pivots[j] = root;
        for row in below.iter_mut().take(n - j - 1) {
            row[j] = (row[j] - dot(row, pivots)) / root;
        }
    }
    Some(())
}

/// Solves in place with a factor of [`cholesky`].
fn solve(l: &Normal, n: usize, b: &mut [f64; ANNULUS]) {
    for i in 0..n {
        let known: f64 = l[i][..i].iter().zip(b.iter()).map(|(x, y)| x * y).sum();
        b[i] = (b[i] - known) / l[i][i];
    }
    for i in (0..n).rev() {
        let known: f64 = (i + 1..n).map(|k| l[k][i] * b[k]).sum();
        b[i] = (b[i] - known) / l[i][i];
    }
}
