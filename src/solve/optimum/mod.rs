//! What is known once the iteration stands at its optimum.
//!
//! ```text
//! covariance (of every unknown) -> fit (an adjustment at its optimum)
//!     -> frame, in_frame (poses and markers in the plate frame that the nominal markers define)
//!     -> length_misfit, response, stretch (tests of what the model lacks)
//! ```

pub(super) mod covariance;
pub(super) mod fit;
pub(super) mod frame;
pub(super) mod in_frame;
pub(super) mod length_misfit;
pub(super) mod response;
pub(super) mod stretch;
