//! observations.csv: everything that was measured, its residual, and why some of it was left out.

use crate::output::names::ImageNames;
use crate::output::solution::residuals::{poses, residuals};
use crate::series::{Edge, csv_line};
use crate::solve::Fit;

/// Name of the file.
pub const FILE_NAME: &str = "observations.csv";

const HEADER: [&str; 11] = ["image", "marker", "u", "v", "edge", "cov_uu", "cov_uv", "cov_vv", "du", "dv", "reason"];

/// Text of observations.csv; covariances as the detector states them, du and dv measured minus predicted (px). For an image
/// that is left out the prediction is that of its joint readings.
pub fn observations_csv(fit: &Fit, series: &[String]) -> String {
    let names = ImageNames::new(&fit.problem, series);
    let poses = poses(fit);
    let mut text = csv_line(&HEADER.map(String::from));
    for (k, image) in fit.problem.images.iter().enumerate() {
        let markers = &fit.problem.plates[image.plate].markers;
        let residuals = residuals(fit, k, poses[k].as_ref());
        for (o, residual) in image.observations.iter().zip(residuals) {
            let covariance = o.information.try_inverse().unwrap_or_default();
            let edge = match o.edge {
                Edge::Outer => "outer",
                Edge::Inner => "inner",
            };
            let mut row = vec![names.of(k).to_owned(), markers[o.marker].id.to_string()];
            row.extend([o.uv.x, o.uv.y].map(|v| format!("{v:?}")));
            row.push(edge.into());
            row.extend([(0, 0), (0, 1), (1, 1)].map(|at| format!("{:?}", covariance[at])));
            row.extend([0, 1].map(|at| residual.map_or_else(String::new, |r| format!("{:.6}", r[at]))));
            row.push(
                image.rejected.as_ref().map_or_else(
                    || o.rejected.map_or("", |r| r.code()).to_owned(),
                    |reason| format!("image: {reason}"),
                ),
            );
            text.push_str(&csv_line(&row));
        }
    }
    text
}
