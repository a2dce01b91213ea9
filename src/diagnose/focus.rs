//! Did focus or zoom change within the series? Every image votes for a focal length of its own.

use std::collections::BTreeSet;

use super::kind::{CheckContext, Kind, Quantity, Subject, Weight};
use super::steps::displaced::Displaced;
use crate::error::Code;
use crate::fit::FocalLength;
use crate::problem::Problem;

/// From an image on the focal length differs.
#[derive(Debug, Clone, PartialEq)]
pub struct FocusChange {
    /// Camera.
    pub camera: String,
    /// Its mountings.
    pub mountings: BTreeSet<String>,
    /// First image after the change.
    pub image: String,
    /// Relative change of the focal length.
    pub change: f64,
    /// Its size in standard errors, from the scatter of the images, or by the poses of all.
    pub significance: f64,
    /// Gate, or a note where it explains little of the joint noise.
    pub weight: Weight,
}

impl FocusChange {
    /// Of a camera from this image on.
    pub(super) fn of(problem: &Problem, camera: usize, image: String, size: (f64, f64), weight: Weight) -> Self {
        let of_camera = problem.images.iter().filter(|image| image.camera == camera);
        let mountings = of_camera.map(|image| problem.mountings[image.mounting].clone()).collect();
        let (change, significance) = size;
        Self { camera: problem.cameras[camera].clone(), mountings, image, change, significance, weight }
    }

    /// True where a camera or a plate that seems to have moved is one that this camera sees so.
    pub(super) fn looks_like(&self, moved: &Displaced) -> bool {
        !moved.is_measured() && self.mountings.contains(&moved.mounting)
    }

    /// True where the camera on this mounting seems to have two places.
    pub(super) fn explains_two_places_of(&self, mounting: &str) -> bool {
        self.weight == Weight::Gate && self.mountings.contains(mounting)
    }
}

/// The most significant change along the order of the images of every camera that has one.
pub(super) fn check(problem: &Problem, setting: &CheckContext) -> Vec<FocusChange> {
    (0..problem.cameras.len()).filter_map(|camera| of_camera(problem, camera, setting)).collect()
}

fn of_camera(problem: &Problem, camera: usize, setting: &CheckContext) -> Option<FocusChange> {
    let limits = setting.limits;
    let of_camera = problem.images.iter().enumerate().filter(|(_, image)| image.camera == camera);
    let all = of_camera.filter_map(|(i, _)| Some((i, setting.free.poses[i].as_ref()?.focal?)));
    let votes: Vec<(usize, FocalLength)> =
        all.filter(|(_, focal)| focal.information > limits.focus_information).collect();
    let of_split = |split: usize| {
        let (before, after) = votes.split_at(split);
        let (before, after) = (Votes::of(before), Votes::of(after));
        let change = after.mean - before.mean;
        (split, change, change.abs() / before.error_beside(&after).max(1e-12))
    };
    let splits = limits.focus_images..(votes.len() + 1).saturating_sub(limits.focus_images);
    let counts =
        |(_, change, sigmas): &(usize, f64, f64)| change.abs() > limits.focus_change && *sigmas > limits.focus_sigmas;
    // Of equals the first.
    let (split, change, sigmas) = splits.rev().map(of_split).filter(counts).max_by(|a, b| a.2.total_cmp(&b.2))?;
    let image = problem.images[votes[split].0].name.clone();
    Some(FocusChange::of(problem, camera, image, (change, sigmas), Weight::Gate))
}

/// What some images say of the focal length.
struct Votes {
    count: f64,
    mean: f64,
    /// Sum of the squares of the deviations from the mean.
    squares: f64,
    /// Mean variance that the images state themselves.
    stated: f64,
}

impl Votes {
    fn of(votes: &[(usize, FocalLength)]) -> Self {
        let count = votes.len() as f64;
        let mean_of = |value: &dyn Fn(&FocalLength) -> f64| votes.iter().map(|(_, v)| value(v)).sum::<f64>() / count;
        let mean = mean_of(&|v| v.change);
        let squares = count * mean_of(&|v| (v.change - mean).powi(2));
        Self { count, mean, squares, stated: mean_of(&|v| 1.0 / v.information) }
    }

    /// Standard error of the difference of the means. A few images may agree by luck: none scatter less than all do, or than they state themselves.
    fn error_beside(&self, other: &Self) -> f64 {
        let pooled = (self.squares + other.squares) / (self.count + other.count - 2.0);
        let of = |votes: &Self| (votes.squares / (votes.count - 1.0)).max(pooled).max(votes.stated) / votes.count;
        (of(self) + of(other)).sqrt()
    }
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
        format!(
            "fix focus and zoom, and take the series again, or put the images from {} on into a series of their own with another [camera] name and the same mounting",
            self.image
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn votes(changes: &[f64], information: f64) -> Vec<(usize, FocalLength)> {
        changes.iter().map(|&change| (0, FocalLength { change, information })).collect()
    }

    #[test]
    fn a_few_images_that_agree_by_luck_are_no_better_known_than_all() {
        let scattered: Vec<f64> = (0..37).map(|k| 0.01 * f64::sin(7.0 * f64::from(k))).collect();
        let all = Votes::of(&votes(&scattered, 1e6));
        let few = Votes::of(&votes(&[-0.0251, -0.0250, -0.0249], 1e6));
        let error = few.error_beside(&all);
        let usual = (all.squares / 36.0).sqrt();
        assert!((error / (usual * f64::sqrt(1.0 / 3.0 + 1.0 / 37.0)) - 1.0).abs() < 0.05, "{error} of {usual}");
        // What they state themselves is no less than it is.
        let [few, all] = [few, all].map(|v| Votes { stated: 1e-3, ..v });
        assert!(few.error_beside(&all) > f64::sqrt(1e-3 / 3.0));
    }
}
