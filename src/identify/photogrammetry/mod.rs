//! Images alone -> cameras, plates and camera poses; no robot takes part.
//!
//! `free_poses` is the adjustment that all else starts from; `stand_alone` makes a result of its own of it, which `pose_comparison` puts beside poses of
//! another source.

mod exchanged_counts;
pub(super) mod free_poses;
pub(super) mod pose_comparison;
pub(super) mod stand_alone;
