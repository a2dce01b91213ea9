//! A robot for those who have none: its joints are the six coordinates of a pose.
//!
//! Three slides along the axes of the base, then three rotations about axes through one point. The first rotation starts from where the
//! middle one stays far from a right angle at all poses, where two of the three would be one.

use std::fmt::Write as _;
use std::path::Path;

use nalgebra::{Matrix3, Vector3};

use super::chain::{Chain, JointKind};
use super::read::RobotDescription;
use crate::error::Result;
use crate::geom::{Pose, project_to_so3, rpy_from_matrix};

/// Name of the robot, and of its files.
const NAME: &str = "controller";
const LINKS: [&str; 7] = ["base", "at_x", "at_xy", "at_xyz", "turned_once", "turned_twice", "flange"];
const SLIDES: [&str; 3] = ["x", "y", "z"];
/// Orders in which to turn about the axes x, y and z: each has another one in the middle.
const ORDERS: [[usize; 3]; 3] = [[2, 1, 0], [0, 2, 1], [1, 0, 2]];
/// Most poses from which the rotations may start.
const MOST_STARTS: usize = 64;

/// Rotations of the first joint, in the base, and the order of the axes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PoseCoordinates {
    start: Matrix3<f64>,
    order: [usize; 3],
}

impl PoseCoordinates {
    /// Those in which the middle angle of all poses stays smallest.
    fn of_poses(poses: &[Pose]) -> Self {
        let sum = poses.iter().fold(Matrix3::zeros(), |sum, p| sum + p.rotation);
        let step = poses.len().div_ceil(MOST_STARTS).max(1);
        let starts = project_to_so3(&sum).into_iter().chain(poses.iter().step_by(step).map(|p| p.rotation));
        let mut best = (f64::INFINITY, Self { start: Matrix3::identity(), order: ORDERS[0] });
        for start in starts {
            for order in ORDERS {
                let coordinates = Self { start, order };
                let widest = poses.iter().map(|p| coordinates.of(p)[4].abs()).fold(0.0, f64::max);
                if widest < best.0 {
                    best = (widest, coordinates);
                }
            }
        }
        best.1
    }

    /// Coordinates of a pose: x, y, z (m), then the three angles (rad).
    pub fn of(&self, base_from_flange: &Pose) -> [f64; 6] {
        let to_order = Matrix3::from_columns(&self.order.map(|k| Vector3::ith(k, 1.0)));
        // Columns of the axes first, middle, last; z, y, x are those of roll, pitch, yaw.
        let as_zyx = Matrix3::from_columns(&[to_order.column(2), to_order.column(1), to_order.column(0)]);
        let turned = as_zyx.transpose() * self.start.transpose() * base_from_flange.rotation * as_zyx;
        let [last, middle, first] = rpy_from_matrix(&turned);
        let [x, y, z] = base_from_flange.xyz();
        [x, y, z, first, middle, last]
    }
}

/// The robot whose tip can be at all these poses, with limits around them.
///
/// # Errors
/// None for finite poses.
pub fn pose_robot(poses: &[Pose]) -> Result<RobotDescription> {
    let coordinates = PoseCoordinates::of_poses(poses);
    let all: Vec<[f64; 6]> = poses.iter().map(|p| coordinates.of(p)).collect();
    let mut text = format!("<robot name=\"{NAME}\">\n");
    let mut line = |what: std::fmt::Arguments<'_>| writeln!(text, "  {what}").map_or((), |()| ());
    LINKS.iter().for_each(|link| line(format_args!("<link name=\"{link}\"/>")));
    for k in 0..6 {
        let (name, kind, axis) = match k {
            0..3 => (SLIDES[k].to_owned(), "prismatic", k),
            _ => (format!("about_{}", SLIDES[coordinates.order[k - 3]]), "revolute", coordinates.order[k - 3]),
        };
        let rpy = if k == 3 { rpy_from_matrix(&coordinates.start) } else { [0.0; 3] };
        let along = [0, 1, 2].map(|i| if i == axis { "1" } else { "0" }).join(" ");
        let (low, high) = all.iter().fold((0.0_f64, 0.0_f64), |(l, h), c| (l.min(c[k]), h.max(c[k])));
        let (low, high) = (low - 0.5, high + 0.5);
        line(format_args!(
            "<joint name=\"{name}\" type=\"{kind}\"><parent link=\"{}\"/><child link=\"{}\"/>\
             <origin xyz=\"0 0 0\" rpy=\"{:?} {:?} {:?}\"/><axis xyz=\"{along}\"/>\
             <limit lower=\"{low:?}\" upper=\"{high:?}\" effort=\"0\" velocity=\"0\"/></joint>",
            LINKS[k],
            LINKS[k + 1],
            rpy[0],
            rpy[1],
            rpy[2]
        ));
    }
    text.push_str("</robot>\n");
    RobotDescription::from_text(Path::new("poses of the controller"), text)
}

impl Chain {
    /// Coordinates of a pose in a chain that is that of a [`pose_robot`]; `None` for an arm.
    pub fn pose_coordinates(&self) -> Option<PoseCoordinates> {
        let kinds = [[JointKind::Prismatic; 3], [JointKind::Revolute; 3]].concat();
        let moves = self.joints.iter().map(|j| j.kind).eq(kinds) && self.joints.iter().all(|j| j.drive.is_some());
        let axis = |k: usize| (0..3).find(|&i| self.joints[k].axis == Vector3::ith(i, 1.0));
        if !moves || (0..3).any(|k| axis(k) != Some(k)) {
            return None;
        }
        let still = |k: usize| self.joints[k].origin == Pose::identity();
        let joined = self.joints[3].origin.translation == Vector3::zeros();
        let order = [axis(3)?, axis(4)?, axis(5)?];
        let is_one = joined && [0, 1, 2, 4, 5].into_iter().all(still) && ORDERS.contains(&order);
        is_one.then_some(PoseCoordinates { start: self.joints[3].origin.rotation, order })
    }
}
