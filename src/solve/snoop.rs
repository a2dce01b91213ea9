//! Rejection with reasons: single observations by their residual, whole images by the joint error that they would need.

use crate::linalg::median;
use crate::problem::{
    Adjustment, BodyMeasurement, BodyRejection, BodySeen, Image, ImageRejection, Mismatch, ObservationRejection,
    TakenFrom, Weighting, predict,
};

/// Re-judges every observation at the estimates; returns how many verdicts changed.
pub fn reject_observations(adjustment: &mut Adjustment) -> usize {
    let mut verdicts = Vec::new();
    let Adjustment { problem, state } = &*adjustment;
    for (i, image) in problem.used() {
        let Some(pose) = adjustment.camera_from_plate(i) else { continue };
        let w = Weighting::of(problem, image);
        for (k, o) in image.observations.iter().enumerate() {
            if o.rejected.is_some_and(|r| r != ObservationRejection::Residual) {
                continue;
            }
            let Some(p) = predict(image, state, &pose, o) else { continue };
            let r = o.uv - p.uv;
            let length = (r.dot(&(o.information * r))).max(0.0).sqrt() / w.pixel_factor;
            let out = length > problem.bounds.of_observation(o.rejected.is_some());
            if out != o.rejected.is_some() {
                verdicts.push((i, k, out));
            }
        }
    }
    for &(i, k, out) in &verdicts {
        adjustment.problem.images[i].observations[k].rejected = out.then_some(ObservationRejection::Residual);
    }
    verdicts.len()
}

/// Leaves out the image most of whose observations are left out, where others were taken at its stop: they cannot all have its joint
/// errors. Returns its index.
pub fn reject_contradicting(adjustment: &mut Adjustment) -> Option<usize> {
    let problem = &adjustment.problem;
    let at_stop = |stop: usize| problem.used().filter(|(_, other)| other.stop == stop).count();
    let counted = problem.used().map(|(i, image)| (i, image.observations.len() - image.used().count()));
    let (worst, contradict) = counted
        .filter(|&(i, out)| 2 * out > problem.images[i].observations.len() && at_stop(problem.images[i].stop) > 1)
        .max_by_key(|&(i, out)| (out, std::cmp::Reverse(i)))?;
    let of = problem.images[worst].observations.len();
    leave_out(adjustment, worst, ImageRejection::WronglyPaired(Mismatch::OtherImages { contradict, of }));
    Some(worst)
}

/// One image in so many may contradict the others; more of them contradict the model.
const ONE_IN: usize = 4;

/// Leaves out the image that lost the largest share of its observations, where that is most of them and few images of its camera did. Returns its
/// index.
pub fn reject_contradictory(adjustment: &mut Adjustment) -> Option<usize> {
    let problem = &adjustment.problem;
    let left_out = |image: &Image| image.observations.len() - image.used().count();
    let lost_most = |image: &Image| 2 * left_out(image) > image.observations.len();
    let share = |image: &Image| left_out(image) as f64 / image.observations.len() as f64;
    let (worst, image) =
        problem.used().filter(|(_, image)| lost_most(image)).max_by(|a, b| share(a.1).total_cmp(&share(b.1)))?;
    let alike = || problem.used().filter(|(_, other)| other.camera == image.camera);
    if ONE_IN * alike().filter(|(_, other)| lost_most(other)).count() > alike().count() {
        return None;
    }
    let (contradict, of) = (left_out(image), image.observations.len());
    leave_out(adjustment, worst, ImageRejection::Contradictory { contradict, of });
    Some(worst)
}

/// Leaves out an image as a whole, in place of its observations by their residuals.
fn leave_out(adjustment: &mut Adjustment, index: usize, why: ImageRejection) {
    let image = &mut adjustment.problem.images[index];
    image.rejected = Some(why);
    let by_residual = image.observations.iter_mut().filter(|o| o.rejected == Some(ObservationRejection::Residual));
    by_residual.for_each(|o| o.rejected = None);
}

/// Latent and local error of every reading where something was taken from, rad or m; `None` for what its readings do not hold.
fn whole_error(adjustment: &Adjustment, from: &TakenFrom) -> Option<Vec<f64>> {
    let local = adjustment.state.robot.local_errors(from.posture.filter(|_| from.joints() > 0)?);
    Some(from.joint_errors.iter().zip(local).map(|(n, l)| n + l).collect())
}

/// An image or a measurement of a body, by its index.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Taken {
    Image(usize),
    Body(usize),
}

/// Leaves out the image or measurement of a body whose readings fit it worst, where they do not fit at all; true where there is one.
pub fn reject_stops(adjustment: &mut Adjustment) -> bool {
    reject_worst(adjustment).is_some()
}

fn reject_worst(adjustment: &mut Adjustment) -> Option<Taken> {
    let (robot, bounds) = (&adjustment.state.robot, adjustment.problem.bounds);
    let images = adjustment
        .used()
        .filter_map(|(i, ..)| Some((Taken::Image(i), whole_error(adjustment, &adjustment.taken_from(i))?)));
    let bodies = adjustment.problem.used_bodies();
    let bodies =
        bodies.filter_map(|(k, _)| Some((Taken::Body(k), whole_error(adjustment, &adjustment.body_taken_from(k))?)));
    let noise: Vec<(Taken, Vec<f64>)> = images.chain(bodies).collect();
    let joints = noise.first()?.1.len();
    let noise: Vec<(Taken, &[f64])> = noise.iter().map(|(i, dq)| (*i, dq.as_slice())).collect();
    let sigma: Vec<f64> = (0..joints)
        .map(|r| {
            let usual = median(noise.iter().map(|(_, dq)| dq[r].abs())).unwrap_or(0.0);
            (1.4826 * usual).max(bounds.joint_sigma)
        })
        .collect();
    let score = |dq: &[f64]| (dq.iter().zip(&sigma).map(|(q, s)| (q / s).powi(2)).sum::<f64>() / joints as f64).sqrt();
    let (worst, dq) = noise.iter().max_by(|a, b| score(a.1).total_cmp(&score(b.1)))?;
    if score(dq) <= bounds.joint_error {
        return None;
    }
    let (joint, error) =
        dq.iter().enumerate().max_by(|a, b| (a.1 / sigma[a.0]).abs().total_cmp(&(b.1 / sigma[b.0]).abs()))?;
    let (usual_errors, joint, error, worst) = (score(dq), robot.chain.readings[joint].clone(), *error, *worst);
    match worst {
        Taken::Image(i) => {
            let rejection = Mismatch::JointError { usual_errors, joint, error };
            adjustment.problem.images[i].rejected = Some(ImageRejection::WronglyPaired(rejection));
        }
        Taken::Body(k) => {
            let rejected = Some(BodyRejection::JointError { usual_errors });
            adjustment.problem.body_measurements[k].rejected = rejected;
        }
    }
    Some(worst)
}

/// Re-judges every measurement of a body by its residual; returns how many verdicts changed. What stays left out has the residual of this fit.
pub fn reject_bodies(adjustment: &mut Adjustment) -> usize {
    let Adjustment { problem, state } = &*adjustment;
    let verdict = |(k, measured): (usize, &BodyMeasurement)| {
        let was_out = matches!(measured.rejected, Some(BodyRejection::Residual { .. }));
        if measured.rejected.is_some() && !was_out {
            return None;
        }
        let predicted = state.instrument_from_body(measured, adjustment.body_taken_from(k))?;
        let sigmas = measured.linearise(&predicted, problem.body_factors(measured)).length;
        let is_out = sigmas > problem.bounds.of_body(matches!(measured.seen, BodySeen::Pose(_)), was_out);
        (is_out || was_out).then_some((k, is_out != was_out, is_out.then_some(BodyRejection::Residual { sigmas })))
    };
    let verdicts: Vec<_> = problem.body_measurements.iter().enumerate().filter_map(verdict).collect();
    for &(k, _, rejected) in &verdicts {
        adjustment.problem.body_measurements[k].rejected = rejected;
    }
    verdicts.iter().filter(|(_, has_changed, _)| *has_changed).count()
}
