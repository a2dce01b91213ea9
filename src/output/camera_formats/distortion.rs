//! The distortion of OpenCV with all its terms: what it says beyond the lenses of this program is lost, and how much.
//!
//! `cv::projectPoints`: x (1 + k1 r^2 + k2 r^4 + k3 r^6) / (1 + k4 r^2 + k5 r^4 + k6 r^6), tangential p1, p2, thin prism s1 to s4, and a tilted
//! sensor by the angles tx, ty.

use std::path::Path;

use nalgebra::{Matrix3, Rotation3, Vector2, Vector3};

use super::model::{ReadCamera, camera_of};
use crate::error::{Code, Error, Result};
use crate::model::camera::{Camera, Lens, LensFit, fit_lens_to};

/// Places across the plane z = 1 at which the nearest lens is fitted.
const ACROSS: usize = 81;

/// Numbers of coefficients that OpenCV takes.
const COUNTS: [usize; 6] = [0, 4, 5, 8, 12, 14];

/// The camera of k1 k2 p1 p2 [k3 [k4 k5 k6 [s1 s2 s3 s4 [tx ty]]]], or the nearest.
pub(super) fn read(
    path: &Path,
    name: Option<String>,
    size_px: [u32; 2],
    pinhole: [f64; 4],
    d: &[f64],
) -> Result<ReadCamera> {
    if !COUNTS.contains(&d.len()) {
        let what = format!("{} distortion coefficients", d.len());
        return Err(Error::new(Code::SettingRange, path.display(), what, "OpenCV has 4, 5, 8, 12 or 14"));
    }
    let mut all = [0.0; 14];
    all[..d.len()].copy_from_slice(d);
    let is_zero = |range: std::ops::Range<usize>| all[range].iter().all(|v| *v == 0.0);
    let exact = |lens: Lens, coefficients: &[f64]| {
        let camera = camera_of(path, lens, size_px, pinhole, coefficients)?;
        Ok(ReadCamera { name: name.clone(), camera, loss_px: None })
    };
    match (is_zero(5..8), is_zero(8..12), is_zero(12..14)) {
        (true, true, true) => exact(Lens::Brown, &all[..5]),
        (false, true, true) => exact(Lens::Rational, &all[..8]),
        (true, false, true) => exact(Lens::ThinPrism, &[&all[..5], &all[8..12]].concat()),
        _ => {
            let start = camera_of(path, Lens::Rational, size_px, pinhole, &all[..8])?;
            let LensFit { camera, rms_px, worst_px } = nearest(&start, &all).ok_or_else(|| {
                let what = "no lens of this program comes near to its distortion";
                Error::new(Code::LensUnknown, path.display(), what, "calibrate it with at most eight coefficients")
            })?;
            Ok(ReadCamera { name, camera, loss_px: Some([rms_px, worst_px]) })
        }
    }
}

fn nearest(start: &Camera, d: &[f64; 14]) -> Option<LensFit> {
    let tilt = tilt(d[12], d[13])?;
    let p = &start.parameters;
    let project = |x: &Vector3<f64>| {
        let at = distorted(&x.xy(), d, &tilt);
        Vector2::new(p[0] * at.x + p[2], p[1] * at.y + p[3])
    };
    // Places that show somewhat beyond the image, where the lens has not folded over.
    let reach = start.corner() * 1.3;
    let place = |k: usize| reach * (2.0 * k as f64 / (ACROSS - 1) as f64 - 1.0);
    let all = (0..ACROSS * ACROSS).map(|i| Vector3::new(place(i % ACROSS), place(i / ACROSS), 1.0));
    let points: Vec<_> =
        all.map(|x| (x, project(&x))).filter(|(x, uv)| start.contains(uv, 0.0) && start.project(x).is_some()).collect();
    let fits = [Lens::Rational, Lens::ThinPrism].into_iter().filter_map(|lens| fit_lens_to(start, lens, &[], &points));
    fits.min_by(|a, b| a.rms_px.total_cmp(&b.rms_px))
}

/// The projection onto a sensor that is turned by tx about x, then by ty about y.
fn tilt(tx: f64, ty: f64) -> Option<Matrix3<f64>> {
    let turn =
        Rotation3::from_axis_angle(&Vector3::y_axis(), -ty) * Rotation3::from_axis_angle(&Vector3::x_axis(), -tx);
    let r = turn.into_inner();
    let onto = Matrix3::new(r[(2, 2)], 0.0, -r[(0, 2)], 0.0, r[(2, 2)], -r[(1, 2)], 0.0, 0.0, 1.0);
    (r[(2, 2)] > 0.0).then_some(onto * r)
}

fn distorted(x: &Vector2<f64>, d: &[f64; 14], tilt: &Matrix3<f64>) -> Vector2<f64> {
    let r2 = x.norm_squared();
    let [k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4, ..] = *d;
    let radial = (1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))) / (1.0 + r2 * (k4 + r2 * (k5 + r2 * k6)));
    let tangential = Vector2::new(
        2.0 * p1 * x.x * x.y + p2 * (r2 + 2.0 * x.x * x.x),
        p1 * (r2 + 2.0 * x.y * x.y) + 2.0 * p2 * x.x * x.y,
    );
    let prism = Vector2::new(r2 * (s1 + r2 * s2), r2 * (s3 + r2 * s4));
    let at = tilt * (x * radial + tangential + prism).push(1.0);
    at.xy() / at.z
}
