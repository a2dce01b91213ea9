//! A measurement series: manifest, joint readings, plate, and images or observations.
//!
//! A new source of recordings is one file here that returns a [`Series`], and one row in `read`.

mod observation;
mod plate;

pub use observation::{Edge, ImageObservations, Observation};
pub use plate::{Marker, Plate, PlateKind, ScaleBar};
