//! The corrected robot as URDF, and every other file about it.

use std::collections::BTreeMap;

use super::controller_files::{self, exported, of_controller};
use super::names::file_part;
use super::{Context, compensation, kinematics_file};
use crate::error::Result;
use crate::geom::Pose;
use crate::identify::Solution;
use crate::model::robot::Robot;
use crate::urdf::patch_origins;

/// Every file about the robot: name and text.
pub(super) fn all(solution: &Solution, context: &Context) -> Result<Vec<(String, String)>> {
    let alone = solution.uncertainty.alone.as_ref().map(|robot| of_controller(robot, context));
    let alone = alone.map(|robot| Ok((name(context, ALONE), urdf(&robot, context)?))).transpose()?;
    let files = vec![
        (name(context, CALIBRATED), urdf(&exported(solution, context), context)?),
        ("kinematics.yaml".into(), kinematics_file::of_solution(solution, context)),
        ("kinematics.xacro".into(), controller_files::xacro(solution, context)),
        ("mdh.csv".into(), controller_files::mdh_csv(solution, context)),
        ("mastering.csv".into(), controller_files::mastering_csv(solution, context)),
        ("compensation.toml".into(), compensation::compensation_toml(solution, context)),
    ];
    Ok(files.into_iter().chain(alone).collect())
}

/// End of the name of the corrected URDF.
pub const CALIBRATED: &str = ".calibrated.urdf";
/// End of the name of the one that does best by itself.
pub const ALONE: &str = ".calibrated_alone.urdf";

fn name(context: &Context, end: &str) -> String {
    format!("{}{end}", file_part(context.robot_name))
}

/// The URDF with the corrected origins of the chain, joint offsets folded in or left to the controller; every other byte as it was.
fn urdf(robot: &Robot, context: &Context) -> Result<String> {
    let new: BTreeMap<String, Pose> = robot.urdf_origins().into_iter().map(|(j, o)| (j.to_owned(), o)).collect();
    patch_origins(&context.robot.text, &new)
}
