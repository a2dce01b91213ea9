//! Lenses that no formula fits: the displacement field takes up what is left, and says where it knows nothing.

#![allow(clippy::unwrap_used)]

use std::path::Path;

use nalgebra::{DMatrix, DVector, Vector2, Vector3};
use robotcal::assess::ProjectionMap;
use robotcal::geom::skew;
use robotcal::model::camera::{Camera, Lens};
use robotcal::plan::plate_design::{PlateRequest, design};
use robotcal::recipe::{MeasuredSeries, Options, Solution, identify, measured};
use robotcal::simulate::{WorldRequest, series};
use robotcal::urdf::{Chain, read};

/// Noise of an observation, px per axis.
const NOISE_PX: f64 = 0.02;

/// The image is covered up to here, px.
const COVERED_TO: f64 = 960.0;

fn chain() -> Chain {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("robots/ur10e/ur10e.urdf");
    read(&path).unwrap().chain(Some("base_link"), Some("tool0")).unwrap()
}

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
        images: 16,
        held_out: 2,
        pixel_sigma_px: NOISE_PX,
        seed: 11,
        ..WorldRequest::typical(chain(), plate)
    };
    let world = series(&request).unwrap();
    let mut seen = measured(&world, &chain());
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
    let all: Vec<f64> = s.linearised.terms.iter().flat_map(|t| &t.residuals).map(|r| r.duv.norm_squared()).collect();
    (all.iter().sum::<f64>() / all.len() as f64 / 2.0).sqrt()
}

#[test]
fn a_lens_that_brown_cannot_fit_is_fitted_to_the_noise() {
    let (brown, truth) = seen(Lens::Brown);
    let (mut with_field, _) = seen(Lens::BrownField);
    with_field.lens = Lens::BrownField;
    let start = std::time::Instant::now();
    let plain = identify(chain(), &[brown], &Options::default()).unwrap();
    println!("brown {:?}", start.elapsed());
    let start = std::time::Instant::now();
    let s = identify(chain(), &[with_field], &Options::default()).unwrap();
    println!("field {:?}", start.elapsed());
    println!("residual px per axis: brown {:.4}, brown+field {:.4}", rms(&plain), rms(&s));
    println!("hold-out mm {:.4} {:.4}", plain.accuracy.calibrated.rms_mm, s.accuracy.calibrated.rms_mm);
    let worst = |s: &Solution| {
        let all = errors(&s.state.cameras[0], &truth, COVERED_TO - 20.0);
        let ms = all.iter().map(|e| e.1 * e.1).sum::<f64>() / all.len() as f64;
        (ms.sqrt(), all.iter().map(|e| e.1).fold(0.0, f64::max))
    };
    println!("projection error rms, worst: brown {:?} field {:?}", worst(&plain), worst(&s));
    println!("families {:?}", s.problem.families.iter().map(|f| (&f.name, f.factor)).collect::<Vec<_>>());
    let range = s.problem.layout.cameras[0].clone();
    let covariance = s.covariance.reduced.view((range.start, range.start), (range.len(), range.len())).into_owned();
    let map = ProjectionMap::new(&s.state.cameras[0], &covariance, 0.5);
    for r in 0..map.rows {
        let row: Vec<String> = (0..map.columns)
            .map(|c| map.sigma_px[r * map.columns + c].map_or("  -  ".into(), |s| format!("{s:5.3}")))
            .collect();
        println!("{}", row.join(" "));
    }
    for c in 0..9 {
        let k = range.start + c;
        println!("{} {:.5} +- {:.5} (plain {:.5} +- {:.5})", s.problem.layout.columns[k].name, s.state.cameras[0].parameters[c], s.covariance.sigma(k), plain.state.cameras[0].parameters[c], plain.covariance.sigma(k));
    }
}
