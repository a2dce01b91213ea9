//! Poses of a controller to readings of a chain: in closed form where its joints are the coordinates of a pose, else by inverse kinematics
//! of the nominal robot.

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use crate::error::{Code, Error, Notice, Quantity, Result};
use crate::geom::Pose;
use crate::model::inverse::{
    self, FARTHEST_STATED_RAD, FullTurns, POSTURE_STARTS, random_readings, reading_limits, solve_from,
};
use crate::model::robot::Robot;
use crate::problem::MeasuredStop;
use crate::series::{ControllerPoses, LENGTH_UNITS, LengthUnit, ReadOtherwise, Series};
use crate::urdf::{Chain, JointKind};

/// Coordinates of a pose.
const POSE_COORDINATES: usize = 6;
/// Postures of an arm of six joints that reach a pose, at most (E. Primrose 1986).
const MOST_POSTURES: usize = 15;
/// Poses that tell whether the poses of a series can be reached.
const TRIED: usize = 8;

/// Readings of every stop of a series in the order of the chain, rad or m; `None` for images taken off the robot.
///
/// # Errors
/// Those of [`Series::readings_for`]; poses that the nominal robot does not reach, or reaches in postures without number.
pub fn readings_of(series: &Series, chain: &Chain) -> Result<Vec<Option<Vec<f64>>>> {
    let Some(poses) = &series.controller else { return series.readings_for(chain) };
    match chain.pose_coordinates() {
        Some(coordinates) => {
            let of = |pose: &Option<Pose>| pose.as_ref().map(|p| coordinates.of(p).to_vec());
            Ok(poses.base_from_flange.iter().map(of).collect())
        }
        None if chain.readings.len() > POSE_COORDINATES => {
            let count = chain.readings.len();
            let what = format!("a pose does not tell the readings of {count} joints ({})", chain.readings.join(", "));
            let remedy = "record joint readings (joints.csv); or leave out --urdf: then camera and hand-eye transform are fitted to the poses \
                          alone";
            Err(Error::new(Code::JointMissing, series.readings_file().display(), what, remedy))
        }
        None => Arm::of(chain).postures(series, poses),
    }
}

/// Whether the readings of a series are computed from poses of the controller by inverse kinematics: right with the model in the controller alone.
pub fn postures_are_computed(series: &Series, chain: &Chain) -> bool {
    series.controller.is_some() && chain.pose_coordinates().is_none()
}

/// Where readings were computed: other postures that reach the pose of every stop, as near to its readings as full turns bring them. None of a
/// pose where axes meet: they are without number.
pub(in crate::identify) fn other_postures(
    series: &Series,
    chain: &Chain,
    stops: &[MeasuredStop],
) -> Vec<Vec<Vec<f64>>> {
    let poses = series.controller.as_ref().filter(|_| postures_are_computed(series, chain));
    let Some(poses) = poses else { return Vec::new() };
    let arm = Arm::of(chain);
    let of = |((pose, stated), stop): ((&Option<Pose>, &Option<Vec<f64>>), &MeasuredStop)| match (pose, &stop.readings)
    {
        (Some(pose), Some(readings)) if stated.is_none() && !stop.observations.is_empty() => arm.others(pose, readings),
        _ => Vec::new(),
    };
    poses.base_from_flange.par_iter().zip(&poses.stated_deg).zip(stops).map(of).collect()
}

/// What to say of postures that were not read.
pub(in crate::identify) fn notice(series: &Series, chain: &Chain) -> Option<Notice> {
    let what = "has poses: the joint readings are those with which the robot of the URDF reaches them, in the posture that the images \
                tell, else in that nearest to the stop before, and at the first stop nearest to the middle of the limits";
    let remedy = "see that they are those of the flange in the base (no tool, no user frame), and that the URDF is the model in the controller (of a corrected one the readings are wrong by the correction), or record \
                  joint readings (joints.csv): they know the posture, and no model plays a part then";
    postures_are_computed(series, chain)
        .then(|| Notice::new(Code::PosturesFromPoses, series.readings_file().display(), what, remedy))
}

/// A way to read a pose other than as it is written.
enum ReadAs<'a> {
    Rotation(&'a ReadOtherwise),
    Unit(&'a LengthUnit),
    Both(&'a ReadOtherwise, &'a LengthUnit),
}

const fn is_angle(kind: JointKind) -> bool {
    !matches!(kind, JointKind::Prismatic)
}

/// Poses that the stated angles reach when they are read in another way.
fn misread(way: &ReadAs, place: String) -> Error {
    let fit = "the robot reaches them with the angles of first_stop_deg";
    let in_unit = |unit: &LengthUnit| format!("positions are in {}", unit.name);
    let to_metres = |unit: &LengthUnit| format!("multiply x_m, y_m and z_m by {}", unit.metres);
    match way {
        ReadAs::Rotation(other) => Error::new(other.code, place, other.says(fit), &other.remedy),
        ReadAs::Unit(unit) => {
            let what = format!("{}: in metres {fit}", in_unit(unit));
            Error::new(Code::MeasuredUnit, place, what, to_metres(unit))
        }
        ReadAs::Both(other, unit) => {
            let what = format!("{}, and {}", in_unit(unit), other.says(fit));
            Error::new(Code::MeasuredUnit, place, what, format!("{}; {}", to_metres(unit), other.remedy))
        }
    }
}

/// An arm whose postures are looked for.
struct Arm {
    robot: Robot,
    limits: Vec<(f64, f64)>,
}

impl Arm {
    fn of(chain: &Chain) -> Self {
        Self { limits: reading_limits(chain), robot: Robot::nominal(chain.clone()) }
    }

    fn postures(&self, series: &Series, poses: &ControllerPoses) -> Result<Vec<Option<Vec<f64>>>> {
        let mut before: Option<Vec<f64>> = None;
        let mut all = Vec::with_capacity(poses.base_from_flange.len());
        for (row, pose) in poses.base_from_flange.iter().enumerate() {
            let Some(pose) = pose else {
                all.push(None);
                continue;
            };
            let readings = match &poses.stated_deg[row] {
                Some(stated_deg) => self.near_stated(series, poses, row, stated_deg)?,
                None => self.nearest(pose, before.as_deref()).ok_or_else(|| self.out_of_reach(series, poses, row))?,
            };
            before = Some(readings.clone());
            all.push(Some(readings));
        }
        Ok(all)
    }

    /// The posture that was stated, deg (m of a prismatic joint).
    fn near_stated(
        &self,
        series: &Series,
        poses: &ControllerPoses,
        row: usize,
        stated_deg: &[f64],
    ) -> Result<Vec<f64>> {
        let chain = &self.robot.chain;
        let place = format!("{}: [controller] first_stop_deg", series.manifest_file().display());
        if stated_deg.len() != chain.readings.len() {
            let what =
                format!("has {} values, and the robot the joints {}", stated_deg.len(), chain.readings.join(", "));
            return Err(Error::new(Code::SettingRange, place, what, "give the angles of all of them in this order"));
        }
        let read = |(v, kind): (&f64, &JointKind)| if is_angle(*kind) { v.to_radians() } else { *v };
        let stated: Vec<f64> = stated_deg.iter().zip(&chain.reading_kinds).map(read).collect();
        let found = poses.base_from_flange[row].and_then(|pose| self.posture_near(&pose, &stated));
        found.ok_or_else(|| self.not_as_stated(series, poses, row, &stated, place))
    }

    /// The posture that reaches a pose nearest to the stated one, if it is near.
    fn posture_near(&self, pose: &Pose, stated: &[f64]) -> Option<Vec<f64>> {
        let by_start = solve_from(&self.robot, &self.limits, pose, stated);
        let all = by_start.into_iter().chain(self.postures_of(pose)).map(|q| self.turned(q, stated));
        let found = all.min_by(|a, b| self.farthest_rad(a, stated).total_cmp(&self.farthest_rad(b, stated)));
        found.filter(|q| self.farthest_rad(q, stated) < FARTHEST_STATED_RAD)
    }

    /// Largest difference of the angles of two postures.
    fn farthest_rad(&self, readings: &[f64], stated: &[f64]) -> f64 {
        let angles = readings.iter().zip(stated).zip(&self.robot.chain.reading_kinds).filter(|(_, k)| is_angle(**k));
        angles.map(|((q, s), _)| (q - s).abs()).fold(0.0, f64::max)
    }

    /// Of ways to read a pose, by their place, the one that the stated posture is nearest to, if it is near.
    fn nearest_to(&self, stated: &[f64], poses: impl Iterator<Item = Pose>) -> Option<usize> {
        let off = |pose: Pose| {
            let found = solve_from(&self.robot, &self.limits, &pose, stated)?;
            Some(self.farthest_rad(&self.turned(found, stated), stated))
        };
        let all = poses.enumerate().filter_map(|(k, pose)| Some((k, off(pose)?)));
        let near = all.filter(|(_, off)| *off < FARTHEST_STATED_RAD);
        near.min_by(|a, b| a.1.total_cmp(&b.1)).map(|(k, _)| k)
    }

    /// Where the stated posture does not reach the pose: the mistake in the poses that explains it, if there is one.
    fn not_as_stated(
        &self,
        series: &Series,
        poses: &ControllerPoses,
        row: usize,
        stated: &[f64],
        place: String,
    ) -> Error {
        let line = &series.stops.stops[row];
        let of_poses = format!("{}:{}, stop {}", series.readings_file().display(), line.line, line.name());
        let written = poses.base_from_flange[row];
        let others: Vec<(&ReadOtherwise, Pose)> =
            poses.otherwise.iter().filter_map(|other| Some((other, other.poses[row]?))).collect();
        let scaled = |pose: &Pose, unit: &LengthUnit| Pose::new(pose.rotation, pose.translation * unit.metres);
        let rotations = others.iter().map(|(other, pose)| (ReadAs::Rotation(other), *pose));
        let units = LENGTH_UNITS.iter().filter_map(|unit| Some((ReadAs::Unit(unit), scaled(&written?, unit))));
        let both = LENGTH_UNITS
            .iter()
            .flat_map(|unit| others.iter().map(move |(other, pose)| (ReadAs::Both(other, unit), scaled(pose, unit))));
        for ways in [units.chain(rotations).collect::<Vec<_>>(), both.collect()] {
            if let Some(k) = self.nearest_to(stated, ways.iter().map(|(_, pose)| *pose)) {
                return misread(&ways[k].0, of_poses);
            }
        }
        let tip = self.robot.base_from_tip(stated);
        let apart = written.map_or((0.0, 0.0), |pose| tip.distance(&pose));
        let what = format!(
            "the robot of the URDF reaches the first pose in no posture near these angles: at them it is {:.0} mm and {:.0} deg from that pose",
            1e3 * apart.1,
            apart.0.to_degrees()
        );
        let remedy = "give the joint angles that the controller shows at the first stop, in deg, with zeros and signs as in the URDF; if they are \
                      right, the poses are not those of the flange in the base (a tool, a user frame or a work object was active), or their unit or \
                      [controller] rotation is another";
        let quantities = vec![Quantity::new("distance", apart.1, "m"), Quantity::new("angle", apart.0, "rad")];
        Error { quantities, ..Error::new(Code::SettingConflict, place, what, remedy) }
    }

    /// The same posture by full turns as near to some readings as the limits allow.
    fn turned(&self, mut readings: Vec<f64>, near: &[f64]) -> Vec<f64> {
        let kinds = &self.robot.chain.reading_kinds;
        let all = readings.iter_mut().zip(near).zip(self.limits.iter().zip(kinds));
        for ((q, near), (limits, _)) in all.filter(|(_, (_, kind))| is_angle(**kind)) {
            *q = inverse::turned(*q, *near, *limits, &[]);
        }
        readings
    }

    /// The posture nearest to the one before, or to the middle of the limits.
    fn nearest(&self, pose: &Pose, before: Option<&[f64]>) -> Option<Vec<f64>> {
        if let Some(found) = before.and_then(|start| solve_from(&self.robot, &self.limits, pose, start)) {
            return Some(found);
        }
        let middle: Vec<f64> = self.limits.iter().map(|(low, high)| 0.5 * (low + high)).collect();
        let wanted = before.unwrap_or(&middle);
        let away = |q: &Vec<f64>| {
            let parts = q.iter().zip(wanted).zip(&self.limits);
            parts.map(|((q, w), (low, high))| ((q - w) / (high - low).max(f64::MIN_POSITIVE)).powi(2)).sum::<f64>()
        };
        self.postures_of(pose).into_iter().min_by(|a, b| away(a).total_cmp(&away(b)))
    }

    /// Postures that reach a pose, from starts all over the limits.
    fn postures_of(&self, pose: &Pose) -> Vec<Vec<f64>> {
        let mut rng = ChaCha8Rng::seed_from_u64(0);
        let start = |_| random_readings(&self.limits, &self.robot.chain.reading_kinds, &mut rng);
        let starts: Vec<Vec<f64>> = (0..POSTURE_STARTS).map(start).collect();
        starts.iter().filter_map(|s| solve_from(&self.robot, &self.limits, pose, s)).collect()
    }

    /// Other postures that reach the pose of some readings; none where they are without number.
    fn others(&self, pose: &Pose, readings: &[f64]) -> Vec<Vec<f64>> {
        let kinds = &self.robot.chain.reading_kinds;
        let mut all = vec![readings.to_vec()];
        for found in self.postures_of(pose).into_iter().map(|q| self.turned(q, readings)) {
            FullTurns::Alike.add(found, &mut all, kinds);
        }
        let others = all.split_off(1);
        if others.len() > MOST_POSTURES { Vec::new() } else { others }
    }

    /// Whether most of the poses can be reached.
    fn reaches(&self, poses: &[Option<Pose>]) -> bool {
        let known: Vec<&Pose> = poses.iter().flatten().collect();
        let step = known.len().div_ceil(TRIED).max(1);
        let tried: Vec<&Pose> = known.into_iter().step_by(step).collect();
        2 * tried.iter().filter(|p| !self.postures_of(p).is_empty()).count() > tried.len()
    }

    /// Where a pose is out of reach: the mistake that explains it, if there is one.
    fn out_of_reach(&self, series: &Series, poses: &ControllerPoses, row: usize) -> Error {
        let stop = &series.stops.stops[row];
        let chain = &self.robot.chain;
        let place = format!("{}:{}, stop {}", series.readings_file().display(), stop.line, stop.name());
        if !self.reaches(&poses.base_from_flange)
            && let Some(other) = poses.otherwise.iter().find(|o| self.reaches(&o.poses))
        {
            let what = other.says("the robot reaches them");
            return Error::new(other.code, place, what, &other.remedy);
        }
        let what = format!("the robot of the URDF reaches no such pose of \"{}\" in \"{}\"", chain.tip, chain.base);
        let remedy = "check that the poses are those of this link in this base (no tool, no work object), and its joint limits; or leave out \
                      --urdf: then camera and hand-eye transform are fitted to the poses alone";
        Error::new(Code::PoseOutOfReach, place, what, remedy)
    }
}
