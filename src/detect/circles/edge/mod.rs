//! Sub-pixel measurement of one marker by a model of its blurred edge.
//!
//! ```text
//! state (the parameters) -> exact, flat_zone, nearby_ink, gauss (what makes up a pixel) -> model (pixels and derivatives)
//!     -> squares (how well it fits); start, prior and normal (what is known beforehand) -> descent (the steps)
//!     -> solved (a fit that has ended) -> noise (covariance under noise in common) -> refine (least squares)
//! ```

mod descent;
mod exact;
mod flat_zone;
pub(super) mod gauss;
pub(super) mod model;
pub(super) mod nearby_ink;
pub(super) mod noise;
mod normal;
mod prior;
pub(super) mod refine;
mod solved;
mod squares;
pub(super) mod start;
mod state;
