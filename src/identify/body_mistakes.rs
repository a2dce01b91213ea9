//! When readings and what an instrument saw of a body do not fit: the usual mistakes in either, tried one by one, named where one of them
//! explains it.

use nalgebra::{Matrix3, Vector3};

use super::mistakes::mistakes_undone;
use crate::assess::Limits;
use crate::diagnose::{Finding, Mistake, MistakeKind};
use crate::error::{Code, Result};
use crate::geom::Pose;
use crate::model::robot::Robot;
use crate::problem::{Adjustment, BodyMeasurement, BodySeen};

/// What an instrument saw of a body, and the readings at its stop.
pub(super) struct SeenAt {
    /// The instrument, by its index.
    pub instrument: usize,
    /// What it saw.
    pub seen: BodySeen,
    /// Readings, rad or m.
    pub readings: Vec<f64>,
}

/// A usual mistake in a file of a tracker, and what it would have said without.
struct Misread {
    code: Code,
    what: &'static str,
    remedy: &'static str,
    undone: fn(BodySeen) -> Option<BodySeen>,
}

const MISREAD: [Misread; 8] = [
    Misread {
        code: Code::MeasuredUnit,
        what: "positions are in millimetres: in metres the measurements fit",
        remedy: "divide x_m, y_m and z_m by 1000",
        undone: |seen| Some(moved(seen, |pose| Pose::new(pose.rotation, pose.translation / 1e3))),
    },
    Misread {
        code: Code::AxesMirrored,
        what: "its axes are left-handed: with y_m negated the measurements fit",
        remedy: "negate y_m, or set the instrument to right-handed axes",
        undone: |seen| Some(moved(seen, |pose| Pose::new(pose.rotation, mirrored(pose.translation, 1)))),
    },
    Misread {
        code: Code::AxesMirrored,
        what: "its axes are left-handed: with x_m negated the measurements fit",
        remedy: "negate x_m, or set the instrument to right-handed axes",
        undone: |seen| Some(moved(seen, |pose| Pose::new(pose.rotation, mirrored(pose.translation, 0)))),
    },
    Misread {
        code: Code::AxesMirrored,
        what: "its axes are left-handed: with z_m negated the measurements fit",
        remedy: "negate z_m, or set the instrument to right-handed axes",
        undone: |seen| Some(moved(seen, |pose| Pose::new(pose.rotation, mirrored(pose.translation, 2)))),
    },
    Misread {
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
    Misread {
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
    Misread {
        code: Code::PosesInverted,
        what: "rotations are those of the tracker in the target: inverted, the measurements fit",
        remedy: "negate qx, qy and qz",
        undone: |seen| of_pose(seen, |pose| Pose::new(pose.rotation.transpose(), pose.translation)),
    },
    Misread {
        code: Code::PosesInverted,
        what: "poses are those of the tracker in the target: inverted, the measurements fit",
        remedy: "write the pose of the target in the frame of the tracker",
        undone: |seen| of_pose(seen, |pose| pose.inverse()),
    },
];

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

/// Refuses measurements and readings that fit with one of the usual mistakes undone, and only then. `misfit` is the median misfit of poses
/// (rad + m), or of points (m), with given readings.
///
/// # Errors
/// The mistake that explains most.
pub(super) fn name_mistake(
    Adjustment { problem, state }: &Adjustment,
    measured: &[usize],
    limits: &Limits,
    misfit: impl Fn(&Robot, &[SeenAt]) -> f64,
) -> Result<()> {
    let robot = &state.robot;
    let at = |k: &usize| {
        let BodyMeasurement { instrument, stop, seen, .. } = problem.body_measurements[*k];
        let readings = problem.stops[stop].posture.as_ref()?.readings.clone();
        Some(SeenAt { instrument, seen, readings })
    };
    let given: Vec<SeenAt> = measured.iter().filter_map(at).collect();
    let as_described = misfit(robot, &given);
    if as_described < limits.suspicious_misfit || robot.chain.pose_coordinates().is_some() {
        return Ok(());
    }
    let readings: Vec<Vec<f64>> = given.iter().map(|s| s.readings.clone()).collect();
    let read_otherwise = MISREAD.iter().filter_map(|misread| {
        let undone = |s: &SeenAt| Some(SeenAt { seen: (misread.undone)(s.seen)?, readings: s.readings.clone(), ..*s });
        let Misread { code, what, remedy, .. } = misread;
        let kind = MistakeKind::Poses { code: *code, what: (*what).to_owned(), remedy: (*remedy).to_owned() };
        Some((given.iter().map(undone).collect::<Option<Vec<_>>>()?, kind))
    });
    let of_readings = mistakes_undone(robot, &readings).into_iter().map(|(readings, kind)| {
        let undone = given.iter().zip(readings).map(|(s, readings)| SeenAt { readings, ..*s });
        (undone.collect(), kind)
    });
    let tried = read_otherwise.chain(of_readings).map(|(undone, kind)| (misfit(robot, &undone), kind));
    let best = tried
        .min_by(|a, b| a.0.total_cmp(&b.0))
        .filter(|(left, _)| *left < limits.mistake_explains * as_described && *left < limits.suspicious_misfit);
    best.map_or(Ok(()), |(left, kind)| {
        let instrument = &problem.instruments[given[0].instrument];
        let of = format!("{} {}", instrument.kind.block(), instrument.name);
        let mistake = Mistake { kind, of, misfit: as_described, misfit_undone: Some(left), by_images: false };
        Err(Finding::from(mistake).refusal())
    })
}
