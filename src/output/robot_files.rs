//! The corrected robot as URDF, and every other file about it.

use std::collections::BTreeMap;

use super::controller_files::{self, exported};
use super::names::file_part;
use super::{Context, compensation, kinematics_file};
use crate::error::Result;
use crate::geom::Pose;
use crate::identify::Solution;
use crate::urdf::patch_origins;

/// Every file about the robot: name and text.
pub(super) fn all(solution: &Solution, context: &Context) -> Result<Vec<(String, String)>> {
    Ok(vec![
        (urdf_name(context), urdf(solution, context)?),
        ("kinematics.yaml".into(), kinematics_file::of_solution(solution, context)),
        ("kinematics.xacro".into(), controller_files::xacro(solution, context)),
        ("mdh.csv".into(), controller_files::mdh_csv(solution, context)),
        ("mastering.csv".into(), controller_files::mastering_csv(solution, context)),
        ("compensation.toml".into(), compensation::compensation_toml(solution, context)),
    ])
}

/// File name of the corrected URDF.
fn urdf_name(context: &Context) -> String {
    format!("{}.calibrated.urdf", file_part(context.robot_name))
}

/// The URDF with the corrected origins of the chain, joint offsets folded in or left to the controller; every other byte as it was.
fn urdf(solution: &Solution, context: &Context) -> Result<String> {
    let robot = exported(solution, context);
    let new: BTreeMap<String, Pose> = robot.urdf_origins().into_iter().map(|(j, o)| (j.to_owned(), o)).collect();
    patch_origins(&context.robot.text, &new)
}
