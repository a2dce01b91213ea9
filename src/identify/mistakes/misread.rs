//! The usual mistakes in what a file says of the places of bodies.

use std::borrow::Cow;

use nalgebra::{Matrix3, Vector3};

use crate::diagnose::MistakeKind;
use crate::error::Code;
use crate::geom::Pose;
use crate::problem::BodySeen;
use crate::series::{LENGTH_UNITS, LengthUnit};

/// One of them, and what the file would have said without.
pub(in crate::identify) struct Misread {
    code: Code,
    what: Cow<'static, str>,
    remedy: Cow<'static, str>,
    undone: Undone,
}

/// What undoes a mistake.
enum Undone {
    /// Positions in metres: they are in units of so many.
    Scaled(f64),
    /// This; `None` where it changes nothing.
    By(fn(BodySeen) -> Option<BodySeen>),
}

/// All of them.
pub(in crate::identify) fn all_misread() -> impl Iterator<Item = Misread> {
    LENGTH_UNITS.iter().map(in_unit).chain(OF_AXES)
}

fn in_unit(LengthUnit { name, metres, .. }: &LengthUnit) -> Misread {
    Misread {
        code: Code::MeasuredUnit,
        what: format!("positions are in {name}: in metres the measurements fit").into(),
        remedy: format!("multiply x_m, y_m and z_m by {metres}").into(),
        undone: Undone::Scaled(*metres),
    }
}

/// Those of axes, of rotations and of what is seen from where.
const OF_AXES: [Misread; 7] = [
    Misread {
        code: Code::AxesMirrored,
        what: Cow::Borrowed("its axes are left-handed: with y_m negated the measurements fit"),
        remedy: Cow::Borrowed(
            "see which axis is wrong, as another sign or two exchanged columns may fit alike: negate y_m, or set the instrument to right-handed axes",
        ),
        undone: Undone::By(|seen| Some(moved(seen, |pose| Pose::new(pose.rotation, mirrored(pose.translation, 1))))),
    },
    Misread {
        code: Code::AxesMirrored,
        what: Cow::Borrowed("its axes are left-handed: with x_m negated the measurements fit"),
        remedy: Cow::Borrowed(
            "see which axis is wrong, as another sign or two exchanged columns may fit alike: negate x_m, or set the instrument to right-handed axes",
        ),
        undone: Undone::By(|seen| Some(moved(seen, |pose| Pose::new(pose.rotation, mirrored(pose.translation, 0))))),
    },
    Misread {
        code: Code::AxesMirrored,
        what: Cow::Borrowed("its axes are left-handed: with z_m negated the measurements fit"),
        remedy: Cow::Borrowed(
            "see which axis is wrong, as another sign or two exchanged columns may fit alike: negate z_m, or set the instrument to right-handed axes",
        ),
        undone: Undone::By(|seen| Some(moved(seen, |pose| Pose::new(pose.rotation, mirrored(pose.translation, 2))))),
    },
    Misread {
        code: Code::AxesMirrored,
        what: Cow::Borrowed(
            "its axes are left-handed, in positions and rotations: with one of them mirrored the measurements fit",
        ),
        remedy: Cow::Borrowed("negate y_m, qx and qz, or set the instrument to right-handed axes"),
        undone: Undone::By(|seen| {
            of_pose(seen, |pose| {
                let [x, y, z, w] = pose.quaternion_xyzw();
                Pose::from_xyz_quaternion(mirrored(pose.translation, 1).into(), [-x, y, -z, w])
            })
        }),
    },
    Misread {
        code: Code::RotationConvention,
        what: Cow::Borrowed("quaternions stand in the order qw, qx, qy, qz: read so, the measurements fit"),
        remedy: Cow::Borrowed("name the columns in the order in which they stand"),
        undone: Undone::By(|seen| {
            of_pose(seen, |pose| {
                let [w, x, y, z] = pose.quaternion_xyzw();
                Pose::from_xyz_quaternion(pose.xyz(), [x, y, z, w])
            })
        }),
    },
    Misread {
        code: Code::PosesInverted,
        what: Cow::Borrowed("rotations are those of the tracker in the target: inverted, the measurements fit"),
        remedy: Cow::Borrowed("negate qx, qy and qz"),
        undone: Undone::By(|seen| of_pose(seen, |pose| Pose::new(pose.rotation.transpose(), pose.translation))),
    },
    Misread {
        code: Code::PosesInverted,
        what: Cow::Borrowed("poses are those of the tracker in the target: inverted, the measurements fit"),
        remedy: Cow::Borrowed("write the pose of the target in the frame of the tracker"),
        undone: Undone::By(|seen| of_pose(seen, |pose| pose.inverse())),
    },
];

impl Misread {
    /// What the file would have said without; `None` where that is the same.
    pub fn undone(&self, seen: BodySeen) -> Option<BodySeen> {
        match self.undone {
            Undone::Scaled(metres) => Some(moved(seen, |pose| Pose::new(pose.rotation, metres * pose.translation))),
            Undone::By(change) => change(seen),
        }
    }

    /// As a mistake with its remedy.
    pub fn kind(&self) -> MistakeKind {
        let Self { code, what, remedy, .. } = self;
        MistakeKind::Poses { code: *code, what: what.to_string(), remedy: remedy.to_string() }
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
