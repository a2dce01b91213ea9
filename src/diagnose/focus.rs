//! Did focus or zoom change within the series? Every image votes for a focal length of its own.

use super::kind::{CheckContext, Kind, Quantity, Subject, Weight};
use crate::error::Code;
use crate::fit::FocalLength;
use crate::problem::Problem;

/// From an image on the focal length differs.
#[derive(Debug, Clone, PartialEq)]
pub struct FocusChange {
    /// Camera.
    pub camera: String,
    /// First image after the change.
    pub image: String,
    /// Relative change of the focal length.
    pub change: f64,
    /// Its size in standard errors, from the scatter of the images, or by the poses of all.
    pub significance: f64,
    /// Gate, or a note where it explains little of the joint noise.
    pub weight: Weight,
}

/// The most significant change along the order of the images of a camera; of the first camera that has one.
pub(super) fn check(problem: &Problem, setting: &CheckContext) -> Option<FocusChange> {
    let limits = setting.limits;
    for (camera, name) in problem.cameras.iter().enumerate() {
        let of_camera = problem.images.iter().enumerate().filter(|(_, image)| image.camera == camera);
        let all = of_camera.filter_map(|(i, _)| Some((i, setting.free.poses[i].as_ref()?.focal?)));
        let votes: Vec<(usize, FocalLength)> =
            all.filter(|(_, focal)| focal.information > limits.focus_information).collect();
        let values: Vec<f64> = votes.iter().map(|(_, focal)| focal.change).collect();
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
            let (camera, weight) = (name.clone(), Weight::Gate);
            return Some(FocusChange { camera, image, change, significance, weight });
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

    fn weight(&self) -> Weight {
        self.weight
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
