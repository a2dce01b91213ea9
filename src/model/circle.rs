//! The area centroid of the image of a circle: what a detector measures.
//!
//! The contour is sampled at N points of the 3-D circle, each projected through the whole camera model. The samples define a
//! trigonometric polynomial; Green's theorem and the spectral derivative give area and first moments. The harmonics of the
//! contour fall off geometrically with (radius / distance), so N = 12 is exact to 1e-7 px for every plate that can be imaged, and
//! N = 8 where the distance is at least fifty radii.

use nalgebra::{Matrix2, Matrix2x3, SMatrix, Vector2, Vector3};
use std::f64::consts::TAU;
use std::sync::LazyLock;

use super::camera::{Camera, MAX_PARAMETERS, Projection};
use crate::geom::{Pose, skew};

/// Where the contour is sampled.
struct Samples<const N: usize> {
    /// On the circle of radius one in the plane of the plate.
    unit: [Vector3<f64>; N],
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
        let mut s = Self { unit: [Vector3::zeros(); N], derivative: [[0.0; N]; N] };
        for i in 0..N {
            s.unit[i] = Vector3::new(angle(i).cos(), angle(i).sin(), 0.0);
            for j in 0..N {
                if i != j {
                    let sign = if (i + j) % 2 == 0 { 0.5 } else { -0.5 };
                    s.derivative[i][j] = sign / ((angle(i) - angle(j)) / 2.0).tan();
                }
            }
        }
        s
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
    /// With respect to the body twist [rho, phi] of `camera_from_plate`.
    pub d_pose: SMatrix<f64, 2, 6>,
    /// With respect to the marker's centre in the plate frame, px/m.
    pub d_marker: Matrix2x3<f64>,
    /// With respect to the parameters of pinhole and lens formula.
    pub d_camera: SMatrix<f64, 2, MAX_PARAMETERS>,
    /// With respect to the displacement field: control points that it touches, ascending, with the derivative by their u and v.
    pub d_field: Vec<(usize, Matrix2<f64>)>,
}

/// Predicts the image of a point of the plate (plate frame, m); `None` behind the camera.
#[inline(always)]
pub fn point(camera: &Camera, camera_from_plate: &Pose, x: &Vector3<f64>) -> Option<Prediction> {
    let p = camera.project_with_jacobian(&camera_from_plate.transform(x))?;
    let d_marker = p.d_point * camera_from_plate.rotation;
    let mut d_pose = SMatrix::<f64, 2, 6>::zeros();
    d_pose.fixed_view_mut::<2, 3>(0, 0).copy_from(&d_marker);
    d_pose.fixed_view_mut::<2, 3>(0, 3).copy_from(&(-d_marker * skew(x)));
    let d_field = match p.field {
        Some(_) => field_columns(std::slice::from_ref(&p), &[Matrix2::identity()]),
        None => Vec::new(),
    };
    Some(Prediction { uv: p.uv, d_pose, d_marker, d_camera: p.d_parameters, d_field })
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
    let mut samples = [Projection::default(); N];
    let mut uv = [Vector2::zeros(); N];
    for (k, unit) in at.unit.iter().enumerate() {
        let x = centre + unit * radius_m;
        samples[k] = camera.project_with_jacobian(&camera_from_plate.transform(&x))?;
        uv[k] = samples[k].uv;
    }
    let (mean, weights) = centroid_weights(at, &uv);
    // With K_k = g_k d_point_k R: d_marker = sum K_k and d_phi = -sum K_k [centre + offset_k]x.
    let (mut d_marker, mut d_turn) = (Matrix2x3::zeros(), Matrix2x3::zeros());
    let mut d_camera = SMatrix::<f64, 2, MAX_PARAMETERS>::zeros();
    for ((p, g), unit) in samples.iter().zip(&weights).zip(&at.unit) {
        let k = g * p.d_point * camera_from_plate.rotation;
        d_marker += k;
        d_turn += k * skew(&(unit * radius_m));
        d_camera += g * p.d_parameters;
    }
    let mut d_pose = SMatrix::<f64, 2, 6>::zeros();
    d_pose.fixed_view_mut::<2, 3>(0, 0).copy_from(&d_marker);
    d_pose.fixed_view_mut::<2, 3>(0, 3).copy_from(&(-d_turn - d_marker * skew(centre)));
    Some(Prediction { uv: mean, d_pose, d_marker, d_camera, d_field: field_columns(&samples, &weights) })
}

/// Derivative by the displacement field of the sum of samples, each with its weight; nothing for a lens without a field.
fn field_columns(samples: &[Projection], weights: &[Matrix2<f64>]) -> Vec<(usize, Matrix2<f64>)> {
    let mut columns: Vec<(usize, Matrix2<f64>)> = Vec::new();
    for (touched, g) in samples.iter().zip(weights).filter_map(|(p, g)| p.field.as_ref().map(|t| (t, g))) {
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
    let mut uv = [Vector2::zeros(); N];
    for (k, unit) in at.unit.iter().enumerate() {
        let x = centre + unit * radius_m;
        uv[k] = camera.project(&camera_from_plate.transform(&x))?;
    }
    Some(centroid_weights(at, &uv).0)
}

/// Area centroid of a closed contour of samples, and its derivative with respect to each sample.
#[inline(always)]
fn centroid_weights<const N: usize>(at: &Samples<N>, uv: &[Vector2<f64>; N]) -> (Vector2<f64>, [Matrix2<f64>; N]) {
    let origin = uv.iter().sum::<Vector2<f64>>() / N as f64;
    let x: [f64; N] = std::array::from_fn(|k| uv[k].x - origin.x);
    let y: [f64; N] = std::array::from_fn(|k| uv[k].y - origin.y);
    let d = |f: &[f64; N]| -> [f64; N] {
        let mut out = [0.0; N];
        for (column, f) in at.derivative.iter().zip(f) {
            for (o, c) in out.iter_mut().zip(column) {
                *o -= c * f;
            }
        }
        out
    };
    let (dx, dy) = (d(&x), d(&y));
    let (dxx, dyy) = (d(&x.map(|a| a * a)), d(&y.map(|a| a * a)));
    // Green: area = sum x y', moments = sum x^2 y' / 2 and -sum y^2 x' / 2 (the common factor 2 pi / N cancels).
    let area: f64 = (0..N).map(|k| x[k] * dy[k]).sum();
    let mx: f64 = (0..N).map(|k| x[k] * x[k] * dy[k]).sum::<f64>() / 2.0;
    let my: f64 = (0..N).map(|k| -y[k] * y[k] * dx[k]).sum::<f64>() / 2.0;
    let c = Vector2::new(mx / area, my / area);
    let weights = std::array::from_fn(|k| {
        let (ax, ay) = (dy[k], -dx[k]);
        let (mxx, mxy) = (x[k] * dy[k], -dxx[k] / 2.0);
        let (myx, myy) = (dyy[k] / 2.0, -y[k] * dx[k]);
        Matrix2::new(mxx - c.x * ax, mxy - c.x * ay, myx - c.y * ax, myy - c.y * ay) / area
    });
    (origin + c, weights)
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
