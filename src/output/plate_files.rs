//! plate.toml and plate.csv with corrected positions, in the formats that a series reads.

use std::collections::BTreeSet;

use nalgebra::{DMatrix, Matrix3, Vector3};
use rayon::prelude::*;

use super::Context;
use super::gauge::{plates_tied_to, rigid, rigid_covariance, seen_markers};
use super::names::{file_names, plate_name};
use super::text::csv;
use crate::error::Result;
use crate::linalg::product;
use crate::model::plate_modes::basis;
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
    let modes = problem.layout.shapes[plate].start;
    // A marker is v - D y with variance V of v and the reduced unknowns y, and its position adds the modes: B y.
    let parts: Vec<(Matrix3<f64>, DMatrix<f64>)> = (0..shape.nominal.len())
        .into_par_iter()
        .map(|m| {
            let (own, coupling) = covariance.system.marker_coupling(problem, &solution.linearised, plate, m);
            let mut f = -coupling;
            let b = basis(&shape.nominal[m], shape.half_diagonal_m);
            for c in 0..b.ncols() {
                for r in 0..3 {
                    f[(r, modes + c)] += b[(r, c)];
                }
            }
            (own, f)
        })
        .collect();
    let mut all = DMatrix::zeros(3 * parts.len(), covariance.reduced.nrows());
    for (k, (_, f)) in parts.iter().enumerate() {
        all.rows_mut(3 * k, 3).copy_from(f);
    }
    let pulled = product(&all, &covariance.reduced);
    let own = |(k, (own, f)): (usize, &(Matrix3<f64>, DMatrix<f64>))| {
        let spread = pulled.rows(3 * k, 3) * f.transpose();
        let total = own + Matrix3::from_column_slice(spread.as_slice());
        match covariance.system.seen(plate, k) {
            true => total - frame_part(&shape.nominal[k], &frame),
            false => total,
        }
    };
    Ok(parts.iter().enumerate().map(own).collect())
}

fn frame_part(x: &Vector3<f64>, frame: &nalgebra::Matrix6<f64>) -> Matrix3<f64> {
    let n = rigid(x);
    n * frame * n.transpose()
}
