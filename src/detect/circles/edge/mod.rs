//! Sub-pixel measurement of one marker by a model of its blurred edge.
//!
//! ```text
//! state (the parameters) -> exact, flat_zone, nearby_ink, gauss (what makes up a pixel) -> model (pixels and derivatives)
//!     -> squares (how well it fits) -> refine (least squares)
//! ```

mod exact;
mod flat_zone;
pub(super) mod gauss;
pub(super) mod model;
pub(super) mod nearby_ink;
pub(super) mod refine;
mod squares;
mod state;
