//! What a detector hands back for one image.

use super::circles::{Ellipse, Found, Outcome};
use crate::error::{Error, Notice};
use crate::series::Observation;

/// Identified observations of one image, and what was seen but not used.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Detection {
    /// Identified observations in order of marker id.
    pub observations: Vec<Observation>,
    /// Candidates that were left out, each with its reason.
    pub dropped: Vec<Dropped>,
    /// What was measured of a plate of circles; `None` for corners.
    pub circles: Option<Circles>,
    /// What the user should know though the work went on.
    pub notices: Vec<Notice>,
    /// Why the image cannot be used, with no observations then; `None` where it can.
    pub failure: Option<Error>,
}

/// What an image of circles tells beyond their places.
#[derive(Debug, Clone, PartialEq)]
pub struct Circles {
    /// The identified markers in order of their ids.
    pub found: Vec<Found>,
    /// How the identification went.
    pub outcome: Outcome,
    /// Median blur (optics and pixel aperture together), px; NaN without markers.
    pub blur_px: f64,
    /// Noise of a pixel on paper and on ink, counts.
    pub noise: [f64; 2],
}

/// A candidate that was left out.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Dropped {
    /// Where it was seen, in pixels.
    pub uv: [f64; 2],
    /// Why it was left out; one of a small set of phrases, so that reasons can be counted.
    pub reason: &'static str,
    /// The ellipse of its contour, where one was fitted.
    pub ellipse: Option<Ellipse>,
    /// The marker that it would have been, where that is known.
    pub marker: Option<u32>,
}

impl Dropped {
    /// A point that was left out.
    pub fn point(uv: [f64; 2], reason: &'static str) -> Self {
        Self { uv, reason, ellipse: None, marker: None }
    }
}
