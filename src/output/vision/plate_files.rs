//! plate.toml and plate.csv with corrected positions, in the formats that a series reads.

use crate::error::Result;
use crate::model::plate_modes::radius;
use crate::output::gauge::Gauge;
use crate::output::names::{file_names, plate_name};
use crate::problem::Problem;
use crate::series::{Edge, plate_toml, to_csv};

const HEADER: [&str; 9] =
    ["id", "x_m", "y_m", "z_m", "outer_radius_m", "inner_radius_m", "sigma_x_m", "sigma_y_m", "sigma_z_m"];

/// plate.toml and plate.csv of every plate, as (file name, text).
///
/// # Errors
/// A plate that cannot be written.
pub fn plates(problem: &Problem, series: &[String], gauge: &Gauge) -> Result<Vec<(String, String)>> {
    let names: Vec<String> = (0..problem.plates.len()).map(|p| plate_name(problem, series, p)).collect();
    let (tomls, tables) = (file_names("plate", "toml", &names), file_names("plate", "csv", &names));
    let mut out = Vec::new();
    for (k, (toml, table)) in tomls.into_iter().zip(tables).enumerate() {
        out.push((toml, plate_toml(&problem.plates[k], Some(&table))?));
        out.push((table, plate_csv(problem, k, gauge)));
    }
    Ok(out)
}

fn plate_csv(problem: &Problem, plate: usize, gauge: &Gauge) -> String {
    let shape = &gauge.plates[plate];
    let covariances = &gauge.positions[plate];
    let mut rows = vec![HEADER.map(String::from).to_vec()];
    for (k, m) in problem.plates[plate].markers.iter().enumerate() {
        let x = shape.position(k);
        let sigma = covariances[k].diagonal().map(|v| v.max(0.0).sqrt());
        let [outer, inner] = [(m.outer_radius_m, Edge::Outer), (m.inner_radius_m, Edge::Inner)]
            .map(|(radius_m, edge)| radius(radius_m, edge, &shape.modes).0);
        let numbers = [x.x, x.y, x.z, outer, inner, sigma.x, sigma.y, sigma.z];
        let mut row = vec![m.id.to_string()];
        row.extend(numbers.map(|v| format!("{v:?}")));
        rows.push(row);
    }
    to_csv(&rows)
}
