//! The result of an adjustment, and what can be had from it without solving again.

mod evidence;
mod free_poses;

pub use evidence::log_evidence;
pub use free_poses::{FreePose, FreePoses, PlacedCamera, misfit};

use crate::problem::{Problem, State};
use crate::solve::{Covariance, Linearised};

/// An adjustment at its optimum.
#[derive(Debug, Clone)]
pub struct Fit {
    /// Data, with the reasons of all rejections and the final variance components.
    pub problem: Problem,
    /// All estimates.
    pub state: State,
    /// Linearisation at the estimates: residuals and weights of the images in use.
    pub linearised: Linearised,
    /// Covariance of the estimates.
    pub covariance: Covariance,
}
