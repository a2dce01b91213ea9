//! Sub-pixel measurement of one marker: least squares of the blurred-edge model on a thin band of pixels.

use super::descent::iterate;
use super::flat_zone::{Flat, Zone};
use super::model::{Lopsided, Pixels};
use super::nearby_ink::lift;
use super::noise::OfCentres;
use super::normal::{Normal, solve};
use super::prior::Prior;
use super::solved::Solved;
use super::squares::Squares;
use super::start::{Descent, Start};
use super::state::{ANNULUS, DARK, DISC, INNER, State};
use crate::detect::Picture;
use crate::detect::circles::ellipse::Ellipse;
use crate::detect::circles::types::{Imaged, Measured, Reason};
use crate::detect::correlated::Correlation;
use crate::detect::shared::{GLARE_SLOPE, SATURATED};
use crate::series::Edge;

/// A fit with what the caller needs to go on.
#[derive(Debug, Clone, Copy)]
pub struct Fit {
    pub measured: Measured,
    /// Cross-covariance of outer and inner centre per axis, px^2.
    pub cross: [f64; 2],
    /// The ink's own gradient as a share of the contrast, 1/px, and its variance.
    pub ink_slope: ([f64; 2], [f64; 2]),
    /// Mean square of the residuals on paper and on ink, away from the edge, with their pixel counts.
    pub plain: [(f64, f64); 2],
    /// Mean square of the residuals in units of the noise.
    pub misfit: f64,
    /// Lopsidedness of the edges and its information ([`Pixels::skew`]).
    pub skew: ([f64; 2], [f64; 2]),
}

impl Fit {
    /// States the covariance of the centres anew, for noise of this correlation.
    pub fn state(&mut self, of: &OfCentres, correlation: &Correlation) {
        let covariance = Covariance { columns: of.covariance(correlation).into() };
        self.measured.outer.covariance = covariance.block(0);
        self.measured.inner.iter_mut().for_each(|inner| inner.covariance = covariance.block(2));
        self.cross = covariance.cross();
    }

    /// Standard deviation of the distance of inner and outer centre, px (the larger of both axes); infinite where the
    /// inner circle is not measured for itself.
    pub fn apart_sigma(&self) -> f64 {
        let outer = self.measured.outer.covariance;
        let variance = |inner: [f64; 3], a: usize| outer[2 * a] + inner[2 * a] - 2.0 * self.cross[a];
        let of = |inner: Imaged| variance(inner.covariance, 0).max(variance(inner.covariance, 1)).max(0.0).sqrt();
        self.measured.inner.map_or(f64::INFINITY, of)
    }
}

/// Half width of the band around an edge in units of the blur (and 0.3 px on top); beyond it lies 0.1 % of the information
/// on the edge.
const REACH: f64 = 2.5;
/// Where the picture is even, in units of the blur from an edge (and half a pixel on top).
const EVEN_FROM: f64 = 3.1;
/// The same where the neighbours are taken off: with paper enough to see its level.
const WIDE_REACH: f64 = 5.0;
/// Width of the even zone beyond the band in units of the blur.
const EVEN: f64 = 5.0;
/// How far, in units of the blur, contours may be from where the band was laid.
const SLACK: f64 = 0.5;
/// Part of the band that must be in the picture when the shape is not known.
pub const WHOLE: f64 = 0.98;

/// A gradient of the ink that exceeds its prior sigma by this factor may be that of glare, which is steep.
const STRAINED: f64 = 5.0;
/// Glare adds the same to ink and paper; their gradients agree to this part.
const ADDED: f64 = 0.5;

/// As [`refine`]; a fit that does not converge is begun once more with damped steps.
pub fn refine_steadily(picture: &Picture, start: &Start, pixels: &mut Pixels) -> Result<Fit, Reason> {
    match refine(picture, start, pixels) {
        Err(Reason::NoConvergence) => refine(picture, &Start { descent: Descent::Damped, ..*start }, pixels),
        other => other,
    }
}

/// Measures one marker, once more where glare lights the ink. The work arrays `pixels` are reused from call to call.
pub fn refine(picture: &Picture, start: &Start, pixels: &mut Pixels) -> Result<Fit, Reason> {
    let fit = measure(picture, start, pixels)?;
    let [x, y] = fit.ink_slope.0;
    if x.hypot(y) <= STRAINED * start.ink_slope {
        return Ok(fit);
    }
    let free = measure(picture, &Start { ink_slope: GLARE_SLOPE, ..*start }, pixels);
    // What the ink has beyond its share of the paper's is then, over the contrast, what the paper has over its own brightness.
    let is_in_glare = |Fit { ink_slope: ([x, y], _), measured: Measured { gradient: [u, v], .. }, .. }: &Fit| {
        (x - u).hypot(y - v) < ADDED * u.hypot(*v)
    };
    // Without glare the fit is made once more, for what it leaves in `pixels`.
    free.ok().filter(is_in_glare).map_or_else(|| measure(picture, start, pixels), Ok)
}

fn measure(picture: &Picture, start: &Start, pixels: &mut Pixels) -> Result<Fit, Reason> {
    let anchor = start.ellipse.centre.map(f64::round);
    let first = once(picture, start, anchor, pixels)?;
    let slack = SLACK * first.0.blur;
    match moved(&first.0, start, anchor).filter(|(_, by)| *by > slack) {
        // the band was not laid where the edges are
        Some((start, _)) => {
            let (state, normal, visible) = once(picture, &start, anchor, pixels)?;
            finish(&state, &start, anchor, visible, pixels, &normal)
        }
        None => finish(&first.0, start, anchor, first.2, pixels, &first.1),
    }
}

/// One fit: the state, the factor of its normal matrix, and the part of the band in the picture.
fn once(
    picture: &Picture,
    start: &Start,
    anchor: [f64; 2],
    pixels: &mut Pixels,
) -> Result<(State, Normal, f64), Reason> {
    let (wanted, saturated) = gather(picture, start, anchor, pixels);
    let parameters = if start.ratio.is_some() { ANNULUS } else { DISC };
    let visible = pixels.count as f64 / wanted.max(1) as f64;
    let missing = if 2 * saturated > wanted - pixels.count { Reason::Saturated } else { Reason::CutByBorder };
    if !start.nearby.is_empty() {
        lift(pixels, start.nearby, anchor);
    }
    // what lies beyond the border is missed less where the neighbours are taken off: the band is wider than it must be
    let whole = start.nearby.is_empty() && start.shape_sigma.is_none();
    if saturated * 5 > wanted || pixels.count < 2 * parameters || (whole && visible < WHOLE) || visible < 0.35 {
        return Err(missing);
    }
    let mut state = initial(start, anchor);
    let prior = Prior::of(start, picture);
    let normal = iterate(&mut state, &prior, start, pixels)?;
    Ok((state, normal, visible))
}

/// The start that a state is, and by how much its contours have moved from the one before, px.
fn moved<'a>(state: &State, start: &Start<'a>, anchor: [f64; 2]) -> Option<(Start<'a>, f64)> {
    let length = |d: [f64; 2]| d[0].hypot(d[1]);
    let ellipse = state.ellipse();
    let ellipse = Ellipse { centre: [0, 1].map(|a| ellipse.centre[a] + anchor[a]), ..ellipse };
    let (now, before) = (ellipse.semi_axes(), start.ellipse.semi_axes());
    let outer = length([0, 1].map(|a| ellipse.centre[a] - start.ellipse.centre[a]))
        + (now[0] - before[0]).abs().max((now[1] - before[1]).abs());
    let inner = state.inner.zip(start.ratio).map(|((centre, ratio), old)| {
        let apart = [0, 1].map(|a| centre[a] - state.centre[a]);
        (apart, ratio, outer + length([0, 1].map(|a| apart[a] - start.apart[a])) + (ratio - old).abs() * now[0])
    });
    let (apart, ratio) = inner.map_or((start.apart, start.ratio), |(apart, ratio, _)| (apart, Some(ratio)));
    let by = inner.map_or(outer, |(.., by)| by);
    by.is_finite().then_some((Start { ellipse, apart, ratio, blur_px: state.blur, ..*start }, by))
}

fn initial(start: &Start, anchor: [f64; 2]) -> State {
    let centre = [0, 1].map(|a| start.ellipse.centre[a] - anchor[a]);
    State {
        centre,
        to_unit: start.ellipse.normaliser(),
        third: start.third.unwrap_or_default(),
        blur: start.blur_px,
        white: [start.paper, 0.0, 0.0],
        dark: [start.ink, 0.0, 0.0],
        inner: start.ratio.map(|r| ([0, 1].map(|a| centre[a] + start.apart[a]), r)),
    }
}

fn finish(
    state: &State,
    start: &Start,
    anchor: [f64; 2],
    visible: f64,
    pixels: &mut Pixels,
    factor: &Normal,
) -> Result<Fit, Reason> {
    let parameters = state.parameters();
    let n = pixels.count;
    let left = Squares::of(pixels);
    let rms = (left.plain / n as f64).sqrt();
    let even = pixels.flat.squares(state);
    let freedom = (n - parameters) as f64 + pixels.flat.paper.count + pixels.flat.ink.count;
    let even_weighted = even[0] / start.noise[0] + even[1] / start.noise[1];
    let scale = (left.weighted + even_weighted) / freedom;
    let contrast = state.white[0] - state.dark[0];
    let expected = start.noise[0].max(start.noise[1]);
    if contrast <= 0.0 || rms * rms > 6.0 * expected + (0.03 * contrast).powi(2) {
        return Err(Reason::EdgeModel);
    }
    let plain = [
        (even[0] + left.off_edge[0].0, pixels.flat.paper.count + left.off_edge[0].1),
        (even[1] + left.off_edge[1].0, pixels.flat.ink.count + left.off_edge[1].1),
    ];
    let solved = Solved { state: *state, factor: *factor, noise: start.noise, scale };
    let covariance = match start.correlation == Correlation::WHITE {
        true => Covariance::of(factor, parameters, scale),
        false => Covariance { columns: OfCentres::of(&solved, pixels).covariance(&start.correlation).into() },
    };
    pixels.solved = Some(solved);
    let place = |e: Ellipse| Ellipse { centre: [0, 1].map(|a| e.centre[a] + anchor[a]), ..e };
    let outer = Imaged { edge: Edge::Outer, ellipse: place(state.ellipse()), covariance: covariance.block(0) };
    let hole = state.inner_ellipse().map(place);
    let inner = hole.filter(|_| start.tie_sigma.is_none()).map(|ellipse| Imaged {
        edge: Edge::Inner,
        ellipse,
        covariance: covariance.block(2),
    });
    let measured = Measured {
        outer,
        inner,
        hole,
        blur_px: state.blur,
        paper: state.white[0],
        ink: state.dark[0],
        rms,
        gradient: [state.white[1] / state.white[0], state.white[2] / state.white[0]],
        visible,
    };
    let ink_slope = ink_slope(state, factor, contrast);
    Ok(Fit {
        measured,
        cross: covariance.cross(),
        plain,
        ink_slope,
        misfit: scale,
        skew: skew(&pixels.skew(state, start.noise), factor, parameters),
    })
}

/// The gradient of the lopsidedness along both axes, and the information that is left on it beside all parameters.
fn skew(lopsided: &Lopsided, factor: &Normal, parameters: usize) -> ([f64; 2], [f64; 2]) {
    let left = |a: usize| {
        let mut solved = lopsided.shared[a];
        solve(factor, parameters, &mut solved);
        let taken: f64 = lopsided.shared[a].iter().zip(&solved).take(parameters).map(|(s, v)| s * v).sum();
        (lopsided.square[a] - taken).max(1e-3 * lopsided.square[a])
    };
    (lopsided.gradient, [left(0), left(1)])
}

fn ink_slope(state: &State, factor: &Normal, contrast: f64) -> ([f64; 2], [f64; 2]) {
    let variance = |k: usize| {
        let mut unit = [0.0; ANNULUS];
        unit[DARK + k] = 1.0;
        solve(factor, state.parameters(), &mut unit);
        unit[DARK + k] / (contrast * contrast)
    };
    ([state.dark[1] / contrast, state.dark[2] / contrast], [variance(1), variance(2)])
}

/// Covariance of the two centres.
struct Covariance {
    columns: [[f64; 4]; 4],
}

impl Covariance {
    /// For white noise.
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

/// What the pixels between one contour of [`rings`] and the next are used for.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Use {
    Band,
    Paper,
    Ink,
    Nothing,
}

/// Nested contours from the outside to the inside, each with the use of the pixels within it up to the next.
///
/// Between a band and the even zones lies a strip that is not used: it says little about the edge, and is not even.
fn rings(start: &Start) -> Vec<(Ellipse, Use)> {
    let blur = start.blur_px;
    let (near, even) = (REACH * blur + 0.3, EVEN_FROM * blur + 0.5);
    let minor = start.ellipse.semi_axes()[1];
    let room = (start.clear - 1.0) * minor;
    let mut all: Vec<(Option<Ellipse>, Use)> = Vec::with_capacity(9);
    if start.nearby.is_empty() {
        let far = (even + EVEN * blur).min(room - 0.8 * blur);
        if far > even {
            all.push((start.ellipse.offset(far), Use::Paper));
            all.push((start.ellipse.offset(even), Use::Nothing));
        }
        all.push((start.ellipse.offset(near.min(room).max(0.9)), Use::Band));
    } else {
        all.push((start.ellipse.offset(WIDE_REACH * blur), Use::Band));
    }
    let within = (start.ellipse.offset(-near), start.ellipse.offset(-even));
    let Some(ratio) = start.ratio else {
        all.push((within.0, Use::Nothing));
        all.push((within.1, Use::Ink));
        all.push((start.ellipse.offset(-even - EVEN * blur), Use::Nothing));
        return nested(all);
    };
    let centre = [0, 1].map(|a| start.ellipse.centre[a] + start.apart[a]);
    let inner = Ellipse { centre, shape: start.ellipse.shape.map(|v| v / (ratio * ratio)) };
    let wider = |a: Option<Ellipse>, b: Option<Ellipse>| {
        let [a, b] = [a, b].map(|e| e.map_or(0.0, |e| e.semi_axes()[1]));
        a > b
    };
    if wider(within.0, inner.offset(near)) {
        all.push((within.0, Use::Nothing));
        if wider(within.1, inner.offset(even)) {
            all.push((within.1, Use::Ink));
            all.push((inner.offset(even), Use::Nothing));
        }
        all.push((inner.offset(near), Use::Band));
    }
    all.push((inner.offset(-near), Use::Nothing));
    all.push((inner.offset(-even), Use::Paper));
    nested(all)
}

/// The contours up to the first that has shrunk to nothing.
fn nested(all: Vec<(Option<Ellipse>, Use)>) -> Vec<(Ellipse, Use)> {
    all.into_iter().map_while(|(e, u)| Some((e?, u))).collect()
}

/// Collects the pixels of the band, and sums over the even zones beside it; returns how many pixels the band would have
/// in an unlimited picture, and how many of the missing ones are saturated.
fn gather(picture: &Picture, start: &Start, anchor: [f64; 2], pixels: &mut Pixels) -> (usize, usize) {
    pixels.clear();
    pixels.flat = Flat { paper: Zone::around(start.paper), ink: Zone::around(start.ink) };
    let rings = rings(start);
    let Some((outermost, _)) = rings.first() else { return (0, 0) };
    let half = outermost.half_extent()[1];
    let first = (start.ellipse.centre[1] - half).ceil() as i64;
    let last = first + (2.0 * half).floor() as i64;
    let mut counts = (0, 0);
    for y in first..=last {
        // what is left between the contours that have been passed
        let Some((mut low, mut high)) = outermost.chord(y as f64).map(whole) else { continue };
        for (k, (_, used)) in rings.iter().enumerate() {
            let next = rings.get(k + 1).and_then(|(e, _)| e.chord(y as f64)).map(whole);
            let (from, to) = next.filter(|(a, b)| a <= b).map_or((high + 1, high), |(a, b)| (a.max(low), b.min(high)));
            let mut strip = Strip { picture, anchor, y, used: *used, pixels, counts: &mut counts };
            strip.take(low, from.min(high + 1));
            strip.take(to + 1, high + 1);
            (low, high) = (from, to);
            if low > high {
                break;
            }
        }
    }
    pixels.finish();
    counts
}

/// First and last pixel of a chord.
fn whole((from, to): (f64, f64)) -> (i64, i64) {
    (from.ceil() as i64, to.floor() as i64)
}

/// Pixels of one row.
struct Strip<'a> {
    picture: &'a Picture,
    anchor: [f64; 2],
    y: i64,
    used: Use,
    pixels: &'a mut Pixels,
    counts: &'a mut (usize, usize),
}

impl Strip<'_> {
    /// Takes the pixels from `from` up to, not with, `to`.
    fn take(&mut self, from: i64, to: i64) {
        if self.used == Use::Nothing || from >= to {
            return;
        }
        let in_band = self.used == Use::Band;
        if in_band {
            self.counts.0 += (to - from) as usize;
        }
        let (width, height) = (self.picture.width as i64, self.picture.height as i64);
        let (from, to) = (from.max(0), to.min(width));
        if self.y < 0 || self.y >= height || from >= to {
            return;
        }
        let limit = SATURATED * self.picture.full_scale;
        let base = (self.y * width) as usize;
        let values = &self.picture.pixels[base + from as usize..base + to as usize];
        let (x, y) = (from as f64 - self.anchor[0], self.y as f64 - self.anchor[1]);
        let saturated = values.iter().filter(|v| **v >= limit).count();
        if saturated == 0 {
            return self.push([x, y], values);
        }
        let mut at = 0;
        for good in values.split(|v| *v >= limit) {
            self.push([x + at as f64, y], good);
            at += good.len() + 1;
        }
        if in_band {
            self.counts.1 += saturated;
        }
    }

    fn push(&mut self, [x, y]: [f64; 2], values: &[f32]) {
        match self.used {
            Use::Band => self.pixels.push_row(x as f32, y as f32, values),
            Use::Paper => self.pixels.flat.paper.push_row(x, y, values),
            Use::Ink => self.pixels.flat.ink.push_row(x, y, values),
            Use::Nothing => {}
        }
    }
}
