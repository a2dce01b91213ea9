//! A series as read -> a series as seen.
//!
//! `measure` strings together what the others do: `detections` look at the images (for a second time in `second_pass`), `bodies` reads what trackers and
//! contacts measured, `stated` what the manifest says of the camera; `together` looks at several series:
//! `plates` says which show one plate, `repeated` which are one recording.

pub(super) mod bodies;
pub(super) mod detections;
pub(super) mod measure;
mod plates;
pub(super) mod repeated;
mod second_pass;
pub(super) mod seen_image;
mod stated;
pub(super) mod together;
