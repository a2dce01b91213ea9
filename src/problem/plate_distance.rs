//! The measured distance of two markers of a plate, the only absolute length beside the links of the robot.
//!
//! It is one observation `(d - |x_a - x_b|) / sigma` of the modes and of the corrections of both markers. A marker that no image shows is
//! no unknown: the variance of the observation grows by its tolerance.

use std::collections::BTreeSet;

use nalgebra::{SVector, Vector3};

use super::{Layout, PlateShape, Problem};
use crate::model::plate_modes::{MODES, SCALE};
use crate::series::{Plate, ScaleBar};

/// Prior sigma of a scale of which nothing is known.
pub const UNKNOWN_SCALE: f64 = 0.1;

/// A measured distance at a shape of its plate.
#[derive(Debug, Clone)]
pub struct PlateDistance {
    /// Index of the plate.
    pub plate: usize,
    /// Its standard deviation, m; with the tolerances of ends that no image shows.
    pub sigma_m: f64,
    /// The distance as the plate stands, m.
    pub length_m: f64,
    /// Measured less length, over sigma.
    pub residual: f64,
    /// The ends that images show, each with the derivative of length over sigma by its position, 1/m.
    pub ends: Vec<(usize, Vector3<f64>)>,
    /// Derivative of length over sigma by the modes.
    pub by_modes: SVector<f64, MODES>,
}

impl PlateDistance {
    /// The distance of a plate, of whose markers some are `seen`; `None` where none was measured.
    pub fn of(problem: &Problem, index: usize, shape: &PlateShape, seen: impl Fn(usize) -> bool) -> Option<Self> {
        let plate = &problem.plates[index];
        let (bar, ends) = measured(plate)?;
        let place = |m: usize| match seen(m) {
            true => shape.position(m),
            false => shape.position(m) - shape.corrections[m],
        };
        let [a, b] = ends.map(place);
        let length = (a - b).norm();
        let unseen = ends.into_iter().filter(|m| !seen(*m)).map(|m| problem.marker_information(index, m).recip());
        let sigma = (bar.sigma_m.powi(2) + unseen.sum::<f64>()).sqrt();
        let direction = (a - b) / (length * sigma);
        let ends = [(ends[0], direction), (ends[1], -direction)];
        (length > 0.0).then(|| Self {
            plate: index,
            sigma_m: sigma,
            length_m: length,
            residual: (bar.distance_m - length) / sigma,
            by_modes: ends.iter().map(|(m, d)| shape.modes_at(*m).tr_mul(d)).sum(),
            ends: ends.into_iter().filter(|(m, _)| seen(*m)).collect(),
        })
    }
}

/// What was measured of a plate, and the indices of the markers at its ends.
fn measured(plate: &Plate) -> Option<(ScaleBar, [usize; 2])> {
    let bar = plate.scale?;
    Some((bar, [plate.index_of(bar.from)?, plate.index_of(bar.to)?]))
}

/// A measured distance takes the place of what the file of a plate says of its scale.
pub fn release_measured_scales(layout: &mut Layout, plates: &[Plate]) {
    for (columns, _) in layout.shapes.iter().zip(plates).filter(|(_, plate)| measured(plate).is_some()) {
        layout.columns[columns.start + SCALE].prior_sigma = UNKNOWN_SCALE;
    }
}

/// Size of a plate by its measured distance, over that of a shape.
pub fn size_by_distance(plate: &Plate, shape: &PlateShape) -> Option<f64> {
    let (bar, [a, b]) = measured(plate)?;
    let length = (shape.position(a) - shape.position(b)).norm();
    (length > 0.0).then(|| bar.distance_m / length)
}

/// Markers of a plate that images in use show.
pub fn seen_markers(problem: &Problem, plate: usize) -> BTreeSet<usize> {
    let images = problem.used().map(|(_, image)| image).filter(|image| image.plate == plate);
    images.flat_map(|image| image.used().map(|o| o.marker)).collect()
}

/// Those of them that tell of their plate what its file says: none that was let go.
pub fn telling_markers(problem: &Problem, plate: usize) -> BTreeSet<usize> {
    let mut seen = seen_markers(problem, plate);
    seen.retain(|marker| !problem.moved_markers.contains(&(plate, *marker)));
    seen
}
