//! Subcommands that use an identified robot: `frames` finds its tool and work object, `compensate` corrects its programs, `verify` judges it by other
//! measurements.
//!
//! `frames_text` is what `frames` prints; `compensate_frames` and `compensate_models` say what is known of the robots of a program; `verify` reads the
//! flags of `verify_args`, takes the model from `verify_model` and what was stated of it from `verify_stated`, judges points with `verify_points` and
//! series in `verify_series`, and ends in `verify_verdict`; `verify_zeros` tells zeros by which a model misses; `zeros` says which controller readings
//! are of.

pub mod compensate;
mod compensate_frames;
mod compensate_models;
mod controller_base;
pub mod frames;
mod frames_text;
pub mod verify;
pub mod verify_args;
mod verify_model;
mod verify_points;
mod verify_series;
mod verify_stated;
mod verify_verdict;
mod verify_zeros;
mod zeros;
