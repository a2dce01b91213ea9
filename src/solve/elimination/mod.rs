//! From the linearised problem to a small dense system: one family of unknowns is eliminated, the reduced normal equations remain.
//!
//! ```text
//! seen_markers, alike, runs, group, pose_space (what is coupled with what)
//!     -> marker_rows, blocks, right_hand_sides, distances (blocks of the normal equations)
//!     -> by_markers, or by_stops with body_stops (one family eliminated)
//!     -> system (the reduced equations, their solution, what follows at every stop)
//!     -> parts (systems of all but some of the stops)
//! ```

mod alike;
pub(super) mod blocks;
mod body_stops;
mod by_markers;
mod by_stops;
mod distances;
mod group;
mod marker_rows;
pub(super) mod parts;
mod pose_space;
pub(super) mod right_hand_sides;
mod runs;
pub(super) mod seen_markers;
pub(super) mod stop_covariance;
pub(super) mod system;
