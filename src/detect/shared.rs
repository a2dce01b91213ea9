//! What several detectors share.

use crate::error::{Code, Error};

/// What print, lens and blur of other shapes leave beyond the noise of an edge or a corner, px per axis; seen on real boards after their
/// printing errors are taken out.
pub(super) const SYSTEMATIC_PX: f64 = 0.015;
/// A pixel at this part of the range or above counts as saturated.
pub(super) const SATURATED: f32 = 0.995;
/// Slope of the light in glare: that of full scale and 40 px changes by this part of the contrast per px.
pub(super) const GLARE_SLOPE: f64 = 0.02;
/// Blur of a marker's border, or of a dot, that the window of a corner stays clear of, px.
pub(super) const KEEP_OFF_PX: f64 = 2.0;
/// A line of which a smaller share of the corners or dots in view is found is missing ...
pub(super) const MISSING: f64 = 0.3;
/// ... where this many of it are in view.
pub(super) const LEAST_IN_VIEW: usize = 3;

/// A picture in a mirror, of what is said to be in it.
pub(super) fn mirrored(what: &str) -> Error {
    Error::new(Code::PlateMirrored, "image", what, "turn off mirroring in the camera or in the image export")
}
