//! The corrected robot as URDF.

use std::collections::BTreeMap;

use super::Context;
use super::controller_files::exported;
use super::names::file_part;
use crate::error::Result;
use crate::geom::Pose;
use crate::identify::Solution;
use crate::urdf::patch_origins;

/// File name of the corrected URDF.
pub(super) fn urdf_name(context: &Context) -> String {
    format!("{}.calibrated.urdf", file_part(context.robot_name))
}

/// The URDF with the corrected origins of the chain, joint offsets folded in or left to the controller; every other byte as it was.
pub(super) fn urdf(solution: &Solution, context: &Context) -> Result<String> {
    let robot = exported(solution, context);
    let new: BTreeMap<String, Pose> = robot.urdf_origins().into_iter().map(|(j, o)| (j.to_owned(), o)).collect();
    patch_origins(&context.robot.text, &new)
}
