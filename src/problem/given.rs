//! What is given: data, columns, and what is known beforehand.

use super::family::Family;
use super::image::Image;
use super::layout::Layout;
use super::noise::Noise;
use super::state::Slack;
use crate::series::Plate;

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
