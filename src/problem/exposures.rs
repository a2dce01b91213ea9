//! Which exposures are known, by what was seen in them.

use std::collections::HashSet;

use super::measured_series::MeasuredStop;
use crate::series::{Edge, Observation};

/// A contour and the bits of its place in the image.
type PlacedContour = (u32, Edge, [u64; 2]);

fn seen(o: &Observation) -> PlacedContour {
    (o.marker, o.edge, o.uv.map(f64::to_bits))
}

/// What was seen in some images, to the last digit. Noise never puts a marker in the same place twice: another image that shows it there was
/// made of the same exposure, in whatever file it came.
#[derive(Debug)]
pub struct Exposures(HashSet<PlacedContour>);

impl Exposures {
    /// Of these stops.
    pub fn of<'a>(stops: impl IntoIterator<Item = &'a MeasuredStop>) -> Self {
        Self(stops.into_iter().flat_map(|stop| stop.observations.iter().map(seen)).collect())
    }

    /// True where more than half of what a stop shows is among it; the last digits of the others come from the images beside them.
    pub fn shows(&self, stop: &MeasuredStop) -> bool {
        let known = stop.observations.iter().filter(|o| self.0.contains(&seen(o))).count();
        2 * known > stop.observations.len()
    }
}
