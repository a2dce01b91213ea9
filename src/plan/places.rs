//! Where to put the plate: the same number of images with the plate at each place, compared.

use nalgebra::DMatrix;

use super::choose::{Choice, PlanRequest, criterion};
use super::forecast::{KNOWN_SHARE, exact_covariance, flange_m};
use crate::error::Result;
use crate::plan::relax::Design;
use crate::plan::rounding::round;

/// What images with the plate at one place would be worth.
#[derive(Debug, Clone, PartialEq)]
pub struct PlaceForecast {
    /// Index of the placement.
    pub placement: usize,
    /// Its name.
    pub name: String,
    /// Workable poses found there.
    pub candidates: usize,
    /// Expected error of the flange, m; `None` where there are fewer workable poses than images.
    pub flange_m: Option<f64>,
    /// Parameters of the robot that become known one by one.
    pub known: Vec<String>,
}

/// Every placement of the request by itself, from the candidates drawn for a choice over all of them: those searched near the
/// best would favour the places that this choice prefers.
///
/// # Errors
/// Where a parameter asked for is unknown.
pub fn compare_places(request: &PlanRequest, choice: &Choice) -> Result<Vec<PlaceForecast>> {
    let criterion =
        choice.identified.criterion(&criterion(&request.demand, &choice.adjustment.problem.layout, &choice.weight)?);
    let setting = &request.setting;
    let one = |(placement, (name, _)): (usize, &(String, crate::geom::Pose))| {
        let here: Vec<usize> = (0..choice.drawn).filter(|&k| choice.pool[k].placement == placement).collect();
        let candidates: Vec<DMatrix<f64>> = here.iter().map(|&k| choice.information[k].clone()).collect();
        let design = Design {
            known: &choice.known,
            candidates: &candidates,
            criterion: &criterion,
            count: request.count,
            rows: &[],
        };
        let chosen = design.relax().ok().and_then(|r| round(&design, &r)).map(|r| r.chosen);
        let covariance = chosen.and_then(|chosen| {
            let planned = chosen.iter().filter_map(|&k| choice.stop(setting, here[k], ""));
            let stops = request.taken.iter().cloned().chain(planned).collect();
            exact_covariance(&choice.adjustment, setting, stops).ok()
        });
        PlaceForecast {
            placement,
            name: name.clone(),
            candidates: candidates.len(),
            flange_m: covariance.as_ref().map(|c| flange_m(&choice.weight, c)),
            known: covariance.as_ref().map_or(Vec::new(), |c| known(choice, c)),
        }
    };
    Ok(setting.placements.iter().enumerate().map(one).collect())
}

fn known(choice: &Choice, covariance: &DMatrix<f64>) -> Vec<String> {
    let layout = &choice.adjustment.problem.layout;
    let is_known = |k: &usize| 1.0 - covariance[(*k, *k)] / layout.columns[*k].prior_sigma.powi(2) > KNOWN_SHARE;
    let name = |k: usize| layout.columns[k].name.trim_start_matches("robot/").to_owned();
    (0..layout.terms.end).filter(is_known).map(name).collect()
}

/// The comparison in words, the best place first.
pub fn place_words(places: &[PlaceForecast]) -> Vec<String> {
    let mut order: Vec<&PlaceForecast> = places.iter().collect();
    let error = |p: &PlaceForecast| p.flange_m.unwrap_or(f64::INFINITY);
    order.sort_by(|a, b| error(a).total_cmp(&error(b)));
    let line = |p: &&PlaceForecast| match p.flange_m {
        None => format!("plate at {}: only {} workable poses", p.name, p.candidates),
        Some(m) => {
            let others: Vec<&String> =
                places.iter().filter(|o| o.placement != p.placement).flat_map(|o| &o.known).collect();
            let only: Vec<&str> = p.known.iter().filter(|k| !others.contains(k)).map(String::as_str).collect();
            let extra = match only.is_empty() {
                true => String::new(),
                false => format!("; only here become known: {}", only.join(", ")),
            };
            format!("plate at {} alone: {:.3} mm expected{extra}", p.name, 1e3 * m)
        }
    };
    order.iter().map(line).collect()
}
