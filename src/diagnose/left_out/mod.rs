//! What was left out of the fit: whether it is too much, and what would explain it.
//!
//! `agreement` says whether images that do not fit their readings agree with each other, for `moved`, and `reading_circles` whose readings they fit; every other file is a check with what it finds.

pub(super) mod agreement;
pub(super) mod exchanged_pictures;
pub(super) mod exchanged_readings;
pub(super) mod exchanged_targets;
pub(super) mod left_out_bodies;
pub(super) mod left_out_images;
pub(super) mod left_out_observations;
pub(super) mod many_left_out;
pub(super) mod moved;
pub(super) mod reading_circles;
pub(super) mod shifted_measurements;
pub(super) mod shifted_readings;
