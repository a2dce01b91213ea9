//! Poses of the flange as a controller says them, and the mistakes that are usual in them.

use crate::error::Code;
use crate::geom::Pose;

/// Poses of the flange at the stops of a series.
#[derive(Debug, Clone, PartialEq)]
pub struct ControllerPoses {
    /// Of every stop; `None` for an image that was taken off the robot.
    pub base_from_flange: Vec<Option<Pose>>,
    /// Joint angles that were stated with some of them, roughly, deg (m of a prismatic joint).
    pub stated_deg: Vec<Option<Vec<f64>>>,
    /// The same table with a mistake undone, for each mistake that is usual.
    pub otherwise: Vec<ReadOtherwise>,
}

/// Poses as they would be if a mistake had been made.
#[derive(Debug, Clone, PartialEq)]
pub struct ReadOtherwise {
    /// Which mistake.
    pub code: Code,
    /// How the table would be to be read; what fits then is to be added.
    pub what: String,
    /// What to do then.
    pub remedy: String,
    /// `base_from_flange` of every stop.
    pub poses: Vec<Option<Pose>>,
}

impl ControllerPoses {
    /// Those of some stops.
    pub(super) fn of_rows(&self, rows: impl Iterator<Item = usize> + Clone) -> Self {
        let of = |poses: &[Option<Pose>]| rows.clone().map(|k| poses[k]).collect::<Vec<_>>();
        let otherwise = self.otherwise.iter().map(|o| ReadOtherwise { poses: of(&o.poses), ..o.clone() });
        let stated_deg = rows.clone().map(|k| self.stated_deg[k].clone()).collect();
        Self { base_from_flange: of(&self.base_from_flange), stated_deg, otherwise: otherwise.collect() }
    }
}

impl ReadOtherwise {
    /// What is wrong, as something fits if it is not.
    pub fn says(&self, fits: &str) -> String {
        format!("{} {fits}", self.what)
    }

    pub(super) fn of_convention(poses: Vec<Option<Pose>>, name: &str, remedy: String) -> Self {
        let what = format!("the rotations in controller.csv follow another convention: read as {name}");
        Self { code: Code::RotationConvention, what, remedy, poses }
    }

    /// Rotations of the base in the flange beside positions of the flange in the base.
    pub(super) fn turned_back(poses: &[Option<Pose>]) -> Self {
        let what = "the rotations in controller.csv are those of the base in the flange: with them inverted, and the positions as they are,".to_owned();
        let remedy = "invert the rotations alone: negate qx, qy and qz (rx, ry, rz), transpose a matrix".to_owned();
        let poses = poses.iter().map(|p| p.map(|p| Pose::new(p.rotation.transpose(), p.translation))).collect();
        Self { code: Code::PosesInverted, what, remedy, poses }
    }

    /// Poses of the base in the flange, where those of the flange in the base are wanted.
    pub(super) fn inverted(poses: &[Option<Pose>], convention: Option<&str>) -> Self {
        let read = convention.map_or_else(String::new, |name| format!(" and their rotations as {name}"));
        let what = format!("the poses in controller.csv are those of the base in the flange: inverted{read}");
        let remedy =
            "invert every pose, or export the pose of the flange in the base; if they are right, the camera is \
                      mounted the other way (camera_mount in series.toml)"
                .to_owned();
        let poses = poses.iter().map(|p| p.map(|p| p.inverse())).collect();
        Self { code: Code::PosesInverted, what, remedy, poses }
    }
}
