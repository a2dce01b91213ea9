//! Lenses that no formula fits: the displacement field takes up what is left, and says where it knows nothing.

use crate::robots::ur10e;
use nalgebra::{DMatrix, DVector, Vector2, Vector3};
use robotcal::assess::ProjectionMap;
use robotcal::geom::skew;
use robotcal::identify::{Options, Solution, identify};
use robotcal::model::camera::{Camera, Lens};
use robotcal::plan::plate_design::{PlateRequest, design};
use robotcal::problem::MeasuredSeries;
use robotcal::simulate::{WorldRequest, series};
use robotcal::study::measured;

/// Noise of an observation, px per axis.
const NOISE_PX: f64 = 0.02;

/// The image is covered up to here, px.
const COVERED_TO: f64 = 960.0;

/// What the true lens does beyond Brown-Conrady, px: rings about a point, and a dent. It is no spline.
fn beyond(uv: &Vector2<f64>) -> Vector2<f64> {
    let from_middle = uv - Vector2::new(600.0, 540.0);
    let r = from_middle.norm();
    let rings = from_middle * (0.6 * (r / 75.0).sin() / r.max(1.0));
    let dent = uv - Vector2::new(350.0, 300.0);
    rings + Vector2::new(0.5, -0.8) * (-dent.norm_squared() / (2.0 * 110.0 * 110.0)).exp()
}

/// A series whose camera is Brown-Conrady with [`beyond`] on top; the right quarter of the image shows nothing.
fn seen(lens: Lens) -> (MeasuredSeries, Camera) {
    let plate = design(&PlateRequest { markers: Some(150), ..PlateRequest::default() }).unwrap().plate;
    let request = WorldRequest {
        images: 24,
        held_out: 2,
        pixel_sigma_px: NOISE_PX,
        seed: 11,
        ..WorldRequest::typical(ur10e(), plate)
    };
    let world = series(&request).unwrap();
    let mut seen = measured(&world, &ur10e());
    for o in seen.stops.iter_mut().flat_map(|s| &mut s.observations) {
        let uv = Vector2::from(o.uv);
        o.uv = (uv + beyond(&uv)).into();
    }
    seen.stops.iter_mut().for_each(|s| s.observations.retain(|o| o.uv[0] < COVERED_TO));
    seen.lens = lens;
    (seen, request.camera)
}

/// Images of the same directions by the true lens and by `camera`, px: place and difference, without the turn that poses take up.
fn errors(camera: &Camera, truth: &Camera, last_column: f64) -> Vec<(Vector2<f64>, f64)> {
    let mut places = Vec::new();
    for i in 0..40 {
        for k in 0..32 {
            let h = Vector2::new(20.0 + 31.0 * f64::from(i), 20.0 + 31.0 * f64::from(k));
            places.extend((h.x < last_column).then_some(h));
        }
    }
    let lines: Vec<(Vector2<f64>, Vector2<f64>, DMatrix<f64>)> = places
        .iter()
        .map(|h| {
            let ray: Vector3<f64> = truth.ray(h).unwrap();
            let p = camera.project_with_jacobian(&ray).unwrap();
            let uv = h + beyond(h);
            (uv, p.uv - uv, DMatrix::from_column_slice(2, 3, (p.d_point * skew(&ray)).as_slice()))
        })
        .collect();
    let mut turn = DMatrix::zeros(2 * lines.len(), 3);
    let mut off = DVector::zeros(2 * lines.len());
    for (k, (_, d, t)) in lines.iter().enumerate() {
        turn.rows_mut(2 * k, 2).copy_from(t);
        off.rows_mut(2 * k, 2).copy_from(d);
    }
    let fitted = turn.clone().svd(true, true).solve(&off, 1e-12).unwrap();
    let rest = off - turn * fitted;
    lines.iter().enumerate().map(|(k, l)| (l.0, rest[2 * k].hypot(rest[2 * k + 1]))).collect()
}

fn rms(s: &Solution) -> f64 {
    let all: Vec<f64> =
        s.fit.linearised.terms.iter().flat_map(|t| &t.residuals).map(|r| r.duv.norm_squared()).collect();
    (all.iter().sum::<f64>() / all.len() as f64 / 2.0).sqrt()
}

/// Number of observations within `within_px` of a place.
fn observed(series: &MeasuredSeries, at: &Vector2<f64>, within_px: f64) -> usize {
    let all = series.stops.iter().flat_map(|s| &s.observations);
    all.filter(|o| (Vector2::from(o.uv) - at).norm() < within_px).count()
}

#[test]
fn a_lens_that_brown_cannot_fit_is_fitted_to_the_noise() {
    let [(brown, truth), (with_field, _)] = [Lens::Brown, Lens::BrownField].map(seen);
    let plain = identify(ur10e(), std::slice::from_ref(&brown), &Options::default()).unwrap();
    let s = identify(ur10e(), &[with_field], &Options::default()).unwrap();
    println!("residual px per axis: brown {:.4}, brown+field {:.4}", rms(&plain), rms(&s));
    // The noise, less some three percent that parameters take up.
    assert!(rms(&plain) > 5.0 * NOISE_PX && (rms(&s) / NOISE_PX - 1.0).abs() < 0.06, "{} {}", rms(&plain), rms(&s));
    let covered = |e: &&(Vector2<f64>, f64)| observed(&brown, &e.0, 40.0) >= 8;
    let all = errors(&s.fit.state.cameras[0], &truth, COVERED_TO);
    let over_field: Vec<f64> = all.iter().filter(covered).map(|e| e.1).collect();
    let worst = over_field.iter().copied().fold(0.0, f64::max);
    println!("projection error over {} covered places of {}: worst {worst:.4} px", over_field.len(), all.len());
    assert!(over_field.len() > all.len() / 2 && worst < 0.05, "{worst}");
    let off_brown = errors(&plain.fit.state.cameras[0], &truth, COVERED_TO);
    assert!(off_brown.iter().filter(covered).any(|e| e.1 > 0.3), "Brown-Conrady can fit this lens");
    // The map is large where nothing was seen, and true where something was.
    let camera = &s.fit.state.cameras[0];
    let range = s.fit.problem.layout.cameras[0].clone();
    let covariance = s.fit.covariance.reduced.view((range.start, range.start), (range.len(), range.len())).into_owned();
    let map = ProjectionMap::new(camera, &covariance, 0.5);
    let (mut known, mut unknown) = (Vec::new(), Vec::new());
    for (k, sigma) in map.sigma_px.iter().enumerate() {
        let at = map.place(k, camera.width_px, camera.height_px);
        match observed(&brown, &at, 40.0) {
            8.. => known.push(sigma.unwrap()),
            _ if at.x > COVERED_TO + 100.0 => unknown.push(sigma.unwrap()),
            _ => {}
        }
    }
    let [known, unknown] = [known, unknown].map(|v| robotcal::linalg::median(&v).unwrap());
    println!("map: {known:.4} px where there are data, {unknown:.4} px where there are none");
    assert!(unknown > 5.0 * known && unknown > 0.1 && known < 0.05, "{known} {unknown}");
    // Directions that the formula says are not in the field.
    let field = DVector::from_row_slice(&camera.parameters[camera.parametric()..]);
    let inside = camera.parametric_directions().unwrap().tr_mul(&field).norm() / field.norm();
    assert!(inside < 1e-3, "{inside:e}");
}
