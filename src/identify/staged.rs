//! A result in two stages, with everything that a joint one has: model, covariance, residuals, accuracy.

use super::estimator::Estimator;
use super::options::JointNoise;
use super::two_stage::{Estimate, PoseStage, fit_poses, with_sizes};
use crate::error::{Code, Error, Result};
use crate::fit::Fit;
use crate::problem::{Adjustment, State};
use crate::solve::LinearisedAdjustment;

fn unsolved(estimator: Estimator) -> Error {
    let remedy = "take more stops, or leave --two-stage away: the joint fit has a solution";
    Error::new(
        Code::FitUndetermined,
        "two-stage fit",
        format!("\"{}\" has no solution here", estimator.title()),
        remedy,
    )
}

/// The two-stage fit of the observations that a joint fit used, from its result.
///
/// Cameras, plates and the covariance of both are those of the first stage, uncorrelated with the robot; only the full covariance of the poses knows
/// how they go together, and then both are those of the second.
/// The noise of the robot's stops is that of the joint fit where the estimator has none.
///
/// # Errors
/// An estimator that has no solution here, or that has no joint noise where one is given.
pub(super) fn staged(joint: &Fit, estimator: Estimator, noise: JointNoise) -> Result<Fit> {
    if noise != JointNoise::Estimated && !estimator.has_joint_noise() {
        let what = format!("--joint-noise is given, but \"{}\" has no joint noise", estimator.title());
        return Err(Error::new(Code::OptionConflict, "--two-stage", what, "take C or D, or leave --joint-noise away"));
    }
    let none = || unsolved(estimator);
    let stage = PoseStage::adjusted(joint).ok_or_else(none)?;
    let Estimate { state, covariance: of_theta, components, .. } =
        fit_poses(joint, &stage, estimator, noise).ok_or_else(none)?;
    let mut own = Adjustment { problem: with_sizes(&joint.problem, estimator, &components), state };
    own.problem.noise.pixel_factor.clone_from(&stage.pixel_factor);
    if !estimator.has_joint_noise() || noise != JointNoise::Estimated {
        let of_joint_fit = own.problem.noise.local.clone();
        own.without_local_errors();
        if noise == JointNoise::Estimated {
            own.problem.noise.local = of_joint_fit;
        }
    }
    let linearised = own.linearise().ok_or_else(none)?;
    let mut covariance = own.linear(&linearised).covariance().map_err(|_| none())?;
    if estimator != Estimator::FullAndRepeatability {
        covariance
            .replace_first(&of_theta, |c| joint.covariance.system.touched(c) && own.problem.layout.columns[c].free);
    }
    Ok(Fit { adjustment: own, linearised, covariance })
}

/// As the hold-out needs it: from the images that are left, with the pixel noise of all, whose stand-alone poses are `solved`.
pub(super) fn refit(
    left: &Adjustment,
    solved: &LinearisedAdjustment,
    estimator: Estimator,
    noise: JointNoise,
) -> Option<State> {
    let stage = PoseStage::of_left(solved, left)?;
    Some(fit_poses(left, &stage, estimator, noise)?.state)
}
