//! Identified series -> the least-squares problem.
//!
//! `build` makes it; `bodies` has its part with trackers, contacts and distances, `local_errors` its columns for joints that come back to a reading, `seen_before` finds
//! images that were given twice.

mod bodies;
pub(super) mod build;
mod local_errors;
mod seen_before;
