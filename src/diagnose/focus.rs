//! Did focus or zoom change within the series? Every image votes for a focal length of its own.

use nalgebra::SVector;

use super::kind::{CheckContext, Kind, Quantity, Subject};
use crate::error::Code;
use crate::problem::{E, ImageTerms, Problem};

/// From an image on the focal length differs.
#[derive(Debug, Clone, PartialEq)]
pub struct FocusChange {
    /// Camera.
    pub camera: String,
    /// First image after the change.
    pub image: String,
    /// Relative change of the focal length.
    pub change: f64,
    /// Its size in standard errors, from the scatter of the images.
    pub significance: f64,
}

/// One image's vote: relative change of the focal length, given its other intrinsics, with the pose free; `None` where the
/// image does not say (seen from straight ahead).
fn vote(terms: &ImageTerms, fx: f64, fy: f64, least_information: f64) -> Option<f64> {
    let mut direction = SVector::<f64, E>::zeros();
    (direction[0], direction[1]) = (fx, fy);
    let with_pose = terms.pe.fixed_columns::<E>(0) * direction;
    let solved = terms.pp.cholesky()?.solve(&with_pose);
    let information = direction.dot(&(terms.ee.fixed_view::<E, E>(0, 0) * direction)) - with_pose.dot(&solved);
    let pull = direction.dot(&terms.be.fixed_rows::<E>(0)) - solved.dot(&terms.bp);
    (information > least_information).then(|| pull / information)
}

/// The most significant change along the order of the images of a camera; of the first camera that has one.
pub(super) fn check(problem: &Problem, setting: &CheckContext) -> Option<FocusChange> {
    let (free, limits) = (setting.free, setting.limits);
    for (camera, name) in problem.cameras.iter().enumerate() {
        let p = &free.state.cameras[camera].parameters;
        let votes: Vec<(usize, f64)> = (free.linearised.images.iter().zip(&free.linearised.terms))
            .filter(|(i, _)| problem.images[**i].camera == camera)
            .filter_map(|(i, terms)| vote(terms, p[0], p[1], limits.focus_information).map(|v| (*i, v)))
            .collect();
        let values: Vec<f64> = votes.iter().map(|(_, v)| *v).collect();
        let mut best: Option<(f64, usize, f64)> = None;
        for split in limits.focus_images..(values.len() + 1).saturating_sub(limits.focus_images) {
            let (before, after) = values.split_at(split);
            let ((m1, s1), (m2, s2)) = (mean_and_error(before), mean_and_error(after));
            let change = m2 - m1;
            let significance = change.abs() / s1.hypot(s2).max(1e-12);
            if change.abs() > limits.focus_change
                && significance > limits.focus_sigmas
                && best.is_none_or(|b| significance > b.0)
            {
                best = Some((significance, split, change));
            }
        }
        if let Some((significance, split, change)) = best {
            let image = problem.images[votes[split].0].name.clone();
            return Some(FocusChange { camera: name.clone(), image, change, significance });
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

impl Kind for FocusChange {
    fn code(&self) -> Code {
        Code::FocusChanged
    }

    fn subjects(&self) -> Vec<Subject> {
        vec![Subject::Camera(self.camera.clone()), Subject::Image(self.image.clone())]
    }

    fn quantities(&self) -> Vec<Quantity> {
        let change = Quantity::new("relative_change", self.change, "1");
        vec![change.with_sigma(self.change.abs() / self.significance)]
    }

    fn place(&self) -> String {
        format!("camera {}", self.camera)
    }

    fn seen(&self) -> String {
        format!(
            "focus or zoom changed before {}: from there on the focal length differs by {:.2} % ({:.0} standard errors)",
            self.image,
            100.0 * self.change,
            self.significance
        )
    }

    fn remedy(&self) -> String {
        "fix focus and zoom".into()
    }
}
