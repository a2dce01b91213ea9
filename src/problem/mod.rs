//! The least-squares problem: what is unknown, what was measured, what is known beforehand.
//!
//! [`Problem`] holds the data and never changes during a solve; [`State`] holds every unknown; [`Adjustment`] is both; [`Layout`] is the one place
//! that turns a name into a column. The unit of residual evaluation is one image ([`linearise`]).

mod adjustment;
mod condensed;
mod equations;
mod family;
mod layout;
mod linearise;
mod measured_series;
mod postures;
mod rejection;
mod scale_bar;
mod select;
mod state;

pub use adjustment::Adjustment;
pub use condensed::{by_columns, condensed};
pub use equations::{Equations, MarkerCoupling, MarkerTerms, Sight};
pub use family::Family;
pub use layout::{Column, Layout, OriginPrior};
pub use linearise::{Chained, E, ImageTerms, Residual, Weighting, equations, linearise, predict};
pub use measured_series::{LensChoice, MeasuredSeries, MeasuredStop};
pub use postures::{common_readings, joined, posture_groups};
pub use rejection::{FitsReadings, ImageRejection, Misfit, Mismatch, ObservationRejection};
pub use scale_bar::{SCALE, hold_scale_bars, seen_markers, size_by_bar};
pub use select::short_name;
pub use state::{PlateShape, Slack, State, Step};

use nalgebra::{Matrix2, Vector2};

use crate::model::robot::Stop;
use crate::series::CameraMount;
use crate::series::{Edge, Plate};
use crate::urdf::JointKind;

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
    /// Share of the local variance of each reading that the local errors of this stop cover; empty where there are none.
    pub local_share: Vec<f64>,
    /// Why the image is left out; `None` while it is used.
    pub rejected: Option<ImageRejection>,
}

/// Standard deviations that the data themselves decide (variance components).
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Noise {
    /// Factor on the stated standard deviations of the observations, per camera.
    pub pixel_factor: Vec<f64>,
    /// Joint noise of every stop by itself, rad or m: per series, per reading.
    pub joint: Vec<Vec<f64>>,
    /// Local error of every reading, rad or m: common to stops at the same reading. Zero where no stops share readings.
    pub local: Vec<f64>,
    /// Apparent tilt of the plate in every image, rad: per series. Empty where it is not part of the slack.
    pub tilt: Vec<f64>,
    /// Factor on the stated tolerances of the markers, per plate. Empty where they are taken as stated.
    pub marker: Vec<f64>,
}

impl Noise {
    /// Every size of the slack at `first`, rad or m.
    pub fn start_at(&mut self, first: f64) {
        self.joint.iter_mut().flatten().for_each(|s| *s = first);
        self.local.iter_mut().filter(|s| **s > 0.0).for_each(|s| *s = first);
        self.tilt.fill(first);
    }

    /// Readings whose noise is alike: of one kind, with local errors told apart or not.
    pub fn groups(&self, kinds: &[JointKind]) -> Vec<Vec<usize>> {
        let apart = |r: usize| self.local.get(r).is_some_and(|s| *s > 0.0);
        let mut groups: Vec<Vec<usize>> = Vec::new();
        for r in 0..kinds.len() {
            match groups.iter_mut().find(|g| kinds[g[0]] == kinds[r] && apart(g[0]) == apart(r)) {
                Some(group) => group.push(r),
                None => groups.push(vec![r]),
            }
        }
        groups
    }
}

/// Smallest prior sigma of a marker coordinate, m: below it a marker counts as fixed.
const FIXED_MARKER_SIGMA_M: f64 = 1e-9;

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
    /// Families of parameters whose size is a variance component, too.
    pub families: Vec<Family>,
    /// Huber bound on the normalised length of a residual.
    pub huber: f64,
}

impl Problem {
    /// Variances of the slack of one reading (behind the readings: of the tilt) at a stop, rad^2 or m^2: its own part, and the part of the local error that no
    /// column stands for.
    pub fn slack_variance(&self, image: &Image, reading: usize) -> [f64; 2] {
        let Some(own) = self.noise.joint[image.series].get(reading) else {
            return [self.noise.tilt[image.series].powi(2), 0.0];
        };
        let covered = image.local_share.get(reading).map_or(0.0, |s| s.min(1.0));
        let local = self.noise.local.get(reading).map_or(0.0, |s| s * s);
        [own * own, (1.0 - covered) * local]
    }

    /// Information (inverse of the variance) of the slack of one reading at a stop.
    pub fn slack_information(&self, image: &Image, reading: usize) -> f64 {
        let [own, local] = self.slack_variance(image, reading);
        1.0 / (own + local)
    }

    /// Squares of the slack of a stop in units of their variances; none for a free pose.
    pub fn slack_squares(&self, image: &Image, slack: &Slack) -> f64 {
        match slack {
            Slack::Joints(dq) => dq.iter().enumerate().map(|(r, q)| q * q * self.slack_information(image, r)).sum(),
            _ => 0.0,
        }
    }

    /// Slack of a stop whose readings are right: joint noise, and tilt where it has a size.
    pub fn exact_slack(&self, image: &Image) -> Slack {
        let readings = image.stop.as_ref().map_or(0, |s| s.readings.len());
        Slack::exact(readings, !self.noise.tilt.is_empty())
    }

    /// Factor on the stated sizes of the twists; 1 where they are held at what is stated.
    pub fn twist_factor(&self) -> f64 {
        self.families.iter().find(|f| f.is_of_twists()).map_or(1.0, |f| f.factor)
    }

    /// Sigma of a column before the data changed it: what robots usually deviate by.
    pub fn stated_sigma(&self, column: usize) -> f64 {
        let of = |f: &Family| f.columns.iter().position(|c| *c == column).map(|k| f.base[k]);
        self.families.iter().find_map(of).unwrap_or(self.layout.columns[column].prior_sigma)
    }

    /// Standard deviation of the whole joint noise of the stops of a series, per reading, rad or m.
    pub fn joint_sigma(&self, series: usize) -> Vec<f64> {
        let local = self.noise.local.iter().chain(std::iter::repeat(&0.0));
        self.noise.joint[series].iter().zip(local).map(|(own, local)| own.hypot(*local)).collect()
    }

    /// Information of the prior of a marker's correction, per coordinate, 1/m^2.
    pub fn marker_information(&self, plate: usize, marker: usize) -> f64 {
        let factor = self.noise.marker.get(plate).copied().unwrap_or(1.0);
        (factor * self.plates[plate].markers[marker].sigma_m).max(FIXED_MARKER_SIGMA_M).powi(-2)
    }

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
