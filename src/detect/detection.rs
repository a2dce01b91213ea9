//! What a detector hands back for one image.

use crate::error::Notice;
use crate::series::Observation;

/// Identified observations of one image, and what was seen but not used.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Detection {
    /// Identified observations in order of marker id.
    pub observations: Vec<Observation>,
    /// Candidates that were left out, each with its reason.
    pub dropped: Vec<Dropped>,
    /// What the user should know though the work went on.
    pub notices: Vec<Notice>,
}

/// A candidate that was left out.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Dropped {
    /// Where it was seen, in pixels.
    pub uv: [f64; 2],
    /// Why it was left out; one of a small set of phrases, so that reasons can be counted.
    pub reason: &'static str,
}
