//! What is given: data, columns, and what is known beforehand.

use std::collections::BTreeSet;

use super::body::{BodyMeasurement, Instrument, InstrumentKind};
use super::bounds::Bounds;
use super::family::{Family, FamilyKind};
use super::image::Image;
use super::layout::Layout;
use super::length::MeasuredLength;
use super::noise::Noise;
use super::restraint::{JointPrior, Restraint};
use super::stop::{SIZE_OF_DISPLACEMENT, Stop, Tie};
use crate::model::robot::Posture;
use crate::series::Plate;

/// Smallest prior sigma of a marker coordinate, m: below it a marker counts as fixed.
const FIXED_MARKER_SIGMA_M: f64 = 1e-9;

/// Prior sigma of a coordinate of a marker that is elsewhere, m: nothing is known of where it is.
const MOVED_MARKER_SIGMA_M: f64 = 0.1;

/// Stops seen by several cameras that tell the sizes of apparent displacements from joint noise.
const LEAST_SHARED_STOPS: usize = 8;

/// Everything that is given.
#[derive(Debug, Clone)]
pub struct Problem {
    /// Columns of the parameters.
    pub layout: Layout,
    /// Plates, nominal.
    pub plates: Vec<Plate>,
    /// Markers that lie far from where their plate says, by plate: they tell nothing of its size and shape.
    pub moved_markers: BTreeSet<(usize, usize)>,
    /// Names of the placements.
    pub placements: Vec<String>,
    /// Names of the mountings.
    pub mountings: Vec<String>,
    /// Names of the cameras.
    pub cameras: Vec<String>,
    /// Stops, in the order of series and row.
    pub stops: Vec<Stop>,
    /// Readings in common that make two stops related: of the joints of an arm [`JOINTS_IN_COMMON`](super::JOINTS_IN_COMMON), of poses all coordinates.
    pub fewest_in_common: usize,
    /// Images, in the order of their stops.
    pub images: Vec<Image>,
    /// Frames in which bodies are measured.
    pub instruments: Vec<Instrument>,
    /// Names of the bodies that the tip carries.
    pub bodies: Vec<String>,
    /// What was measured of them, in the order of their stops.
    pub body_measurements: Vec<BodyMeasurement>,
    /// Distances that were measured between places and bodies.
    pub lengths: Vec<MeasuredLength>,
    /// Variance components.
    pub noise: Noise,
    /// Families of parameters whose size is a variance component, too.
    pub families: Vec<Family>,
    /// What holds the robot near nominal where the data do not say; none where nothing asks for it.
    pub restraint: Option<Restraint>,
    /// Huber bound on the normalised length of a residual.
    pub huber: f64,
    /// What is left out.
    pub bounds: Bounds,
}

/// Huber bound on the normalised length of a residual of an image: the 95 % point of the length of a 2-D standard normal vector.
pub const HUBER: f64 = 2.45;

/// What was measured of bodies, out of its problem.
#[derive(Debug)]
pub struct TakenBodies(Vec<BodyMeasurement>, Vec<MeasuredLength>);

impl Problem {
    /// What a plate is called where the series do not name it.
    pub fn plate_name(&self, plate: usize) -> String {
        match self.plates.len() {
            1 => "plate".to_owned(),
            _ => format!("plate {}", plate + 1),
        }
    }

    /// Joint readings of an image; `None` where it was taken off the robot.
    pub fn posture(&self, image: usize) -> Option<&Posture> {
        self.stops[self.images[image].stop].posture.as_ref()
    }

    /// True for an image taken on the robot.
    pub fn on_robot(&self, image: usize) -> bool {
        self.posture(image).is_some()
    }

    /// Indices of the images in use that were taken on the robot.
    pub fn used_on_robot(&self) -> impl Iterator<Item = usize> {
        self.used().map(|(i, _)| i).filter(|&i| self.on_robot(i))
    }

    /// Variances of the latent error of one reading at a stop, rad^2 or m^2: its own part, and the part of the local error that no column
    /// stands for.
    pub fn joint_error_variance(&self, stop: &Stop, reading: usize) -> [f64; 2] {
        let own = self.noise.joint[stop.series][reading];
        let covered = stop.local_share.get(reading).map_or(0.0, |s| s.min(1.0));
        let local = self.noise.local.get(reading).map_or(0.0, |s| s * s);
        [own * own, (1.0 - covered) * local]
    }

    /// Information (inverse of the variance) of the latent error of one reading at a stop.
    pub fn joint_error_information(&self, stop: &Stop, reading: usize) -> f64 {
        let [own, local] = self.joint_error_variance(stop, reading);
        1.0 / (own + local)
    }

    /// Squares of the latent errors of a stop in units of their variances.
    pub fn joint_error_squares(&self, stop: usize, errors: &[f64]) -> impl Iterator<Item = f64> {
        let stop = &self.stops[stop];
        errors.iter().enumerate().map(|(r, q)| q * q * self.joint_error_information(stop, r))
    }

    /// Index of the size that a component of the apparent displacement of an image has.
    pub fn size_of_displacement(&self, image: &Image, component: usize) -> usize {
        self.noise.displacement_sizes() * self.stops[image.stop].series + SIZE_OF_DISPLACEMENT[component]
    }

    /// Variance of a component of the apparent displacement of an image, rad^2 or m^2.
    pub fn displacement_variance(&self, image: &Image, component: usize) -> f64 {
        self.noise.displacement[self.size_of_displacement(image, component)].powi(2)
    }

    /// Information (inverse of the variance) of every unknown of a tie; zero for a free pose.
    pub fn tie_information(&self, image: &Image, tie: &Tie) -> impl Iterator<Item = f64> {
        let displaced = !tie.is_free();
        (0..tie.len()).map(move |k| if displaced { 1.0 / self.displacement_variance(image, k) } else { 0.0 })
    }

    /// Squares of a tie in units of their variances; none for a free pose.
    pub fn tie_squares(&self, image: &Image, tie: &Tie) -> impl Iterator<Item = f64> {
        let values = tie.displacement().iter();
        values.enumerate().map(|(k, t)| t * t / self.displacement_variance(image, k))
    }

    /// Of every series, by the index of its noise: true where enough of its stops were seen by several cameras, so that all components of apparent
    /// displacements are told from errors of the joints.
    pub fn tells_displacements(&self) -> Vec<bool> {
        let mut shared = vec![0; self.noise.joint.len()];
        for of_stop in self.images.chunk_by(|a, b| a.stop == b.stop).filter(|of_stop| of_stop.len() > 1) {
            shared[self.stops[of_stop[0].stop].series] += 1;
        }
        shared.into_iter().map(|stops| stops >= LEAST_SHARED_STOPS).collect()
    }

    /// Apparent shift of the plate in the images of every series, by the index of its noise, across the optical axis and along it, m; none where
    /// its stops do not tell it, whatever others tell of theirs.
    pub fn apparent_shifts_m(&self) -> Vec<Option<[f64; 2]>> {
        let sizes = self.noise.displacement_sizes();
        let told = self.tells_displacements().into_iter().enumerate();
        let of =
            |(series, is_told): (usize, bool)| match *self.noise.displacement.get(series * sizes..)?.get(..sizes)? {
                [_, _, across, along] if is_told => Some([across, along]),
                _ => None,
            };
        told.map(of).collect()
    }

    /// Tie of every image to its readings: rigid, or displaced by nothing where apparent displacements have a size.
    pub fn upright_ties(&self) -> Vec<Tie> {
        if self.noise.displacement.is_empty() {
            return vec![Tie::Rigid; self.images.len()];
        }
        let tells = self.tells_displacements();
        self.images.iter().map(|image| Tie::upright(tells[self.stops[image.stop].series])).collect()
    }

    /// Priors that say something of several columns together.
    pub fn joint_priors(&self) -> impl Iterator<Item = JointPrior<'_>> {
        let of_family = |f| Some(JointPrior { information: Family::information(f)?, columns: &f.columns });
        let families = self.families.iter().filter_map(of_family);
        families.chain(self.restraint.iter().map(Restraint::prior))
    }

    /// Factor on the stated sizes of the twists; 1 where they are held at what is stated.
    pub fn twist_factor(&self) -> f64 {
        self.families.iter().find(|f| f.kind == FamilyKind::Twists).map_or(1.0, |f| f.factor)
    }

    /// Sigma of a column before the data changed it: what robots usually deviate by.
    pub fn stated_sigma(&self, column: usize) -> f64 {
        let of = |f: &Family| f.columns.iter().position(|c| *c == column).map(|k| f.base[k]);
        self.families.iter().find_map(of).unwrap_or(self.layout.columns[column].prior_sigma)
    }

    /// Index of the noise of the stops of a series: series that several cameras took at the same stops have it in common.
    pub fn noise_of(&self, series: usize) -> usize {
        let image = self.images.iter().find(|image| image.series == series).map(|image| image.stop);
        let body =
            || self.body_measurements.iter().find(|measured| measured.read.0 == series).map(|measured| measured.stop);
        let last = self.noise.joint.len().saturating_sub(1);
        image.or_else(body).map_or(series.min(last), |stop| self.stops[stop].series)
    }

    /// Standard deviation of the whole joint noise of stops, by the index of their noise, per reading, rad or m.
    pub fn joint_sigma(&self, series: usize) -> Vec<f64> {
        let local = self.noise.local.iter().chain(std::iter::repeat(&0.0));
        self.noise.joint[series].iter().zip(local).map(|(own, local)| own.hypot(*local)).collect()
    }

    /// Information of the prior of a marker's correction, per coordinate, 1/m^2.
    pub fn marker_information(&self, plate: usize, marker: usize) -> f64 {
        if self.moved_markers.contains(&(plate, marker)) {
            return MOVED_MARKER_SIGMA_M.powi(-2);
        }
        let factor = self.noise.marker.get(plate).copied().unwrap_or(1.0);
        (factor * self.plates[plate].markers[marker].sigma_m).max(FIXED_MARKER_SIGMA_M).powi(-2)
    }

    /// Takes out what was measured of bodies: poses of images alone are asked for.
    pub fn take_bodies(&mut self) -> TakenBodies {
        TakenBodies(std::mem::take(&mut self.body_measurements), std::mem::take(&mut self.lengths))
    }

    /// Puts back what [`Problem::take_bodies`] took out.
    pub fn put_bodies(&mut self, TakenBodies(measurements, lengths): TakenBodies) {
        (self.body_measurements, self.lengths) = (measurements, lengths);
    }

    /// Measurements of bodies that take part, with their indices.
    pub fn used_bodies(&self) -> impl Iterator<Item = (usize, &BodyMeasurement)> {
        self.body_measurements.iter().enumerate().filter(|(_, measured)| measured.rejected.is_none())
    }

    /// True of what a tracker measured.
    pub fn is_by_tracker(&self, measured: &BodyMeasurement) -> bool {
        self.instruments[measured.instrument].kind == InstrumentKind::Tracker
    }

    /// True where an image or a measurement of a body takes part at a stop.
    pub fn is_measured_at(&self, stop: usize) -> bool {
        self.used().any(|(_, image)| image.stop == stop) || self.used_bodies().any(|(_, body)| body.stop == stop)
    }

    /// Measured distances between places or bodies that take part, with their indices.
    pub fn used_lengths(&self) -> impl Iterator<Item = (usize, &MeasuredLength)> {
        self.lengths.iter().enumerate().filter(|(_, length)| !length.left_out)
    }

    /// Stops at which something in use was measured, ascending.
    pub fn used_stops(&self) -> Vec<usize> {
        let of_bodies = self.used_bodies().map(|(_, measured)| measured.stop);
        let mut stops: Vec<usize> = self.used().map(|(_, image)| image.stop).chain(of_bodies).collect();
        stops.sort_unstable();
        stops.dedup();
        stops
    }

    /// Factors on the stated sigmas of a measurement of a body: position, rotation.
    pub fn body_factors(&self, measured: &BodyMeasurement) -> [f64; 2] {
        self.noise.body[self.instruments[measured.instrument].component]
    }

    /// Images that take part.
    pub fn used(&self) -> impl Iterator<Item = (usize, &Image)> {
        self.images.iter().enumerate().filter(|(_, image)| image.rejected.is_none())
    }
}
