//! One lens expressed by another, and what that loses.

use nalgebra::{SMatrix, SVector, Vector2, Vector3};

use super::formula::MAX_PARAMETERS;
use super::lens::Lens;
use super::projection::Camera;

/// Points across the image.
const ACROSS: usize = 33;
/// Most Gauss-Newton steps.
const STEPS: usize = 60;

/// The nearest camera of another lens.
#[derive(Debug, Clone, PartialEq)]
pub struct LensFit {
    /// It.
    pub camera: Camera,
    /// RMS of what it loses over the image, px.
    pub rms_px: f64,
    /// The most that it loses, px.
    pub worst_px: f64,
}

impl Camera {
    /// The nearest camera that ROS has a model for, for points from the nearer to the farther depth (m), and its loss; `None` where ROS has this
    /// one, or none that comes near.
    pub fn in_ros(&self, depths_m: &[f64; 2]) -> Option<LensFit> {
        let nearest = match self.lens.formula() {
            _ if self.lens.is_in_ros() => return None,
            Lens::Fisheye => Lens::Fisheye,
            _ => Lens::Rational,
        };
        fit_lens(self, nearest, depths_m)
    }
}

/// Fits a camera with the lens `lens` to `camera` over its whole image, for points from the nearer to the farther depth (m).
///
/// `None` where too little of the image has a direction, or where the fit does not settle.
pub fn fit_lens(camera: &Camera, lens: Lens, depths_m: &[f64; 2]) -> Option<LensFit> {
    fit_lens_holding(camera, lens, &[], depths_m)
}

/// As [`fit_lens`], with some parameters of the fitted camera held at zero.
pub fn fit_lens_holding(camera: &Camera, lens: Lens, zeros: &[usize], depths_m: &[f64; 2]) -> Option<LensFit> {
    fit_lens_to(camera, lens, zeros, &points(camera, depths_m))
}

/// As [`fit_lens_holding`], to points in space (m) with their images (px), from the pinhole of `camera`.
pub fn fit_lens_to(
    camera: &Camera,
    lens: Lens,
    zeros: &[usize],
    points: &[(Vector3<f64>, Vector2<f64>)],
) -> Option<LensFit> {
    if points.len() < ACROSS * ACROSS / 2 {
        return None;
    }
    let mut start = Camera::pinhole(lens, camera.width_px, camera.height_px, camera.parameters[0]);
    start.parameters[..4].copy_from_slice(&camera.parameters[..4]);
    let free = settled(&start, points, zeros, squares);
    free.or_else(|| settled(&within_image(&start, points, zeros), points, zeros, squares_of_images))
}

/// Where a fit starts that is held to cameras which image all points: with a denominator from the lens without one, as numerator and
/// denominator nearly say the same, and a fit from far away leaves a pole between the points.
fn within_image(start: &Camera, points: &[(Vector3<f64>, Vector2<f64>)], zeros: &[usize]) -> Camera {
    let mut plain = Camera::pinhole(Lens::Brown, start.width_px, start.height_px, start.parameters[0]);
    plain.parameters[..4].copy_from_slice(&start.parameters[..4]);
    let count = plain.parameters.len();
    let zeros: Vec<usize> = zeros.iter().copied().filter(|k| *k < count).collect();
    let extended = || settled(&plain, points, &zeros, squares_of_images)?.camera.extended(start.lens);
    extended().unwrap_or_else(|| start.clone())
}

/// A sum of squares over points (m) with their images (px).
type Cost = fn(&Camera, &[(Vector3<f64>, Vector2<f64>)]) -> Option<f64>;

/// Gauss-Newton from a camera; `cost_of` is the sum of squares that has to fall, and says where a camera may not go. `None` where the camera to
/// which it comes does not image all points.
fn settled(start: &Camera, points: &[(Vector3<f64>, Vector2<f64>)], zeros: &[usize], cost_of: Cost) -> Option<LensFit> {
    let mut fitted = start.clone();
    let mut damping = 1e-6;
    let mut cost = cost_of(&fitted, points)?;
    for _ in 0..STEPS {
        let mut next = fitted.clone();
        let step = step(&fitted, points, damping, zeros);
        next.parameters.iter_mut().zip(step.iter().flatten()).for_each(|(p, s)| *p += s);
        match cost_of(&next, points).filter(|c| step.is_some() && *c <= cost) {
            Some(lower) => {
                let settled = cost - lower < 1e-12 * (cost + 1e-12);
                (fitted, cost, damping) = (next, lower, (0.1 * damping).max(1e-9));
                if settled {
                    break;
                }
            }
            None if damping > 1e6 => break,
            None => damping *= 10.0,
        }
    }
    let losses: Vec<f64> = points.iter().filter_map(|(x, uv)| Some((fitted.project(x)? - uv).norm())).collect();
    let worst_px = losses.iter().fold(0.0, |m: f64, l| m.max(*l));
    let complete = losses.len() == points.len();
    complete.then(|| LensFit { camera: fitted, rms_px: (cost / points.len() as f64).sqrt(), worst_px })
}

/// Points in space (m) with their images (px), all over the image and the depths.
fn points(camera: &Camera, depths_m: &[f64; 2]) -> Vec<(Vector3<f64>, Vector2<f64>)> {
    let place = |k: usize, n: u32| k as f64 * (f64::from(n) - 1.0) / (ACROSS - 1) as f64;
    let mut points = Vec::new();
    for i in 0..ACROSS * ACROSS {
        let uv = Vector2::new(place(i % ACROSS, camera.width_px), place(i / ACROSS, camera.height_px));
        let Some(ray) = camera.ray(&uv) else { continue };
        let all = [depths_m[0], 0.5 * (depths_m[0] + depths_m[1]), depths_m[1]].map(|z| ray * z);
        points.extend(all.iter().filter_map(|x| Some((*x, camera.project(x)?))));
    }
    points
}

fn squares(camera: &Camera, points: &[(Vector3<f64>, Vector2<f64>)]) -> Option<f64> {
    let square =
        |(x, uv): &(Vector3<f64>, Vector2<f64>)| Some((camera.project_with_jacobian(x)?.uv - uv).norm_squared());
    points.iter().map(square).sum::<Option<f64>>().filter(|s| s.is_finite())
}

/// As [`squares`], and `None` for a camera that does not image all points.
fn squares_of_images(camera: &Camera, points: &[(Vector3<f64>, Vector2<f64>)]) -> Option<f64> {
    let square = |(x, uv): &(Vector3<f64>, Vector2<f64>)| Some((camera.project(x)? - uv).norm_squared());
    points.iter().map(square).sum::<Option<f64>>().filter(|s| s.is_finite())
}

fn step(camera: &Camera, points: &[(Vector3<f64>, Vector2<f64>)], damping: f64, zeros: &[usize]) -> Option<Vec<f64>> {
    let mut normal = SMatrix::<f64, MAX_PARAMETERS, MAX_PARAMETERS>::zeros();
    let mut right = SVector::<f64, MAX_PARAMETERS>::zeros();
    for (x, uv) in points {
        let p = camera.project_with_jacobian(x)?;
        normal += p.d_parameters.transpose() * p.d_parameters;
        right += p.d_parameters.transpose() * (uv - p.uv);
    }
    for k in 0..MAX_PARAMETERS {
        normal[(k, k)] += if k < camera.parameters.len() { damping * normal[(k, k)] + 1e-9 } else { 1.0 };
    }
    for &k in zeros {
        normal.row_mut(k).fill(0.0);
        normal.column_mut(k).fill(0.0);
        normal[(k, k)] = 1.0;
        right[k] = 0.0;
    }
    let step = normal.cholesky()?.solve(&right);
    Some(step.iter().take(camera.parameters.len()).copied().collect())
}
