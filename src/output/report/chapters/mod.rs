//! The chapters of the reports.
//!
//! | what they tell of | |
//! |---|---|
//! | the data | `findings`, `gallery`, `coverage`, `bodies` |
//! | the residuals | `images`, `pose_residuals` |
//! | what is known | `knowledge`, `parameters`, `two_stage` |
//!
//! `sections` holds those of a few lines.

pub(super) mod bodies;
pub(super) mod coverage;
pub(super) mod findings;
pub(super) mod gallery;
pub(super) mod images;
pub(super) mod knowledge;
pub(super) mod parameters;
pub(super) mod pose_residuals;
pub(super) mod sections;
pub(super) mod two_stage;
