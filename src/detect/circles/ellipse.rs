//! Ellipses in the image, and the direct fit of one to the points of a contour.

/// An ellipse in the image: all `p` with `(p - centre)' Q (p - centre) = 1`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ellipse {
    /// Centre (column, row), px.
    pub centre: [f64; 2],
    /// Upper triangle (xx, xy, yy) of the symmetric positive matrix `Q`, 1/px^2.
    pub shape: [f64; 3],
}

impl Ellipse {
    /// The ellipse that a unit circle becomes under `p = centre + axes * (cos t, sin t)`, with `axes` in rows.
    pub fn from_axes(centre: [f64; 2], axes: [[f64; 2]; 2]) -> Option<Self> {
        let det = axes[0][0] * axes[1][1] - axes[0][1] * axes[1][0];
        if !det.is_normal() {
            return None;
        }
        // Q = inverse(A A')
        let d2 = det * det;
        let xx = axes[0][0].powi(2) + axes[0][1].powi(2);
        let xy = axes[0][0] * axes[1][0] + axes[0][1] * axes[1][1];
        let yy = axes[1][0].powi(2) + axes[1][1].powi(2);
        Some(Self { centre, shape: [yy / d2, -xy / d2, xx / d2] })
    }

    /// Semi-axes, longer first, px.
    pub fn semi_axes(&self) -> [f64; 2] {
        let [xx, xy, yy] = self.shape;
        let mean = 0.5 * (xx + yy);
        let split = (0.25 * (xx - yy).powi(2) + xy * xy).sqrt();
        [1.0 / (mean - split).max(f64::MIN_POSITIVE).sqrt(), 1.0 / (mean + split).sqrt()]
    }

    /// Geometric mean of the semi-axes, px.
    pub fn mean_radius(&self) -> f64 {
        1.0 / self.determinant().sqrt().sqrt()
    }

    /// Determinant of `Q`.
    pub fn determinant(&self) -> f64 {
        self.shape[0] * self.shape[2] - self.shape[1] * self.shape[1]
    }

    /// The ellipse in a picture whose columns run the other way, from the one at `last` px.
    pub fn mirrored(&self, last: f64) -> Self {
        let [xx, xy, yy] = self.shape;
        Self { centre: [last - self.centre[0], self.centre[1]], shape: [xx, -xy, yy] }
    }

    /// Symmetric square root of `Q`: maps offsets from the centre to the unit circle.
    pub fn normaliser(&self) -> [[f64; 2]; 2] {
        let [xx, xy, yy] = self.shape;
        let root = self.determinant().max(0.0).sqrt();
        let scale = 1.0 / (xx + yy + 2.0 * root).sqrt();
        [[(xx + root) * scale, xy * scale], [xy * scale, (yy + root) * scale]]
    }

    /// Radius of `point` in the frame where the ellipse is the unit circle.
    pub fn relative_radius(&self, point: [f64; 2]) -> f64 {
        let (x, y) = (point[0] - self.centre[0], point[1] - self.centre[1]);
        (self.shape[0] * x * x + 2.0 * self.shape[1] * x * y + self.shape[2] * y * y).max(0.0).sqrt()
    }

    /// Point of the ellipse at parameter `t` (of the unit circle of [`Self::normaliser`]).
    pub fn point(&self, t: f64, relative_radius: f64) -> [f64; 2] {
        let n = self.normaliser();
        let det = n[0][0] * n[1][1] - n[0][1] * n[1][0];
        let (s, c) = t.sin_cos();
        let (s, c) = (s * relative_radius, c * relative_radius);
        [self.centre[0] + (n[1][1] * c - n[0][1] * s) / det, self.centre[1] + (n[0][0] * s - n[1][0] * c) / det]
    }

    /// What lies at least between this ellipse and one of the same shape, `size` times as large, around another centre, px;
    /// negative where they overlap.
    ///
    /// The sum of the two is the ellipse scaled by `1 + size`; the relative radius is a convex function, so that its
    /// value over its slope at the other centre is no more than the distance.
    pub fn gap(&self, centre: [f64; 2], size: f64) -> f64 {
        let [x, y] = [0, 1].map(|a| centre[a] - self.centre[a]);
        let [xx, xy, yy] = self.shape;
        let slope = [xx * x + xy * y, xy * x + yy * y];
        let relative = (slope[0] * x + slope[1] * y).max(0.0).sqrt();
        (relative - 1.0 - size) * relative / slope[0].hypot(slope[1]).max(f64::MIN_POSITIVE)
    }

    /// Half width and half height of the bounding box, px.
    pub fn half_extent(&self) -> [f64; 2] {
        let det = self.determinant();
        [(self.shape[2] / det).sqrt(), (self.shape[0] / det).sqrt()]
    }

    /// The ellipse with both semi-axes longer by `by` px; `None` when nothing is left.
    pub fn offset(&self, by: f64) -> Option<Self> {
        let [major, minor] = self.semi_axes();
        if minor + by <= 0.0 {
            return None;
        }
        let [xx, xy, yy] = self.shape;
        // eigenvalues of Q: low belongs to the major axis
        let (low, high) = (1.0 / (major * major), 1.0 / (minor * minor));
        let (new_low, new_high) = (1.0 / (major + by).powi(2), 1.0 / (minor + by).powi(2));
        let shape = if high - low < 1e-9 * high {
            [new_high, 0.0, new_high]
        } else {
            let slope = (new_high - new_low) / (high - low);
            [new_low + slope * (xx - low), slope * xy, new_low + slope * (yy - low)]
        };
        Some(Self { shape, ..*self })
    }

    /// First and last column of the ellipse in a row.
    pub fn chord(&self, row: f64) -> Option<(f64, f64)> {
        let [xx, xy, yy] = self.shape;
        let y = row - self.centre[1];
        let root = (xy * xy - xx * yy) * y * y + xx;
        if root < 0.0 {
            return None;
        }
        let (middle, half) = (self.centre[0] - xy * y / xx, root.sqrt() / xx);
        Some((middle - half, middle + half))
    }

    /// Signed distance of a point to the curve to first order (positive outside), px.
    pub fn distance(&self, point: [f64; 2]) -> f64 {
        let (x, y) = (point[0] - self.centre[0], point[1] - self.centre[1]);
        let g = [self.shape[0] * x + self.shape[1] * y, self.shape[1] * x + self.shape[2] * y];
        let q = g[0] * x + g[1] * y;
        let slope = (g[0] * g[0] + g[1] * g[1]).sqrt();
        if slope > 0.0 { (q - q.max(0.0).sqrt()) / slope } else { -self.mean_radius() }
    }

    /// Ellipse through the points in the sense of least algebraic distance with `4ac - b^2 = 1`.
    ///
    /// Method: R. Halir and J. Flusser, "Numerically stable direct least squares fitting of ellipses" (1998): the
    /// quadratic and the linear part of the design matrix are separated, which leaves a 3x3 eigenproblem. The points
    /// are first moved to their mean and scaled. `None` when they determine no ellipse.
    pub fn fit(points: &[[f32; 2]]) -> Option<Self> {
        if points.len() < 6 {
            return None;
        }
        let count = points.len() as f64;
        let (mx, my) = points.iter().fold((0.0, 0.0), |(x, y), p| (x + f64::from(p[0]), y + f64::from(p[1])));
        let (mx, my) = (mx / count, my / count);
        let spread =
            points.iter().map(|p| (f64::from(p[0]) - mx).powi(2) + (f64::from(p[1]) - my).powi(2)).sum::<f64>();
        let scale = (2.0 * count / spread).sqrt();
        if !scale.is_finite() {
            return None;
        }
        let mut moments = [[0.0f64; 5]; 5]; // moments[i][j] = mean of x^i y^j
        for p in points {
            let (x, y) = ((f64::from(p[0]) - mx) * scale, (f64::from(p[1]) - my) * scale);
            let mut xi = 1.0;
            for (i, row) in moments.iter_mut().enumerate() {
                let mut v = xi;
                for m in row.iter_mut().take(5 - i) {
                    *m += v;
                    v *= y;
                }
                xi *= x;
            }
        }
        let m = |i: usize, j: usize| moments[i][j] / count;
        let s1 = [[m(4, 0), m(3, 1), m(2, 2)], [m(3, 1), m(2, 2), m(1, 3)], [m(2, 2), m(1, 3), m(0, 4)]];
        let s2 = [[m(3, 0), m(2, 1), m(2, 0)], [m(2, 1), m(1, 2), m(1, 1)], [m(1, 2), m(0, 3), m(0, 2)]];
        let s3 = [[m(2, 0), m(1, 1), m(1, 0)], [m(1, 1), m(0, 2), m(0, 1)], [m(1, 0), m(0, 1), 1.0]];
        let conic = constrained_conic(s1, s2, s3)?;
        from_conic(conic).map(|e| Self {
            centre: [e.centre[0] / scale + mx, e.centre[1] / scale + my],
            shape: e.shape.map(|v| v * scale * scale),
        })
    }
}

type Matrix3 = nalgebra::Matrix3<f64>;

fn matrix(rows: [[f64; 3]; 3]) -> Matrix3 {
    Matrix3::from_fn(|i, j| rows[i][j])
}

/// Minimiser (a, b, c, d, e, f) of the algebraic distance under the ellipse constraint.
fn constrained_conic(s1: [[f64; 3]; 3], s2: [[f64; 3]; 3], s3: [[f64; 3]; 3]) -> Option<[f64; 6]> {
    let (s1, s2) = (matrix(s1), matrix(s2));
    let t = -(matrix(s3).try_inverse()? * s2.transpose());
    let reduced = s1 + s2 * t;
    // inverse of the constraint matrix [[0,0,2],[0,-1,0],[2,0,0]] applied from the left
    let system = Matrix3::from_rows(&[reduced.row(2) * 0.5, -reduced.row(1), reduced.row(0) * 0.5]);
    let trace = system.trace();
    let minors = (trace * trace - (system * system).trace()) / 2.0;
    let mut best: Option<nalgebra::Vector3<f64>> = None;
    for root in real_roots(-trace, minors, -system.determinant()) {
        let Some(v) = null_vector(&(system - Matrix3::identity() * root)) else { continue };
        if 4.0 * v[0] * v[2] - v[1] * v[1] > 0.0 {
            best = Some(v);
        }
    }
    let v = best?;
    let linear = t * v;
    Some([v[0], v[1], v[2], linear[0], linear[1], linear[2]])
}

/// Vector that a singular 3x3 matrix takes to (nearly) zero.
fn null_vector(m: &Matrix3) -> Option<nalgebra::Vector3<f64>> {
    let rows = [m.row(0).transpose(), m.row(1).transpose(), m.row(2).transpose()];
    let crosses = [rows[0].cross(&rows[1]), rows[1].cross(&rows[2]), rows[2].cross(&rows[0])];
    crosses.into_iter().max_by(|a, b| a.norm_squared().total_cmp(&b.norm_squared()))?.try_normalize(1e-300)
}

/// Real roots of `x^3 + a x^2 + b x + c`, each polished by Newton steps.
fn real_roots(a: f64, b: f64, c: f64) -> Vec<f64> {
    let shift = a / 3.0;
    let p = b - a * a / 3.0;
    let q = 2.0 * a.powi(3) / 27.0 - a * b / 3.0 + c;
    let discriminant = q * q / 4.0 + p.powi(3) / 27.0;
    let mut roots = if discriminant > 0.0 {
        let r = discriminant.sqrt();
        vec![(-q / 2.0 + r).cbrt() + (-q / 2.0 - r).cbrt() - shift]
    } else {
        let radius = 2.0 * (-p / 3.0).max(0.0).sqrt();
        let cosine = if radius > 0.0 { (3.0 * q / (p * radius)).clamp(-1.0, 1.0) } else { 1.0 };
        let angle = cosine.acos() / 3.0;
        (0..3).map(|k| radius * (angle - 2.0 * std::f64::consts::PI * f64::from(k) / 3.0).cos() - shift).collect()
    };
    for x in &mut roots {
        for _ in 0..3 {
            let slope = (3.0 * *x + 2.0 * a) * *x + b;
            let step = (((*x + a) * *x + b) * *x + c) / slope;
            if step.is_finite() {
                *x -= step;
            }
        }
    }
    roots
}

fn from_conic(conic: [f64; 6]) -> Option<Ellipse> {
    let sign = if conic[0] < 0.0 { -1.0 } else { 1.0 };
    let [a, b, c, d, e, f] = conic.map(|v| v * sign);
    let det = 4.0 * a * c - b * b;
    if det <= 0.0 {
        return None;
    }
    let (x, y) = ((b * e - 2.0 * c * d) / det, (b * d - 2.0 * a * e) / det);
    let level = -(f + 0.5 * (d * x + e * y));
    let shape = [a / level, b / (2.0 * level), c / level];
    let good = level > 0.0 && x.is_finite() && y.is_finite() && shape.iter().all(|v| v.is_finite());
    good.then_some(Ellipse { centre: [x, y], shape })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_exact_ellipse_is_recovered() {
        for (a, b, angle) in [(4.0f64, 4.0, 0.0), (30.0, 9.0, 0.7), (6.0, 5.9, 2.0), (80.0, 20.0, -1.1)] {
            let (s, c) = f64::sin_cos(angle);
            let truth = Ellipse::from_axes([512.3, 77.7], [[a * c, -b * s], [a * s, b * c]]).unwrap();
            let points: Vec<[f32; 2]> =
                (0..60).map(|k| truth.point(f64::from(k) * 0.1047, 1.0).map(|v| v as f32)).collect();
            let found = Ellipse::fit(&points).unwrap();
            // f32 coordinates carry 3e-5 px here
            assert!((found.centre[0] - 512.3).abs() < 2e-5 && (found.centre[1] - 77.7).abs() < 2e-5, "{found:?}");
            let axes = found.semi_axes();
            assert!((axes[0] - a).abs() < 1e-4 && (axes[1] - b).abs() < 1e-4, "{axes:?}");
            assert!(points.iter().all(|p| found.distance(p.map(f64::from)).abs() < 1e-4));
        }
    }

    #[test]
    fn a_line_of_points_is_no_ellipse() {
        let points: Vec<[f32; 2]> = (0..20).map(|k| [k as f32, 2.0 * k as f32]).collect();
        assert!(Ellipse::fit(&points).is_none_or(|e| e.semi_axes()[1] < 1e-2));
    }

    #[test]
    fn normaliser_is_the_root_of_the_shape() {
        let e = Ellipse { centre: [0.0, 0.0], shape: [0.04, 0.01, 0.09] };
        let n = e.normaliser();
        assert!((n[0][0] * n[0][0] + n[0][1] * n[1][0] - 0.04).abs() < 1e-15);
        assert!((n[0][0] * n[0][1] + n[0][1] * n[1][1] - 0.01).abs() < 1e-15);
        assert!((n[1][0] * n[0][1] + n[1][1] * n[1][1] - 0.09).abs() < 1e-15);
    }
}
