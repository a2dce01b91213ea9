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

use nalgebra::{SMatrix, SVector};

use super::beside::Printed;
use super::code_edges::{CodeEdge, code_edges};
use super::edge_line::{EdgeLine, bend};
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
/// Of a component of `q`: 1, x, y, 1 - x^2, 1 - y^2 and the last two times x and y, which vanish at the corners but for the first three.
const TERMS: usize = 9;
const PARAMETERS: usize = 1 + 2 * TERMS;
/// Prior sigma of the terms of third order: k1 = 0.3 displaces by this times the cube of half a side, over the square of the picture's width.
const BEND_CUBIC: f64 = 0.3;
/// By how much code and outline of the tags of a picture differ in their growth, in common: px, and as a share of it. Fits of short edges to
/// encoded steps said up to 3 % more than those of the long sides.
const UNLIKE_PX: f64 = 0.01;
const UNLIKE_SHARE: f64 = 0.03;
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
}

impl Outlined<'_> {
    /// What the code of the tag says, in a picture that was smoothed with this sigma; `None` where its modules are too small.
    pub fn growth(&self, picture: &Picture, smoothing_px: f64) -> Option<Growth> {
        let n = self.printed.reader.side() as f64;
        let unit = [[0.0, n], [n, n], [n, 0.0], [0.0, 0.0]];
        let map = PlaneMap::fit(&unit.into_iter().zip(self.corners).collect::<Vec<_>>())?;
        let measured = |edge: &CodeEdge| {
            let line = edge.fit(picture, &map, self.printed)?;
            let step = line.contrast() / self.contrast;
            let line = line.widened(variance_factor(line.blur_px(), smoothing_px));
            (OTHER_STEP..1.0 / OTHER_STEP).contains(&step).then(|| Row::of(edge, &line, n))
        };
        let rows: Vec<Row> = code_edges(self.printed).iter().filter_map(measured).collect();
        solve(&rows, &self.priors(picture)).filter(|_| rows.len() >= LEAST_EDGES)
    }

    /// Prior variances of the terms of `q`, px^2.
    fn priors(&self, picture: &Picture) -> [f64; TERMS] {
        let half = (0..4).map(|k| distance(self.corners[k], self.corners[(k + 1) % 4])).sum::<f64>() / 8.0;
        let second = bend(picture) * half * half;
        let third = BEND_CUBIC * half * (half / picture.width.max(picture.height) as f64).powi(2);
        let [second, third] = [second * second, third * third];
        let first = self.variance;
        [first, first, first, second, second, third, third, third, third]
    }
}

/// What one edge of the code says.
struct Row {
    terms: SVector<f64, PARAMETERS>,
    off_px: f64,
    variance: f64,
}

impl Row {
    fn of(edge: &CodeEdge, line: &EdgeLine, n: f64) -> Self {
        let [x, y] = edge.middle().map(|at| 2.0 * at / n - 1.0);
        let (bow_x, bow_y) = (1.0 - x * x, 1.0 - y * y);
        let smooth = [1.0, x, y, bow_x, bow_y, x * bow_x, x * bow_y, y * bow_x, y * bow_y];
        let mut terms = SVector::zeros();
        terms[0] = 1.0 - edge.to_light * [x, y][edge.axis];
        for (k, term) in smooth.into_iter().enumerate() {
            terms[1 + edge.axis * TERMS + k] = edge.to_light * term;
        }
        let (off_px, variance) = line.offset_at_middle();
        Self { terms, off_px, variance: variance + SYSTEMATIC_PX * SYSTEMATIC_PX }
    }
}

/// Least squares with Huber's weights.
fn solve(rows: &[Row], priors: &[f64; TERMS]) -> Option<Growth> {
    let mut state = SVector::<f64, PARAMETERS>::zeros();
    let mut variance = 0.0;
    for _ in 0..ROUNDS {
        let mut normal = SMatrix::<f64, PARAMETERS, PARAMETERS>::zeros();
        let mut right = SVector::<f64, PARAMETERS>::zeros();
        let mut square = 0.0;
        for (k, prior) in priors.iter().chain(priors).enumerate() {
            normal[(k + 1, k + 1)] = prior.recip();
        }
        for row in rows {
            let sigmas = (row.off_px - row.terms.dot(&state)).abs() / row.variance.sqrt();
            let far = if sigmas > FAR_SIGMAS { FAR_SIGMAS / sigmas } else { 1.0 };
            let weight = far / row.variance;
            normal += row.terms * row.terms.transpose() * weight;
            right += row.terms * (row.off_px * weight);
            square += far * sigmas * sigmas;
        }
        let factor = normal.cholesky()?;
        state = factor.solve(&right);
        let first = SVector::<f64, PARAMETERS>::ith(0, 1.0);
        variance = factor.solve(&first)[0] * (square / rows.len() as f64).max(1.0);
    }
    (state[0].is_finite() && variance.is_finite()).then_some(Growth { px: state[0], variance })
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
        let [a, b] = [own.variance, self.variance].map(f64::recip);
        // It is one of those that the middle is of: a single one is known no better by that.
        let variance = (a + b).recip().max(own.variance / self.tags);
        Growth { px: (a * own.px + b * self.middle) / (a + b), variance }
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
