//! The corrected robot: URDF and kinematics.yaml.

use std::collections::BTreeMap;

use super::Context;
use super::controller_files::{exported, offsets_in_words};
use super::names::file_part;
use super::text::{key, number};
use crate::error::Result;
use crate::geom::Pose;
use crate::recipe::Solution;
use crate::urdf::patch_origins;

/// File name of the corrected URDF.
pub(super) fn urdf_name(context: &Context) -> String {
    format!("{}.calibrated.urdf", file_part(context.robot_name))
}

/// The URDF with the corrected origins of the chain, joint offsets folded in or left to the controller; every other byte as it was.
pub(super) fn urdf(solution: &Solution, context: &Context) -> Result<String> {
    let robot = exported(solution, context);
    let new: BTreeMap<String, Pose> =
        robot.chain.joints.iter().zip(robot.corrected_origins()).map(|(j, o)| (j.name.clone(), o)).collect();
    patch_origins(&context.robot.text, &new)
}

/// Corrected origins of the chain in the layout of ur_description.
pub(super) fn kinematics_yaml(solution: &Solution, context: &Context) -> String {
    let robot = exported(solution, context);
    let mut out = format!(
        "# Corrected joint origins (m, rad) in the layout that ur_description reads (kinematics_params). {}\nkinematics:\n",
        offsets_in_words(context)
    );
    for (joint, origin) in robot.chain.joints.iter().zip(robot.corrected_origins()) {
        out += &format!("  {}:\n", key(&joint.name));
        for (name, value) in
            ["x", "y", "z", "roll", "pitch", "yaw"].iter().zip(origin.xyz().into_iter().chain(origin.rpy()))
        {
            // `y` alone is a boolean in YAML 1.1, but a plain key in every file of this layout.
            out += &format!("    {name}: {}\n", number(value));
        }
    }
    out
}
