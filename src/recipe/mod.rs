//! The modes of the program: short lists of stages over the same chain.
//!
//! `series -> observations -> free poses -> starting values -> joint fit -> assessment`. A new mode is a file here.

mod build;
mod focus;
mod free_poses;
mod gates;
mod joint;
mod measure;
mod moved;
mod solution;
mod start;
mod suspects;

pub use build::{MeasuredSeries, MeasuredStop};
pub use free_poses::{FreePose, FreePoses, adjust_free_poses};
pub use joint::{JointNoise, Options, RobotModel, identify};
pub use measure::{Measured, measure};
pub use solution::{Solution, StartVerdict};
