//! Did focus or zoom change within the series? Every image votes for a focal length of its own.

use nalgebra::SVector;

use crate::fit::Fit;
use crate::problem::{Adjustment, E, ImageTerms};

/// Fewest images on either side of a change.
const FEWEST: usize = 3;

/// Difference of the two sides, in its own standard errors from the scatter of the images, beyond which it is no chance.
const SIGNIFICANT: f64 = 8.0;

/// Smallest relative change of the focal length that is reported.
const SMALLEST: f64 = 1e-3;

/// One image's vote: relative change of the focal length, given its other intrinsics, with the pose free; `None` where the
/// image does not say (seen from straight ahead).
fn vote(terms: &ImageTerms, fx: f64, fy: f64) -> Option<f64> {
    let mut direction = SVector::<f64, E>::zeros();
    (direction[0], direction[1]) = (fx, fy);
    let with_pose = terms.pe.fixed_columns::<E>(0) * direction;
    let solved = terms.pp.cholesky()?.solve(&with_pose);
    let information = direction.dot(&(terms.ee.fixed_view::<E, E>(0, 0) * direction)) - with_pose.dot(&solved);
    let pull = direction.dot(&terms.be.fixed_rows::<E>(0)) - solved.dot(&terms.bp);
    // An image whose own sigma is above one percent says nothing.
    (information > 1e4).then(|| pull / information)
}

/// The most significant change along the order of the images of a camera, in words that name the first image after it.
pub fn find_focus_change(fit: &Fit) -> Option<String> {
    let Fit { adjustment: Adjustment { problem, state }, linearised: lin, .. } = fit;
    for (camera, name) in problem.cameras.iter().enumerate() {
        let p = &state.cameras[camera].parameters;
        let votes: Vec<(usize, f64)> = (lin.images.iter().zip(&lin.terms))
            .filter(|(i, _)| problem.images[**i].camera == camera)
            .filter_map(|(i, terms)| vote(terms, p[0], p[1]).map(|v| (*i, v)))
            .collect();
        let values: Vec<f64> = votes.iter().map(|(_, v)| *v).collect();
        let mut best: Option<(f64, usize, f64)> = None;
        for split in FEWEST..values.len().saturating_sub(FEWEST - 1) {
            let (before, after) = values.split_at(split);
            let ((m1, s1), (m2, s2)) = (mean_and_error(before), mean_and_error(after));
            let change = m2 - m1;
            let significance = change.abs() / s1.hypot(s2).max(1e-12);
            if change.abs() > SMALLEST && significance > SIGNIFICANT && best.is_none_or(|b| significance > b.0) {
                best = Some((significance, split, change));
            }
        }
        if let Some((significance, split, change)) = best {
            let image = &problem.images[votes[split].0].name;
            return Some(format!(
                "focus or zoom of camera {name} changed before {image}: from there on the focal length differs by {:.2} % ({significance:.0} standard errors)",
                100.0 * change
            ));
        }
    }
    None
}

fn mean_and_error(values: &[f64]) -> (f64, f64) {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0);
    (mean, (variance / n).sqrt())
}
