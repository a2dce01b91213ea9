//! Camera pose of a single image by Levenberg-Marquardt on its pixels.

use nalgebra::Matrix6;

use crate::geom::Pose;
use crate::problem::{Image, State, Weighting, linearise_pose};

/// Squared Newton decrement below which a pose is at its end.
const AT_END: f64 = 1e-8;
/// Most steps from near the end.
const NEAR_STEPS: usize = 8;

/// Refines `camera_from_plate` of one image with everything else held; returns the pose and its robust cost, `None` where it diverges.
pub fn resect(image: &Image, state: &State, start: &Pose, weighting: &Weighting) -> Option<(Pose, f64)> {
    let mut pose = *start;
    let mut terms = linearise_pose(image, state, &pose, weighting)?;
    let mut lambda = 1e-4;
    for _ in 0..60 {
        let mut a: Matrix6<f64> = terms.pp;
        for i in 0..6 {
            a[(i, i)] *= 1.0 + lambda;
        }
        let step = a.cholesky()?.solve(&terms.bp);
        let decrement = step.dot(&terms.bp);
        let next = pose.perturbed(&step);
        match linearise_pose(image, state, &next, weighting) {
            Some(better) if better.cost <= terms.cost => {
                (pose, terms) = (next, better);
                lambda = (lambda * 0.1).max(1e-12);
                if decrement < AT_END {
                    break;
                }
            }
            _ if decrement < AT_END => break,
            _ => lambda *= 10.0,
        }
        if lambda > 1e12 {
            break;
        }
    }
    Some((pose, terms.cost))
}

/// As [`resect`], from near the end: Gauss-Newton, whose squared decrement `d` falls to some `d^2 / d_before` with the next step, so that the last
/// step is taken without a look at where it leads.
pub fn resect_near(image: &Image, state: &State, start: &Pose, weighting: &Weighting) -> Option<Pose> {
    let (mut pose, mut before) = (*start, None::<f64>);
    for _ in 0..NEAR_STEPS {
        let terms = linearise_pose(image, state, &pose, weighting)?;
        let step = terms.pp.cholesky()?.solve(&terms.bp);
        let decrement = step.dot(&terms.bp);
        if before.is_some_and(|before| decrement > before) {
            break;
        }
        pose = pose.perturbed(&step);
        if decrement < AT_END || before.is_some_and(|before| decrement * decrement / before < AT_END) {
            return Some(pose);
        }
        before = Some(decrement);
    }
    resect(image, state, start, weighting).map(|(pose, _)| pose)
}
