//! Starting values -> the joint fit.
//!
//! `fit` is in rounds of fitting and leaving out, with `measured_lengths` where these agree and `moved_markers` are let go; `unpredicted` says why no image could be held out.

pub(super) mod fit;
mod measured_lengths;
mod moved_markers;
pub(super) mod unpredicted;
