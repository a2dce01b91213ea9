//! What was measured of a marker in an image, and how each kind of it is predicted.

use nalgebra::{Matrix2, SVector, Vector2, Vector3};

use super::rejection::ObservationRejection;
use crate::geom::Pose;
use crate::model::camera::Camera;
use crate::model::circle::{self, Prediction};
use crate::model::plate_modes::{DOT_GAIN, MODES, SCALE};
use crate::series::Edge;

/// Share of its radius that a circle keeps, whatever the dot gain.
const SMALLEST_RADIUS: f64 = 0.1;

/// One observation, ready for the adjustment.
#[derive(Debug, Clone, PartialEq)]
pub struct MarkerObservation {
    /// Index of the marker on its plate.
    pub marker: usize,
    /// Contour.
    pub edge: Edge,
    /// What `uv` is the image of.
    pub mark: Mark,
    /// Measured image, px.
    pub uv: Vector2<f64>,
    /// Inverse of the covariance that the detector states, px^-2.
    pub information: Matrix2<f64>,
    /// Why it is left out; `None` while it is used.
    pub rejected: Option<ObservationRejection>,
}

/// Kinds of measurements of a marker.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Mark {
    /// The area centroid of the image of a circle about the marker, in the plane of the plate.
    Circle {
        /// Its radius, m.
        radius_m: f64,
    },
    /// The marker itself, a point: a corner, or the imaged centre of a circle.
    Corner,
}

impl Mark {
    /// The centroid of a circle, or a point for the radius 0.
    pub fn of_radius(radius_m: f64) -> Self {
        if radius_m > 0.0 { Self::Circle { radius_m } } else { Self::Corner }
    }

    /// Radius of the circle, m; 0 for a point.
    pub fn radius_m(self) -> f64 {
        match self {
            Self::Circle { radius_m } => radius_m,
            Self::Corner => 0.0,
        }
    }
}

impl MarkerObservation {
    /// Radius of the circle on a plate with these modes, m, and its derivative by them: it grows with the plate and by the dot gain, by which inner
    /// edges shrink. 0 for a point.
    #[inline(always)]
    pub fn radius(&self, modes: &[f64; MODES]) -> (f64, SVector<f64, MODES>) {
        let radius_m = self.mark.radius_m();
        let mut by_modes = SVector::zeros();
        if radius_m == 0.0 {
            return (0.0, by_modes);
        }
        by_modes[SCALE] = radius_m;
        by_modes[DOT_GAIN] = match self.edge {
            Edge::Outer => 1.0,
            Edge::Inner => -1.0,
        };
        let grown_m = radius_m + by_modes.dot(&SVector::from(*modes));
        (grown_m.max(SMALLEST_RADIUS * radius_m), by_modes)
    }

    /// Prediction of a circle of this radius, m, about `position` (plate frame, m), of the point itself for none; `None` behind the camera.
    #[inline(always)]
    pub fn predict(
        &self,
        camera: &Camera,
        camera_from_plate: &Pose,
        position: &Vector3<f64>,
        radius_m: f64,
    ) -> Option<Prediction> {
        match self.mark {
            Mark::Circle { .. } => circle::centroid(camera, camera_from_plate, position, radius_m),
            Mark::Corner => circle::point(camera, camera_from_plate, position),
        }
    }
}
