//! The least-squares problem: what is unknown, what was measured, what is known beforehand.
//!
//! [`Problem`] holds the data and never changes during a solve; [`State`] holds every unknown; [`Layout`] is the one place
//! that turns a name into a column. The unit of residual evaluation is one image ([`linearise`]).

mod layout;
mod linearise;
mod select;
mod state;

pub use layout::{Column, Layout, OriginPrior};
pub use linearise::{Chained, E, ImageTerms, MarkerTerms, Residual, Weighting, chained, linearise, predict};
pub use select::short_name;
pub use state::{PlateShape, Slack, State, Step};

use nalgebra::{Matrix2, Vector2};

use crate::model::robot::Stop;
use crate::series::CameraMount;
use crate::series::{Edge, Plate};

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
    pub rejected: Option<&'static str>,
}

/// One image with what belongs to it.
#[derive(Debug, Clone, PartialEq)]
pub struct Image {
    /// File name.
    pub name: String,
    /// Index of its series.
    pub series: usize,
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
    /// Joint readings; `None` for an image taken off the robot.
    pub stop: Option<Stop>,
    /// Observations, ordered by marker.
    pub observations: Vec<Measured>,
    /// Why the image is left out; `None` while it is used.
    pub rejected: Option<String>,
}

/// Standard deviations that the data themselves decide (variance components).
#[derive(Debug, Clone, PartialEq)]
pub struct Noise {
    /// Factor on the stated standard deviations of the observations, per camera.
    pub pixel_factor: Vec<f64>,
    /// Joint noise, rad or m: per camera, per reading.
    pub joint: Vec<Vec<f64>>,
}

/// Everything that is given.
#[derive(Debug, Clone)]
pub struct Problem {
    /// Columns of the parameters.
    pub layout: Layout,
    /// Plates, nominal.
    pub plates: Vec<Plate>,
    /// Names of the placements.
    pub placements: Vec<String>,
    /// Names of the mountings.
    pub mountings: Vec<String>,
    /// Names of the cameras.
    pub cameras: Vec<String>,
    /// Images, in the order of series and row.
    pub images: Vec<Image>,
    /// Variance components.
    pub noise: Noise,
    /// Huber bound on the normalised length of a residual.
    pub huber: f64,
}

impl Problem {
    /// Images that take part.
    pub fn used(&self) -> impl Iterator<Item = (usize, &Image)> {
        self.images.iter().enumerate().filter(|(_, image)| image.rejected.is_none())
    }
}

impl Image {
    /// Observations that take part.
    pub fn used(&self) -> impl Iterator<Item = &Measured> {
        self.observations.iter().filter(|o| o.rejected.is_none())
    }
}
