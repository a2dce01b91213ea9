//! Even paper and even ink near a marker, beyond the band around its edges.
//!
//! Blur does not reach these pixels: they say nothing about the contour, but they hold the level and the gradient of the
//! light, and it is the uncertainty of the gradient that costs most of the precision of a centre (a gradient and a shift
//! look alike along an edge). They enter the normal equations as sums that are taken once.

use super::state::{ANNULUS, DARK, State, WHITE};

/// Sums over the pixels of a zone; `x`, `y` relative to the anchor, values relative to `reference`.
#[derive(Debug, Clone, Copy, Default)]
pub struct Zone {
    reference: f64,
    pub count: f64,
    x: f64,
    y: f64,
    xx: f64,
    xy: f64,
    yy: f64,
    v: f64,
    xv: f64,
    yv: f64,
    vv: f64,
}

/// Sums of the residuals times (1, x, y), and of their squares.
struct Residuals {
    by_term: [f64; 3],
    square: f64,
}

impl Zone {
    pub fn around(reference: f64) -> Self {
        Self { reference, ..Self::default() }
    }

    /// Adds neighbouring pixels of a row, the first of them at `x`.
    pub fn push_row(&mut self, x: f64, y: f64, values: &[f32]) {
        let n = values.len() as f64;
        let (mut v, mut kv, mut vv) = (0.0, 0.0, 0.0);
        for (k, value) in values.iter().enumerate() {
            let value = f64::from(*value) - self.reference;
            v += value;
            kv += k as f64 * value;
            vv += value * value;
        }
        // sums of k and k^2 over 0 .. n - 1
        let (k, kk) = (0.5 * n * (n - 1.0), n * (n - 1.0) * (2.0 * n - 1.0) / 6.0);
        let sum_x = n * x + k;
        self.count += n;
        self.x += sum_x;
        self.y += n * y;
        self.xx += x * (sum_x + k) + kk;
        self.xy += sum_x * y;
        self.yy += n * y * y;
        self.v += v;
        self.xv += x * v + kv;
        self.yv += y * v;
        self.vv += vv;
    }

    fn moments(&self) -> [[f64; 3]; 3] {
        [[self.count, self.x, self.y], [self.x, self.xx, self.xy], [self.y, self.xy, self.yy]]
    }

    fn residuals(&self, [level, gx, gy]: [f64; 3]) -> Residuals {
        let model = [level - self.reference, gx, gy];
        let m = self.moments();
        let seen = [self.v, self.xv, self.yv];
        let by_term = [0, 1, 2].map(|i| seen[i] - (0..3).map(|j| m[i][j] * model[j]).sum::<f64>());
        // sum r^2 = sum v r - model . sum r terms
        let cross: f64 = (0..3).map(|j| model[j] * seen[j]).sum();
        let square = self.vv - cross - (0..3).map(|i| model[i] * by_term[i]).sum::<f64>();
        Residuals { by_term, square: square.max(0.0) }
    }
}

/// The paper and the ink around the edges of one marker.
#[derive(Debug, Clone, Copy, Default)]
pub struct Flat {
    pub paper: Zone,
    pub ink: Zone,
}

impl Flat {
    /// Adds to the lower triangle of the normal matrix; `noise`: variances of a pixel on paper and on ink.
    pub fn add_normal(&self, state: &State, noise: [f64; 2], out: &mut [[f64; ANNULUS]; ANNULUS]) {
        let (paper, ink) = (self.paper.moments(), self.ink.moments());
        let tie = state.tie();
        for i in 0..3 {
            for j in 0..=i {
                out[WHITE + i][WHITE + j] += paper[i][j] / noise[0];
                out[DARK + i][DARK + j] += ink[i][j] / noise[1];
                if j > 0 {
                    out[WHITE + i][WHITE + j] += tie * tie * ink[i][j] / noise[1];
                }
            }
            for j in 1..3 {
                out[DARK + i][WHITE + j] += tie * ink[i][j] / noise[1];
            }
        }
    }

    /// Adds to the gradient of the parameters.
    pub fn add_gradient(&self, state: &State, noise: [f64; 2], out: &mut [f64; ANNULUS]) {
        let (paper, ink) = self.residuals(state);
        let tie = state.tie();
        for i in 0..3 {
            out[WHITE + i] += paper.by_term[i] / noise[0];
            out[DARK + i] += ink.by_term[i] / noise[1];
            if i > 0 {
                out[WHITE + i] += tie * ink.by_term[i] / noise[1];
            }
        }
    }

    /// Sums of squared residuals on paper and on ink.
    pub fn squares(&self, state: &State) -> [f64; 2] {
        let (paper, ink) = self.residuals(state);
        [paper.square, ink.square]
    }

    fn residuals(&self, state: &State) -> (Residuals, Residuals) {
        let [_, gx, gy] = state.white;
        let [d0, dx, dy] = state.dark;
        let tie = state.tie();
        (self.paper.residuals(state.white), self.ink.residuals([d0, tie * gx + dx, tie * gy + dy]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sums_give_the_residuals_of_every_pixel() {
        let mut zone = Zone::around(200.0);
        let pixels: Vec<(f64, f64, f32)> =
            (0..42).map(|k| (f64::from(k % 7) - 3.0, f64::from(k / 7), 195.0 + (k * k % 11) as f32)).collect();
        for row in pixels.chunks(7) {
            zone.push_row(row[0].0, row[0].1, &[0, 1, 2, 3, 4, 5, 6].map(|k| row[k].2));
        }
        let level = [198.0, 0.3, -0.2];
        let sums = zone.residuals(level);
        let one = |&(x, y, v): &(f64, f64, f32)| f64::from(v) - (level[0] + level[1] * x + level[2] * y);
        let square: f64 = pixels.iter().map(|p| one(p).powi(2)).sum();
        let along: f64 = pixels.iter().map(|p| one(p) * p.0).sum();
        assert!((sums.square - square).abs() < 1e-9 * square && (sums.by_term[1] - along).abs() < 1e-8);
        let squares: f64 = pixels.iter().map(|p| p.0 * p.0).sum();
        assert!((zone.moments()[1][1] - squares).abs() < 1e-9);
    }
}
