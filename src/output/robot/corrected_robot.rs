//! The corrected robot as URDF, and every other file about it.

use std::collections::BTreeMap;

use super::controller_files::{kinematics_xacro, mdh_csv, offsets_in_words};
use super::kinematics_file::kinematics_yaml;
use super::{compensation, mastering};
use crate::error::Result;
use crate::geom::Pose;
use crate::identify::Solution;
use crate::model::robot::Robot;
use crate::output::Context;
use crate::output::names::file_part;
use crate::urdf::patch_origins;

/// Every file about the robot: name and text.
pub fn all(solution: &Solution, context: &Context) -> Result<Vec<(String, String)>> {
    let alone = solution.uncertainty.alone.as_ref();
    let note = alone.map_or("", |_| WITH_TERMS);
    let mut files = described(&mastering::exported(solution, context), "", note, context)?;
    files.push(("mastering.csv".into(), mastering::mastering_csv(solution, context)));
    files.push(("compensation.toml".into(), compensation::compensation_toml(solution, context)));
    if let Some(robot) = alone {
        files.extend(described(
            &robot.mastered_by(&mastering::to_enter(solution, context)),
            "_alone",
            BY_ITSELF,
            context,
        )?);
    }
    Ok(files)
}

/// Heads of the files to which compensation.toml adds, and of those that do without.
const WITH_TERMS: &str = "compensation.toml adds to these origins: a program that does not read it does better with those of the files _alone.";
const BY_ITSELF: &str = "These origins do best by themselves and do not go with compensation.toml.";

/// End of the name of the corrected URDF.
pub const CALIBRATED: &str = ".calibrated.urdf";
/// End of the name of the one that does best by itself.
pub const ALONE: &str = ".calibrated_alone.urdf";

/// A robot, as the controller has it, in every format that its readers take; `mark` stands in the names, `note` in the heads.
fn described(robot: &Robot, mark: &str, note: &str, context: &Context) -> Result<Vec<(String, String)>> {
    let note = [offsets_in_words(context), note].join(" ");
    let note = note.trim_end();
    Ok(vec![
        (format!("{}.calibrated{mark}.urdf", file_part(context.robot_name)), urdf(robot, context)?),
        (format!("kinematics{mark}.yaml"), kinematics_yaml(robot, context.robot, note)),
        (format!("kinematics{mark}.xacro"), kinematics_xacro(robot, note)),
        (format!("mdh{mark}.csv"), mdh_csv(robot, note)),
    ])
}

/// The URDF with the corrected origins of the chain, joint offsets folded in or left to the controller; every other byte as it was.
fn urdf(robot: &Robot, context: &Context) -> Result<String> {
    let new: BTreeMap<String, Pose> = robot.urdf_origins().into_iter().map(|(j, o)| (j.to_owned(), o)).collect();
    patch_origins(&context.robot.text, &new)
}
