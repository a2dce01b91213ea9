//! All scalar estimates of the dense part with their sigmas, and their covariance.

use nalgebra::DMatrix;

use super::solution_json::EstimateRecord;
use crate::assess::Uncertainty;
use crate::error::{Code, Error, Result};
use crate::identify::Solution;
use crate::output::gauge::Gauge;
use crate::output::names::column_names;
use crate::solve::Fit;

/// False where a column was held fixed or nothing touches it.
fn is_known(fit: &Fit, column: usize) -> bool {
    fit.problem.layout.columns[column].free && fit.covariance.system.touched(column)
}

/// `1 - sigma^2 / prior^2` of a column with a prior.
fn share_of_data(fit: &Fit, column: usize) -> Option<f64> {
    let prior = fit.problem.layout.columns[column].prior_sigma;
    let sigma = Some(fit.covariance.sigma(column)).filter(|_| is_known(fit, column) && prior.is_finite())?;
    Some((1.0 - (sigma / prior).powi(2)).max(0.0))
}

/// True where an image in use ties the six columns of a pose to the data.
pub fn determined(solution: &Solution, start: usize) -> bool {
    (start..start + 6).all(|c| solution.fit.covariance.system.touched(c))
}

/// Every column with what is known of it by the `stated` covariance, beside what else an `uncertainty` says.
///
/// # Errors
/// A value or sigma that is not finite.
pub(super) fn estimates(
    fit: &Fit,
    series: &[String],
    stated: &DMatrix<f64>,
    uncertainty: Option<&Uncertainty>,
) -> Result<Vec<EstimateRecord>> {
    let layout = &fit.problem.layout;
    let values = fit.state.values(layout);
    let poses = || layout.mountings.iter().chain(&layout.placements);
    let names = column_names(&fit.problem, series);
    let mut all = Vec::with_capacity(layout.len());
    for (k, (column, name)) in layout.columns.iter().zip(names).enumerate() {
        let sigma = is_known(fit, k).then(|| stated[(k, k)].max(0.0).sqrt());
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
            sigma_model: sigma.and_then(|_| uncertainty?.model_sigma.get(k).copied()),
            sigma_clustered: sigma.and_then(|_| uncertainty?.clustered_sigma.as_ref()?.get(k).copied()),
            free: column.free,
            share_of_data: share_of_data(fit, k),
        });
    }
    Ok(all)
}

/// The covariance of the dense part that is stated, without a robot that of the fit; that of placements is of the poses that are written.
pub fn covariance_of_columns(fit: &Fit, gauge: &Gauge, uncertainty: Option<&Uncertainty>) -> DMatrix<f64> {
    let layout = &fit.problem.layout;
    let of_fit = || fit.covariance.reduced.view((0, 0), (layout.len(), layout.len())).into_owned();
    let mut stated = uncertainty.map_or_else(of_fit, |u| u.covariance.clone());
    for (placement, columns) in layout.placements.iter().enumerate() {
        let followed = gauge.followed(placement);
        let rows = followed * stated.fixed_rows::<6>(columns.start);
        stated.fixed_rows_mut::<6>(columns.start).copy_from(&rows);
        let columns_after = stated.fixed_columns::<6>(columns.start) * followed.transpose();
        stated.fixed_columns_mut::<6>(columns.start).copy_from(&columns_after);
    }
    stated
}

/// Lower triangle of the stated covariance, row by row; zero where a column was held fixed or is not touched.
pub(super) fn lower_triangle(fit: &Fit, stated: &DMatrix<f64>) -> Vec<f64> {
    let known: Vec<bool> = (0..stated.nrows()).map(|k| is_known(fit, k)).collect();
    let entry = |i: usize, j: usize| if known[i] && known[j] { stated[(i, j)] } else { 0.0 };
    (0..known.len()).flat_map(|i| (0..=i).map(move |j| (i, j))).map(|(i, j)| entry(i, j)).collect()
}
