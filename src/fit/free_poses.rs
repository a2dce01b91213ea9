//! Stand-alone camera poses: what the free-pose adjustment found.

use nalgebra::Matrix6;

use crate::geom::Pose;
use crate::problem::State;
use crate::solve::{Linearised, PlateScale};

/// Stand-alone pose of one image.
#[derive(Debug, Clone, PartialEq)]
pub struct FreePose {
    /// `camera_from_plate`.
    pub camera_from_plate: Pose,
    /// Covariance of its body twist [rho, phi], m and rad, with the tolerances of the markers.
    pub covariance: Matrix6<f64>,
    /// The pose in the plate frame that the nominal markers define, with the scale of [`FreePoses::scales`]; the sigma of the scale is not
    /// in its covariance.
    pub in_frame: PlacedCamera,
    /// RMS of the lengths of its residuals, px.
    pub rms_px: f64,
}

/// A camera in the frame of a plate.
#[derive(Debug, Clone, PartialEq)]
pub struct PlacedCamera {
    /// The pose.
    pub plate_from_camera: Pose,
    /// Covariance of its body twist [rho, phi], m and rad.
    pub covariance: Matrix6<f64>,
}

impl FreePoses {
    /// Of no image.
    pub fn none(state: State) -> Self {
        Self {
            poses: Vec::new(),
            rms_px: 0.0,
            observations: 0,
            state,
            scales: Vec::new(),
            pixel_factor: Vec::new(),
            linearised: Linearised::default(),
        }
    }
}

/// The adjusted free poses.
#[derive(Debug, Clone)]
pub struct FreePoses {
    /// One for each image of the problem; `None` for an image that is left out.
    pub poses: Vec<Option<FreePose>>,
    /// RMS of the lengths of all residuals, px per point.
    pub rms_px: f64,
    /// Number of observations in use.
    pub observations: usize,
    /// Cameras and plates of this adjustment.
    pub state: State,
    /// Scale of every plate, in which the poses in its frame are given: as it was made, or as it was measured (`[scale]`). None for a
    /// plate that no image shows.
    pub scales: Vec<Option<PlateScale>>,
    /// Pixel factors found.
    pub pixel_factor: Vec<f64>,
    /// Linearisation of this adjustment: residuals and weights of the images in use.
    pub linearised: Linearised,
}
