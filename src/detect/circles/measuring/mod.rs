//! All markers of a picture measured, and what is believed of that.
//!
//! ```text
//! measure (candidates) -> bands (noise of neighbouring pixels) -> rescue (small ones, by what neighbours tell) -> agreement (inner and outer circle), glare
//! predicted, overlapping -> predicted_pass (the second pass: where camera and pose say that they are)
//! ```

pub(super) mod agreement;
pub(super) mod bands;
pub(super) mod glare;
pub(super) mod measure;
mod overlapping;
pub(super) mod predicted;
pub(super) mod predicted_pass;
pub(super) mod rescue;
