//! Coded circles: from a grey picture to identified sub-pixel centres.
//!
//! ```text
//! picture -> candidates: levels (envelopes, threshold) -> contour -> candidate (ellipse, tests)
//!         -> identity: lattice (neighbour to neighbour) -> code (position on the plate) -> neighbour_check (is every neighbour of one mind)
//!         -> edge: refine (blurred edge) -> measuring: inner/outer agreement -> Detection
//! ```
//!
//! `pipeline` calls them in this order; `grid` is the detector of plain grids of dots, of the same stages.
//!
//! Every stage is a pure function of the picture; none knows a camera or a robot.

mod candidates;
mod drift;
mod edge;
mod ellipse;
mod grid;
mod identity;
mod measuring;
mod pipeline;
mod smoothed;
#[cfg(test)]
pub(crate) mod synth;
mod types;

pub use super::correlated::Correlation;
pub(super) use candidates::contour::{Contour, Encloses, contours};
pub(super) use candidates::levels::Levels;
pub use drift::Drift;
pub(super) use edge::gauss::normal_tail;
pub use ellipse::Ellipse;
pub use grid::pipeline::detect_grid;
pub(super) use identity::code::{FALSE_ALARMS, binomial_tail};
pub use measuring::measure::measure;
pub use measuring::predicted::Predicted;
pub use measuring::predicted_pass::{detect_predicted, measure_predicted};
pub use pipeline::detect;
pub(super) use smoothed::{smoothed, variance_factor};
pub use types::{
    CircleDetection, DroppedCandidate, Found, Imaged, InnerOuter, LOPSIDED_PX, Measured, Options, Outcome, Reason,
};
