//! Coded circles: from a grey picture to identified sub-pixel centres.
//!
//! ```text
//! picture -> levels (envelopes, threshold) -> contour -> candidate (ellipse, tests)
//!         -> lattice (neighbour to neighbour) -> code (position on the plate) -> neighbour_check (is every neighbour of one mind)
//!         -> refine (blurred edge) -> inner/outer agreement -> Detection
//! ```
//!
//! Every stage is a pure function of the picture; none knows a camera or a robot.

mod agreement;
mod asymmetry;
mod candidate;
mod code;
mod contour;
mod edge_model;
mod edge_state;
mod ellipse;
mod exact_edge;
mod flat_zone;
mod gauss;
mod glare;
mod grid;
mod grid_dots;
mod grid_missing;
mod grid_place;
mod grid_seen;
mod lattice;
mod levels;
mod local_map;
mod measure;
mod nearby_ink;
mod neighbour_check;
mod overlapping;
mod pipeline;
mod predicted;
mod predicted_pass;
mod refine;
mod rescue;
mod smoothed;
mod squares;
#[cfg(test)]
pub(crate) mod synth;
mod types;

pub use asymmetry::Drift;
pub(super) use code::{FALSE_ALARMS, binomial_tail};
pub(super) use contour::{Contour, Encloses, contours};
pub use ellipse::Ellipse;
pub(super) use gauss::normal_tail;
pub use grid::detect_grid;
pub(super) use levels::Levels;
pub use measure::measure;
pub use pipeline::detect;
pub use predicted::Predicted;
pub use predicted_pass::{detect_predicted, measure_predicted};
pub use types::{
    CircleDetection, DroppedCandidate, Found, Imaged, InnerOuter, LOPSIDED_PX, Measured, Options, Outcome, Reason,
};
