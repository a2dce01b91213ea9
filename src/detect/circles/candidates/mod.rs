//! What may be the image of a marker: levels (envelopes, threshold) -> contour -> ellipse -> candidate (the tests of quality).

pub(super) mod candidate;
pub(super) mod contour;
pub(super) mod levels;
