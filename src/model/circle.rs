//! The area centroid of the image of a circle: what a detector measures.
//!
//! The contour is sampled at N points of the 3-D circle, each projected through the whole camera model. The samples define a
//! trigonometric polynomial; Green's theorem and the spectral derivative give area and first moments. The harmonics of the
//! contour fall off geometrically with (radius / distance), so N = 12 is exact to 1e-7 px for every plate that can be imaged, and
//! N = 8 where the distance is at least fifty radii.

use nalgebra::{Matrix2, Matrix2x3, Matrix3, SMatrix, Vector2, Vector3};
use std::f64::consts::TAU;
use std::sync::LazyLock;

use super::camera::{Camera, MAX_PARAMETERS, Projections, Touched, weighted_sum};
use crate::geom::{Pose, skew};

/// Where the contour is sampled.
struct Samples<const N: usize> {
    /// On the circle of radius one, by components in the plane of the plate.
    places: [[f64; N]; 2],
    /// Spectral derivative with respect to the angle; antisymmetric.
    derivative: [[f64; N]; N],
}

/// Distance of a circle, in radii, from which the fewer samples do.
const FAR: f64 = 50.0;

static NEAR_SAMPLES: LazyLock<Samples<12>> = LazyLock::new(Samples::new);
static FAR_SAMPLES: LazyLock<Samples<8>> = LazyLock::new(Samples::new);

impl<const N: usize> Samples<N> {
    fn new() -> Self {
        let angle = |k: usize| TAU * k as f64 / N as f64;
        let places = [f64::cos, f64::sin].map(|component| std::array::from_fn(|k| component(angle(k))));
        let mut s = Self { places, derivative: [[0.0; N]; N] };
        for i in 0..N {
            for j in 0..N {
                if i != j {
                    let sign = if (i + j) % 2 == 0 { 0.5 } else { -0.5 };
                    s.derivative[i][j] = sign / ((angle(i) - angle(j)) / 2.0).tan();
                }
            }
        }
        s
    }

    /// Those of a circle of `radius_m` about `centre` (plate frame, m), in the camera frame, m.
    #[inline(always)]
    fn of_circle(&self, camera_from_plate: &Pose, centre: &Vector3<f64>, radius_m: f64) -> [[f64; N]; 3] {
        let (centre, radii) = (camera_from_plate.transform(centre), camera_from_plate.rotation * radius_m);
        let mut points = [[0.0; N]; 3];
        for (axis, points) in points.iter_mut().enumerate() {
            for (point, (u, v)) in points.iter_mut().zip(self.places[0].iter().zip(&self.places[1])) {
                *point = centre[axis] + radii[(axis, 0)] * u + radii[(axis, 1)] * v;
            }
        }
        points
    }

    /// Derivative with respect to the angle of what has these values at the samples.
    #[inline(always)]
    fn differentiated(&self, f: &[f64; N]) -> [f64; N] {
        let mut out = [0.0; N];
        for (column, f) in self.derivative.iter().zip(f) {
            for (o, c) in out.iter_mut().zip(column) {
                *o -= c * f;
            }
        }
        out
    }
}

/// True where the fewer samples do.
#[inline(always)]
fn is_far(camera_from_plate: &Pose, centre: &Vector3<f64>, radius_m: f64) -> bool {
    camera_from_plate.transform(centre).norm() > FAR * radius_m
}

/// The prediction of one observation, with derivatives.
#[derive(Debug, Clone)]
pub struct Prediction {
    /// Column and row, px.
    pub uv: Vector2<f64>,
    /// With respect to the body twist [rho, phi] of `camera_from_plate`: of the column, and of the row.
    pub d_pose: SMatrix<f64, 6, 2>,
    /// With respect to the marker's centre in the plate frame, px/m.
    pub d_marker: Matrix2x3<f64>,
    /// With respect to the radius of the circle.
    pub d_radius: Vector2<f64>,
    /// With respect to the parameters of pinhole and lens formula: of the column, and of the row.
    pub d_camera: SMatrix<f64, MAX_PARAMETERS, 2>,
    /// With respect to the displacement field: control points that it touches, ascending, with the derivative by their u and v.
    pub d_field: Vec<(usize, Matrix2<f64>)>,
}

/// Predicts the image of a point of the plate (plate frame, m); `None` behind the camera.
#[inline(always)]
pub fn point(camera: &Camera, camera_from_plate: &Pose, x: &Vector3<f64>) -> Option<Prediction> {
    let p = camera.project_with_jacobian(&camera_from_plate.transform(x))?;
    let d_marker = p.d_point * camera_from_plate.rotation;
    let d_pose = by_twist(&d_marker, &(-d_marker * skew(x)));
    let d_field = match camera.lens.has_field() {
        true => field_columns(camera, std::iter::once((p.by_formula, Matrix2::identity()))),
        false => Vec::new(),
    };
    let d_radius = Vector2::zeros();
    Some(Prediction { uv: p.uv, d_pose, d_marker, d_radius, d_camera: p.d_parameters.transpose(), d_field })
}

/// Predicts the area centroid of the image of a circle of `radius_m` about `centre` (plate frame, m), parallel to the
/// plate; `None` where part of it lies behind the camera. Radius 0 is a point.
#[inline(always)]
pub fn centroid(camera: &Camera, camera_from_plate: &Pose, centre: &Vector3<f64>, radius_m: f64) -> Option<Prediction> {
    match radius_m {
        0.0 => point(camera, camera_from_plate, centre),
        r if is_far(camera_from_plate, centre, r) => {
            centroid_of_contour(&FAR_SAMPLES, camera, camera_from_plate, centre, r)
        }
        r => centroid_of_contour(&NEAR_SAMPLES, camera, camera_from_plate, centre, r),
    }
}

#[inline(always)]
fn centroid_of_contour<const N: usize>(
    at: &Samples<N>,
    camera: &Camera,
    camera_from_plate: &Pose,
    centre: &Vector3<f64>,
    radius_m: f64,
) -> Option<Prediction> {
    let formula: Projections<N> = camera.project_together(&at.of_circle(camera_from_plate, centre, radius_m))?;
    if !camera.lens.has_field() {
        let (uv, weights) = centroid_weights(at, &formula.uv);
        let sums = Sums::of(at, camera, &formula, &weights);
        return Some(sums.prediction(uv, camera_from_plate, centre, radius_m));
    }
    let by_formula: [Vector2<f64>; N] = std::array::from_fn(|n| Vector2::new(formula.uv[0][n], formula.uv[1][n]));
    let displaced = by_formula.map(|h| camera.displacement(&h));
    let uv = [0, 1].map(|i| std::array::from_fn(|n| by_formula[n][i] + displaced[n].0[i]));
    let (uv, weights) = centroid_weights(at, &uv);
    let at_sample = |n: usize| Matrix2::from_fn(|i, c| weights[i][c][n]);
    // A sample is moved by the field as well, where the formula moves it.
    let through_field: [Matrix2<f64>; N] =
        std::array::from_fn(|n| at_sample(n) * (Matrix2::identity() + displaced[n].1));
    let by_component = |i, c| std::array::from_fn(|n| through_field[n][(i, c)]);
    let sums = Sums::of(at, camera, &formula, &[0, 1].map(|i| [0, 1].map(|c| by_component(i, c))));
    let d_field = field_columns(camera, (0..N).map(|n| (by_formula[n], at_sample(n))));
    Some(Prediction { d_field, ..sums.prediction(uv, camera_from_plate, centre, radius_m) })
}

/// Derivatives of the centroid with respect to the samples: of component i by component c of sample n.
type Weights<const N: usize> = [[[f64; N]; 2]; 2];

/// Derivatives of samples, summed with the weights `g` that they have in the centroid.
struct Sums {
    /// `sum g d_point`.
    whole: Matrix2x3<f64>,
    /// `sum g d_point u` for both components of the places `u` of the samples on the unit circle.
    moments: [Matrix2x3<f64>; 2],
    /// `sum g d_parameters`.
    d_camera: SMatrix<f64, MAX_PARAMETERS, 2>,
}

impl Sums {
    #[inline(always)]
    fn of<const N: usize>(at: &Samples<N>, camera: &Camera, formula: &Projections<N>, weights: &Weights<N>) -> Self {
        let mut sums = Self { whole: Matrix2x3::zeros(), moments: [Matrix2x3::zeros(); 2], d_camera: SMatrix::zeros() };
        let parameters = camera.parametric();
        for i in 0..2 {
            for j in 0..3 {
                let (mut by, of) = ([0.0; N], [&formula.d_point[0][j], &formula.d_point[1][j]]);
                for n in 0..N {
                    by[n] = weights[i][0][n] * of[0][n] + weights[i][1][n] * of[1][n];
                }
                sums.whole[(i, j)] = weighted_sum(&by, &[1.0; N]);
                for (axis, moment) in sums.moments.iter_mut().enumerate() {
                    moment[(i, j)] = weighted_sum(&by, &at.places[axis]);
                }
            }
            let by = formula.by_parameters(&weights[i], parameters);
            (0..MAX_PARAMETERS).for_each(|k| sums.d_camera[(k, i)] = by[k]);
        }
        sums
    }

    /// `d_marker = sum g d_point R`, and `d_phi = -sum g d_point R [centre + radius u]x`.
    #[inline(always)]
    fn prediction(
        &self,
        uv: Vector2<f64>,
        camera_from_plate: &Pose,
        centre: &Vector3<f64>,
        radius_m: f64,
    ) -> Prediction {
        let rotated = |d: &Matrix2x3<f64>| times(d, &camera_from_plate.rotation);
        let d_marker = rotated(&self.whole);
        let [across, along] = [rotated(&self.moments[0]) * radius_m, rotated(&self.moments[1]) * radius_m];
        // Columns of [x]x and [y]x are unit vectors.
        let d_turn = Matrix2x3::from_columns(&[
            -along.column(2),
            across.column(2).into_owned(),
            along.column(0) - across.column(1),
        ]);
        let d_pose = by_twist(&d_marker, &(-d_turn - d_marker * skew(centre)));
        let d_radius = (across.column(0) + along.column(1)) / radius_m;
        Prediction { uv, d_pose, d_marker, d_radius, d_camera: self.d_camera, d_field: Vec::new() }
    }
}

/// Derivatives by a body twist, from those by its translation and its rotation.
#[inline(always)]
fn by_twist(d_rho: &Matrix2x3<f64>, d_phi: &Matrix2x3<f64>) -> SMatrix<f64, 6, 2> {
    let mut d = SMatrix::zeros();
    for i in 0..2 {
        for j in 0..3 {
            (d[(j, i)], d[(3 + j, i)]) = (d_rho[(i, j)], d_phi[(i, j)]);
        }
    }
    d
}

/// The product, compiled where it stands.
#[inline(always)]
fn times(a: &Matrix2x3<f64>, b: &Matrix3<f64>) -> Matrix2x3<f64> {
    let mut c = Matrix2x3::zeros();
    for (j, b) in b.column_iter().enumerate() {
        (0..2).for_each(|i| c[(i, j)] = a[(i, 0)] * b[0] + a[(i, 1)] * b[1] + a[(i, 2)] * b[2]);
    }
    c
}

/// Derivative by the displacement field of the sum of samples, each given by where the formula images it, with its weight.
fn field_columns(
    camera: &Camera,
    samples: impl Iterator<Item = (Vector2<f64>, Matrix2<f64>)>,
) -> Vec<(usize, Matrix2<f64>)> {
    let mut columns: Vec<(usize, Matrix2<f64>)> = Vec::with_capacity(Touched::POINTS);
    for (touched, g) in samples.filter_map(|(h, g)| Some((camera.touched(&h)?, g))) {
        for (k, b) in touched.points() {
            match columns.binary_search_by_key(&k, |c| c.0) {
                Ok(at) => columns[at].1 += g * b,
                Err(at) => columns.insert(at, (k, g * b)),
            }
        }
    }
    columns
}

/// Area centroid of the image of a circle, px, without derivatives; `None` where the lens does not image all of it.
pub fn centroid_uv(
    camera: &Camera,
    camera_from_plate: &Pose,
    centre: &Vector3<f64>,
    radius_m: f64,
) -> Option<Vector2<f64>> {
    match radius_m {
        0.0 => camera.project(&camera_from_plate.transform(centre)),
        r if is_far(camera_from_plate, centre, r) => {
            centroid_of_samples(&FAR_SAMPLES, camera, camera_from_plate, centre, r)
        }
        r => centroid_of_samples(&NEAR_SAMPLES, camera, camera_from_plate, centre, r),
    }
}

fn centroid_of_samples<const N: usize>(
    at: &Samples<N>,
    camera: &Camera,
    camera_from_plate: &Pose,
    centre: &Vector3<f64>,
    radius_m: f64,
) -> Option<Vector2<f64>> {
    let [x, y, z] = at.of_circle(camera_from_plate, centre, radius_m);
    let mut uv = [[0.0; N]; 2];
    for k in 0..N {
        let sample = camera.project(&Vector3::new(x[k], y[k], z[k]))?;
        (0..2).for_each(|i| uv[i][k] = sample[i]);
    }
    Some(centroid_weights(at, &uv).0)
}

/// Area centroid of a closed contour of samples, and its derivative with respect to each sample.
#[inline(always)]
fn centroid_weights<const N: usize>(at: &Samples<N>, uv: &[[f64; N]; 2]) -> (Vector2<f64>, Weights<N>) {
    let ones = [1.0; N];
    let origin = [weighted_sum(&uv[0], &ones) / N as f64, weighted_sum(&uv[1], &ones) / N as f64];
    let (mut x, mut y, mut xx, mut yy) = ([0.0; N], [0.0; N], [0.0; N], [0.0; N]);
    for k in 0..N {
        (x[k], y[k]) = (uv[0][k] - origin[0], uv[1][k] - origin[1]);
        (xx[k], yy[k]) = (x[k] * x[k], y[k] * y[k]);
    }
    let (dx, dy, dxx, dyy) =
        (at.differentiated(&x), at.differentiated(&y), at.differentiated(&xx), at.differentiated(&yy));
    let (mut x_dy, mut y_dx) = ([0.0; N], [0.0; N]);
    for k in 0..N {
        (x_dy[k], y_dx[k]) = (x[k] * dy[k], y[k] * dx[k]);
    }
    // Green: area = sum x y', moments = sum x^2 y' / 2 and -sum y^2 x' / 2 (the common factor 2 pi / N cancels).
    let area = weighted_sum(&x, &dy);
    let c = [weighted_sum(&x, &x_dy) / 2.0 / area, -weighted_sum(&y, &y_dx) / 2.0 / area];
    let mut weights = [[[0.0; N]; 2]; 2];
    for k in 0..N {
        weights[0][0][k] = (x_dy[k] - c[0] * dy[k]) / area;
        weights[0][1][k] = (-dxx[k] / 2.0 + c[0] * dx[k]) / area;
        weights[1][0][k] = (dyy[k] / 2.0 - c[1] * dy[k]) / area;
        weights[1][1][k] = (-y_dx[k] + c[1] * dx[k]) / area;
    }
    (Vector2::new(origin[0] + c[0], origin[1] + c[1]), weights)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::camera::Lens;
    use nalgebra::Vector6;

    fn close_wide_view() -> (Camera, Pose) {
        let mut camera = Camera::pinhole(Lens::Brown, 1280, 1024, 640.0 / 37.5_f64.to_radians().tan());
        camera.parameters[4..].copy_from_slice(&[-0.12, 0.02, 5e-4, -3e-4, 0.0]);
        let tilt = Pose::exp(&Vector6::new(0.0, 0.0, 0.0, 50_f64.to_radians(), 0.1, 0.3));
        (camera, Pose::new(tilt.rotation, Vector3::new(0.02, -0.03, 0.12)))
    }

    /// Centroid from 20 000 polygon corners: an independent witness of the spectral formula.
    fn polygon_centroid(camera: &Camera, pose: &Pose, centre: &Vector3<f64>, radius: f64) -> Vector2<f64> {
        let n = 20_000;
        let corner = |k: usize| {
            let a = TAU * k as f64 / n as f64;
            camera.project(&pose.transform(&(centre + Vector3::new(a.cos(), a.sin(), 0.0) * radius))).unwrap()
        };
        let origin = corner(0);
        let (mut area, mut moment) = (0.0, Vector2::zeros());
        for k in 0..n {
            let (a, b) = (corner(k) - origin, corner(k + 1) - origin);
            let cross = a.x * b.y - b.x * a.y;
            area += cross / 2.0;
            moment += (a + b) * cross / 6.0;
        }
        origin + moment / area
    }

    #[test]
    fn twelve_samples_give_the_area_centroid_at_close_range() {
        let (camera, pose) = close_wide_view();
        for centre in [[0.0, 0.0], [0.03, 0.02], [-0.05, 0.04], [0.04, -0.02]] {
            let centre = Vector3::new(centre[0], centre[1], 0.0);
            let truth = polygon_centroid(&camera, &pose, &centre, 0.0054);
            let spectral = centroid(&camera, &pose, &centre, 0.0054).unwrap().uv;
            // The polygon itself is right to (2 pi / n)^2 r ~ 1e-6 px of shape, far less in its centroid.
            assert!((spectral - truth).norm() < 2e-7, "{centre}: {}", (spectral - truth).norm());
        }
    }

    #[test]
    fn eight_samples_do_from_fifty_radii_on() {
        let (camera, mut pose) = close_wide_view();
        let radius = 0.0054;
        pose.translation *= 1.01 * FAR * radius / pose.translation.norm();
        for centre in [[0.0, 0.0], [0.08, 0.06], [-0.12, 0.1], [0.1, -0.08]] {
            let centre = Vector3::new(centre[0], centre[1], 0.0);
            let fewer = centroid_of_contour(&FAR_SAMPLES, &camera, &pose, &centre, radius).unwrap().uv;
            let more = centroid_of_contour(&NEAR_SAMPLES, &camera, &pose, &centre, radius).unwrap().uv;
            assert!((fewer - more).norm() < 1e-7, "{centre}: {:e}", (fewer - more).norm());
        }
    }

    #[test]
    fn the_projected_centre_is_wrong_where_the_centroid_is_right() {
        let (camera, pose) = close_wide_view();
        let centre = Vector3::new(0.03, 0.02, 0.0);
        let projected = camera.project(&pose.transform(&centre)).unwrap();
        let truth = polygon_centroid(&camera, &pose, &centre, 0.0054);
        assert!((projected - truth).norm() > 0.1);
    }
}
