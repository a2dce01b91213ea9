//! The result of an adjustment, and what can be had from it without solving again.

mod evidence;
mod free_poses;

pub use crate::solve::Fit;
pub use evidence::{log_evidence, log_evidence_of_fit};
pub use free_poses::{FocalLength, FreePose, FreePoses, PlacedCamera};
