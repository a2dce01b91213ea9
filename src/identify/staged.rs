//! A result in two stages, with everything that a joint one has: model, covariance, residuals, accuracy.

use super::joint::JointNoise;
use super::two_stage::{Estimate, Estimator, PoseStage, fit_poses, with_sizes};
use crate::error::{Error, Result};
use crate::fit::Fit;
use crate::problem::{Problem, State};
use crate::solve::{Covariance, covariance, linearise_all};

fn unsolved(estimator: Estimator) -> Error {
    let remedy = "take more stops, or leave --two-stage away: the joint fit has a solution";
    Error::unsolved("two-stage fit", format!("\"{}\" has no solution here", estimator.title()), remedy)
}

/// The two-stage fit of the observations that a joint fit used, from its result.
///
/// Cameras, plates and the covariance of both are those of the first stage, uncorrelated with the robot; only the full covariance of the poses knows
/// how they go together, and then both are those of the second.
/// The noise of the robot's stops is that of the joint fit where the estimator has none.
///
/// # Errors
/// An estimator that has no solution here, or that has no joint noise where one is given.
pub(super) fn staged(joint: (&Problem, &State, &Covariance), estimator: Estimator, noise: JointNoise) -> Result<Fit> {
    let (problem, start, of_joint) = joint;
    if noise != JointNoise::Estimated && !estimator.has_joint_noise() {
        let what = format!("--joint-noise is given, but \"{}\" has no joint noise", estimator.title());
        return Err(Error::input("--two-stage", what, "take C or D, or leave --joint-noise away"));
    }
    let none = || unsolved(estimator);
    let stage = PoseStage::adjusted(problem, start).ok_or_else(none)?;
    let Estimate { mut state, covariance: of_theta, components, .. } =
        fit_poses(problem, &stage, start, estimator, noise).ok_or_else(none)?;
    let mut own = with_sizes(problem, estimator, &components);
    own.noise.pixel_factor.clone_from(&stage.pixel_factor);
    if !estimator.has_joint_noise() || noise != JointNoise::Estimated {
        let of_joint_fit = own.noise.local.clone();
        own.without_local_errors(&mut state);
        if noise == JointNoise::Estimated {
            own.noise.local = of_joint_fit;
        }
    }
    let linearised = linearise_all(&own, &state).ok_or_else(none)?;
    let mut covariance = covariance(&own, &state, &linearised).map_err(|_| none())?;
    if estimator != Estimator::FullAndRepeatability {
        covariance.replace_first(&of_theta, |c| of_joint.system.touched(c) && own.layout.columns[c].free);
    }
    Ok(Fit { problem: own, state, linearised, covariance })
}

/// As the hold-out needs it: from the images that are left.
pub(super) fn refit(problem: &Problem, start: &State, estimator: Estimator, noise: JointNoise) -> Option<State> {
    let stage = PoseStage::adjusted(problem, start)?;
    Some(fit_poses(problem, &stage, start, estimator, noise)?.state)
}
