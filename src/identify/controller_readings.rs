//! Poses of a controller to readings of a chain: in closed form where its joints are the coordinates of a pose, else by inverse kinematics
//! of the nominal robot.

use std::f64::consts::TAU;

use rand::SeedableRng;
use rand::rngs::SmallRng;
use rayon::prelude::*;

use crate::error::{Code, Error, Notice, Result};
use crate::geom::Pose;
use crate::model::inverse::{random_readings, reading_limits, solve_from};
use crate::model::robot::Robot;
use crate::problem::MeasuredStop;
use crate::series::{ControllerPoses, Series};
use crate::urdf::{Chain, JointKind};

/// Random starts from which a posture is looked for.
const STARTS: usize = 200;
/// Postures of an arm of six joints that reach a pose, at most (E. Primrose 1986).
const MOST_POSTURES: usize = 15;
/// Readings that are nearer are the same, rad or m.
const SAME: f64 = 1e-3;
/// Poses that tell whether the poses of a series can be reached.
const TRIED: usize = 8;

/// Readings of every stop of a series in the order of the chain, rad or m; `None` for images taken off the robot.
///
/// # Errors
/// Those of [`Series::readings_for`]; poses that the nominal robot does not reach.
pub fn readings_of(series: &Series, chain: &Chain) -> Result<Vec<Option<Vec<f64>>>> {
    let Some(poses) = &series.controller else { return series.readings_for(chain) };
    match chain.pose_coordinates() {
        Some(coordinates) => {
            let of = |pose: &Option<Pose>| pose.as_ref().map(|p| coordinates.of(p).to_vec());
            Ok(poses.base_from_flange.iter().map(of).collect())
        }
        None => Arm::of(chain).postures(series, poses),
    }
}

/// Where readings were computed: other postures that reach the pose of every stop, as near to its readings as full turns bring them. None of an
/// arm with more joints than a pose has coordinates, and of a pose where axes meet: they are without number.
pub(super) fn other_postures(series: &Series, chain: &Chain, stops: &[MeasuredStop]) -> Vec<Vec<Vec<f64>>> {
    let poses = series.controller.as_ref().filter(|_| chain.pose_coordinates().is_none() && chain.readings.len() <= 6);
    let Some(poses) = poses else { return Vec::new() };
    let arm = Arm::of(chain);
    let of = |(pose, stop): (&Option<Pose>, &MeasuredStop)| match (pose, &stop.readings) {
        (Some(pose), Some(readings)) if !stop.observations.is_empty() => arm.others(pose, readings),
        _ => Vec::new(),
    };
    poses.base_from_flange.par_iter().zip(stops).map(of).collect()
}

/// What to say of postures that were not read.
pub(super) fn notice(series: &Series, chain: &Chain) -> Option<Notice> {
    let is_computed = series.controller.is_some() && chain.pose_coordinates().is_none();
    let what = "has poses: the joint readings are those with which the nominal robot reaches them, in the posture that the images \
                tell, else in that nearest to the stop before, and at the first stop nearest to the middle of the limits";
    let remedy = "record joint readings (joints.csv) where the controller tells them: they know the posture, and the model in the controller \
                  plays no part then";
    is_computed.then(|| Notice::new(Code::PosturesFromPoses, series.readings_file().display(), what, remedy))
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
            let found = self.nearest(pose, before.as_deref());
            let readings = found.ok_or_else(|| self.out_of_reach(series, poses, row))?;
            before = Some(readings.clone());
            all.push(Some(readings));
        }
        Ok(all)
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
        let mut rng = SmallRng::seed_from_u64(0);
        let start = |_| random_readings(&self.limits, &self.robot.chain.reading_kinds, &mut rng);
        let starts: Vec<Vec<f64>> = (0..STARTS).map(start).collect();
        starts.iter().filter_map(|s| solve_from(&self.robot, &self.limits, pose, s)).collect()
    }

    /// Other postures that reach the pose of some readings; none where they are without number.
    fn others(&self, pose: &Pose, readings: &[f64]) -> Vec<Vec<f64>> {
        let kinds = &self.robot.chain.reading_kinds;
        let apart = |a: &[f64], b: &[f64]| a.iter().zip(b).any(|(a, b)| (a - b).abs() > SAME);
        let mut all: Vec<Vec<f64>> = Vec::new();
        for mut found in self.postures_of(pose) {
            for ((q, near), ((low, high), kind)) in found.iter_mut().zip(readings).zip(self.limits.iter().zip(kinds)) {
                let turned = *q + TAU * ((near - *q) / TAU).round();
                if *kind != JointKind::Prismatic && (*low..=*high).contains(&turned) {
                    *q = turned;
                }
            }
            if apart(&found, readings) && all.iter().all(|other| apart(&found, other)) {
                all.push(found);
            }
        }
        if all.len() > MOST_POSTURES { Vec::new() } else { all }
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
            let what = other.what.replace("the images fit", "the robot reaches them");
            return Error::new(other.code, place, what, &other.remedy);
        }
        let what = format!("the robot of the URDF reaches no such pose of \"{}\" in \"{}\"", chain.tip, chain.base);
        let remedy = "check that the poses are those of this link in this base (no tool, no work object), and its joint limits; or leave out \
                      --urdf: then camera and hand-eye transform are fitted to the poses alone";
        Error::new(Code::PoseOutOfReach, place, what, remedy)
    }
}
