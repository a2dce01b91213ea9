//! Subcommands about a series before it is used: `plan` says where to take images, `simulate` makes a series, `convert` makes one of a recording, `doctor` says
//! what is missing in it.
//!
//! `plan_targets` and `plan_touches` belong to `plan`, `convert_camera` to `convert`.

pub mod convert;
mod convert_camera;
pub mod doctor;
pub mod plan;
mod plan_targets;
mod plan_touches;
pub mod simulate;
