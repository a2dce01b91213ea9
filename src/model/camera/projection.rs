//! A camera: pinhole, lens and displacement field; points to pixels and pixels to rays.

use std::array;
use std::borrow::Cow;

use nalgebra::{Matrix2, Matrix2x3, SMatrix, Vector2, Vector3};
use serde::{Deserialize, Serialize};

use super::field::{Lattice, Touched};
use super::formula::{MAX_PARAMETERS, Points};
use super::lens::Lens;
use super::projections::Projections;

/// First guess of the displacements that a field has to make, px; the data decide.
const FIELD_SIGMA_PX: f64 = 1.0;

/// Names of the pinhole parameters, px, with which every camera starts.
const PINHOLE: [&str; 4] = ["fx", "fy", "cx", "cy"];

/// A camera: x right, y down, z forward; pixel (0, 0) is the centre of the top-left pixel.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Camera {
    /// Lens model.
    pub lens: Lens,
    /// Columns of the image.
    pub width_px: u32,
    /// Rows of the image.
    pub height_px: u32,
    /// fx, fy, cx, cy (px), then the coefficients of the lens, then the displacement field where there is one: u and v (px) of every
    /// control point, row by row.
    pub parameters: Vec<f64>,
}

/// The image of a point with its derivatives.
#[derive(Debug, Clone, Copy, Default)]
pub struct Projection {
    /// Column and row, px.
    pub uv: Vector2<f64>,
    /// With respect to the point in the camera frame, px/m.
    pub d_point: Matrix2x3<f64>,
    /// With respect to the parameters of the formula; columns beyond their number are zero.
    pub d_parameters: SMatrix<f64, 2, MAX_PARAMETERS>,
    /// Column and row that the formula gives, px: there the displacement field moves the point.
    pub by_formula: Vector2<f64>,
}

impl Camera {
    /// A camera without distortion: focal length `focal_px`, principal point in the middle of the image.
    pub fn pinhole(lens: Lens, width_px: u32, height_px: u32, focal_px: f64) -> Self {
        let middle = |n: u32| (f64::from(n) - 1.0) / 2.0;
        let mut parameters = vec![focal_px, focal_px, middle(width_px), middle(height_px)];
        let field = if lens.has_field() { 2 * Lattice::over(width_px, height_px).points() } else { 0 };
        parameters.resize(4 + lens.coefficient_names().len() + field, 0.0);
        Self { lens, width_px, height_px, parameters }
    }

    /// Names of all parameters, in their order: those of the field are `u_<column>_<row>` and `v_<column>_<row>` of its control points.
    pub fn parameter_names(&self) -> impl Iterator<Item = Cow<'static, str>> {
        let formula = PINHOLE.into_iter().chain(self.lens.coefficient_names().iter().copied()).map(Cow::Borrowed);
        let lattice = self.lattice();
        let points = lattice.map_or(0, |l| l.points());
        let across = lattice.map_or(1, |l| l.size()[0]);
        let at = move |k: usize| ["u", "v"].map(|c| Cow::Owned(format!("{c}_{}_{}", k % across, k / across)));
        formula.chain((0..points).flat_map(at))
    }

    /// Number of parameters of pinhole and lens formula, which come first.
    pub fn parametric(&self) -> usize {
        PINHOLE.len() + self.lens.coefficient_names().len()
    }

    /// The lattice of the displacement field; `None` for a lens without one.
    pub fn lattice(&self) -> Option<Lattice> {
        self.lens.has_field().then(|| Lattice::over(self.width_px, self.height_px))
    }

    /// The camera without its displacement field.
    pub fn without_field(&self) -> Self {
        let parameters = self.parameters[..self.parametric()].to_vec();
        Self { lens: self.lens.formula(), parameters, ..*self }
    }

    /// The same camera with a lens that has all the coefficients of this one, in this order, and others, which are zero; `None` for others.
    pub fn extended(&self, lens: Lens) -> Option<Self> {
        let holds = lens.coefficient_names().starts_with(self.lens.coefficient_names()) && !self.lens.has_field();
        let mut next = Self::pinhole(lens, self.width_px, self.height_px, self.parameters[0]);
        next.parameters.iter_mut().zip(&self.parameters).for_each(|(own, known)| *own = *known);
        holds.then_some(next)
    }

    /// Distance of the farthest corner of the image from the principal point over the focal length.
    pub fn corner(&self) -> f64 {
        let p = &self.parameters;
        let far = |centre: f64, n: u32, focal: f64| centre.max(f64::from(n) - 1.0 - centre) / focal;
        far(p[2], self.width_px, p[0]).hypot(far(p[3], self.height_px, p[1]))
    }

    /// Prior sigma of parameter `index` about zero; infinite for none.
    pub fn prior_sigma(&self, index: usize) -> f64 {
        match index.checked_sub(PINHOLE.len()) {
            None => f64::INFINITY,
            Some(_) if index >= self.parametric() => FIELD_SIGMA_PX,
            Some(k) => self.lens.prior_sigma(k),
        }
    }

    /// Unit of parameter `index`: "px" or "1".
    pub fn parameter_unit(&self, index: usize) -> &'static str {
        if (PINHOLE.len()..self.parametric()).contains(&index) { "1" } else { "px" }
    }

    /// Block of parameter `index`: "pinhole", "lens" or "field".
    pub fn parameter_block(&self, index: usize) -> &'static str {
        match index {
            0..4 => "pinhole",
            k if k < self.parametric() => "lens",
            _ => "field",
        }
    }

    /// Image (px) of a point in the camera frame (m); `None` behind the camera or where the lens model folds over.
    pub fn project(&self, x_camera: &Vector3<f64>) -> Option<Vector2<f64>> {
        self.project_all(&[[x_camera.x], [x_camera.y], [x_camera.z]]).map(|[uv]| uv)
    }

    /// Images (px) of N points in the camera frame (m); `None` where one of them has none.
    pub fn project_all<const N: usize>(&self, points: &[[f64; N]; 3]) -> Option<[Vector2<f64>; N]> {
        let [x, y, z] = points;
        let formula = self.project_together(points)?;
        let is_imaged = |n: usize| {
            let r2 = (x[n] / z[n]).powi(2) + (y[n] / z[n]).powi(2);
            self.lens.is_monotonic_to(&self.parameters[4..], r2, 1.0 / z[n])
        };
        (0..N).all(is_imaged).then(|| {
            array::from_fn(|n| {
                let h = Vector2::new(formula.uv[0][n], formula.uv[1][n]);
                h + self.displacement(&h).0
            })
        })
    }

    /// As [`Camera::project`], with derivatives; `None` only behind the camera, so that an adjustment can pass through a poor state.
    #[inline(always)]
    pub fn project_with_jacobian(&self, x_camera: &Vector3<f64>) -> Option<Projection> {
        let formula = self.project_together(&[[x_camera.x], [x_camera.y], [x_camera.z]])?;
        let h = Vector2::new(formula.uv[0][0], formula.uv[1][0]);
        let (mut d_point, mut d_parameters) = (Matrix2x3::zeros(), SMatrix::<f64, 2, MAX_PARAMETERS>::zeros());
        for (i, by_point) in formula.d_point.iter().enumerate() {
            (0..3).for_each(|j| d_point[(i, j)] = by_point[j][0]);
            let of_component = [0, 1].map(|c| [f64::from(u8::from(c == i))]);
            let by = formula.by_parameters(&of_component, self.parametric());
            by.iter().enumerate().for_each(|(k, by)| d_parameters[(i, k)] = *by);
        }
        if !self.lens.has_field() {
            return Some(Projection { uv: h, d_point, d_parameters, by_formula: h });
        }
        let (shift, bend) = self.displacement(&h);
        let by_h = Matrix2::identity() + bend;
        Some(Projection { uv: h + shift, d_point: by_h * d_point, d_parameters: by_h * d_parameters, by_formula: h })
    }

    /// Projects N points in the camera frame (m) by the formula alone; `None` where one is behind the camera.
    #[inline(always)]
    pub fn project_together<const N: usize>(&self, points: &[[f64; N]; 3]) -> Option<Projections<N>> {
        let [x, y, z] = points;
        if z.iter().any(|z| !Self::is_before(*z)) {
            return None;
        }
        let mut ideal = Points { at: [[0.0; N]; 2], inverse_depth: [0.0; N] };
        for n in 0..N {
            ideal.inverse_depth[n] = 1.0 / z[n];
            ideal.at[0][n] = x[n] / z[n];
            ideal.at[1][n] = y[n] / z[n];
        }
        let distorted = self.lens.distort(&self.parameters[4..], &ideal);
        let focal = [self.parameters[0], self.parameters[1]];
        let (mut uv, mut d_point) = ([[0.0; N]; 2], [[[0.0; N]; 3]; 2]);
        for (i, focal) in focal.into_iter().enumerate() {
            for n in 0..N {
                let scale = focal * ideal.inverse_depth[n];
                let [by_x, by_y] = [scale * distorted.d_point[i][0][n], scale * distorted.d_point[i][1][n]];
                uv[i][n] = focal * distorted.point[i][n] + self.parameters[2 + i];
                d_point[i][0][n] = by_x;
                d_point[i][1][n] = by_y;
                d_point[i][2][n] = -by_x * ideal.at[0][n]
                    - by_y * ideal.at[1][n]
                    - scale * ideal.inverse_depth[n] * distorted.d_inverse_depth[i][n];
            }
        }
        Some(Projections { uv, d_point, focal, distorted })
    }

    /// Basis functions of the displacement field where the formula images a point at `h` px: derivatives of u by its u components, and of v by its
    /// v components. `None` for a lens without a field.
    pub fn touched(&self, h: &Vector2<f64>) -> Option<Touched> {
        self.lattice().map(|lattice| lattice.touched(h))
    }

    /// Displacement (px) on top of the formula where that images a point at `h`, and its derivative.
    pub(in crate::model) fn displacement(&self, h: &Vector2<f64>) -> (Vector2<f64>, Matrix2<f64>) {
        let lattice = self.lattice();
        lattice.map_or_else(Default::default, |l| l.displacement(&self.parameters[self.parametric()..], h))
    }

    /// Direction (z = 1) in the camera frame that is imaged at `uv` px; `None` where no direction is. A lens that sees the distance is
    /// taken as it is far away.
    pub fn ray(&self, uv: &Vector2<f64>) -> Option<Vector3<f64>> {
        let p = &self.parameters;
        let scale = Vector2::new(p[0], p[1]);
        let target = (uv - Vector2::new(p[2], p[3])).component_div(&scale);
        // Image on the plane z = 1, the field included, and its derivative.
        let image = |x: &Vector2<f64>| {
            let (point, by_x) = self.distorted(x);
            let (shift, bend) = self.displacement(&self.to_pixels(&point));
            let bend = Matrix2::from_fn(|i, k| bend[(i, k)] * scale[k] / scale[i]);
            (point + shift.component_div(&scale), (Matrix2::identity() + bend) * by_x)
        };
        let mut x = target;
        for _ in 0..50 {
            let (at, by_x) = image(&x);
            let step = by_x.try_inverse()? * (target - at);
            // A bounded step keeps Newton on the inner branch of the lens.
            x += step * (0.5 / step.norm().max(0.5));
            if step.norm() < 1e-14 {
                break;
            }
        }
        let reached = (image(&x).0 - target).norm() < 1e-9 && self.lens.is_monotonic_to(&p[4..], x.norm_squared(), 0.0);
        reached.then(|| Vector3::new(x.x, x.y, 1.0))
    }

    /// True where `uv` lies on the sensor, at least `margin_px` from its border.
    pub fn contains(&self, uv: &Vector2<f64>, margin_px: f64) -> bool {
        let inside = |x: f64, n: u32| x >= margin_px - 0.5 && x <= f64::from(n) - 0.5 - margin_px;
        inside(uv.x, self.width_px) && inside(uv.y, self.height_px)
    }

    /// A point of the plane z = 1, distorted as far away, and its derivative by that point.
    fn distorted(&self, x: &Vector2<f64>) -> (Vector2<f64>, Matrix2<f64>) {
        let ideal = Points { at: [[x.x], [x.y]], inverse_depth: [0.0] };
        let d = self.lens.distort(&self.parameters[4..], &ideal);
        (Vector2::new(d.point[0][0], d.point[1][0]), Matrix2::from_fn(|i, j| d.d_point[i][j][0]))
    }

    /// True for a depth (m) that is imaged.
    #[inline(always)]
    fn is_before(depth: f64) -> bool {
        depth > 1e-6
    }

    #[inline(always)]
    fn to_pixels(&self, x: &Vector2<f64>) -> Vector2<f64> {
        let p = &self.parameters;
        Vector2::new(p[0] * x.x + p[2], p[1] * x.y + p[3])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ray_inverts_projection() {
        let mut camera = Camera::pinhole(Lens::Brown, 1280, 1024, 800.0);
        camera.parameters[4..].copy_from_slice(&[-0.15, 0.03, 8e-4, -5e-4, 0.002]);
        for (u, v) in [(0.0, 0.0), (640.0, 500.0), (1279.0, 12.5), (33.0, 1023.0)] {
            let uv = Vector2::new(u, v);
            let ray = camera.ray(&uv).unwrap();
            assert!((camera.project(&ray).unwrap() - uv).norm() < 1e-9);
        }
    }

    #[test]
    fn a_point_beyond_the_fold_has_no_image() {
        let mut camera = Camera::pinhole(Lens::Brown, 1280, 1024, 800.0);
        camera.parameters[4] = -0.3;
        // r (1 - 0.3 r^2) has its maximum at r = 1.054.
        assert!(camera.project(&Vector3::new(1.0, 0.0, 1.0)).is_some());
        assert!(camera.project(&Vector3::new(1.1, 0.0, 1.0)).is_none());
        assert!(camera.project(&Vector3::new(0.0, 0.0, -1.0)).is_none());
    }
}
