//! Maps between two planes.

use nalgebra::{Matrix3, SMatrix, SVector, Vector3};

/// A projective map of the plane; points are `[x, y]`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlaneMap(Matrix3<f64>);

impl PlaneMap {
    /// Linear least-squares fit of `to = map(from)` in normalised coordinates; `None` for fewer than four points or
    /// where they do not determine the map (all but one on a line).
    pub fn fit(pairs: &[([f64; 2], [f64; 2])]) -> Option<Self> {
        if pairs.len() < 4 {
            return None;
        }
        let source = normaliser(pairs.iter().map(|p| p.0))?;
        let target = normaliser(pairs.iter().map(|p| p.1))?;
        let mut normal = SMatrix::<f64, 8, 8>::zeros();
        let mut right = SVector::<f64, 8>::zeros();
        for (from, to) in pairs {
            let (p, q) = (transform(&source, *from), transform(&target, *to));
            let [x, y] = [p.x, p.y];
            let rows = [
                (SVector::from([x, y, 1.0, 0.0, 0.0, 0.0, -q.x * x, -q.x * y]), q.x),
                (SVector::from([0.0, 0.0, 0.0, x, y, 1.0, -q.y * x, -q.y * y]), q.y),
            ];
            for (row, value) in rows {
                normal += row * row.transpose();
                right += row * value;
            }
        }
        let factor = normal.cholesky()?;
        let diagonal = factor.l_dirty().diagonal();
        if diagonal.min() < 1e-6 * diagonal.max() {
            return None;
        }
        let h = factor.solve(&right);
        let middle = Matrix3::new(h[0], h[1], h[2], h[3], h[4], h[5], h[6], h[7], 1.0);
        let map = target.try_inverse()? * middle * source;
        map.iter().all(|x| x.is_finite()).then_some(Self(map))
    }

    /// Homogeneous matrix.
    pub fn matrix(&self) -> Matrix3<f64> {
        self.0
    }

    /// Image of a point; `None` on or beyond the line that maps to infinity.
    pub fn apply(&self, point: [f64; 2]) -> Option<[f64; 2]> {
        let q = transform(&self.0, point);
        (q.z > 1e-12).then(|| [q.x / q.z, q.y / q.z])
    }

    /// Derivative of the image by the point, `[[du/dx, du/dy], [dv/dx, dv/dy]]`.
    pub fn jacobian(&self, point: [f64; 2]) -> Option<[[f64; 2]; 2]> {
        let [u, v] = self.apply(point)?;
        let q = transform(&self.0, point);
        let m = &self.0;
        let row = |k: usize, value: f64| [(m[(k, 0)] - value * m[(2, 0)]) / q.z, (m[(k, 1)] - value * m[(2, 1)]) / q.z];
        Some([row(0, u), row(1, v)])
    }
}

fn transform(m: &Matrix3<f64>, p: [f64; 2]) -> Vector3<f64> {
    m * Vector3::new(p[0], p[1], 1.0)
}

/// Similarity that brings points to mean 0 and mean distance sqrt(2).
fn normaliser(points: impl Iterator<Item = [f64; 2]> + Clone) -> Option<Matrix3<f64>> {
    let count = points.clone().count() as f64;
    let sum = points.clone().fold([0.0; 2], |s, p| [s[0] + p[0], s[1] + p[1]]);
    let mean = [sum[0] / count, sum[1] / count];
    let spread = points.map(|p| (p[0] - mean[0]).hypot(p[1] - mean[1])).sum::<f64>() / count;
    if !(spread > 0.0 && spread.is_finite()) {
        return None;
    }
    let s = std::f64::consts::SQRT_2 / spread;
    Some(Matrix3::new(s, 0.0, -s * mean[0], 0.0, s, -s * mean[1], 0.0, 0.0, 1.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn example() -> PlaneMap {
        PlaneMap(Matrix3::new(50.0, 4.0, 700.0, -3.0, 45.0, 500.0, 0.004, -0.006, 1.0))
    }

    #[test]
    fn recovers_an_exact_map_and_its_derivative() {
        let truth = example();
        let pairs: Vec<_> = (0..20)
            .filter_map(|k| {
                let p = [f64::from(k % 5), f64::from(k / 5)];
                Some((p, truth.apply(p)?))
            })
            .collect();
        let Some(found) = PlaneMap::fit(&pairs) else { panic!("no map") };
        let p = [7.5, -3.25];
        let (Some(a), Some(b)) = (truth.apply(p), found.apply(p)) else { panic!("no image") };
        assert!((a[0] - b[0]).abs() < 1e-8 && (a[1] - b[1]).abs() < 1e-8, "{a:?} {b:?}");
        let Some(jacobian) = found.jacobian(p) else { panic!("no derivative") };
        let step = 1e-5;
        for axis in 0..2 {
            let mut ahead = p;
            ahead[axis] += step;
            let mut behind = p;
            behind[axis] -= step;
            let (Some(f), Some(g)) = (found.apply(ahead), found.apply(behind)) else { panic!("no image") };
            for k in 0..2 {
                let numeric = (f[k] - g[k]) / (2.0 * step);
                assert!((numeric - jacobian[k][axis]).abs() < 1e-5, "{numeric} {jacobian:?}");
            }
        }
    }

    #[test]
    fn collinear_points_give_none() {
        let pairs: Vec<_> = (0..9).map(|k| ([f64::from(k), 2.0 * f64::from(k)], [f64::from(k), 1.0])).collect();
        assert_eq!(PlaneMap::fit(&pairs), None);
    }
}
