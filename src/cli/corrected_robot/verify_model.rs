//! What `verify` judges, with what the solution beside its description says of it.

use std::path::Path;

use super::compensate_frames::Side;
use super::compensate_models::not_given;
use super::verify_stated::Stated;
use crate::assess::Limits;
use crate::error::Result;
use crate::model::robot::Robot;
use crate::output::corrections::FileFinding;

/// A robot that is judged, and the limits with which its solution was found.
pub(super) struct Model {
    pub robot: Robot,
    pub stated: Option<Stated>,
    /// Said where the solution beside it is of another description.
    of_other: Option<FileFinding>,
    /// The usual ones where no solution stands beside it.
    pub limits: Limits,
}

impl Model {
    /// # Errors
    /// A solution beside the description that cannot be used.
    pub fn of(robot: Robot, urdf: &Path) -> Result<Self> {
        let (stated, of_other) = Stated::beside(urdf, &robot)?;
        let limits = stated.as_ref().map_or_else(Limits::default, Stated::limits);
        Ok(Self { robot, stated, of_other, limits })
    }

    /// What speaks against it whatever was measured: its solution is of another description or failed checks, or its compensation.toml was not given.
    pub fn doubts(&self, urdf: &Path, compensation: Option<&Path>) -> Vec<FileFinding> {
        let side = Side { robot: &self.robot, urdf, solution: None };
        let untrusted = self.stated.as_ref().and_then(|s| s.untrusted(urdf));
        let not_given = not_given(&side, compensation, "--compensation");
        self.of_other.clone().into_iter().chain(untrusted).chain(not_given).collect()
    }
}
