//! A world with known truth: rendered images, simulated robots, series with everything known.

pub mod conditions;
pub mod faults;
pub mod folder;
mod observe;
mod placement;
pub mod psf;
pub mod raster;
pub mod render;
mod request;
pub mod scenery;
pub mod sensor;
pub mod truth;
pub mod world;

pub use crate::plan::visibility::is_seen;
pub use observe::observe;
pub use request::{RobotErrors, WorldRequest, lens_camera, typical_camera};
pub use world::{SimulatedSeries, series};
