//! A simulated robot, identified.

use crate::robots::kr6_to_link_6;
use robotcal::identify::{Options, RobotModel, Solution, identify};
use robotcal::series::{Plate, PlateKind};
use robotcal::simulate::{RobotErrors, SimulatedSeries, WorldRequest, series};
use robotcal::study::measured;

/// A KR 6 with such errors, identified from 40 stops.
pub fn identified_kr6(errors: RobotErrors, held_out: usize, seed: u64) -> (SimulatedSeries, Solution) {
    let mut plate = Plate::lattice(PlateKind::Points, 8, 6, 0.038, 0.1e-3);
    plate.markers.iter_mut().for_each(|m| m.outer_radius_m = 0.01);
    let request = WorldRequest {
        images: 40,
        errors,
        pixel_sigma_px: 0.05,
        marker_sigma_m: 0.1e-3,
        plate_modes: true,
        least_markers: 12,
        held_out,
        seed,
        ..WorldRequest::typical(kr6_to_link_6(), plate)
    };
    let made = series(&request).unwrap();
    let options = Options { model: RobotModel::Full, ..Options::default() };
    let solution = identify(kr6_to_link_6(), &[measured(&made, &kr6_to_link_6())], &options).unwrap();
    (made, solution)
}
