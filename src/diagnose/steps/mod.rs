//! What stands elsewhere at some of the stops: a plate, a camera, a tracker, a given place or the zero of a joint.
//!
//! ```text
//! candidates (what may differ, and how stops are divided by it) -> rows (what a change explains, stop by stop) -> orders (which are tried)
//!     -> pose_step, loose (the checks) -> displaced, images_shifted, place_misstated, zero_moved, loose_mounting (what they find)
//! ```

mod candidates;
pub(super) mod displaced;
pub(super) mod images_shifted;
pub(super) mod loose;
pub(super) mod loose_mounting;
mod orders;
pub(super) mod place_misstated;
pub(super) mod pose_step;
mod rows;
pub(super) mod zero_moved;
