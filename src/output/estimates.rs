//! All scalar estimates of the dense part with their sigmas, and their covariance.

use super::Context;
use super::names::column_names;
use super::solution_json::EstimateRecord;
use crate::error::{Code, Error, Result};
use crate::identify::Solution;

/// Posterior sigma of a column in its unit; `None` where it was held fixed or nothing touches it.
pub(super) fn sigma(solution: &Solution, column: usize) -> Option<f64> {
    let known = solution.fit.problem.layout.columns[column].free && solution.fit.covariance.system.touched(column);
    known.then(|| solution.fit.covariance.sigma(column))
}

/// `1 - sigma^2 / prior^2` of a column with a prior.
pub(super) fn share_of_data(solution: &Solution, column: usize) -> Option<f64> {
    let prior = solution.fit.problem.layout.columns[column].prior_sigma;
    let sigma = sigma(solution, column).filter(|_| prior.is_finite())?;
    Some((1.0 - (sigma / prior).powi(2)).max(0.0))
}

/// Every column with what is known of it.
///
/// # Errors
/// A value or sigma that is not finite.
pub(super) fn estimates(solution: &Solution, context: &Context) -> Result<Vec<EstimateRecord>> {
    let layout = &solution.fit.problem.layout;
    let values = solution.fit.state.values(layout);
    let poses = || layout.mountings.iter().chain(&layout.placements);
    let names = column_names(&solution.fit.problem, &context.series);
    let mut all = Vec::with_capacity(layout.len());
    for (k, (column, name)) in layout.columns.iter().zip(names).enumerate() {
        let sigma = sigma(solution, k);
        if !values[k].is_finite() || sigma.is_some_and(|s| !s.is_finite()) {
            let what = "its estimate is not finite";
            return Err(Error::new(
                Code::EstimateNotFinite,
                name,
                what,
                "look at the images and joint readings that determine it",
            ));
        }
        let prior = column.prior_sigma.is_finite();
        all.push(EstimateRecord {
            name,
            unit: column.unit.into(),
            value: (!poses().any(|r| r.contains(&k))).then_some(values[k]),
            sigma,
            prior_mean: prior.then_some(column.prior_mean),
            prior_sigma: prior.then_some(column.prior_sigma),
            sigma_model: sigma.and_then(|_| solution.uncertainty.model_sigma.get(k).copied()),
            sigma_clustered: sigma.and_then(|_| solution.uncertainty.clustered_sigma.as_ref()?.get(k).copied()),
            free: column.free,
            share_of_data: share_of_data(solution, k),
        });
    }
    Ok(all)
}

/// Lower triangle of the covariance of the dense part, row by row; zero where a column was held fixed or is not touched.
pub(super) fn lower_triangle(solution: &Solution) -> Vec<f64> {
    let known: Vec<bool> = (0..solution.fit.problem.layout.len()).map(|k| sigma(solution, k).is_some()).collect();
    let c = &solution.fit.covariance.reduced;
    let entry = |i: usize, j: usize| if known[i] && known[j] { c[(i, j)] } else { 0.0 };
    (0..known.len()).flat_map(|i| (0..=i).map(move |j| (i, j))).map(|(i, j)| entry(i, j)).collect()
}
