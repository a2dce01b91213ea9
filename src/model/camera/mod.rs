//! Cameras: one table of lenses, one file per lens.
//!
//! To add a lens: write `src/model/camera/<lens>.rs` with its names and `distort` (value and derivatives), add a variant to
//! [`Lens`] and a row to each `match` in this file (the compiler lists them), and a row to `tests/model/jacobians.rs`.

mod brown;
mod field;
mod fisheye;
mod fit;
mod parallax;
mod radial;
mod rational;
mod thin_prism;

use std::borrow::Cow;

use nalgebra::{DMatrix, Matrix2, Matrix2x3, SMatrix, Vector2, Vector3};
use serde::{Deserialize, Serialize};

pub use field::{Lattice, Touched};
pub use fit::{LensFit, fit_lens};

/// Most parameters that the formula of any camera has (pinhole and lens; a displacement field comes on top).
pub const MAX_PARAMETERS: usize = 13;

/// Derivatives of a distorted point by the coefficients of a lens, one column each.
type Coefficients = SMatrix<f64, 2, { MAX_PARAMETERS - 4 }>;

/// First guess of the displacements that a field has to make, px; the data decide.
const FIELD_SIGMA_PX: f64 = 1.0;

/// Prior sigma of `s1` and `s3`. To first order `s1 r^2` is a shift of the principal point with a turn of the camera and `p2`: at a width of 50
/// degrees 1e-3 of it is 0.32 px, of which 0.012 px are left when these follow, and takes the principal point along by 4.6 px.
const PRISM_SIGMA: f64 = 3e-4;

/// Prior sigma of `s2` and `s4`.
const PRISM_FOURTH_ORDER_SIGMA: f64 = 0.01;

/// Names of the pinhole parameters, px, with which every camera starts.
const PINHOLE: [&str; 4] = ["fx", "fy", "cx", "cy"];

/// Lens distortion models.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Lens {
    /// Brown-Conrady: k1 k2 p1 p2 k3, in the order of OpenCV and of ROS `plumb_bob`.
    Brown,
    /// Kannala-Brandt: k1 k2 k3 k4, in the order of OpenCV's fisheye and of ROS `equidistant`.
    Fisheye,
    /// Rational: k1 k2 p1 p2 k3 k4 k5 k6, in the order of OpenCV and of ROS `rational_polynomial`.
    Rational,
    /// Brown-Conrady with a thin prism: k1 k2 p1 p2 k3 s1 s2 s3 s4.
    ThinPrism,
    /// Brown-Conrady with radial coefficients that depend on the distance: k1 k2 p1 p2 k3 k1z k2z (the last two in m).
    Parallax,
    /// Brown-Conrady and a displacement field on top: k1 k2 p1 p2 k3, then the field.
    #[serde(rename = "brown+field")]
    BrownField,
    /// Kannala-Brandt and a displacement field on top: k1 k2 k3 k4, then the field.
    #[serde(rename = "fisheye+field")]
    FisheyeField,
}

/// A distorted point of the plane z = 1 with its derivatives.
pub(super) struct Distorted {
    pub point: Vector2<f64>,
    pub d_point: Matrix2<f64>,
    /// One column per lens coefficient.
    pub d_coefficients: Coefficients,
    /// With respect to 1 / depth (1/m).
    pub d_inverse_depth: Vector2<f64>,
}

impl Distorted {
    /// Of a lens that does not see the distance.
    #[inline(always)]
    fn flat(point: Vector2<f64>, d_point: Matrix2<f64>, d_coefficients: Coefficients) -> Self {
        Self { point, d_point, d_coefficients, d_inverse_depth: Vector2::zeros() }
    }
}

impl Lens {
    /// All lenses, the simpler ones first.
    pub const ALL: [Self; 7] = [
        Self::Brown,
        Self::Fisheye,
        Self::Parallax,
        Self::Rational,
        Self::ThinPrism,
        Self::BrownField,
        Self::FisheyeField,
    ];

    /// Name in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Brown => "brown",
            Self::Fisheye => "fisheye",
            Self::Rational => "rational",
            Self::ThinPrism => "thin_prism",
            Self::Parallax => "parallax",
            Self::BrownField => "brown+field",
            Self::FisheyeField => "fisheye+field",
        }
    }

    /// The lens without the displacement field on top of it.
    pub fn formula(self) -> Self {
        match self {
            Self::BrownField => Self::Brown,
            Self::FisheyeField => Self::Fisheye,
            other => other,
        }
    }

    /// True where camera.yaml, with the models of ROS, says all of this lens.
    pub fn is_in_ros(self) -> bool {
        matches!(self, Self::Brown | Self::Fisheye | Self::Rational)
    }

    /// True with a displacement field on top of the formula.
    pub fn has_field(self) -> bool {
        self != self.formula()
    }

    /// The lens of a name in files.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|lens| lens.name() == name)
    }

    /// Names of all lenses, as in files.
    pub fn names() -> Vec<&'static str> {
        Self::ALL.iter().map(|lens| lens.name()).collect()
    }

    /// Names of the lens coefficients (dimensionless), in the order of OpenCV.
    pub fn coefficient_names(self) -> &'static [&'static str] {
        match self {
            Self::Brown | Self::BrownField => &brown::NAMES,
            Self::Fisheye | Self::FisheyeField => &fisheye::NAMES,
            Self::Rational => &rational::NAMES,
            Self::ThinPrism => &thin_prism::NAMES,
            Self::Parallax => &parallax::NAMES,
        }
    }

    /// Prior sigma of a coefficient about zero. Where numerator and denominator (or prism and tilt) nearly say the same, a wide prior keeps the
    /// result finite; elsewhere there is none.
    pub fn prior_sigma(self, coefficient: usize) -> f64 {
        match (self, coefficient) {
            (Self::Rational, 5..) => 1.0,
            (Self::ThinPrism, 5 | 7) => PRISM_SIGMA,
            (Self::ThinPrism, 5..) => PRISM_FOURTH_ORDER_SIGMA,
            (Self::Parallax, 5..) => 0.1,
            _ => f64::INFINITY,
        }
    }

    /// Size that a coefficient without a prior may have, for the evidence of formulas: one bends a ray at 45 degrees by as much as it is off
    /// the axis; what is tangential comes of lens elements that are off by a hundredth.
    pub fn typical(self, coefficient: usize) -> f64 {
        match self.coefficient_names().get(coefficient) {
            Some(name) if name.starts_with('p') => 0.01,
            _ => 1.0,
        }
    }

    #[inline(always)]
    fn distort(self, c: &[f64], x: &Vector2<f64>, inverse_depth: f64) -> Distorted {
        match self {
            Self::Brown | Self::BrownField => brown::distort(c, x),
            Self::Fisheye | Self::FisheyeField => fisheye::distort(c, x),
            Self::Rational => rational::distort(c, x),
            Self::ThinPrism => thin_prism::distort(c, x),
            Self::Parallax => parallax::distort(c, x, inverse_depth),
        }
    }

    fn is_monotonic_to(self, c: &[f64], r2: f64, inverse_depth: f64) -> bool {
        match self {
            Self::Brown | Self::BrownField | Self::ThinPrism => brown::is_monotonic_to(c, r2),
            Self::Fisheye | Self::FisheyeField => fisheye::is_monotonic_to(c, r2),
            Self::Rational => rational::is_monotonic_to(c, r2),
            Self::Parallax => parallax::is_monotonic_to(c, r2, inverse_depth),
        }
    }
}

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
    /// Basis functions of the displacement field: derivatives of u by its u components, and of v by its v components.
    pub field: Option<Touched>,
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

    /// The nearest camera that ROS has a model for, for points from the nearer to the farther depth (m), and its loss; `None` where ROS has this
    /// one, or none that comes near.
    pub fn in_ros(&self, depths_m: &[f64; 2]) -> Option<LensFit> {
        let nearest = match self.lens {
            Lens::Brown | Lens::Rational | Lens::Fisheye => return None,
            Lens::ThinPrism | Lens::Parallax | Lens::BrownField => Lens::Rational,
            Lens::FisheyeField => Lens::Fisheye,
        };
        fit_lens(self, nearest, depths_m)
    }

    /// Distance of the farthest corner of the image from the principal point over the focal length.
    pub fn corner(&self) -> f64 {
        let p = &self.parameters;
        let far = |centre: f64, n: u32, focal: f64| centre.max(f64::from(n) - 1.0 - centre) / focal;
        far(p[2], self.width_px, p[0]).hypot(far(p[3], self.height_px, p[1]))
    }

    /// What the formula and a turn of the camera can say, as displacement fields: orthonormal columns over the parameters of the field;
    /// `None` for a lens without one.
    pub fn parametric_directions(&self) -> Option<DMatrix<f64>> {
        self.lattice().map(|lattice| field::parametric_directions(&self.without_field(), &lattice))
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
        let x = normalised(x_camera)?;
        let inverse_depth = 1.0 / x_camera.z;
        if !self.lens.is_monotonic_to(&self.parameters[4..], x.norm_squared(), inverse_depth) {
            return None;
        }
        let d = self.lens.distort(&self.parameters[4..], &x, inverse_depth);
        let h = self.to_pixels(&d.point);
        Some(h + self.displacement(&h).0)
    }

    /// As [`Camera::project`], with derivatives; `None` only behind the camera, so that an adjustment can pass through a poor state.
    #[inline(always)]
    pub fn project_with_jacobian(&self, x_camera: &Vector3<f64>) -> Option<Projection> {
        let x = normalised(x_camera)?;
        let iz = 1.0 / x_camera.z;
        let d = self.lens.distort(&self.parameters[4..], &x, iz);
        let scale = [self.parameters[0], self.parameters[1]];
        let mut d_parameters = SMatrix::<f64, 2, MAX_PARAMETERS>::zeros();
        let mut d_point = Matrix2x3::zeros();
        for (c, focal) in scale.into_iter().enumerate() {
            d_parameters[(c, c)] = d.point[c];
            d_parameters[(c, 2 + c)] = 1.0;
            for k in 0..MAX_PARAMETERS - 4 {
                d_parameters[(c, 4 + k)] = focal * d.d_coefficients[(c, k)];
            }
            let [by_x, by_y] = [focal * iz * d.d_point[(c, 0)], focal * iz * d.d_point[(c, 1)]];
            d_point[(c, 0)] = by_x;
            d_point[(c, 1)] = by_y;
            d_point[(c, 2)] = -by_x * x.x - by_y * x.y - focal * iz * iz * d.d_inverse_depth[c];
        }
        let h = self.to_pixels(&d.point);
        let Some(lattice) = self.lattice() else {
            return Some(Projection { uv: h, d_point, d_parameters, field: None });
        };
        let (shift, bend) = self.displacement(&h);
        let by_h = Matrix2::identity() + bend;
        Some(Projection {
            uv: h + shift,
            d_point: by_h * d_point,
            d_parameters: by_h * d_parameters,
            field: Some(lattice.touched(&h)),
        })
    }

    /// Displacement (px) on top of the formula where that images a point at `h`, and its derivative.
    fn displacement(&self, h: &Vector2<f64>) -> (Vector2<f64>, Matrix2<f64>) {
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
            let d = self.lens.distort(&p[4..], x, 0.0);
            let (shift, bend) = self.displacement(&self.to_pixels(&d.point));
            let bend = Matrix2::from_fn(|i, k| bend[(i, k)] * scale[k] / scale[i]);
            (d.point + shift.component_div(&scale), (Matrix2::identity() + bend) * d.d_point)
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

    #[inline(always)]
    fn to_pixels(&self, x: &Vector2<f64>) -> Vector2<f64> {
        let p = &self.parameters;
        Vector2::new(p[0] * x.x + p[2], p[1] * x.y + p[3])
    }
}

#[inline(always)]
fn normalised(x: &Vector3<f64>) -> Option<Vector2<f64>> {
    (x.z > 1e-6).then(|| Vector2::new(x.x / x.z, x.y / x.z))
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
