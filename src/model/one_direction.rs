//! Arms that tilt nothing: SCARA, palletiser.

use nalgebra::Vector3;

use super::inverse::reading_limits;
use super::robot::Robot;
use crate::geom::log_so3;

/// True for an arm that turns what it carries about one direction in space alone: its axes are all parallel, or joints that follow others keep its
/// flange level. `least_rad`: so small a turn about a second direction is none.
///
/// Every reading is taken to a quarter and to three quarters of its range, the others being in the middle of theirs: where all of these turns have
/// one axis, no other posture has another one.
pub fn turns_about_one_direction(robot: &Robot, least_rad: f64) -> bool {
    let limits = reading_limits(&robot.chain);
    let middle: Vec<f64> = limits.iter().map(|(low, high)| 0.5 * (low + high)).collect();
    let level = robot.base_from_tip(&middle).rotation.transpose();
    let turns = limits.iter().enumerate().flat_map(|(reading, (low, high))| {
        [0.25, 0.75].map(|share| {
            let mut readings = middle.clone();
            readings[reading] = low + share * (high - low);
            log_so3(&(level * robot.base_from_tip(&readings).rotation))
        })
    });
    let turns: Vec<Vector3<f64>> = turns.collect();
    let Some(largest) = turns.iter().max_by(|a, b| a.norm().total_cmp(&b.norm())) else { return true };
    let Some(axis) = largest.try_normalize(least_rad) else { return true };
    turns.iter().all(|turn| turn.cross(&axis).norm() < least_rad)
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::urdf::RobotDescription;

    const LEAST_RAD: f64 = 0.02;

    fn joint(name: &str, kind: &str, [parent, child]: [&str; 2], inner: &str) -> String {
        format!(
            "<link name='{child}'/><joint name='{name}' type='{kind}'><parent link='{parent}'/><child link='{child}'/>\
             {inner}<limit lower='-1' upper='1.2' effort='0' velocity='0'/></joint>"
        )
    }

    fn is_level(joints: &[String]) -> bool {
        let text = format!("<robot name='r'><link name='base'/>{}</robot>", joints.concat());
        let chain = RobotDescription::from_text(Path::new("r.urdf"), text).and_then(|d| d.chain(None, None));
        turns_about_one_direction(&Robot::nominal(chain.unwrap()), LEAST_RAD)
    }

    #[test]
    fn an_arm_of_parallel_axes_tilts_nothing() {
        let level = |axis: &str, rpy: &str| {
            let at = |axis: &str, rpy: &str| format!("<origin xyz='0.3 0 0' rpy='{rpy}'/><axis xyz='{axis}'/>");
            is_level(&[
                joint("j1", "revolute", ["base", "a"], &at("0 0 1", "0 0 0")),
                joint("j2", "prismatic", ["a", "b"], &at("1 0 0", "0 0 0")),
                joint("j3", "revolute", ["b", "c"], &at(axis, rpy)),
            ])
        };
        assert!(level("0 0 1", "0 0 0.5") && level("0 0 -1", "3.14159265 0 0"));
        assert!(!level("0 1 0", "0 0 0") && !level("0 0 1", "1.5 0 0"));
    }

    #[test]
    fn a_palletiser_whose_rods_keep_the_flange_level_tilts_nothing() {
        let palletiser = |multiplier: f64| {
            let follows = |of: &str| format!("<axis xyz='0 1 0'/><mimic joint='{of}' multiplier='{multiplier}'/>");
            is_level(&[
                joint("j1", "revolute", ["base", "a"], "<axis xyz='0 0 1'/>"),
                joint("j2", "revolute", ["a", "b"], "<axis xyz='0 1 0'/>"),
                joint("j3", "revolute", ["b", "c"], "<origin xyz='0 0 0.8'/><axis xyz='0 1 0'/>"),
                joint("rod2", "revolute", ["c", "d"], &follows("j2")),
                joint("rod3", "revolute", ["d", "e"], &follows("j3")),
                joint("j4", "revolute", ["e", "f"], "<axis xyz='0 0 -1'/>"),
            ])
        };
        assert!(palletiser(-1.0) && !palletiser(-0.9));
    }
}
