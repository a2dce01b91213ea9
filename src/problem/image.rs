//! An image of the problem: what it shows, and what it belongs to.

use super::measured::MarkerObservation;
use super::rejection::{ImageRejection, ObservationRejection};
use super::shared::Shared;
use crate::series::CameraMount;

/// One image with what belongs to it.
#[derive(Debug, Clone, PartialEq)]
pub struct Image {
    /// File name.
    pub name: String,
    /// Index of its series.
    pub series: usize,
    /// Index of the stop at which it was taken; images of one stop follow each other.
    pub stop: usize,
    /// Index of its camera.
    pub camera: usize,
    /// Index of its mounting (camera pose).
    pub mounting: usize,
    /// Index of its placement (plate pose).
    pub placement: usize,
    /// Index of its plate.
    pub plate: usize,
    /// Where the camera is.
    pub mount: CameraMount,
    /// Observations, ordered by marker.
    pub observations: Shared<Vec<MarkerObservation>>,
    /// Why the image is left out; `None` while it is used.
    pub rejected: Option<ImageRejection>,
}

impl Image {
    /// Observations that take part.
    pub fn used(&self) -> impl Iterator<Item = &MarkerObservation> {
        self.observations.iter().filter(|o| o.rejected.is_none())
    }

    /// Leaves observations out, or takes them back, in their order. Where nothing changes they stay shared.
    pub fn leave_out_as(&mut self, rejected: impl Iterator<Item = Option<ObservationRejection>> + Clone) {
        if !self.observations.iter().map(|o| o.rejected).eq(rejected.clone()) {
            self.observations.iter_mut().zip(rejected).for_each(|(o, rejected)| o.rejected = rejected);
        }
    }
}
