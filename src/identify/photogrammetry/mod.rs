//! Images alone -> cameras, plates and camera poses; no robot takes part.
//!
//! `free_poses` is the adjustment that all else starts from; `stand_alone` makes a result of its own of it, which `pose_comparison` puts beside poses of
//! another source.

pub(super) mod free_poses;
mod numbering;
pub(super) mod pose_comparison;
pub(super) mod stand_alone;
