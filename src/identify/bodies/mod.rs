//! What trackers and contacts measured of bodies on the tip: starting values, and which usual mistake explains why there are none.
//!
//! `start` strings these together: `points_start` and `placed` find where instruments and bodies are, `misfit` how well they fit; `repeated_rows` are left
//! out; the others each name a mistake. `taken_back` takes back what was left out, where it fits the robot that was found. `touch_mistakes` are those of
//! touches by which tools and work objects are found.

mod misfit;
mod mistakes;
mod moved_between;
pub(super) mod placed;
mod places_exchanged;
mod points_start;
mod repeated_rows;
mod rows_in_part;
pub(super) mod rows_of;
pub(super) mod start;
pub(super) mod taken_back;
pub(super) mod touch_mistakes;
mod touch_size;
mod unrelated_rows;
