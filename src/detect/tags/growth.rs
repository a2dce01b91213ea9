//! How far ink reaches beyond its place, px of the picture: ink grows in print, paper that is clipped grows into it, and so it does where grey
//! values are not proportional to the light, as in the files of ordinary cameras: half of the encoded step is less than half of the light.
//!
//! The code of a tag tells. Within the map through the four corners of its outline, whose sides are displaced by `g` themselves, the edge
//! between a dark and a light module lies too far towards its light by
//!
//! ```text
//! r = g (1 - n.x) + n.q(x)
//! ```
//!
//! with `x` its place on the tag, from -1 to 1, and `n` the unit vector to its light. `q` is smooth: what the noise of the sides leaves of the
//! map, and what the lens bends, in powers of `x` with priors. Light and dark stand on both sides of edges, so that `g` is told from `q`.
//! The sides themselves, whose `n.x` is 1, tell of `q` how far the lens bends them; edges are looked for where `q` says, again where that changes.

use nalgebra::{SMatrix, SVector};

use super::beside::Printed;
use super::code_edges::{CodeEdge, code_edges};
use super::edge_line::{Measured, bends};
use super::quads::{Quad, distance};
use crate::detect::Picture;
use crate::detect::circles::variance_factor;
use crate::detect::shared::SYSTEMATIC_PX;
use crate::geom::PlaneMap;
use crate::linalg::median;

/// Edges within a tag that must say by how much its ink has grown: those of one light module.
const LEAST_EDGES: usize = 4;
/// A step below this part of those of the sides, or the other way round, is not between their ink and their paper.
const OTHER_STEP: f64 = 0.75;
/// Residuals beyond so many sigmas count less, in proportion.
const FAR_SIGMAS: f64 = 2.5;
const ROUNDS: usize = 12;
/// A solution that changes less has settled, px.
const SETTLED_PX: f64 = 1e-5;
/// Of a component of `q`, by their order from 0 to 5: only the first four do not vanish at the corners.
const ORDERS: [usize; 7] = [1, 2, 1, 2, 4, 5, 6];
const TERMS: usize = 21;
type Terms = SVector<f64, TERMS>;
/// Prior sigma of `g`, px: none, but that sides alone do not tell it.
const GROWN_PX: f64 = 100.0;
/// Places of a side that say how it is bent, from -1 to 1.
const ALONG: [f64; 7] = [-0.9, -0.6, -0.3, 0.0, 0.3, 0.6, 0.9];
/// Coefficients of a side: so many of its places are independent.
const OF_A_SIDE: f64 = 5.0;
/// Edges are looked for again where they are expected by more than this elsewhere, px, and how often.
const ELSEWHERE_PX: f64 = 0.5;
const MOST_LOOKS: usize = 5;
/// By how much code and outline of the tags of a picture differ in their growth, in common: px, and as a share of it. Fits of short edges to
/// encoded steps said up to 3 % more than those of the long sides.
const UNLIKE_PX: f64 = 0.01;
const UNLIKE_SHARE: f64 = 0.03;
/// Growth that nothing tells, as a share of the blur: that of the light to the power of 1 / 2.2 for ink that reflects 3 to 6 % of the paper.
const OF_ENCODING: f64 = 0.43;
/// Square of the standard error of a median over that of a mean.
const OF_MEDIAN: f64 = std::f64::consts::FRAC_PI_2;

/// By how much ink has grown.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Growth {
    pub px: f64,
    /// Its variance, px^2.
    pub variance: f64,
}

impl Growth {
    /// Where nothing tells it, of edges of this blur in a picture that was smoothed with this sigma: that of light in proportion, no more than
    /// an encoding makes.
    pub fn untold(blur_px: f64, smoothing_px: f64) -> Self {
        let square = (blur_px * blur_px - smoothing_px * smoothing_px).max(0.0);
        Self { px: 0.0, variance: OF_ENCODING * OF_ENCODING * square }
    }

    /// The mean of both by their variances.
    pub fn beside(self, other: &Self) -> Self {
        let [a, b] = [self.variance, other.variance].map(f64::recip);
        Self { px: (a * self.px + b * other.px) / (a + b), variance: (a + b).recip() }
    }

    /// That of the outline of a tag, where its code says it.
    pub fn of_outline(self) -> Self {
        let unlike = UNLIKE_PX * UNLIKE_PX + (UNLIKE_SHARE * self.px).powi(2);
        Self { variance: self.variance + unlike, ..self }
    }
}

/// A tag whose outline is measured.
pub struct Outlined<'a> {
    pub printed: &'a Printed<'a>,
    /// Its corners where its sides cross, counter-clockwise from the bottom-left.
    pub corners: Quad,
    /// Mean variance of a corner per axis, px^2.
    pub variance: f64,
    /// Median step of its sides, counts.
    pub contrast: f64,
    /// Bottom, right, top and left as printed.
    pub sides: &'a [Measured; 4],
}

impl Outlined<'_> {
    /// What the code of the tag says, in a picture that was smoothed with this sigma; `None` where its modules are too small.
    pub fn growth(&self, picture: &Picture, smoothing_px: f64) -> Option<Growth> {
        let n = self.printed.reader.side() as f64;
        let unit = [[0.0, n], [n, n], [n, 0.0], [0.0, 0.0]];
        let map = PlaneMap::fit(&unit.into_iter().zip(self.corners).collect::<Vec<_>>())?;
        let measured = |edge: &CodeEdge, q: &[Terms; 2]| {
            let place = |at: [f64; 2]| Place::of(edge.axis, edge.to_light, at.map(|at| 2.0 * at / n - 1.0));
            let line = edge.fit(picture, &map, self.printed, |at| place(at).smooth(q))?;
            let step = line.contrast() / self.contrast;
            let line = line.widened(variance_factor(line.blur_px(), smoothing_px));
            let at = edge.middle();
            let row = Row::of(place(at), line.offset_from(map.apply(at)?));
            (OTHER_STEP..1.0 / OTHER_STEP).contains(&step).then_some(row)
        };
        let (edges, sides, priors) = (code_edges(self.printed), self.side_rows(&map, n), self.priors(picture));
        let mut q = solve(&[], &sides, &priors)?.0.q;
        for _ in 0..MOST_LOOKS {
            let code: Vec<Row> = edges.iter().filter_map(|edge| measured(edge, &q)).collect();
            let (state, variance) = solve(&code, &sides, &priors).filter(|_| code.len() >= LEAST_EDGES)?;
            let moved = [state.q[0] - q[0], state.q[1] - q[1]];
            if code.iter().all(|row| row.place.smooth(&moved).abs() < ELSEWHERE_PX) {
                return Some(Growth { px: state.grown, variance });
            }
            q = state.q;
        }
        None
    }

    /// How far the sides lie beside the lines between the corners.
    fn side_rows(&self, map: &PlaneMap, n: f64) -> Vec<Row> {
        let places = [(1, 1.0), (0, 1.0), (1, -1.0), (0, -1.0)];
        let sides = self.sides.iter().zip(places).filter_map(|(side, place)| Some((side.as_ref().ok()?, place)));
        let rows = sides.flat_map(|(side, (axis, out))| {
            ALONG.into_iter().filter_map(move |along| {
                let at = if axis == 0 { [out, along] } else { [along, out] };
                let seen = map.apply(at.map(|at| 0.5 * n * (at + 1.0)))?;
                let row = Row::of(Place::of(axis, out, at), side.offset_from(seen));
                Some(Row { variance: row.variance * ALONG.len() as f64 / OF_A_SIDE, ..row })
            })
        });
        rows.collect()
    }

    /// Prior variances of the terms of `q`, px^2.
    fn priors(&self, picture: &Picture) -> Terms {
        let half = (0..4).map(|k| distance(self.corners[k], self.corners[(k + 1) % 4])).sum::<f64>() / 8.0;
        let bent = (2..).zip(bends(picture)).map(|(order, bend)| (bend * half.powi(order)).powi(2));
        let of_orders = [self.variance; 3].into_iter().chain(bent);
        let all = ORDERS.into_iter().zip(of_orders).flat_map(|(count, variance)| std::iter::repeat_n(variance, count));
        Terms::from_iterator(all)
    }
}

/// `g` and the coefficients of both components of `q`, px.
#[derive(Clone, Copy)]
struct State {
    grown: f64,
    q: [Terms; 2],
}

impl State {
    fn nothing() -> Self {
        Self { grown: 0.0, q: [Terms::zeros(); 2] }
    }

    fn is_finite(&self) -> bool {
        self.grown.is_finite() && self.q.iter().flatten().all(|c| c.is_finite())
    }

    /// Whether nothing differs by more than what counts.
    fn is_settled(&self, before: &Self) -> bool {
        let moved = self.q.iter().zip(&before.q).map(|(q, before)| (q - before).amax());
        moved.chain([(self.grown - before.grown).abs()]).all(|moved| moved < SETTLED_PX)
    }
}

/// What `r` is made of at a place: `1 - n.x`, and the terms of `n.q` in the component of `q` along `n`.
#[derive(Clone, Copy)]
struct Place {
    axis: usize,
    grown: f64,
    terms: Terms,
}

impl Place {
    /// Of an edge across an axis, at a place from -1 to 1.
    fn of(axis: usize, to_light: f64, at: [f64; 2]) -> Self {
        let [x, y] = at;
        let (bow_x, bow_y) = (1.0 - x * x, 1.0 - y * y);
        let (xx, xy, yy) = (bow_x * bow_x, bow_x * bow_y, bow_y * bow_y);
        let first = [1.0, x, y, x * y];
        let third = [bow_x, bow_y, x * bow_x, x * bow_y, y * bow_x, y * bow_y];
        let fifth = [xx, xy, yy, x * y * bow_x, x * y * bow_y, x * xx, x * xy, x * yy, y * xx, y * xy, y * yy];
        let terms = Terms::from_iterator(first.into_iter().chain(third).chain(fifth)) * to_light;
        Self { axis, grown: 1.0 - to_light * at[axis], terms }
    }

    /// `n.q`, px.
    fn smooth(&self, q: &[Terms; 2]) -> f64 {
        self.terms.dot(&q[self.axis])
    }
}

/// What one edge of the code says, or one place of a side.
#[derive(Clone, Copy)]
struct Row {
    place: Place,
    off_px: f64,
    variance: f64,
}

impl Row {
    fn of(place: Place, (off_px, variance): (f64, f64)) -> Self {
        Self { place, off_px, variance: variance + SYSTEMATIC_PX * SYSTEMATIC_PX }
    }
}

/// Normal equations of a component of `q`.
#[derive(Clone, Copy)]
struct Component {
    normal: SMatrix<f64, TERMS, TERMS>,
    with_grown: Terms,
    right: Terms,
}

/// Least squares with Huber's weights: the state, and the variance of `g` by how well the edges of the code fit.
fn solve(code: &[Row], sides: &[Row], priors: &Terms) -> Option<(State, f64)> {
    let (mut state, mut variance) = (State::nothing(), 0.0);
    for _ in 0..ROUNDS {
        let of_prior = SMatrix::from_diagonal(&priors.map(f64::recip));
        let mut components = [Component { normal: of_prior, with_grown: Terms::zeros(), right: Terms::zeros() }; 2];
        let (mut normal, mut right, mut square) = (GROWN_PX.powi(-2), 0.0, 0.0);
        for (k, Row { place, off_px, variance }) in code.iter().chain(sides).enumerate() {
            let left = off_px - place.grown * state.grown - place.smooth(&state.q);
            let sigmas = left.abs() / variance.sqrt();
            let far = if sigmas > FAR_SIGMAS { FAR_SIGMAS / sigmas } else { 1.0 };
            let weight = far / variance;
            let of_q = &mut components[place.axis];
            of_q.normal.ger(weight, &place.terms, &place.terms, 1.0);
            of_q.with_grown.axpy(weight * place.grown, &place.terms, 1.0);
            of_q.right.axpy(weight * off_px, &place.terms, 1.0);
            normal += weight * place.grown * place.grown;
            right += weight * place.grown * off_px;
            if k < code.len() {
                square += far * sigmas * sigmas;
            }
        }
        let [x, y] = components.map(|c| Some((c.normal.cholesky()?, c)));
        let solved = [x?, y?].map(|(factor, c)| (factor.solve(&c.with_grown), factor.solve(&c.right), c));
        for (with, alone, c) in &solved {
            normal -= c.with_grown.dot(with);
            right -= c.with_grown.dot(alone);
        }
        let grown = right / normal;
        let before =
            std::mem::replace(&mut state, State { grown, q: solved.map(|(with, alone, _)| alone - with * grown) });
        variance = (square / code.len().max(1) as f64).max(1.0) / normal;
        if state.is_settled(&before) {
            break;
        }
    }
    (state.is_finite() && variance.is_finite()).then_some((state, variance))
}

/// What values of one tag say that scatter with this variance each, beside what print leaves; `None` without any.
pub fn of_tag(values: &[f64], variance: f64) -> Option<Growth> {
    let px = median(values)?;
    let each = variance + SYSTEMATIC_PX * SYSTEMATIC_PX;
    Some(Growth { px, variance: OF_MEDIAN * each / values.len() as f64 })
}

/// What the tags of a picture have in common, and by how much they differ: the light changes over it, and with it what clips and what an
/// encoding makes of it.
#[derive(Debug, Clone, Copy)]
pub struct InPicture {
    middle: f64,
    /// Variance of a tag that says nothing about it, px^2.
    variance: f64,
    /// How many tags say something.
    tags: f64,
}

impl InPicture {
    /// `None` where no tag says anything.
    pub fn of(tags: &[Growth]) -> Option<Self> {
        let (middle, n) = (median(tags.iter().map(|g| g.px))?, tags.len() as f64);
        let mean = |of: &dyn Fn(&Growth) -> f64| tags.iter().map(of).sum::<f64>() / n;
        let (apart, own) = (mean(&|g| (g.px - middle).powi(2)), mean(&|g| g.variance));
        Some(Self { middle, variance: (apart - own).max(0.0) + OF_MEDIAN * apart.max(own) / n, tags: n })
    }

    /// The growth of a tag that says this itself: the mean of both by their variances.
    pub fn with(&self, own: Option<Growth>) -> Growth {
        let Some(own) = own else { return Growth { px: self.middle, variance: self.variance } };
        let both = own.beside(&Growth { px: self.middle, variance: self.variance });
        // It is one of those that the middle is of: a single one is known no better by that.
        Growth { variance: both.variance.max(own.variance / self.tags), ..both }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Tags in even light share what they say; one in a highlight keeps its own.
    #[test]
    fn a_tag_apart_from_the_others_keeps_its_growth() {
        let one = |px: f64| Growth { px, variance: 1e-4 };
        let single = InPicture::of(&[one(-0.3)]).unwrap().with(Some(one(-0.3)));
        assert!((single.px + 0.3).abs() < 1e-12 && (single.variance - 1e-4).abs() < 1e-12, "{single:?}");
        let even: Vec<Growth> = (0..25).map(|k| one(-0.3 + 0.01 * f64::from(k % 3 - 1))).collect();
        let known = InPicture::of(&even).unwrap();
        let shared = known.with(Some(one(-0.29)));
        assert!((shared.px + 0.3).abs() < 2e-3 && shared.variance < 1e-5, "{shared:?}");
        assert!((known.with(None).px + 0.3).abs() < 1e-12);
        let known = InPicture::of(&[even, vec![one(-0.1)]].concat()).unwrap();
        let apart = known.with(Some(one(-0.1)));
        // (0.2 px)^2 / 26 between the tags, beside 1e-4 of its own.
        assert!((apart.px + 0.1).abs() < 0.02 && apart.variance < 1e-4, "{apart:?}");
    }
}
