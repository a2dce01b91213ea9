//! Camera pose of a single image by Levenberg-Marquardt on its pixels.

use nalgebra::Matrix6;

use crate::geom::Pose;
use crate::problem::{Image, ImageTerms, State, Weighting, linearise};

/// Refines `camera_from_plate` of one image with everything else held; returns pose and final terms, `None` where it diverges.
pub fn resect(image: &Image, state: &State, start: &Pose, weighting: &Weighting) -> Option<(Pose, ImageTerms)> {
    let mut pose = *start;
    let mut terms = linearise(image, state, &pose, weighting)?;
    let mut lambda = 1e-4;
    for _ in 0..60 {
        let mut a: Matrix6<f64> = terms.pp;
        for i in 0..6 {
            a[(i, i)] *= 1.0 + lambda;
        }
        let step = a.cholesky()?.solve(&terms.bp);
        let decrement = step.dot(&terms.bp);
        let next = pose.perturbed(&step);
        match linearise(image, state, &next, weighting) {
            Some(better) if better.cost <= terms.cost => {
                (pose, terms) = (next, better);
                lambda = (lambda * 0.1).max(1e-12);
                if decrement < 1e-8 {
                    break;
                }
            }
            _ if decrement < 1e-8 => break,
            _ => lambda *= 10.0,
        }
        if lambda > 1e12 {
            break;
        }
    }
    Some((pose, terms))
}
