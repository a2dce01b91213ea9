//! A series as read -> a series as seen.
//!
//! `measure` strings together what the others do: `detections` look at the images (for a second time in `second_pass`), `bodies` reads what trackers and
//! contacts measured, `stated` what the manifest says of the camera; `plates` says which series show one plate.

mod bodies;
pub(super) mod detections;
pub(super) mod measure;
pub(super) mod plates;
mod second_pass;
pub(super) mod seen_image;
pub(super) mod stated;
