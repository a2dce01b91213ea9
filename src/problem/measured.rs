//! What was measured of a marker in an image, and how each kind of it is predicted.

use nalgebra::{Matrix2, SMatrix, Vector2};

use super::plate_shape::PlateShape;
use super::rejection::ObservationRejection;
use crate::geom::Pose;
use crate::model::camera::Camera;
use crate::model::circle::{self, Prediction};
use crate::model::plate_modes::{MODES, radius};
use crate::series::Edge;

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
    /// Mean square of the distance to the truth that the detector states, px^2.
    pub fn stated_variance_px2(&self) -> f64 {
        self.information.trace() / self.information.determinant()
    }

    /// Its prediction on this plate, with the derivative of column and row of the image by the modes of the plate; `None` behind the camera.
    #[inline(always)]
    pub fn predict(
        &self,
        camera: &Camera,
        camera_from_plate: &Pose,
        plate: &PlateShape,
    ) -> Option<(Prediction, SMatrix<f64, MODES, 2>)> {
        let basis = plate.modes_at(self.marker);
        let position = plate.position_by(&basis, self.marker);
        let by_position = |p: &Prediction| basis.tr_mul(&p.d_marker.transpose());
        match self.mark {
            Mark::Circle { radius_m } => {
                let (grown_m, by_modes) = radius(radius_m, self.edge, &plate.modes);
                let p = circle::centroid(camera, camera_from_plate, &position, grown_m)?;
                let by_modes = by_position(&p) + by_modes * p.d_radius.transpose();
                Some((p, by_modes))
            }
            Mark::Corner => {
                let p = circle::point(camera, camera_from_plate, &position)?;
                let by_modes = by_position(&p);
                Some((p, by_modes))
            }
        }
    }
}
