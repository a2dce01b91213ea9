//! The blurred-edge model of a disc or annulus, with its derivatives, on the pixels of a thin band.
//!
//! ```text
//! I(p)  = white(p) (1 - D) + dark(p) D            D = B_outer - B_inner
//! B     = Phi(-(d + s^2 ln(1 + kappa d) / 2 d) / s) + C    coverage by a disc, blurred by a Gaussian of sigma s
//! d     = e (1 + e b / 2), e = (rho - 1 - h) / |grad rho|  distance to the contour, h = a3 cos 3t + b3 sin 3t
//! w     = N (p + s^2 grad L / L - c),  rho = |w|, t = angle of w
//! white = l0 + gx x + gy y
//! dark  = d0 + (d0 / l0) (gx x + gy y) + dx x + dy y
//! ```
//!
//! `N` maps the ellipse to the unit circle. In that frame an affine map of a disc is round, and what lens distortion
//! and perspective add to second order is a third harmonic; with it as a parameter, `c` is the area centroid of the
//! contour's image: the integral of `rho^3 (cos t, sin t)` over `rho = 1 + h` vanishes. The first harmonic of a real
//! contour is a shift, the second belongs to `N`. `b` is the second derivative of `rho` along the normal over the first,
//! which makes `d` right to second order. The term with `kappa`, the curvature of the contour, is the displacement of a
//! blurred curved edge: blur diffuses the distance, whose Laplacian is the curvature of the parallel contour, here in the
//! mean along the normal. `C` is what is missing to the exact coverage ([`super::exact`]) where the radius of
//! curvature is not large against the blur; it is taken at a state close to the last. The term `s^2 grad L / L` is what blur does to an edge in light with a
//! gradient: it moves every edge towards the light.

use super::exact::{Contour, MOMENTS, Nodes};
use super::flat_zone::Flat;
use super::gauss::{LANES, normal_tail};
use super::solved::Solved;
use super::state::{ANNULUS, CENTRE, INNER, LN_BLUR, LN_RATIO, SHAPE, State, THIRD, WHITE};
use crate::linalg::wide;

/// Distance from an edge, in units of the blur, beyond which a pixel sees nothing of its shape.
const FAR: f32 = 4.2;

/// Pixels of a band, relative to the anchor, and the work arrays of the model.
#[derive(Debug, Default)]
pub struct Pixels {
    pub x: Vec<f32>,
    pub y: Vec<f32>,
    pub value: Vec<f32>,
    /// 1 for a pixel, 0 for padding.
    pub mask: Vec<f32>,
    pub count: usize,
    outer: EdgeTerms,
    inner: EdgeTerms,
    /// Coverage by ink of every pixel at the last evaluation.
    pub ink: Vec<f32>,
    /// Residual of every pixel, counts (unweighted).
    pub residual: Vec<f32>,
    /// Weighted residuals.
    pub weighted: Vec<f32>,
    /// Columns of the weighted Jacobian.
    columns: Vec<Vec<f32>>,
    /// Whatever is summed up last: the weighted residuals that a lopsidedness along either axis leaves, or those off the edge.
    pub work: [Vec<f32>; 2],
    pub nodes: Nodes,
    /// Even paper and ink beyond the band.
    pub flat: Flat,
    /// The last fit that ended on them.
    pub solved: Option<Solved>,
}

/// What lopsided edges leave in the residuals, along both axes ([`Pixels::skew`]).
pub struct Lopsided {
    pub gradient: [f64; 2],
    pub square: [f64; 2],
    pub shared: [[f64; ANNULUS]; 2],
}

/// Per pixel: coverage, density of the blurred edge, and the geometry behind it.
#[derive(Debug, Default)]
struct EdgeTerms {
    coverage: Vec<f32>,
    density: Vec<f32>,
    /// `1 / |grad rho|`.
    scale: Vec<f32>,
    rho: Vec<f32>,
    cos: Vec<f32>,
    sin: Vec<f32>,
    normal_x: Vec<f32>,
    normal_y: Vec<f32>,
    /// Distance to the edge in units of the blur.
    argument: Vec<f32>,
    /// Derivative of the argument by ln blur.
    widen: Vec<f32>,
    /// Exact coverage less that of the closed form, where the contour is strongly curved.
    missing: Vec<f32>,
    /// Exact derivatives of the coverage by the parameters of a contour, where it is strongly curved.
    exact: Vec<Vec<f32>>,
}

impl EdgeTerms {
    /// No edge: covers nothing.
    fn clear(&mut self) {
        let Self { coverage, density, argument, normal_x, normal_y, .. } = self;
        [coverage, density, argument, normal_x, normal_y].into_iter().for_each(|v| v.fill(0.0));
    }

    fn resize(&mut self, n: usize) {
        let EdgeTerms { coverage, density, scale, rho, cos, sin, normal_x, normal_y, argument, widen, missing, exact } =
            self;
        missing.clear();
        exact.clear();
        for v in [coverage, density, scale, rho, cos, sin, normal_x, normal_y, argument, widen, missing] {
            v.resize(n, 0.0);
        }
    }
}

impl Pixels {
    pub fn clear(&mut self) {
        self.x.clear();
        self.y.clear();
        self.value.clear();
        self.count = 0;
        self.solved = None;
    }

    /// Adds neighbouring pixels of a row, the first of them at `x`.
    pub fn push_row(&mut self, x: f32, y: f32, values: &[f32]) {
        self.x.extend((0..values.len()).map(|k| x + k as f32));
        self.y.resize(self.x.len(), y);
        self.value.extend_from_slice(values);
    }

    /// Column and row of every pixel; they are whole numbers.
    pub fn places(&self) -> Vec<[i32; 2]> {
        self.x.iter().zip(&self.y).take(self.count).map(|(x, y)| [*x as i32, *y as i32]).collect()
    }

    /// Weighted derivatives of the pixels by a parameter.
    pub fn column(&self, parameter: usize) -> Vec<f64> {
        self.columns[parameter][..self.count].iter().map(|v| f64::from(*v)).collect()
    }

    /// The same by several parameters, summed up by these weights.
    pub fn combination(&self, weights: &[f64]) -> Vec<f32> {
        let mut sum = vec![0.0; self.x.len()];
        wide(
            #[inline(always)]
            || {
                for (column, weight) in self.columns.iter().zip(weights) {
                    let weight = *weight as f32;
                    sum.iter_mut().zip(column).for_each(|(s, v)| *s += weight * v);
                }
            },
        );
        sum
    }

    /// Keeps the first `count` pixels.
    pub fn truncate(&mut self, count: usize) {
        for v in [&mut self.x, &mut self.y, &mut self.value] {
            v.truncate(count);
        }
        self.finish();
    }

    /// Pads to whole lanes; call once after the last row.
    pub fn finish(&mut self) {
        self.count = self.x.len();
        let n = self.count.next_multiple_of(LANES);
        self.x.resize(n, 0.0);
        self.y.resize(n, 0.0);
        self.value.resize(n, 0.0);
        self.mask.clear();
        self.mask.resize(self.count, 1.0);
        self.mask.resize(n, 0.0);
        self.ink.resize(n, 0.0);
        self.residual.resize(n, 0.0);
        self.weighted.resize(n, 0.0);
        self.columns.resize_with(ANNULUS, Vec::new);
        self.columns.iter_mut().chain(&mut self.work).for_each(|c| c.resize(n, 0.0));
        self.outer.resize(n);
        self.inner.resize(n);
    }

    /// Evaluates residuals and Jacobian at a state; `noise` are the variances of a pixel on paper and on ink.
    pub fn evaluate(&mut self, state: &State, noise: [f64; 2]) {
        self.outer.evaluate(&Geometry::of(&state.outer_contour()), &self.x, &self.y);
        if let Some(inner) = state.inner_contour() {
            self.inner.evaluate(&Geometry::of(&inner), &self.x, &self.y);
        } else {
            self.inner.clear();
        }
        wide(
            #[inline(always)]
            || {
                self.levels(state, noise);
                self.shape_columns(state);
            },
        );
    }

    /// Takes what the closed form misses to the exact coverage from this state on; false where it misses nothing.
    pub fn correct(&mut self, state: &State) -> bool {
        let Self { outer, inner, x, y, nodes, .. } = self;
        let of_outer = outer.correct(&state.outer_contour(), x, y, nodes);
        let of_inner = state.inner_contour().is_some_and(|contour| inner.correct(&contour, x, y, nodes));
        of_outer || of_inner
    }

    /// Residuals and the columns of the levels; leaves weighted densities in the edge terms.
    #[inline(always)]
    fn levels(&mut self, state: &State, noise: [f64; 2]) {
        let n = self.x.len();
        let [l0, gx, gy] = state.white.map(|v| v as f32);
        let [d0, dx, dy] = state.dark.map(|v| v as f32);
        let tie = state.tie() as f32;
        let (v_white, v_dark) = (noise[0] as f32, noise[1] as f32);
        let (x, y, value, mask) = (&self.x[..n], &self.y[..n], &self.value[..n], &self.mask[..n]);
        let (bo, bi) = (&self.outer.coverage[..n], &self.inner.coverage[..n]);
        let (qo, qi) = (&mut self.outer.density[..n], &mut self.inner.density[..n]);
        let (ink, residual, weighted) = (&mut self.ink[..n], &mut self.residual[..n], &mut self.weighted[..n]);
        let [c0, c1, c2, c3, c4, c5] = &mut self.columns[WHITE..WHITE + 6] else { return };
        let (c0, c1, c2) = (&mut c0[..n], &mut c1[..n], &mut c2[..n]);
        let (c3, c4, c5) = (&mut c3[..n], &mut c4[..n], &mut c5[..n]);
        for i in 0..n {
            let d = bo[i] - bi[i];
            let slope = gx * x[i] + gy * y[i];
            let white = l0 + slope;
            let dark = d0 + tie * slope + dx * x[i] + dy * y[i];
            let contrast = white - dark;
            let r = (value[i] - (white - contrast * d)) * mask[i];
            let root = mask[i] / (v_white + (v_dark - v_white) * d).max(0.1 * v_dark).sqrt();
            ink[i] = d;
            residual[i] = r;
            weighted[i] = r * root;
            qo[i] *= contrast * root;
            qi[i] *= -contrast * root;
            let (light, shade) = ((1.0 - d) * root, d * root);
            c0[i] = light;
            let both = light + tie * shade;
            c1[i] = both * x[i];
            c2[i] = both * y[i];
            c3[i] = shade;
            c4[i] = shade * x[i];
            c5[i] = shade * y[i];
        }
    }

    #[inline(always)]
    fn shape_columns(&mut self, state: &State) {
        let n = self.x.len();
        let ratio = state.inner.map_or(0.0, |(_, k)| k as f32);
        let third = [1.0, ratio];
        for (edge, terms) in [&self.outer, &self.inner].into_iter().enumerate() {
            if edge == 1 && state.inner.is_none() {
                break;
            }
            let first = edge == 0;
            if !terms.exact.is_empty() {
                exact_columns(terms, &mut self.columns, first, third[edge]);
                continue;
            }
            let (q, g, rho) = (&terms.density[..n], &terms.scale[..n], &terms.rho[..n]);
            let (c, s, widen) = (&terms.cos[..n], &terms.sin[..n], &terms.widen[..n]);
            let [_, _, e0, ec, es, a3, b3, ls, ..] = &mut self.columns[..] else { return };
            let (e0, ec, es, ls) = (&mut e0[..n], &mut ec[..n], &mut es[..n], &mut ls[..n]);
            let (a3, b3) = (&mut a3[..n], &mut b3[..n]);
            let keep = if first { 0.0 } else { 1.0 };
            let h = third[edge];
            for i in 0..n {
                let size = q[i] * g[i];
                let radial = size * rho[i];
                let (c2, s2) = (c[i] * c[i] - s[i] * s[i], 2.0 * c[i] * s[i]);
                let (c3, s3) = (c[i] * c2 - s[i] * s2, s[i] * c2 + c[i] * s2);
                e0[i] = keep * e0[i] + radial;
                ec[i] = keep * ec[i] + radial * c2;
                es[i] = keep * es[i] + radial * s2;
                a3[i] = keep * a3[i] - h * size * c3;
                b3[i] = keep * b3[i] - h * size * s3;
                ls[i] = keep * ls[i] + q[i] * widen[i];
            }
            let base = if first { CENTRE } else { INNER };
            let (px, py) = (&terms.normal_x[..n], &terms.normal_y[..n]);
            for (axis, p) in [px, py].into_iter().enumerate() {
                let column = &mut self.columns[base + axis][..n];
                for i in 0..n {
                    column[i] = -q[i] * p[i];
                }
            }
            if !first {
                let column = &mut self.columns[LN_RATIO][..n];
                for i in 0..n {
                    column[i] = -q[i] * g[i] * rho[i];
                }
            }
        }
    }

    /// What the edges' lopsidedness says about the displacement of the centre, and the information on it (1/px^2).
    ///
    /// A point spread with the third cumulant `k` along the normal adds `k / (6 s^3) (u^2 - 1) phi(u)` to the coverage.
    /// The fit takes the part along `phi` for a displacement `-k / (12 s^2)`; the part with `u^2 - 1/2` stays in the
    /// residuals and tells its size. Returns the gradient `L' r` of the two amplitudes, `L' L`, and `J' L` with the columns `J` of all
    /// parameters: they take a part of `L` for themselves.
    pub fn skew(&mut self, state: &State, noise: [f64; 2]) -> Lopsided {
        wide(
            #[inline(always)]
            || self.skew_lanes(state, noise),
        )
    }

    #[inline(always)]
    fn skew_lanes(&mut self, state: &State, noise: [f64; 2]) -> Lopsided {
        let n = self.x.len();
        let (v_white, v_dark) = (noise[0] as f32, noise[1] as f32);
        let factor = ((state.white[0] - state.dark[0]) * 2.0 / state.blur) as f32;
        let inner = if state.inner.is_some() { -factor } else { 0.0 };
        let (ink, mask) = (&self.ink[..n], &self.mask[..n]);
        let (outer, inner) = (self.outer.lobes(n, factor), self.inner.lobes(n, inner));
        let [along_x, along_y] = &mut self.work;
        let (along_x, along_y) = (&mut along_x[..n], &mut along_y[..n]);
        for i in 0..n {
            let root = mask[i] / (v_white + (v_dark - v_white) * ink[i]).max(0.1 * v_dark).sqrt();
            let ([ox, oy], [ix, iy]) = (outer(i), inner(i));
            along_x[i] = root * (ox + ix);
            along_y[i] = root * (oy + iy);
        }
        let along = [&*along_x, &*along_y];
        let shared = |c: &[f32]| {
            let mut products = [0.0; ANNULUS];
            let used = products.iter_mut().zip(&self.columns).take(state.parameters());
            used.for_each(|(p, column)| *p = dot(c, column));
            products
        };
        Lopsided {
            gradient: along.map(|c| dot(c, &self.weighted)),
            square: along.map(|c| dot(c, c)),
            shared: along.map(shared),
        }
    }

    /// Normal matrix (lower triangle) of `parameters` columns, by blocks of pixels that stay in the nearest cache.
    pub fn normal(&self, parameters: usize, out: &mut [[f64; ANNULUS]; ANNULUS]) {
        wide(
            #[inline(always)]
            || self.normal_lanes(parameters, out),
        );
    }

    #[inline(always)]
    fn normal_lanes(&self, parameters: usize, out: &mut [[f64; ANNULUS]; ANNULUS]) {
        const BLOCK: usize = 64 * LANES;
        out.iter_mut().for_each(|row| row.fill(0.0));
        let n = self.x.len();
        for from in (0..n).step_by(BLOCK) {
            let to = (from + BLOCK).min(n);
            for (i, row) in out.iter_mut().enumerate().take(parameters) {
                let column = &self.columns[i][from..to];
                for (v, other) in row.iter_mut().zip(&self.columns[..=i]) {
                    *v += dot(column, &other[from..to]);
                }
            }
        }
    }

    /// Gradient of the parameters.
    pub fn gradient(&self, parameters: usize, out: &mut [f64; ANNULUS]) {
        wide(
            #[inline(always)]
            || {
                for (g, column) in out.iter_mut().zip(&self.columns).take(parameters) {
                    *g = dot(column, &self.weighted);
                }
            },
        );
    }
}

/// Columns of an edge from its exact derivatives; those that both edges share are added to for the inner one.
fn exact_columns(terms: &EdgeTerms, columns: &mut [Vec<f32>], first: bool, third: f32) {
    let base = if first { CENTRE } else { INNER };
    let places = [base, base + 1, SHAPE, SHAPE + 1, SHAPE + 2, THIRD, THIRD + 1, LN_BLUR];
    let q = &terms.density;
    for (k, place) in places.into_iter().enumerate() {
        let own = first || k < 2;
        let factor = if place == THIRD || place == THIRD + 1 { -third } else { -1.0 };
        let pairs = terms.exact[k].iter().zip(q);
        let column = columns[place].iter_mut().zip(pairs);
        if own {
            column.for_each(|(c, (e, q))| *c = factor * q * e);
        } else {
            column.for_each(|(c, (e, q))| *c += factor * q * e);
        }
    }
    if !first {
        let pairs = terms.exact[2].iter().zip(q);
        columns[LN_RATIO].iter_mut().zip(pairs).for_each(|(c, (e, q))| *c = q * e);
    }
}

/// Product of two columns, whose length is a multiple of the lanes.
#[inline(always)]
pub fn dot(a: &[f32], b: &[f32]) -> f64 {
    const WIDE: usize = 4 * LANES;
    let mut sums = [0.0f32; WIDE];
    let whole = a.len() / WIDE * WIDE;
    for (p, q) in a[..whole].chunks_exact(WIDE).zip(b[..whole].chunks_exact(WIDE)) {
        for k in 0..WIDE {
            sums[k] += p[k] * q[k];
        }
    }
    for (p, q) in a[whole..].chunks_exact(LANES).zip(b[whole..].chunks_exact(LANES)) {
        for k in 0..LANES {
            sums[k] += p[k] * q[k];
        }
    }
    let mut total = 0.0;
    for k in 0..LANES {
        total += f64::from((sums[k] + sums[k + 2 * LANES]) + (sums[k + LANES] + sums[k + 3 * LANES]));
    }
    total
}

/// One contour in single precision.
struct Geometry {
    centre: [f32; 2],
    to_unit: [f32; 4],
    third: [f32; 2],
    blur: f32,
    determinant2: f32,
}

impl Geometry {
    fn of(contour: &Contour) -> Self {
        let n = contour.to_unit;
        let determinant = n[0][0] * n[1][1] - n[0][1] * n[1][0];
        Self {
            centre: contour.centre.map(|v| v as f32),
            to_unit: [n[0][0], n[0][1], n[1][0], n[1][1]].map(|v| v as f32),
            third: contour.third.map(|v| v as f32),
            blur: contour.blur as f32,
            determinant2: (determinant * determinant) as f32,
        }
    }
}

impl EdgeTerms {
    /// What a displacement by lopsidedness leaves in a pixel beside a plain one, along both axes.
    #[inline(always)]
    fn lobes(&self, n: usize, factor: f32) -> impl Fn(usize) -> [f32; 2] {
        let (argument, normal_x, normal_y) = (&self.argument[..n], &self.normal_x[..n], &self.normal_y[..n]);
        #[inline(always)]
        move |i| {
            let u = argument[i];
            let lobe = factor * (u * u - 0.5) * normal_tail(u).1;
            [lobe * normal_x[i], lobe * normal_y[i]]
        }
    }

    fn correct(&mut self, contour: &Contour, x: &[f32], y: &[f32], nodes: &mut Nodes) -> bool {
        let had = !self.exact.is_empty();
        self.missing.fill(0.0);
        self.exact.clear();
        if !contour.is_strongly_curved() {
            return had;
        }
        self.evaluate(&Geometry::of(contour), x, y);
        self.exact.resize_with(MOMENTS, || vec![0.0; x.len()]);
        // far from the edge there is nothing to be missed
        let near = self.argument.chunks_exact(LANES).map(|c| c.iter().any(|u| u.abs() < FAR));
        let near: Vec<bool> = near.collect();
        contour.coverage(x, y, &near, nodes, &mut self.missing, &mut self.exact);
        let blocks = self.missing.chunks_exact_mut(LANES).zip(self.coverage.chunks_exact(LANES));
        for ((missing, closed), near) in blocks.zip(near) {
            missing.iter_mut().zip(closed).for_each(|(m, c)| *m = if near { *m - c } else { 0.0 });
        }
        true
    }

    fn evaluate(&mut self, geometry: &Geometry, x: &[f32], y: &[f32]) {
        wide(
            #[inline(always)]
            || self.evaluate_lanes(geometry, x, y),
        );
    }

    #[inline(always)]
    fn evaluate_lanes(&mut self, geometry: &Geometry, x: &[f32], y: &[f32]) {
        let n = x.len();
        let y = &y[..n];
        let Self { coverage, density, scale, rho, cos, sin, normal_x, normal_y, argument, widen, missing, exact } =
            self;
        let (missing, is_exact) = (&missing[..n], !exact.is_empty());
        let (coverage, density, scale) = (&mut coverage[..n], &mut density[..n], &mut scale[..n]);
        let (rho, cos, sin) = (&mut rho[..n], &mut cos[..n], &mut sin[..n]);
        let (normal_x, normal_y, widen) = (&mut normal_x[..n], &mut normal_y[..n], &mut widen[..n]);
        let argument = &mut argument[..n];
        let [n00, n01, n10, n11] = geometry.to_unit;
        let [cx, cy] = geometry.centre;
        let [a3, b3] = geometry.third;
        let (blur, inverse_blur) = (geometry.blur, 1.0 / geometry.blur);
        let half_s2 = 0.5 * blur * blur;
        for i in 0..n {
            let (px, py) = (x[i] - cx, y[i] - cy);
            let (wx, wy) = (n00 * px + n01 * py, n10 * px + n11 * py);
            let r = (wx * wx + wy * wy).sqrt().max(1e-4);
            let inverse = 1.0 / r;
            let (c, s) = (wx * inverse, wy * inverse);
            let (gx, gy) = (n00 * c + n10 * s, n01 * c + n11 * s);
            let g = 1.0 / (gx * gx + gy * gy).sqrt();
            let (c2, s2) = (c * c - s * s, 2.0 * c * s);
            let h = a3 * (c * c2 - s * s2) + b3 * (s * c2 + c * s2);
            let first = (r - 1.0 - h) * g;
            let g3 = g * g * g;
            let (tx, ty) = (n10 * c - n00 * s, n11 * c - n01 * s);
            let across = gx * tx + gy * ty;
            let bend = 0.5 * g3 * across * across * inverse;
            let d = first * (1.0 + (bend * first).clamp(-0.5, 0.5));
            // curvature of the contour at the foot of the pixel, and ln(1 + x) / x in Pade's form
            let kappa = (geometry.determinant2 * g3).min(inverse_blur);
            let bow = (kappa * d).max(-0.7);
            let lift = kappa * half_s2 * (6.0 + bow) / (6.0 + 4.0 * bow);
            let u = ((d + lift) * inverse_blur).clamp(-8.0, 8.0);
            let (tail, phi) = normal_tail(u);
            coverage[i] = tail + missing[i];
            density[i] = if is_exact { 1.0 } else { phi * inverse_blur };
            scale[i] = g;
            rho[i] = r;
            cos[i] = c;
            sin[i] = s;
            normal_x[i] = gx * g;
            normal_y[i] = gy * g;
            argument[i] = u;
            widen[i] = lift - d;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn example(annulus: bool) -> State {
        State {
            centre: [0.3, -0.2],
            to_unit: [[0.11, 0.02], [0.02, 0.17]],
            third: [0.01, -0.006],
            blur: 0.9,
            white: [200.0, 0.0, 0.0],
            dark: [30.0, 0.05, -0.02],
            inner: annulus.then_some(([0.25, -0.15], 0.5)),
        }
    }

    /// Columns of a strongly curved contour are exact but for the shift by the gradient of the light and, by twice its
    /// size (1.2 %), the third harmonic.
    #[test]
    fn the_jacobian_agrees_with_differences() {
        for annulus in [false, true] {
            let state = example(annulus);
            let mut pixels = Pixels::default();
            (-12..=12).for_each(|y| pixels.push_row(-14.0, y as f32, &[100.0; 29]));
            pixels.finish();
            let noise = [1.0, 1.0];
            pixels.correct(&state);
            pixels.evaluate(&state, noise);
            let columns = pixels.columns.clone();
            for p in 0..state.parameters() {
                let h = if (SHAPE..=LN_BLUR).contains(&p) || p == LN_RATIO { 1e-3 } else { 1e-2 };
                let mut side = |sign: f64| {
                    let mut delta = [0.0; ANNULUS];
                    delta[p] = sign * h;
                    let mut moved = state;
                    moved.step(&delta);
                    pixels.correct(&moved);
                    pixels.evaluate(&moved, noise);
                    pixels.residual.clone()
                };
                let (plus, minus) = (side(1.0), side(-1.0));
                let norm: f64 = columns[p].iter().map(|v| f64::from(*v).powi(2)).sum::<f64>().sqrt();
                let off: f64 = (0..pixels.count)
                    .map(|i| (f64::from(minus[i] - plus[i]) / (2.0 * h) - f64::from(columns[p][i])).powi(2))
                    .sum::<f64>()
                    .sqrt();
                let tolerance = if (WHITE..INNER).contains(&p) { 0.08 } else { 0.03 };
                assert!(off < tolerance * norm, "parameter {p} annulus {annulus}: {off} of {norm}");
            }
        }
    }
}
