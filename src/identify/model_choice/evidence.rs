//! Which robot model the data support: Laplace's approximation of the evidence, at the joint noise of the full model; where that leaves none, each at its
//! own.
//!
//! `ln E = -cost - 1/2 ln det N - sum ln sigma_prior` up to what the models share, with the whole information `N` (dense columns,
//! latents and markers) at the optimum of each (D. MacKay, *Bayesian interpolation*, 1992).

use nalgebra::DVector;

use crate::assess::Limits;
use crate::error::{Code, Notice, Result};
use crate::fit::{Fit, NoEvidence, log_evidence_of_fit, log_evidence_of_outcome};
use crate::identify::joint_fit::fit::{JointFit, fit_model};
use crate::identify::options::{JointNoise, Options};
use crate::identify::problem::build::FIRST_JOINT_NOISE;
use crate::identify::solution::Evidence;
use crate::linalg::SymmetricFactor;
use crate::model::joint_terms::{JointTerm, RobotModel};
use crate::problem::{Adjustment, MeasuredSeries};
use crate::solve::{
    ComponentOptions, JOINT_NOISE_FLOOR, LinearProblem, Settings, estimate_components, side_by_side, solve,
};
use crate::stage::stage;
use crate::urdf::Chain;

/// Newton decrement of a fit that is judged by its evidence, whose logarithm is then known to a tenth or so.
const DECREMENT: f64 = 0.1;

/// Stops beyond which some of them tell the model, and how many those are.
const MANY_STOPS: usize = 2000;
const SOME_STOPS: usize = 1000;

/// Rounds in which a model finds its joint noise: its size is then known to a few percent.
const ROUNDS: usize = 8;

/// The fit of the largest robot model that none beats by evidence, from that of the full one; that of the full one where it has none itself.
pub(in crate::identify) fn best_model(
    chain: Chain,
    series: &[MeasuredSeries],
    options: &Options,
    (full, notices): (JointFit, &mut Vec<Notice>),
) -> Result<(JointFit, Vec<Evidence>)> {
    let (compared, without) = {
        let _stage = stage("evidence of robot models");
        compare_models(&full.fit, options.joint_noise)
    };
    notices.extend(without.iter().map(|(model, why)| not_compared(*model, *why)));
    let (evidences, mut reduced): (Vec<Evidence>, Vec<Adjustment>) = compared.into_iter().unzip();
    let largest = largest_supported(&evidences, &options.limits);
    let chosen = match largest.map(|k| (evidences[k].model, reduced.swap_remove(k))) {
        None | Some((RobotModel::Full, _)) => full,
        Some((model, near)) => {
            let options = Options { model, ..options.clone() };
            drop(full.fit);
            fit_model(chain, series, &options, Some((full.start, Some(near))))?
        }
    };
    Ok((chosen, evidences))
}

/// The largest model that none beats decisively, by its place; `None` where the full one has no evidence, so that nothing beats it.
fn largest_supported(evidences: &[Evidence], limits: &Limits) -> Option<usize> {
    let is_compared = evidences.iter().any(|e| e.model == RobotModel::Full);
    let supported = evidences.iter().enumerate().filter(|(_, e)| e.log_evidence > -limits.decisive_log_odds);
    supported.max_by_key(|(_, e)| e.parameters).map(|(k, _)| k).filter(|_| is_compared)
}

/// A model of which nobody knows how well the data support it.
fn not_compared(model: RobotModel, why: NoEvidence) -> Notice {
    let what = match model {
        RobotModel::Full => format!("has no evidence, and no smaller one takes its place: {why}"),
        _ => format!("has no evidence, and takes no part in the choice: {why}"),
    };
    Notice::new(
        Code::ModelNotCompared,
        model.title(),
        what,
        "name a robot model with --robot-model to have its own fit",
    )
}

/// What is known of every model that a fit of the full one holds: its evidence, and its optimum; and models that have none.
type Compared = (Vec<(Evidence, Adjustment)>, Vec<(RobotModel, NoEvidence)>);

/// Compares them.
fn compare_models(full: &Fit, noise: JointNoise) -> Compared {
    let models = RobotModel::CHOICES;
    let found = side_by_side(&full.problem, &models, |_, model| evidence(full, *model, noise));
    let (mut all, mut without) = (Vec::new(), Vec::new());
    for (model, found) in models.into_iter().zip(found) {
        match found {
            Ok(found) => all.push(found),
            Err(why) => without.push((model, why)),
        }
    }
    let best = all.iter().map(|(e, _)| e.log_evidence).fold(f64::NEG_INFINITY, f64::max);
    all.iter_mut().for_each(|(e, _): &mut (Evidence, Adjustment)| e.log_evidence -= best);
    (all, without)
}

fn evidence(
    full: &Fit,
    model: RobotModel,
    noise: JointNoise,
) -> std::result::Result<(Evidence, Adjustment), NoEvidence> {
    let dropped = dropped_terms(full, model);
    let whole = if dropped.is_empty() { full.adjustment.clone() } else { without_terms(full, &dropped) };
    let some = whole.some_stops(MANY_STOPS, SOME_STOPS);
    if dropped.is_empty() && some.is_none() {
        let log_evidence = log_evidence_of_fit(full).ok_or(NoEvidence::Undetermined)?;
        return Ok((told(full.linear(), model, log_evidence), whole));
    }
    let mut start = some.unwrap_or(whole);
    let settings = Settings { decrement: DECREMENT, ..Settings::default() };
    let has_none = full.problem.noise.joint.iter().flatten().all(|s| *s <= JOINT_NOISE_FLOOR);
    let outcome = match noise == JointNoise::Estimated && has_none {
        // Terms enough to take up all noise would leave a model with fewer of them none, and judge it by errors that it does not have.
        true => {
            start.problem.noise.joint.iter_mut().flatten().for_each(|s| *s = FIRST_JOINT_NOISE);
            let options = ComponentOptions {
                factors: false,
                displacement: false,
                rounds: ROUNDS,
                settings,
                ..ComponentOptions::default()
            };
            estimate_components(start, &options)
        }
        false => solve(start, &settings),
    };
    let log_evidence = log_evidence_of_outcome(&outcome)?;
    let linear = outcome.linear().ok_or(NoEvidence::Unfinished(outcome.status))?;
    let evidence = told(linear, model, log_evidence);
    Ok((evidence, outcome.adjustment))
}

/// Terms of the robot that a model does not have.
fn dropped_terms(full: &Adjustment, model: RobotModel) -> Vec<usize> {
    let robot = &full.state.robot;
    let is_dropped = |t: &JointTerm| !model.has(t.term, &robot.chain, t.reading);
    robot.terms.iter().enumerate().filter(|(_, t)| is_dropped(t)).map(|(k, _)| k).collect()
}

/// Without some terms of the robot: a condition on the full model, under which everything else goes where the covariance leads.
fn without_terms(full: &Fit, dropped: &[usize]) -> Adjustment {
    let (layout, covariance) = (&full.problem.layout, &full.covariance);
    let first = layout.terms.start;
    let told = |k: &usize| layout.columns[first + k].free && covariance.system.touched(first + k);
    let columns: Vec<usize> = dropped.iter().copied().filter(told).map(|k| first + k).collect();
    let by_condition = DVector::from_iterator(
        columns.len(),
        columns.iter().map(|c| layout.columns[*c].prior_mean - full.state.robot.terms[c - first].value),
    );
    let of_columns = covariance.reduced.select_columns(&columns);
    let mut left = full.adjustment.clone();
    if let Ok(factor) = SymmetricFactor::new(&of_columns.select_rows(&columns)) {
        let step = covariance.system.step(full.linear(), &(of_columns * factor.solve(&by_condition)));
        left.state = full.state.moved(layout, &step);
    }
    let Adjustment { problem, state } = &mut left;
    for k in dropped {
        let column = &mut problem.layout.columns[first + k];
        // A fixed term stays at its prior mean, where its prior costs nothing.
        state.robot.terms[*k].value = column.prior_mean;
        column.free = false;
    }
    left
}

/// Of the model that an adjustment has, at its optimum.
fn told(linear: LinearProblem, model: RobotModel, log_evidence: f64) -> Evidence {
    let layout = &linear.adjustment.problem.layout;
    let parameters = layout.columns[layout.robot()].iter().filter(|c| c.free).count();
    Evidence { model, log_evidence, cost: linear.lin.cost, parameters }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Where the full model has no evidence, none takes its place.
    #[test]
    fn a_model_with_fewer_terms_takes_the_place_of_one_that_it_was_compared_with() {
        let of = |model, log_evidence, parameters| Evidence { model, log_evidence, cost: 1.0, parameters };
        let [rigid, gear] = [of(RobotModel::Rigid, 0.0, 48), of(RobotModel::Gear, -1.0, 78)];
        let largest = |full| {
            let all: Vec<Evidence> = [rigid.clone(), gear.clone()].into_iter().chain(full).collect();
            largest_supported(&all, &Limits::default())
        };
        assert_eq!(largest(Some(of(RobotModel::Full, -20.0, 108))), Some(1));
        assert_eq!(largest(Some(of(RobotModel::Full, -2.0, 108))), Some(2));
        assert_eq!(largest(None), None);
    }
}
