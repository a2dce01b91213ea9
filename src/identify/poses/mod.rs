//! Camera poses as a result of their own: images alone, no robot takes part.
//!
//! `stand_alone` chooses the lenses and makes the result of the adjustment of free poses; `pose_comparison` puts it beside poses of another source.

pub(super) mod pose_comparison;
pub(super) mod stand_alone;
