//! The finding that pictures of a camera are cut out elsewhere from one on; [`super::pose_step`] looks for it.

use super::displaced::Displaced;
use super::rows::Step;
use crate::diagnose::focus::FocusChange;
use crate::diagnose::kind::{Kind, Quantity, Subject, Weight};
use crate::error::Code;
use crate::problem::Problem;

/// Pictures whose content is shifted against that of the others of their camera.
#[derive(Debug, Clone, PartialEq)]
pub struct ImagesShifted {
    /// Camera.
    pub camera: String,
    /// Names of its mountings in these images.
    pub mountings: Vec<String>,
    /// The images, in their order: all from the first on.
    pub images: Vec<String>,
    /// By how much to the right and downwards, px: at least, as the fit has taken a part of it.
    pub shift_px: [f64; 2],
    /// Gate, or a note where it explains little of the joint noise.
    pub weight: Weight,
}

impl ImagesShifted {
    /// Of a step of the principal point.
    pub(super) fn of(step: &Step, problem: &Problem, camera: usize, images: Vec<String>) -> Self {
        let mut mountings: Vec<String> =
            step.images().iter().map(|i| problem.mountings[problem.images[*i].mounting].clone()).collect();
        mountings.sort_unstable();
        mountings.dedup();
        Self {
            camera: problem.cameras[camera].clone(),
            mountings,
            images,
            shift_px: [0, 1].map(|axis| step.change[axis]),
            weight: if step.explains_most { Weight::Gate } else { Weight::Note },
        }
    }

    /// True where plate or camera seem to stand elsewhere because of it.
    pub(in crate::diagnose) fn looks_like(&self, moved: &Displaced) -> bool {
        self.weight == Weight::Gate && !moved.is_measured() && self.mountings.contains(&moved.mounting)
    }

    /// True where the camera on this mounting seems to have two places.
    pub(in crate::diagnose) fn explains_two_places_of(&self, mounting: &str) -> bool {
        self.weight == Weight::Gate && self.mountings.iter().any(|own| own == mounting)
    }

    /// True where the focal length seems to be another because of it.
    pub(in crate::diagnose) fn explains_focus(&self, other: &FocusChange) -> bool {
        self.weight == Weight::Gate && self.camera == other.camera
    }
}

impl Kind for ImagesShifted {
    fn code(&self) -> Code {
        Code::ImagesShifted
    }

    fn weight(&self) -> Weight {
        self.weight
    }

    fn subjects(&self) -> Vec<Subject> {
        let camera = Subject::Camera(self.camera.clone());
        std::iter::once(camera).chain(self.images.iter().cloned().map(Subject::Image)).collect()
    }

    fn quantities(&self) -> Vec<Quantity> {
        let [u, v] = self.shift_px;
        vec![Quantity::new("shift_u", u, "px"), Quantity::new("shift_v", v, "px")]
    }

    fn place(&self) -> String {
        format!("camera {}", self.camera)
    }

    fn seen(&self) -> String {
        let [u, v] = self.shift_px;
        let first = self.images.first().map_or("", String::as_str);
        format!(
            "its images from {first} on are shifted against the others, by {u:+.1} px in u and {v:+.1} px in v or more: the region that is read from the sensor, or the crop, was changed"
        )
    }

    fn remedy(&self) -> String {
        "read all images with one region, or put them into a series of their own with another [camera] name".into()
    }
}
