//! A fit whose robot is held near nominal where the data do not say, in place of one that extrapolates badly.

use crate::assess::restraint;
use crate::error::Result;
use crate::fit::Fit;
use crate::identify::joint_fit::fit::{JointFit, fit_model};
use crate::identify::options::Options;
use crate::model::joint_terms::RobotModel;
use crate::problem::{MeasuredSeries, Restraint};
use crate::solve::{Settings, Status, solve};
use crate::urdf::Chain;

/// The fit as it is, or with what holds it near nominal where that is asked for. Errors that come back with the reading of a joint are what gears,
/// gravity and backlash are, too: where the robot model is open, such a fit has the rigid one.
///
/// # Errors
/// As of [`fit_model`].
pub(in crate::identify) fn near_nominal(
    chain: Chain,
    series: &[MeasuredSeries],
    options: &Options,
    chosen: JointFit,
) -> Result<JointFit> {
    let Some(own) = restraint(&chosen.fit, &options.limits) else { return Ok(chosen) };
    let model = RobotModel::Rigid;
    let rigid = match options.model_is_open() {
        true => Some(fit_model(chain, series, &Options { model, ..options.clone() }, None)?),
        false => None,
    };
    let of_rigid = rigid.and_then(|rigid| Some((restraint(&rigid.fit, &options.limits)?, rigid)));
    let (own, mut kept) = of_rigid.unwrap_or((own, chosen));
    if let Some(held) = held(&kept.fit, own) {
        kept.fit = held;
    }
    Ok(kept)
}

/// The estimates with the restraint, at the same noise; their covariance without it: it is no knowledge of the robot.
fn held(fit: &Fit, restraint: Restraint) -> Option<Fit> {
    let mut adjustment = fit.adjustment.clone();
    adjustment.problem.restraint = Some(restraint);
    let outcome = solve(adjustment, &Settings::default());
    if outcome.status != Status::Converged {
        return None;
    }
    let mut adjustment = outcome.adjustment;
    let restraint = adjustment.problem.restraint.take();
    let linearised = adjustment.linearise()?;
    let covariance = adjustment.linear(&linearised).covariance().ok()?;
    adjustment.problem.restraint = restraint;
    Some(Fit { adjustment, linearised, covariance })
}
