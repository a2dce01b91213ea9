//! A result in two stages, with everything that a joint one has: model, covariance, residuals, accuracy.

use nalgebra::{DMatrix, DVector};

use super::fit::{Estimate, PoseStage, fit_poses, with_sizes};
use crate::error::{Code, Error, Result};
use crate::fit::Fit;
use crate::geom::Pose;
use crate::identify::estimator::Estimator;
use crate::identify::options::JointNoise;
use crate::problem::{Adjustment, Layout, Problem, SCALE, State};
use crate::solve::LinearisedAdjustment;

/// Relative size of a plate by which it is varied.
const VARIED: f64 = 3e-4;

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
pub(in crate::identify) fn staged(joint: &Fit, estimator: Estimator, noise: JointNoise) -> Result<Fit> {
    if noise != JointNoise::Estimated && !estimator.has_joint_noise() {
        let what = format!("--joint-noise is given, but \"{}\" has no joint noise", estimator.title());
        return Err(Error::new(Code::OptionConflict, "--two-stage", what, "take C or D, or leave --joint-noise away"));
    }
    let none = || unsolved(estimator);
    let stage = PoseStage::adjusted(joint).ok_or_else(none)?;
    let found = fit_poses(joint, &stage, estimator, noise).ok_or_else(none)?;
    let of_theta = match estimator {
        Estimator::FullAndRepeatability => found.covariance.clone(),
        _ => with_sizes_of_plates(joint, &stage, &found, noise).ok_or_else(none)?,
    };
    let Estimate { state, components, .. } = found;
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
pub(in crate::identify) fn refit(
    left: &Adjustment,
    solved: &LinearisedAdjustment,
    estimator: Estimator,
    noise: JointNoise,
) -> Option<State> {
    let stage = PoseStage::of_left(solved, left, &[estimator])?;
    Some(fit_poses(left, &stage, estimator, noise)?.state)
}

/// The covariance of an estimate with what is not known of the sizes of plates, which all poses have in common and which no estimator knows that
/// takes them for independent.
fn with_sizes_of_plates(joint: &Fit, stage: &PoseStage, found: &Estimate, noise: JointNoise) -> Option<DMatrix<f64>> {
    let (problem, mut covariance) = (&joint.problem, found.covariance.clone());
    for plate in 0..problem.plates.len() {
        let sigma = size_sigma(problem, plate);
        let mut varied = stage.clone();
        let own = stage.images.iter().enumerate().filter(|(_, i)| problem.images[**i].plate == plate);
        for (k, reference) in own.map(|(k, _)| (k, &stage.references[k])) {
            let moved = reference.rotation.tr_mul(&reference.translation) * VARIED;
            (0..3).for_each(|axis| varied.offset[6 * k + axis] += moved[axis]);
        }
        let other = fit_poses(joint, &varied, found.estimator, noise)?.state;
        let by_size = between(&found.state, &other, &problem.layout, covariance.nrows()) * (sigma / VARIED);
        covariance += &by_size * by_size.transpose();
    }
    Some(covariance)
}

/// Relative sigma of the size of a plate, as stated or measured.
fn size_sigma(problem: &Problem, plate: usize) -> f64 {
    let stated = problem.layout.columns[problem.layout.shapes[plate].start + SCALE].prior_sigma;
    problem.plates[plate].scale.map_or(stated, |bar| bar.sigma_m / bar.distance_m)
}

/// The step from one state to another in the first columns of a layout, those of the robot and of the poses that carry camera and plate.
fn between(from: &State, to: &State, layout: &Layout, columns: usize) -> DVector<f64> {
    let difference = to.values(layout) - from.values(layout);
    let mut step = DVector::from_fn(columns, |c, _| if layout.robot().contains(&c) { difference[c] } else { 0.0 });
    let mut put = |places: &[std::ops::Range<usize>], from: &[Pose], to: &[Pose]| {
        for ((own, from), to) in places.iter().zip(from).zip(to) {
            step.rows_mut(own.start, 6).copy_from(&(from.inverse() * *to).log());
        }
    };
    put(&layout.mountings, &from.mountings, &to.mountings);
    put(&layout.placements, &from.placements, &to.placements);
    step
}
