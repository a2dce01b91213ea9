//! Inner and outer circle of an annulus must be of one mind about its centre.
//!
//! Circles of different size have different area centroids in a picture with perspective and distortion. The difference is
//! predicted from the markers themselves: one projective map from the plate to the image through all of them, a polynomial over
//! the image through what that map leaves (distortion is smooth there, however the plate is tilted), and around each annulus a quadratic through the small rest. Both circles are sent through the map, and the
//! centroids of their images are compared with the measured ones. What then remains on the mean is an asymmetric blur.

use nalgebra::{DMatrix, DVector};
use std::collections::BTreeMap;
use std::sync::LazyLock;

use crate::detect::circles::drift::Drift;
use crate::detect::circles::identity::lattice::Cell;
use crate::detect::circles::identity::local_map::LocalMap;
use crate::detect::circles::types::InnerOuter;
use crate::geom::PlaneMap;
use crate::linalg::median;

/// A measured marker: where on the plate (cells), radii in units of the pitch, centroids in the image.
#[derive(Debug, Clone, Copy)]
pub struct MeasuredMarker {
    pub cell: Cell,
    pub outer_radius: f64,
    pub outer: [f64; 2],
    pub inner: Option<Inner>,
}

/// Inner circle of an annulus.
#[derive(Debug, Clone, Copy)]
pub struct Inner {
    pub radius: f64,
    pub centre: [f64; 2],
    /// Sigma of the difference inner - outer, px.
    pub sigma: [f64; 2],
}

/// Which markers agree (in their order), and the difference that geometry does not explain; `size` is that of the picture.
pub fn agreement(markers: &[MeasuredMarker], size: [usize; 2]) -> (Vec<bool>, Option<InnerOuter>) {
    let Some(map) = Map::of(markers) else { return (vec![true; markers.len()], None) };
    let differences: Vec<Option<Difference>> = markers.iter().map(|m| map.difference(m)).collect();
    let mean = |a: usize| median(differences.iter().flatten().map(|d| d.value[a])).unwrap_or(0.0);
    let common = if differences.iter().flatten().count() >= 5 { [mean(0), mean(1)] } else { [0.0; 2] };
    let agrees = |d: &Difference| (0..2).all(|a| (d.value[a] - common[a]).abs() < 5.0 * d.sigma[a] + 0.02 + d.unsure);
    let good: Vec<bool> = differences.iter().map(|d| d.as_ref().is_none_or(agrees)).collect();
    (good.clone(), summary(&differences, &good, size))
}

/// Unexplained difference inner - outer centre of an annulus.
#[derive(Debug, Clone, Copy)]
struct Difference {
    /// Where, px.
    at: [f64; 2],
    value: [f64; 2],
    sigma: [f64; 2],
    /// How well that is known, px: markers are not where the plate says, and bend the map alike over their neighbours.
    unsure: f64,
    /// Size of the difference that geometry explains, px.
    explained: f64,
}

/// The projective map and the polynomial through all markers, and what they leave at each.
struct Map {
    projective: PlaneMap,
    polynomial: Polynomial,
    left: BTreeMap<Cell, [f64; 2]>,
}

/// Points on a circle that is sent through a map.
const RING: usize = 32;
/// Cells to either side that the quadratic is fitted to.
const REACH: i32 = 2;

impl Map {
    fn of(markers: &[MeasuredMarker]) -> Option<Self> {
        let place = |m: &MeasuredMarker| [f64::from(m.cell.0), f64::from(m.cell.1)];
        let fit = |shifts: &[[f64; 2]]| {
            let moved = |(m, s): (&MeasuredMarker, &[f64; 2])| (place(m), [m.outer[0] - s[0], m.outer[1] - s[1]]);
            PlaneMap::fit(&markers.iter().zip(shifts).map(moved).collect::<Vec<_>>())
        };
        let first = fit(&vec![[0.0; 2]; markers.len()])?;
        // centroids are not images of centres: the map through the former tells by how much they differ
        let shift = |m: &MeasuredMarker| {
            let at = place(m);
            let to = |d: [f64; 2]| first.apply([at[0] + d[0], at[1] + d[1]]);
            let (centre, centroid) = (to([0.0; 2])?, centroid(&to, m.outer_radius)?);
            Some([centroid[0] - centre[0], centroid[1] - centre[1]])
        };
        let shifts: Vec<[f64; 2]> = markers.iter().map(|m| shift(m).unwrap_or_default()).collect();
        let projective = fit(&shifts)?;
        let rest = |m: &MeasuredMarker, s: &[f64; 2]| {
            let image = projective.apply(place(m))?;
            Some((image, [0, 1].map(|a| m.outer[a] - s[a] - image[a])))
        };
        let rests: Vec<_> = markers.iter().zip(&shifts).filter_map(|(m, s)| rest(m, s)).collect();
        let polynomial = Polynomial::fit(&rests);
        let left = markers.iter().zip(&shifts).filter_map(|(m, s)| {
            let (image, r) = rest(m, s)?;
            let p = polynomial.at(image);
            Some((m.cell, [r[0] - p[0], r[1] - p[1]]))
        });
        let left = left.collect();
        Some(Self { projective, polynomial, left })
    }

    fn difference(&self, marker: &MeasuredMarker) -> Option<Difference> {
        let inner = marker.inner?;
        let (column, row) = marker.cell;
        let mut pairs = Vec::with_capacity(25);
        for (i, j) in (-REACH..=REACH).flat_map(|j| (-REACH..=REACH).map(move |i| (i, j))) {
            if let Some(left) = self.left.get(&(column + i, row + j)) {
                pairs.push(([f64::from(i), f64::from(j)], *left));
            }
        }
        let bend = LocalMap::fit(&pairs);
        let to = |d: [f64; 2]| {
            let place = [f64::from(column) + d[0], f64::from(row) + d[1]];
            let p = self.projective.apply(place)?;
            let q = self.polynomial.at(p);
            let b = bend.map_or([0.0; 2], |b| b.at(d));
            Some([0, 1].map(|a| p[a] + q[a] + b[a]))
        };
        let (large, small) = (centroid(&to, marker.outer_radius)?, centroid(&to, inner.radius)?);
        let expected = [0, 1].map(|a| small[a] - large[a]);
        let value = [0, 1].map(|a| inner.centre[a] - marker.outer[a] - expected[a]);
        // the expectation is good to a tenth; a one-sided neighbourhood to a third
        let part = if pairs.len() >= 20 { 0.1 } else { 0.35 };
        let explained = expected[0].hypot(expected[1]);
        let unsure = part * explained;
        Some(Difference { at: marker.outer, value, sigma: inner.sigma, unsure, explained })
    }
}

/// Polynomial over the image for both of its coordinates.
struct Polynomial {
    middle: [f64; 2],
    scale: f64,
    degree: usize,
    coefficients: [[f64; 2]; TERMS],
}

/// Highest degree; markers that are needed for each coefficient.
const DEGREE: usize = 5;
const TERMS: usize = (DEGREE + 1) * (DEGREE + 2) / 2;
const MARKERS_PER_TERM: usize = 3;

impl Polynomial {
    /// Least squares with the highest degree that the markers determine; zero where they determine none.
    fn fit(pairs: &[([f64; 2], [f64; 2])]) -> Self {
        let bound = |a: usize, pick: fn(f64, f64) -> f64| pairs.iter().map(|p| p.0[a]).reduce(pick).unwrap_or(0.0);
        let (low, high) = ([0, 1].map(|a| bound(a, f64::min)), [0, 1].map(|a| bound(a, f64::max)));
        let middle = [0, 1].map(|a| 0.5 * (low[a] + high[a]));
        let scale = 2.0 / (high[0] - low[0]).max(high[1] - low[1]).max(1.0);
        let zero = Self { middle, scale, degree: 0, coefficients: [[0.0; 2]; TERMS] };
        let solve = |degree: usize| {
            let count = (degree + 1) * (degree + 2) / 2;
            let (mut normal, mut right) = (DMatrix::zeros(count, count), DMatrix::zeros(count, 2));
            for (at, value) in pairs {
                let terms = DVector::from_row_slice(&zero.terms(*at, degree)[..count]);
                normal.syger(1.0, &terms, &terms, 1.0);
                (0..2).for_each(|a| right.column_mut(a).axpy(value[a], &terms, 1.0));
            }
            // a part in 1e9 of the largest pivot holds what the markers do not determine at zero
            (0..count).for_each(|k| normal[(k, k)] += 1e-9 * pairs.len() as f64);
            let solved = normal.cholesky()?.solve(&right);
            let mut coefficients = zero.coefficients;
            coefficients.iter_mut().zip(solved.row_iter()).for_each(|(c, row)| *c = [row[0], row[1]]);
            Some(Self { degree, coefficients, ..zero })
        };
        let allowed = |d: &usize| (d + 1) * (d + 2) / 2 * MARKERS_PER_TERM <= pairs.len();
        (2..=DEGREE).rev().filter(allowed).find_map(solve).unwrap_or(zero)
    }

    /// Products of powers up to a degree, by rising degree; zero beyond.
    fn terms(&self, at: [f64; 2], degree: usize) -> [f64; TERMS] {
        let [x, y] = [0, 1].map(|a| (at[a] - self.middle[a]) * self.scale);
        let (mut px, mut py, mut terms) = ([1.0; DEGREE + 1], [1.0; DEGREE + 1], [0.0; TERMS]);
        for k in 1..=degree {
            (px[k], py[k]) = (px[k - 1] * x, py[k - 1] * y);
        }
        let mut place = terms.iter_mut();
        for d in 0..=degree {
            (0..=d).zip(&mut place).for_each(|(i, term)| *term = px[d - i] * py[i]);
        }
        terms
    }

    fn at(&self, at: [f64; 2]) -> [f64; 2] {
        let terms = self.terms(at, self.degree);
        self.coefficients.iter().zip(&terms).fold([0.0; 2], |[u, v], (c, t)| [u + c[0] * t, v + c[1] * t])
    }
}

/// Points of the unit circle.
static UNIT_RING: LazyLock<[[f64; 2]; RING]> = LazyLock::new(|| {
    std::array::from_fn(|k| {
        let (sin, cos) = (k as f64 * std::f64::consts::TAU / RING as f64).sin_cos();
        [cos, sin]
    })
});

/// Area centroid of the image of a circle of `radius` about the origin.
pub(super) fn centroid(map: &impl Fn([f64; 2]) -> Option<[f64; 2]>, radius: f64) -> Option<[f64; 2]> {
    let mut ring = [[0.0; 2]; RING];
    for (p, [cos, sin]) in ring.iter_mut().zip(UNIT_RING.iter()) {
        *p = map([radius * cos, radius * sin])?;
    }
    let origin = ring[0];
    let (mut area, mut sum) = (0.0, [0.0; 2]);
    for k in 0..RING {
        let [p, q] = [ring[k], ring[(k + 1) % RING]].map(|p| [p[0] - origin[0], p[1] - origin[1]]);
        let cross = p[0] * q[1] - q[0] * p[1];
        area += cross / 2.0;
        (0..2).for_each(|a| sum[a] += (p[a] + q[a]) * cross / 6.0);
    }
    area.is_normal().then(|| [0, 1].map(|a| origin[a] + sum[a] / area))
}

fn summary(differences: &[Option<Difference>], good: &[bool], size: [usize; 2]) -> Option<InnerOuter> {
    let used: Vec<&Difference> =
        differences.iter().zip(good).filter(|(_, g)| **g).filter_map(|(d, _)| d.as_ref()).collect();
    if used.len() < 3 {
        return None;
    }
    let information = |d: &Difference| d.sigma.map(|s| (s * s + d.unsure * d.unsure).recip());
    let drift = Drift::fit(used.iter().map(|d| (d.at, d.value, information(d))), size)?;
    let explained_px = used.iter().map(|d| d.explained).sum::<f64>() / used.len() as f64;
    Some(InnerOuter { drift, explained_px, count: used.len() })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Strong perspective with barrel distortion.
    fn image([x, y]: [f64; 2]) -> [f64; 2] {
        let w = 1.0 + 0.04 * x - 0.02 * y;
        let (u, v) = ((0.05 * x + 0.003 * y) / w, (0.035 * y - 0.002 * x) / w);
        let stretch = 1.0 - 0.12 * (u * u + v * v);
        [1000.0 * u * stretch, 1000.0 * v * stretch]
    }

    const SIZE: [usize; 2] = [1000, 800];

    /// Inner centres are off by `shift`, and by `corner` along the radius in the picture's corner.
    fn seen(shift: [f64; 2], corner: f64) -> Vec<MeasuredMarker> {
        let cells = (-7..=7).flat_map(|i| (-5..=5).map(move |j| (i, j)));
        let marker = |cell: Cell| {
            let at = |d: [f64; 2]| Some(image([f64::from(cell.0) + d[0], f64::from(cell.1) + d[1]]));
            let outer_radius = if (cell.0 + cell.1) % 3 == 0 { 0.2 } else { 0.3 };
            let middle = SIZE.map(|n| (n as f64 - 1.0) / 2.0);
            let place = |p: [f64; 2]| [p[0] + middle[0], p[1] + middle[1]];
            let outer = place(centroid(&at, outer_radius).unwrap());
            let inner = place(centroid(&at, outer_radius / 2.0).unwrap());
            let field = [0, 1].map(|a| (outer[a] - middle[a]) / middle[0].hypot(middle[1]));
            let centre = [0, 1].map(|a| inner[a] + shift[a] + corner * field[a]);
            let inner = Some(Inner { radius: outer_radius / 2.0, centre, sigma: [0.003; 2] });
            MeasuredMarker { cell, outer_radius, outer, inner: inner.filter(|_| cell.0 % 2 == 0) }
        };
        cells.map(marker).collect()
    }

    #[test]
    fn perspective_and_distortion_are_explained_and_an_offset_is_not() {
        let (good, summary) = agreement(&seen([0.0; 2], 0.0), SIZE);
        let summary = summary.unwrap();
        assert!(good.iter().all(|g| *g));
        assert!(summary.drift.mean_px.iter().all(|m| m.abs() < 5e-4) && !summary.asymmetric(), "{summary:?}");
        let (good, summary) = agreement(&seen([0.012, -0.008], 0.0), SIZE);
        let summary = summary.unwrap();
        assert!(good.iter().all(|g| *g));
        assert!(summary.asymmetric() && (summary.drift.mean_px[0] - 0.012).abs() < 5e-4, "{summary:?}");
    }

    /// Image by a barrel lens from 0.08 to 0.38 m away under 50 degrees; `None` behind the view. Steps of 18 mm.
    fn close_image([i, j]: [f64; 2]) -> Option<[f64; 2]> {
        let (x, y) = (0.018 * i, 0.018 * j);
        let z = 0.2101 + 0.5439 * x + 0.5391 * y;
        let [a, b] = [0.0768 + 0.6595 * x + 0.1992 * y, 0.0307 + 0.5189 * x - 0.8183 * y].map(|v| v / z);
        let r2 = a * a + b * b;
        let stretch = 1.0 + r2 * (-0.11 + r2 * (0.09 - 0.02 * r2));
        (z > 0.07 && r2 < 0.6).then_some([831.4 * a * stretch + 479.5, 831.4 * b * stretch + 383.5])
    }

    /// What a close view over a range of scales of 4 to 1 shows in a picture of 960 x 768; large images of markers are measured better.
    fn close_view(shift: [f64; 2]) -> Vec<MeasuredMarker> {
        let marker = |cell: Cell| {
            let at = |d: [f64; 2]| close_image([f64::from(cell.0) + d[0], f64::from(cell.1) + d[1]]);
            let (middle, next) = (at([0.0; 2])?, at([1.0, 0.0])?);
            let step = (next[0] - middle[0]).hypot(next[1] - middle[1]);
            let inside = |a: usize, size: f64| middle[a] > 0.5 * step && middle[a] < size - 0.5 * step;
            let outer_radius = if (cell.0 + cell.1) % 3 == 0 { 0.2 } else { 0.3 };
            let (outer, inner) = (centroid(&at, outer_radius)?, centroid(&at, outer_radius / 2.0)?);
            let centre = [0, 1].map(|a| inner[a] + shift[a]);
            let inner = Inner { radius: outer_radius / 2.0, centre, sigma: [0.3 / step; 2] };
            let seen = MeasuredMarker { cell, outer_radius, outer, inner: (cell.0 % 2 == 0).then_some(inner) };
            (inside(0, 960.0) && inside(1, 768.0)).then_some(seen)
        };
        (-14..=14).flat_map(|i| (-9..=9).map(move |j| (i, j))).filter_map(marker).collect()
    }

    /// The nearest markers have the largest part to explain and the smallest sigma: they must not outvote the others.
    #[test]
    fn a_close_tilted_view_is_explained_and_an_offset_in_it_is_told() {
        let summary = agreement(&close_view([0.0; 2]), [960, 768]).1.unwrap();
        assert!(summary.count > 60 && summary.explained_px > 0.1, "{summary:?}");
        assert!(summary.drift.mean_px.iter().all(|m| m.abs() < 3e-3) && !summary.asymmetric(), "{summary:?}");
        let summary = agreement(&close_view([0.02, -0.012]), [960, 768]).1.unwrap();
        assert!((summary.drift.mean_px[0] - 0.02).abs() < 3e-3 && summary.asymmetric(), "{summary:?}");
    }

    #[test]
    fn coma_that_grows_towards_the_corners_is_seen_though_its_mean_vanishes() {
        let (good, summary) = agreement(&seen([0.0; 2], 0.02), SIZE);
        let summary = summary.unwrap();
        assert!(good.iter().all(|g| *g));
        assert!(summary.drift.mean_px.iter().all(|m| m.abs() < 2e-3), "{summary:?}");
        assert!((summary.drift.corner_px - 0.02).abs() < 2e-3, "{summary:?}");
    }

    #[test]
    fn one_marker_that_disagrees_is_named() {
        let mut markers = seen([0.0; 2], 0.0);
        let odd = markers.iter().position(|m| m.inner.is_some()).unwrap() + 22;
        let inner = markers[odd].inner.as_mut().unwrap();
        inner.centre[0] += 0.3;
        let (good, _) = agreement(&markers, SIZE);
        assert_eq!(good.iter().filter(|g| !**g).count(), 1);
        assert!(!good[odd]);
    }
}
