//! The usual mistakes in what a file says of the places of bodies.

use nalgebra::{Matrix3, Vector3};

use super::angles_misread::AnglesMisread;
use super::exchanged::Exchanged;
use crate::diagnose::MistakeKind;
use crate::error::Code;
use crate::geom::Pose;
use crate::problem::BodySeen;
use crate::series::{LENGTH_UNITS, LengthUnit};

/// One of them.
#[derive(Clone, Copy)]
pub(in crate::identify) enum Misread {
    /// Positions are in this unit and not in metres.
    InUnit(&'static LengthUnit),
    /// Two coordinates stand in each other's column, and the rotations as they should.
    InColumns(Exchanged),
    /// Rotations were made of angles of another convention.
    OfAngles(AnglesMisread),
    /// Another.
    Otherwise(&'static Otherwise),
}

/// A mistake of axes, of rotations or of what is seen from where, and what the file would have said without.
pub(in crate::identify) struct Otherwise {
    code: Code,
    what: &'static str,
    remedy: &'static str,
    /// `None` where it changes nothing.
    undone: fn(BodySeen) -> Option<BodySeen>,
}

/// All of them.
pub(in crate::identify) fn all_misread() -> impl Iterator<Item = Misread> {
    let in_units = LENGTH_UNITS.iter().map(Misread::InUnit);
    let in_columns = Exchanged::ALL.into_iter().map(Misread::InColumns);
    let of_angles = AnglesMisread::all().map(Misread::OfAngles);
    in_units.chain(OF_AXES.iter().map(Misread::Otherwise)).chain(in_columns).chain(of_angles)
}

/// Those of axes, of rotations and of what is seen from where.
const OF_AXES: [Otherwise; 7] = [
    Otherwise {
        code: Code::AxesMirrored,
        what: "its axes are left-handed: with y_m negated the measurements fit",
        remedy: "see which axis is wrong, as another sign or two exchanged columns may fit alike: negate y_m, or set the instrument to right-handed axes",
        undone: |seen| Some(moved(seen, |pose| Pose::new(pose.rotation, mirrored(pose.translation, 1)))),
    },
    Otherwise {
        code: Code::AxesMirrored,
        what: "its axes are left-handed: with x_m negated the measurements fit",
        remedy: "see which axis is wrong, as another sign or two exchanged columns may fit alike: negate x_m, or set the instrument to right-handed axes",
        undone: |seen| Some(moved(seen, |pose| Pose::new(pose.rotation, mirrored(pose.translation, 0)))),
    },
    Otherwise {
        code: Code::AxesMirrored,
        what: "its axes are left-handed: with z_m negated the measurements fit",
        remedy: "see which axis is wrong, as another sign or two exchanged columns may fit alike: negate z_m, or set the instrument to right-handed axes",
        undone: |seen| Some(moved(seen, |pose| Pose::new(pose.rotation, mirrored(pose.translation, 2)))),
    },
    Otherwise {
        code: Code::AxesMirrored,
        what: "its axes are left-handed, in positions and rotations: with one of them mirrored the measurements fit",
        remedy: "negate y_m, qx and qz, or set the instrument to right-handed axes",
        undone: |seen| {
            of_pose(seen, |pose| {
                let [x, y, z, w] = pose.quaternion_xyzw();
                Pose::from_xyz_quaternion(mirrored(pose.translation, 1).into(), [-x, y, -z, w])
            })
        },
    },
    Otherwise {
        code: Code::RotationConvention,
        what: "quaternions stand in the order qw, qx, qy, qz: read so, the measurements fit",
        remedy: "name the columns in the order in which they stand",
        undone: |seen| {
            of_pose(seen, |pose| {
                let [w, x, y, z] = pose.quaternion_xyzw();
                Pose::from_xyz_quaternion(pose.xyz(), [x, y, z, w])
            })
        },
    },
    Otherwise {
        code: Code::PosesInverted,
        what: "rotations are those of the tracker in the target: inverted, the measurements fit",
        remedy: "negate qx, qy and qz",
        undone: |seen| of_pose(seen, |pose| Pose::new(pose.rotation.transpose(), pose.translation)),
    },
    Otherwise {
        code: Code::PosesInverted,
        what: "poses are those of the tracker in the target: inverted, the measurements fit",
        remedy: "write the pose of the target in the frame of the tracker",
        undone: |seen| of_pose(seen, |pose| pose.inverse()),
    },
];

impl Misread {
    /// What the file would have said without; `None` where that is the same.
    pub fn undone(self, seen: BodySeen) -> Option<BodySeen> {
        match self {
            Self::InUnit(unit) => Some(moved(seen, |pose| Pose::new(pose.rotation, unit.metres * pose.translation))),
            Self::InColumns(exchanged) => of_pose(seen, |pose| exchanged.undone(pose)),
            Self::OfAngles(angles) => of_pose(seen, |pose| Pose::new(angles.undone(&pose.rotation), pose.translation)),
            Self::Otherwise(other) => (other.undone)(seen),
        }
    }

    /// As a mistake with its remedy.
    pub fn kind(self) -> MistakeKind {
        match self {
            Self::InUnit(unit) => MistakeKind::MeasuredUnit(*unit),
            Self::InColumns(exchanged) => MistakeKind::Poses {
                code: Code::AxesMirrored,
                what: format!(
                    "{}, and the rotations as they should: exchanged, the measurements fit",
                    exchanged.what()
                ),
                remedy: exchanged.remedy(),
            },
            Self::OfAngles(angles) => MistakeKind::Poses {
                code: Code::RotationConvention,
                what: format!("{}: made so, the measurements fit", angles.what()),
                remedy: angles.remedy(),
            },
            Self::Otherwise(Otherwise { code, what, remedy, .. }) => {
                MistakeKind::Poses { code: *code, what: (*what).to_owned(), remedy: (*remedy).to_owned() }
            }
        }
    }
}

fn mirrored(mut position: Vector3<f64>, axis: usize) -> Vector3<f64> {
    position[axis] = -position[axis];
    position
}

fn moved(seen: BodySeen, to: impl Fn(Pose) -> Pose) -> BodySeen {
    match seen {
        BodySeen::Point(position) => BodySeen::Point(to(Pose::new(Matrix3::identity(), position)).translation),
        BodySeen::Pose(pose) => BodySeen::Pose(to(pose)),
    }
}

fn of_pose(seen: BodySeen, to: impl Fn(Pose) -> Pose) -> Option<BodySeen> {
    match seen {
        BodySeen::Point(_) => None,
        BodySeen::Pose(pose) => Some(BodySeen::Pose(to(pose))),
    }
}
