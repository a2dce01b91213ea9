//! Starting values -> the joint fit.
//!
//! `fit` is in rounds of fitting and leaving out, with `measured_lengths` where these agree; `unpredicted` says why no image could be held out.

pub(super) mod fit;
mod measured_lengths;
pub(super) mod unpredicted;
