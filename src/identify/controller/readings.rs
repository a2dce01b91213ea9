//! Poses of a controller to readings of a chain: in closed form where its joints are the coordinates of a pose, else by inverse kinematics
//! of the nominal robot.

use std::collections::BTreeSet;
use std::f64::consts::PI;

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use super::told::{Misplaced, PosesFit, ReadAs};
use crate::error::{Code, Error, Notice, Quantity, Result};
use crate::geom::Pose;
use crate::model::inverse::{
    self, FARTHEST_STATED_RAD, FullTurns, POSTURE_STARTS, random_readings, reading_limits, solve_from,
};
use crate::model::robot::Robot;
use crate::problem::{MeasuredStop, SeenBody};
use crate::series::{ControllerPoses, LengthUnit, Series};
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
    readings_told(series, chain, &PosesFit::Open)
}

/// True for a refusal of poses that the robot does not reach: what was seen at them may tell why.
pub(in crate::identify) const fn is_unreached(refused: &Error) -> bool {
    matches!(
        refused.code,
        Code::PoseOutOfReach
            | Code::PosesInverted
            | Code::RotationConvention
            | Code::MeasuredUnit
            | Code::SettingConflict
    )
}

/// As [`readings_of`]; what was seen is `told` of the poses, for what is said of those that are not reached.
///
/// # Errors
/// As of [`readings_of`].
pub(in crate::identify) fn readings_told(
    series: &Series,
    chain: &Chain,
    told: &PosesFit,
) -> Result<Vec<Option<Vec<f64>>>> {
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
        None => Arm::of(chain).postures(series, poses, told),
    }
}

/// Whether the readings of a series are computed from poses of the controller by inverse kinematics: right with the model in the controller alone.
pub fn postures_are_computed(series: &Series, chain: &Chain) -> bool {
    series.controller.is_some() && chain.pose_coordinates().is_none()
}

/// Where readings were computed: other postures that reach the pose of every stop at which an image, or something that measures bodies, saw anything,
/// as near to its readings as full turns bring them. None of a pose where axes meet: they are without number.
pub(in crate::identify) fn other_postures(
    series: &Series,
    chain: &Chain,
    (stops, bodies): (&[MeasuredStop], &[SeenBody]),
) -> Vec<Vec<Vec<f64>>> {
    let poses = series.controller.as_ref().filter(|_| postures_are_computed(series, chain));
    let Some(poses) = poses else { return Vec::new() };
    let arm = Arm::of(chain);
    let measured: BTreeSet<usize> = bodies.iter().map(|body| body.stop).collect();
    let of = |k: usize| match (&poses.base_from_flange[k], &poses.stated_deg[k], &stops[k].readings) {
        (Some(pose), None, Some(readings)) if !stops[k].observations.is_empty() || measured.contains(&k) => {
            arm.others(pose, readings)
        }
        _ => Vec::new(),
    };
    (0..stops.len()).into_par_iter().map(of).collect()
}

/// What to say of postures that were not read.
pub(in crate::identify) fn notice(series: &Series, chain: &Chain) -> Option<Notice> {
    let what = "has poses: the joint readings are those with which the robot of the URDF reaches them, in the posture that images \
                and trackers tell, else in that nearest to the stop before, and at the first stop nearest to the middle of the limits";
    let remedy = "see that they are those of the flange in the base (no tool, no user frame), and that the URDF is the model in the controller (of a corrected one the readings are wrong by the correction), or record \
                  joint readings (joints.csv): they know the posture, and no model plays a part then";
    postures_are_computed(series, chain)
        .then(|| Notice::new(Code::PosturesFromPoses, series.readings_file().display(), what, remedy))
}

const fn is_angle(kind: JointKind) -> bool {
    !matches!(kind, JointKind::Prismatic)
}

/// Poses that `fit` when they are read in another way; `None` where they do as they are written.
fn misread(way: ReadAs, poses: &ControllerPoses, place: String, fit: &str) -> Option<Error> {
    let in_unit = |unit: &LengthUnit| format!("positions are in {}", unit.name);
    let to_metres = |unit: &LengthUnit| format!("multiply x_m, y_m and z_m by {}", unit.metres);
    match way.misplaced {
        Some(Misplaced::Columns(exchanged)) => {
            let what = format!("{}: exchanged {fit}", exchanged.what());
            return Some(Error::new(Code::AxesMirrored, place, what, exchanged.remedy()));
        }
        Some(Misplaced::Rows { below }) => {
            let (other, way) = if below { ("below", "down") } else { ("above", "up") };
            let what = format!("the poses are shifted by one row: with the pose of the row {other} {fit}");
            let remedy = format!("shift the names in the first column of controller.csv one row {way}");
            return Some(Error::new(Code::RowsShifted, place, what, remedy));
        }
        None => (),
    }
    Some(match (way.otherwise.map(|k| &poses.otherwise[k]), way.unit) {
        (None, None) => return None,
        (Some(other), None) => Error::new(other.code, place, other.says(fit), &other.remedy),
        (None, Some(unit)) => {
            let what = format!("{}: in metres {fit}", in_unit(&unit));
            Error::new(Code::MeasuredUnit, place, what, to_metres(&unit))
        }
        (Some(other), Some(unit)) => {
            let what = format!("{}, and {}", in_unit(&unit), other.says(fit));
            Error::new(Code::MeasuredUnit, place, what, format!("{}; {}", to_metres(&unit), other.remedy))
        }
    })
}

/// What fits where the images or a tracker tell.
const SEEN_FITS: &str = "what was seen at the stops fits";

/// An arm whose postures are looked for.
#[derive(Clone)]
pub(super) struct Arm {
    robot: Robot,
    limits: Vec<(f64, f64)>,
}

impl Arm {
    pub fn of(chain: &Chain) -> Self {
        Self { limits: reading_limits(chain), robot: Robot::nominal(chain.clone()) }
    }

    /// Whose joints turn all round at least.
    pub fn beyond_limits(chain: &Chain) -> Self {
        let all = reading_limits(chain).into_iter().zip(&chain.reading_kinds);
        let wide = |((low, high), kind): ((f64, f64), &JointKind)| match is_angle(*kind) {
            true => (low.min(-PI), high.max(PI)),
            false => (low, high),
        };
        Self { limits: all.map(wide).collect(), robot: Robot::nominal(chain.clone()) }
    }

    /// Readings that reach a pose, looked for from some; `None` where they do not lead there.
    pub fn reading_near(&self, pose: &Pose, from: &[f64]) -> Option<Vec<f64>> {
        solve_from(&self.robot, &self.limits, pose, from)
    }

    pub fn tip(&self, readings: &[f64]) -> Pose {
        self.robot.base_from_tip(readings)
    }

    fn postures(&self, series: &Series, poses: &ControllerPoses, told: &PosesFit) -> Result<Vec<Option<Vec<f64>>>> {
        let mut before: Option<Vec<f64>> = None;
        let mut all = Vec::with_capacity(poses.base_from_flange.len());
        for (row, pose) in poses.base_from_flange.iter().enumerate() {
            let Some(pose) = pose else {
                all.push(None);
                continue;
            };
            let readings = match &poses.stated_deg[row] {
                Some(stated_deg) => self.near_stated(series, (poses, told), row, stated_deg)?,
                None => self
                    .nearest(pose, before.as_deref())
                    .ok_or_else(|| self.out_of_reach(series, (poses, told), row))?,
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
        (poses, told): (&ControllerPoses, &PosesFit),
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
        found.ok_or_else(|| self.not_as_stated(series, (poses, told), row, &stated, place))
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

    /// Of ways to read the poses the one that the stated posture is nearest to, if it is near, and the other poses are reached.
    fn nearest_to(&self, stated: &[f64], (poses, row): (&ControllerPoses, usize), ways: Vec<ReadAs>) -> Option<ReadAs> {
        let off = |way: ReadAs| {
            let found = solve_from(&self.robot, &self.limits, &way.of(poses)[row]?, stated)?;
            Some((self.farthest_rad(&self.turned(found, stated), stated), way))
        };
        let mut near: Vec<(f64, ReadAs)> = ways.into_iter().filter_map(off).collect();
        near.retain(|(off, _)| *off < FARTHEST_STATED_RAD);
        near.sort_by(|a, b| a.0.total_cmp(&b.0));
        near.into_iter().map(|(_, way)| way).find(|way| self.reach(&way.of(poses)).is_whole())
    }

    /// Where the stated posture does not reach the pose: the mistake in the poses that explains it, if there is one.
    fn not_as_stated(
        &self,
        series: &Series,
        (poses, told): (&ControllerPoses, &PosesFit),
        row: usize,
        stated: &[f64],
        place: String,
    ) -> Error {
        let line = &series.stops.stops[row];
        let of_poses = format!("{}:{}, stop {}", series.readings_file().display(), line.line, line.name());
        let written = poses.base_from_flange[row];
        let fit = "the robot reaches them, the first with the angles of first_stop_deg";
        let mistake = match *told {
            PosesFit::Fit(way) => misread(way, poses, of_poses, SEEN_FITS),
            PosesFit::InNoWay => None,
            PosesFit::Open => {
                let mut tried = ReadAs::mistaken(poses).into_iter();
                let found = tried.find_map(|ways| self.nearest_to(stated, (poses, row), ways));
                found.and_then(|way| misread(way, poses, of_poses, fit))
            }
        };
        if let Some(mistake) = mistake {
            return mistake;
        }
        let tip = self.robot.base_from_tip(stated);
        let apart = written.map_or((0.0, 0.0), |pose| tip.distance(&pose));
        let what = format!(
            "the robot of the URDF reaches the first pose in no posture near these angles: at them it is {:.0} mm and {:.0} deg from that pose",
            1e3 * apart.1,
            apart.0.to_degrees()
        );
        let remedy = match told {
            PosesFit::Fit(_) => {
                "give the joint angles that the controller shows at the first stop, in deg, with zeros and signs as in the URDF; if they are \
                 right, the poses are not those of the flange in the base: a user frame (work object) or a tool was active. Their rotation and \
                 unit are as stated: what was seen at the stops fits them"
            }
            _ => {
                "give the joint angles that the controller shows at the first stop, in deg, with zeros and signs as in the URDF; if they are \
                 right, the poses are not those of the flange in the base (a tool, a user frame or a work object was active), or their unit or \
                 [controller] rotation is another"
            }
        };
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
    pub fn others(&self, pose: &Pose, readings: &[f64]) -> Vec<Vec<f64>> {
        let others = self.other_than(readings, self.postures_of(pose).into_iter());
        if others.len() > MOST_POSTURES { Vec::new() } else { others }
    }

    /// Postures other than some readings that reach a pose, looked for from those of another one.
    pub fn reached_from(&self, postures: &[Vec<f64>], pose: &Pose, readings: &[f64]) -> Vec<Vec<f64>> {
        self.other_than(readings, postures.iter().filter_map(|from| self.reading_near(pose, from)))
    }

    /// Those found that differ from some readings and from each other, as near to them as full turns bring them.
    fn other_than(&self, readings: &[f64], found: impl Iterator<Item = Vec<f64>>) -> Vec<Vec<f64>> {
        let mut all = vec![readings.to_vec()];
        for found in found.map(|q| self.turned(q, readings)) {
            FullTurns::Alike.add(found, &mut all, &self.robot.chain.reading_kinds);
        }
        all.split_off(1)
    }

    /// How many of some of the poses can be reached.
    fn reach(&self, poses: &[Option<Pose>]) -> Reach {
        let known: Vec<&Pose> = poses.iter().flatten().collect();
        let step = known.len().div_ceil(TRIED).max(1);
        let tried: Vec<&Pose> = known.into_iter().step_by(step).collect();
        let reached = tried.par_iter().filter(|p| !self.postures_of(p).is_empty()).count();
        Reach { reached, tried: tried.len() }
    }

    /// Where a pose is out of reach: the mistake that explains it, if there is one.
    fn out_of_reach(&self, series: &Series, (poses, told): (&ControllerPoses, &PosesFit), row: usize) -> Error {
        let stop = &series.stops.stops[row];
        let chain = &self.robot.chain;
        let place = format!("{}:{}, stop {}", series.readings_file().display(), stop.line, stop.name());
        let reach = self.reach(&poses.base_from_flange);
        let mistake = match *told {
            PosesFit::Fit(way) => misread(way, poses, place.clone(), SEEN_FITS),
            PosesFit::Open if !reach.is_of_most() => self.by_reach(poses, &place),
            _ => None,
        };
        if let Some(mistake) = mistake {
            return mistake;
        }
        let Reach { reached, tried } = reach;
        let what = format!(
            "the robot of the URDF reaches no such pose of \"{}\" in \"{}\"; of {tried} poses of the series it reaches {reached}{}",
            chain.tip,
            chain.base,
            match told {
                PosesFit::Fit(_) =>
                    ". What was seen at the stops fits the poses as they are: they are not inverted, rotation and unit are as stated",
                PosesFit::InNoWay =>
                    ". What was seen at the stops does not fit them either, nor inverted, in another unit, convention, column or row",
                PosesFit::Open => "",
            }
        );
        let alone = "or leave out --urdf: then camera and hand-eye transform are fitted to the poses alone";
        let remedy = match told {
            PosesFit::InNoWay => {
                "see that the names of the stops stand in the right rows, that plate and camera did not move, and that [controller] rotation is \
                 that of the controller: it may be of a kind that this program does not know"
                    .to_owned()
            }
            _ => format!(
                "see whether a user frame (work object) or a tool was active, and write the poses of this link in this base; check base and tip, \
                 and the joint limits; {alone}"
            ),
        };
        let quantities = vec![Quantity::new("reached", reached as f64, "1"), Quantity::new("tried", tried as f64, "1")];
        Error { quantities, ..Error::new(Code::PoseOutOfReach, place, what, remedy) }
    }

    /// The mistake with which all poses that are tried are reached: a guess, as a frame in the base may bring poses out of reach, too.
    fn by_reach(&self, poses: &ControllerPoses, place: &str) -> Option<Error> {
        let other = poses.otherwise.iter().find(|o| self.reach(&o.poses).is_whole())?;
        let remedy = format!(
            "{}; where that is not so, a user frame or a tool may be active in the poses (`identify` asks the images)",
            other.remedy
        );
        Some(Error::new(other.code, place, other.says("the robot reaches them"), remedy))
    }
}

/// Poses that can be reached.
#[derive(Debug, Clone, Copy)]
struct Reach {
    reached: usize,
    tried: usize,
}

impl Reach {
    const fn is_of_most(self) -> bool {
        2 * self.reached > self.tried
    }

    const fn is_whole(self) -> bool {
        self.reached == self.tried && self.tried > 0
    }
}
