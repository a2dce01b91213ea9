//! An image of the problem: what it shows, and what it belongs to.

use nalgebra::{Matrix2, Vector2};

use super::rejection::{ImageRejection, ObservationRejection};
use crate::series::{CameraMount, Edge};

/// One observation, ready for the adjustment.
#[derive(Debug, Clone, PartialEq)]
pub struct Measured {
    /// Index of the marker on its plate.
    pub marker: usize,
    /// Contour.
    pub edge: Edge,
    /// Radius of the observed circle, m; 0 for a point or where the observation is of the imaged centre.
    pub radius_m: f64,
    /// Measured image, px.
    pub uv: Vector2<f64>,
    /// Inverse of the covariance that the detector states, px^-2.
    pub information: Matrix2<f64>,
    /// Why it is left out; `None` while it is used.
    pub rejected: Option<ObservationRejection>,
}

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
    pub observations: Vec<Measured>,
    /// Why the image is left out; `None` while it is used.
    pub rejected: Option<ImageRejection>,
}

impl Image {
    /// Observations that take part.
    pub fn used(&self) -> impl Iterator<Item = &Measured> {
        self.observations.iter().filter(|o| o.rejected.is_none())
    }
}
