//! Rejection with reasons: single observations by their residual, whole images by the joint error that they would need.

use crate::problem::{Adjustment, ImageRejection, Mismatch, ObservationRejection, Weighting, predict};

/// Normalised residual length beyond which an observation is left out (a clean one is so with probability 4e-5).
const OBSERVATION_BOUND: f64 = 4.5;

/// A rejected observation comes back below this.
const OBSERVATION_RETURN: f64 = 4.0;

/// Joint error of an image, in robust sigmas per joint, beyond which it does not belong to its readings.
const IMAGE_BOUND: f64 = 8.0;

/// Smallest robust sigma of a joint that is believed in this test, rad or m.
const IMAGE_SIGMA_FLOOR: f64 = 1e-4;

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
            let out = length > if o.rejected.is_some() { OBSERVATION_RETURN } else { OBSERVATION_BOUND };
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

/// Latent and local error of every reading at the stop of an image, rad or m; `None` for one that its readings do not hold.
fn whole_error(adjustment: &Adjustment, image: usize) -> Option<Vec<f64>> {
    let from = adjustment.taken_from(image);
    let local = adjustment.state.robot.local_errors(from.posture.filter(|_| from.joints() > 0)?);
    Some(from.joint_errors.iter().zip(local).map(|(n, l)| n + l).collect())
}

/// Leaves out the image whose readings fit it worst, where they do not fit at all; returns its index.
pub fn reject_images(adjustment: &mut Adjustment) -> Option<usize> {
    let robot = &adjustment.state.robot;
    let used = adjustment.used().filter_map(|(i, ..)| Some((i, whole_error(adjustment, i)?)));
    let noise: Vec<(usize, Vec<f64>)> = used.collect();
    let joints = noise.first()?.1.len();
    let noise: Vec<(usize, &[f64])> = noise.iter().map(|(i, dq)| (*i, dq.as_slice())).collect();
    let sigma: Vec<f64> = (0..joints)
        .map(|r| {
            let mut sizes: Vec<f64> = noise.iter().map(|(_, dq)| dq[r].abs()).collect();
            sizes.sort_by(f64::total_cmp);
            (1.4826 * sizes[sizes.len() / 2]).max(IMAGE_SIGMA_FLOOR)
        })
        .collect();
    let score = |dq: &[f64]| (dq.iter().zip(&sigma).map(|(q, s)| (q / s).powi(2)).sum::<f64>() / joints as f64).sqrt();
    let (worst, dq) = noise.iter().max_by(|a, b| score(a.1).total_cmp(&score(b.1)))?;
    if score(dq) <= IMAGE_BOUND {
        return None;
    }
    let (joint, error) =
        dq.iter().enumerate().max_by(|a, b| (a.1 / sigma[a.0]).abs().total_cmp(&(b.1 / sigma[b.0]).abs()))?;
    let rejection =
        Mismatch::JointError { usual_errors: score(dq), joint: robot.chain.readings[joint].clone(), error: *error };
    adjustment.problem.images[*worst].rejected = Some(ImageRejection::WronglyPaired(rejection));
    Some(*worst)
}
