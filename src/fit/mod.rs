//! The result of an adjustment, and what can be had from it without solving again.

mod evidence;
mod free_poses;

pub use crate::solve::Fit;
pub use evidence::{NoEvidence, fit_of_outcome, log_evidence, log_evidence_of_fit, log_evidence_of_outcome};
pub use free_poses::{FocalLength, FreePose, FreePoses, PlacedCamera};
