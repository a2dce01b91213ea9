//! A fit whose robot is held near nominal where the data do not say, in place of one that extrapolates badly.

use crate::assess::{Limits, restraint};
use crate::fit::Fit;
use crate::problem::Restraint;
use crate::solve::{Settings, Status, solve};

/// The fit as it is, or with what holds it near nominal where that is asked for.
pub(super) fn near_nominal(fit: Fit, limits: &Limits) -> Fit {
    restraint(&fit, limits).and_then(|own| held(&fit, own)).unwrap_or(fit)
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
