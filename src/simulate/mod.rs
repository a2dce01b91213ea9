//! A world with known truth: rendered images, simulated robots, series with everything known.

pub mod conditions;
pub mod psf;
pub mod raster;
pub mod render;
pub mod scenery;
pub mod sensor;
