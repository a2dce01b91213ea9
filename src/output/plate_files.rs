//! plate.toml and plate.csv with corrected positions, in the formats that a series reads.

use std::collections::BTreeSet;

use nalgebra::Matrix3;

use super::Context;
use super::gauge::{plates_tied_to, rigid, rigid_covariance, seen_markers};
use super::names::{file_names, plate_name};
use super::text::csv;
use crate::error::Result;
use crate::model::plate_modes::MODES;
use crate::recipe::Solution;
use crate::series::plate_toml;

const HEADER: [&str; 9] =
    ["id", "x_m", "y_m", "z_m", "outer_radius_m", "inner_radius_m", "sigma_x_m", "sigma_y_m", "sigma_z_m"];

/// plate.toml and plate.csv of every plate, as (file name, text).
///
/// # Errors
/// Markers that lie on a line.
pub(super) fn plates(solution: &Solution, context: &Context) -> Result<Vec<(String, String)>> {
    let problem = &solution.problem;
    let names: Vec<String> = (0..problem.plates.len()).map(|p| plate_name(problem, context, p)).collect();
    let (tomls, tables) = (file_names("plate", "toml", &names), file_names("plate", "csv", &names));
    let mut out = Vec::new();
    for (k, (toml, table)) in tomls.into_iter().zip(tables).enumerate() {
        out.push((toml, plate_toml(&problem.plates[k], Some(&table))?));
        out.push((table, plate_csv(solution, k)?));
    }
    Ok(out)
}

fn plate_csv(solution: &Solution, plate: usize) -> Result<String> {
    let shape = &solution.state.plates[plate];
    let covariances = position_covariances(solution, plate)?;
    let mut rows = vec![HEADER.map(String::from).to_vec()];
    for (k, m) in solution.problem.plates[plate].markers.iter().enumerate() {
        let x = shape.position(k);
        let sigma = covariances[k].diagonal().map(|v| v.max(0.0).sqrt());
        let numbers = [x.x, x.y, x.z, m.outer_radius_m, m.inner_radius_m, sigma.x, sigma.y, sigma.z];
        let mut row = vec![m.id.to_string()];
        row.extend(numbers.map(|v| format!("{v:?}")));
        rows.push(row);
    }
    Ok(csv(&rows))
}

/// Covariance of the position (modes and correction) of every marker, m^2, in the frame that the nominal markers define. A marker
/// that no image shows keeps its tolerance.
///
/// # Errors
/// Markers that lie on a line.
pub(super) fn position_covariances(solution: &Solution, plate: usize) -> Result<Vec<Matrix3<f64>>> {
    let (problem, covariance) = (&solution.problem, &solution.covariance);
    let shape = &solution.state.plates[plate];
    let frame = rigid_covariance(problem, &seen_markers(problem, &plates_tied_to(problem, BTreeSet::from([plate]))))?;
    let start = problem.layout.shapes[plate].start;
    let modes = covariance.reduced.fixed_view::<MODES, MODES>(start, start).into_owned();
    let all = covariance.positions(problem, &solution.state).swap_remove(plate);
    let one = |(m, seen): (usize, Option<Matrix3<f64>>)| match seen {
        Some(total) => {
            let n = rigid(&shape.nominal[m]);
            total - n * frame * n.transpose()
        }
        None => {
            let b = shape.modes_at(m);
            b * modes * b.transpose() + Matrix3::identity() / problem.marker_information(plate, m)
        }
    };
    Ok(all.into_iter().enumerate().map(one).collect())
}
