//! When what was read and what was seen do not fit: which usual mistake explains it.
//!
//! `readings`, `name_order`, `misread`, `exchanged` and `angles_misread` undo mistakes of readings and of places; `suspects`, `mounting`, `row_shift` and `part_fits` try them on
//! images, in whole series and in parts; of several that explain it `likeliest` names one.

mod angles_misread;
pub(super) mod divided;
pub(super) mod exchanged;
pub(super) mod likeliest;
pub(super) mod misread;
mod mounting;
mod name_order;
pub(super) mod part_fits;
pub(super) mod readings;
mod row_shift;
pub(super) mod suspects;
