//! Which robot model the data support: Laplace's approximation of the evidence, at the same noise components.
//!
//! `ln E = -cost - 1/2 ln det N - sum ln sigma_prior` up to what the models share, with the whole information `N` (dense columns,
//! latents and markers) at the optimum of each (D. MacKay, *Bayesian interpolation*, 1992).

use super::estimator::Estimator;
use super::joint::identify_model;
use super::lens_choice::{self, with_lenses};
use super::options::Options;
use super::solution::{Evidence, Solution};
use crate::error::Result;
use crate::fit::log_evidence;
use crate::model::joint_terms::RobotModel;
use crate::problem::{Adjustment, MeasuredSeries};
use crate::solve::{Settings, solve};
use crate::stage::stage;
use crate::urdf::Chain;

/// Identifies robot, cameras, mountings and plates from identified series. The automatic model is the largest that no smaller one
/// beats decisively; whoever names a joint term wants all of them.
///
/// # Errors
/// Input errors of the series; unsolved where the data do not determine camera or hand-camera offset, or readings and images do
/// not belong together.
pub fn identify(chain: Chain, series: &[MeasuredSeries], options: &Options) -> Result<Solution> {
    let chain = chain.carrying(options.payload.as_ref())?;
    let model = match options.model {
        RobotModel::Auto => RobotModel::Full,
        other => other,
    };
    let by_joint_fit = Options { model, estimator: Estimator::Joint, ..options.clone() };
    let (full, series) = with_lenses(&chain, series, &by_joint_fit)?;
    let mut solution = match options.model == RobotModel::Auto && !options.selection.names_terms() {
        true => best_model(chain, &series, options, full)?,
        false if options.estimator == Estimator::Joint => full,
        false => {
            let lenses = full.lenses;
            Solution { lenses, ..identify_model(chain, &series, &Options { model, ..options.clone() })? }
        }
    };
    let losses = lens_choice::losses(&solution);
    solution.findings.extend(losses.into_iter().map(Into::into));
    Ok(Solution { options: options.clone(), ..solution })
}

/// The solution with the smallest robot model that the evidence supports, from that with the full one.
fn best_model(chain: Chain, series: &[MeasuredSeries], options: &Options, full: Solution) -> Result<Solution> {
    let evidences = {
        let _stage = stage("evidence of robot models");
        compare_models(&full)
    };
    let supported = evidences.iter().filter(|e| e.log_evidence > -options.limits.decisive_log_odds);
    let largest = supported.max_by_key(|e| e.parameters).map_or(RobotModel::Full, |e| e.model);
    let lenses = full.lenses.clone();
    let chosen = match largest {
        RobotModel::Full if options.estimator == Estimator::Joint => full,
        model => identify_model(chain, series, &Options { model, ..options.clone() })?,
    };
    Ok(Solution { evidences, lenses, ..chosen })
}

/// Evidence of every model that a solution with the full one holds, at its noise components.
fn compare_models(full: &Solution) -> Vec<Evidence> {
    let mut all: Vec<Evidence> =
        [RobotModel::Rigid, RobotModel::Gear, RobotModel::Full].into_iter().filter_map(|m| evidence(full, m)).collect();
    let best = all.iter().map(|e| e.log_evidence).fold(f64::NEG_INFINITY, f64::max);
    all.iter_mut().for_each(|e| e.log_evidence -= best);
    all
}

fn evidence(full: &Solution, model: RobotModel) -> Option<Evidence> {
    let mut smaller = full.fit.adjustment.clone();
    let Adjustment { problem, state } = &mut smaller;
    let first = problem.layout.terms.start;
    for (k, t) in state.robot.terms.iter_mut().enumerate().filter(|(_, t)| !model.has(t.term)) {
        let column = &mut problem.layout.columns[first + k];
        // A fixed term stays at its prior mean, where its prior costs nothing.
        t.value = column.prior_mean;
        column.free = false;
    }
    let outcome = solve(smaller, &Settings::default());
    let linear = outcome.linear()?;
    let layout = &outcome.adjustment.problem.layout;
    let parameters = layout.columns[layout.robot()].iter().filter(|c| c.free).count();
    let log_evidence = log_evidence(linear)?;
    Some(Evidence { model, log_evidence, cost: linear.lin.cost, parameters })
}
