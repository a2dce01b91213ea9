//! Which joints a pose means: by the joints beside it, by its codes, or by where the robot comes from.

use std::collections::BTreeMap;

use nalgebra::Matrix6xX;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::codes::{Branch, Codes};
use super::program::{Heed, MeantPosture, PoseTarget, Understood, Way};
use super::reason::{LeftReason, Why};
use crate::geom::Pose;
use crate::model::inverse::{self, FARTHEST_STATED_RAD, FullTurns, POSTURE_STARTS, Reach, SAME_READING};
use crate::model::robot::{Posture as At, Robot};
use crate::urdf::JointKind;

/// Seed of the random starts for the joints of a pose that no earlier target is near to.
const SEED: u64 = 5;
/// A solution in which no joint is further (rad or m) from where the robot comes is of the same posture.
const NEAR: f64 = 0.5;
/// Nor is one in which a joint turns more between two places of a straight line.
const LINE_TURN: f64 = 0.3;
/// Distance of places on a straight line, m and rad.
const LINE_STEP: f64 = 0.02;
/// Part of it to which it is halved where a joint turns quickly, as beside a singular posture.
const SHORTEST_STEP: f64 = 1.0 / 1024.0;
/// Most places on a line.
const LINE_STEPS: f64 = 400.0;
/// A second posture that is less than so many times as far as the nearest leaves open which is meant.
const AMBIGUOUS: f64 = 1.25;
/// A posture whose smallest singular value (m and rad) is less is singular.
const SINGULAR: f64 = 1e-3;
/// Places between two postures at which the sign of the Jacobian's determinant is looked at.
const BETWEEN: usize = 40;

/// How the posture of a pose became known.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Known {
    /// The target has joints, no pose.
    Joints,
    /// Joints that the motion names (`qnear`) or the row of a table has.
    Near,
    /// Joints that were taught with the pose.
    Taught,
    /// Status and turn, or confdata.
    Codes,
    /// It goes on along a straight line from the target before.
    Line,
    /// It goes on along another path of the tool.
    Path,
    /// It is the one next to that of the target before.
    Before,
    /// It is the one next to `--start`.
    Start,
    /// Any: the joints are written beside the pose.
    Any,
}

impl Known {
    /// Word for tables.
    pub fn word(self) -> &'static str {
        match self {
            Self::Joints => "joints",
            Self::Near => "near",
            Self::Taught => "taught",
            Self::Codes => "codes",
            Self::Line => "line",
            Self::Path => "path",
            Self::Before => "before",
            Self::Start => "start",
            Self::Any => "any",
        }
    }
}

/// Joints of a pose, rad or m, and how its posture became known.
type Posture = (Vec<f64>, Known);

/// Where the robot comes from.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Before<'a> {
    /// Joints whose posture goes on, rad or m.
    pub readings: Option<&'a [f64]>,
    /// True where nothing lies between them and the target.
    pub straight: bool,
}

/// Finds joints by the controller's model.
pub(super) struct Finder<'a> {
    robot: &'a Robot,
    limits: Vec<(f64, f64)>,
    start: Option<&'a [f64]>,
    /// A little beside the middle of the ranges: a straight arm is singular.
    middle: Vec<f64>,
    /// Joints of the last pose with each code.
    by_code: BTreeMap<String, Vec<f64>>,
    rng: ChaCha8Rng,
}

/// Which of several postures near to a place will do.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Choice {
    /// The nearest, however near others are.
    Nearest,
    /// The nearest, where no other is about as near.
    Clear,
    /// The same of those that no singular posture parts from the place.
    Unparted,
}

type Six<'c> = Option<(&'c Codes, &'c [usize; 6])>;

fn farthest(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

/// True for joints (rad or m) of one posture and turn.
pub(super) fn same_posture(a: &[f64], b: &[f64]) -> bool {
    farthest(a, b) < SAME_READING
}

/// Motion of the tip by the readings that are free.
fn jacobian(robot: &Robot, q: &[f64], held: &[bool]) -> Matrix6xX<f64> {
    let columns = robot.kinematics_at(&At::at(q)).d_readings;
    let is_free = |i: usize| !held.get(i).copied().unwrap_or(false);
    let free: Vec<_> = columns.iter().enumerate().filter(|(i, _)| is_free(*i)).map(|(_, column)| *column).collect();
    Matrix6xX::from_columns(&free)
}

/// How little the tip moves (m and rad) by a unit of the readings in the direction in which that is least; of fewer than six free readings, by these.
pub(super) fn smallest_singular_value(robot: &Robot, q: &[f64], held: &[bool]) -> f64 {
    let jacobian = jacobian(robot, q, held);
    let gram = if jacobian.ncols() < 6 {
        (jacobian.transpose() * &jacobian).symmetric_eigenvalues().min()
    } else {
        (&jacobian * jacobian.transpose()).symmetric_eigenvalues().min()
    };
    gram.max(0.0).sqrt()
}

/// Readings on the way from one posture to another.
fn between(from: &[f64], to: &[f64], share: f64) -> Vec<f64> {
    from.iter().zip(to).map(|(a, b)| a + share * (b - a)).collect()
}

/// True where a singular posture lies between two of six free readings: there the determinant of the Jacobian changes its sign.
pub(super) fn is_parted(robot: &Robot, from: &[f64], to: &[f64], held: &[bool]) -> bool {
    let sign = |k: usize| {
        let jacobian = jacobian(robot, &between(from, to, k as f64 / BETWEEN as f64), held);
        (jacobian.ncols() == 6).then(|| jacobian.fixed_columns::<6>(0).determinant() > 0.0)
    };
    let first = sign(0);
    (1..=BETWEEN).any(|k| sign(k) != first)
}

/// True where a path of the tool, which passes no singular posture, leads from a place to a posture. From a singular one it leads to either side.
fn path_leads(robot: &Robot, place: &[f64], found: &[f64], held: &[bool]) -> bool {
    smallest_singular_value(robot, place, held) < SINGULAR || !is_parted(robot, place, found, held)
}

fn unreached(posture: &str) -> Why {
    let remedy = "look at the base and tip link, and at tool and work frame";
    Why::new(LeftReason::OutOfReach, format!("the controller's model does not reach this pose{posture} ({remedy})"))
}

/// The codes and the way there must mean the same, where it is not known which of them counts.
fn by_either(coded: Understood<Posture>, way: Understood<Posture>) -> Understood<Posture> {
    match (coded, way) {
        (Ok(coded), Ok((near, _))) if farthest(&coded.0, &near) < SAME_READING => Ok(coded),
        (Ok(_), Ok(_)) => {
            let words = "its posture is not known: the check of configurations may be switched off, and its confdata mean another one than the way there (--nearest-posture heeds no confdata)";
            Err(Why::new(LeftReason::PostureUnknown, words))
        }
        (_, way) => way,
    }
}

fn leads_elsewhere(codes: &Codes) -> Why {
    let words = format!(
        "its posture is not known: the way there leads to another one than {}, which no path of the tool heeds (--nearest-posture heeds no codes)",
        codes.shown()
    );
    Why::new(LeftReason::PostureUnknown, words)
}

fn contradicted() -> Why {
    let words = "the joints beside the pose are far from those that reach it: pose or joints are of another row, or its tool or work frame is another one (--tool, --work; without them it is the pose of the flange)";
    Why::new(LeftReason::PostureUnknown, words)
}

fn line_not_followed() -> Why {
    let words = "its posture is not known: the straight line to it passes a singular posture, or leaves the joint limits (move there by the joints, or look at the limits of the description, at tool and work frame)";
    Why::new(LeftReason::PostureUnknown, words)
}

fn path_not_followed() -> Why {
    let words = "its posture is not known: a singular posture parts every one from where the robot comes, which a path of the tool does not pass (move there by the joints, or look at tool and work frame)";
    Why::new(LeftReason::PostureUnknown, words)
}

impl<'a> Finder<'a> {
    pub fn new(robot: &'a Robot, limits: &[(f64, f64)], start: Option<&'a [f64]>) -> Self {
        let ranges = inverse::reading_limits(&robot.chain);
        let middle = ranges.iter().map(|(low, high)| 0.5 * (low + high) + 0.05 * (high - low).min(2.0)).collect();
        let rng = ChaCha8Rng::seed_from_u64(SEED);
        Self { robot, limits: limits.to_vec(), start, middle, by_code: BTreeMap::new(), rng }
    }

    /// Where `--start` has a reading, rad or m.
    pub fn start(&self, reading: usize) -> Option<f64> {
        self.start.map(|start| start[reading])
    }

    /// Joint values of axes that no target told so far.
    pub fn anywhere(&self, reading: usize) -> f64 {
        self.start.map_or(self.middle[reading], |s| s[reading])
    }

    /// Joints by which the controller reaches a pose.
    pub fn joints(&mut self, pose: &PoseTarget, held: &[bool], before: Before<'_>) -> Understood<Posture> {
        match (&pose.posture, &pose.taught) {
            (MeantPosture::Coded(codes, axes, way, heed), _) => {
                let coded = self.by_codes(pose, held, before, (codes, axes));
                match (heed, before.readings.filter(|_| before.straight)) {
                    (Heed::Unknown, _) => by_either(coded, self.by_approach(pose, held, before, *way)),
                    (Heed::Unheeded, Some(q)) => {
                        let by_tool = self.by_tool(pose, held, q, *way);
                        let is_other = match (&coded, &by_tool) {
                            (Ok((coded, _)), Ok((by_tool, _))) => farthest(coded, by_tool) > SAME_READING,
                            (Ok((coded, _)), Err(_)) => {
                                *way == Way::Path && !path_leads(self.robot, &Self::fixed(pose, q), coded, held)
                            }
                            (Err(_), _) => false,
                        };
                        let found = coded.or_else(|why| by_tool.map_err(|_| why));
                        if is_other { Err(leads_elsewhere(codes)) } else { found }
                    }
                    _ => coded,
                }
            }
            (MeantPosture::Near(q), _) => {
                let found = self.near(pose, held, q, Choice::Clear)?;
                self.is_beside(pose, q, &found).then_some((found, Known::Near)).ok_or_else(contradicted)
            }
            (MeantPosture::ByWay(_), Some(q)) => Ok((self.near(pose, held, q, Choice::Clear)?, Known::Taught)),
            (MeantPosture::ByWay(way), None) => self.by_approach(pose, held, before, *way),
        }
    }

    /// False where the columns of a table state joints that are far from those that reach the pose of the row.
    fn is_beside(&self, pose: &PoseTarget, stated: &[f64], found: &[f64]) -> bool {
        let is_stated = pose.has_joint_fields();
        let kinds = &self.robot.chain.reading_kinds;
        let mut angles = stated.iter().zip(found).zip(kinds).filter(|(_, kind)| **kind != JointKind::Prismatic);
        !is_stated || angles.all(|((stated, found), _)| (stated - found).abs() < FARTHEST_STATED_RAD)
    }

    /// The posture that goes on from the target before, or the one next to `--start`.
    fn by_approach(&mut self, pose: &PoseTarget, held: &[bool], before: Before<'_>, way: Way) -> Understood<Posture> {
        let written = pose.has_joint_fields();
        let choice = if written { Choice::Nearest } else { Choice::Clear };
        match (before.readings, self.start) {
            (Some(q), _) if before.straight && way != Way::Joints => self.by_tool(pose, held, q, way),
            (Some(q), _) => Ok((self.near(pose, held, q, choice)?, Known::Before)),
            (None, Some(start)) => Ok((self.near(pose, held, start, choice)?, Known::Start)),
            (None, None) if written => Ok((self.near(pose, held, &self.middle.clone(), choice)?, Known::Any)),
            (None, None) => {
                let words =
                    "its posture is not known: nothing tells the joints from which the robot comes (give --start)";
                Err(Why::new(LeftReason::PostureUnknown, words))
            }
        }
    }

    /// The posture to which a line or another path of the tool from `q` leads.
    fn by_tool(&mut self, pose: &PoseTarget, held: &[bool], q: &[f64], way: Way) -> Understood<Posture> {
        if way == Way::Path {
            return Ok((self.near(pose, held, q, Choice::Unparted)?, Known::Path));
        }
        match self.along(pose, held, q) {
            Some(found) => Ok((found, Known::Line)),
            None => Err(self.near(pose, held, q, Choice::Nearest).err().unwrap_or_else(line_not_followed)),
        }
    }

    fn fixed(pose: &PoseTarget, q: &[f64]) -> Vec<f64> {
        q.iter().zip(&pose.fixed).map(|(q, f)| f.unwrap_or(*q)).collect()
    }

    /// The solution next to `q` of those that will do.
    fn near(&mut self, pose: &PoseTarget, held: &[bool], q: &[f64], choice: Choice) -> Understood<Vec<f64>> {
        let (wanted, near) = (pose.base_from_flange(), Self::fixed(pose, q));
        let robot = self.robot;
        let will_do = |found: &[f64]| choice != Choice::Unparted || path_leads(robot, &near, found, held);
        if let Some(found) = self.solved(&wanted, &near, &near, held, None)
            && farthest(&near, &found) < NEAR
            && will_do(&found)
        {
            return Ok(found);
        }
        let mut all = self.postures(&wanted, &near, held);
        if all.is_empty() {
            return Err(unreached(""));
        }
        all.retain(|found| will_do(found));
        let Some(best) = all.first() else { return Err(path_not_followed()) };
        let redundant = held.iter().filter(|h| !**h).count() > 6;
        let second = all.get(1).filter(|_| choice != Choice::Nearest && !redundant);
        match second.filter(|second| farthest(&near, second) < AMBIGUOUS * farthest(&near, best)) {
            None => Ok(best.clone()),
            Some(second) => {
                let words = format!(
                    "its posture is not known: two lie about equally far from where the robot comes ({:.0} and {:.0} deg)",
                    farthest(&near, best).to_degrees(),
                    farthest(&near, second).to_degrees()
                );
                Err(Why::new(LeftReason::PostureUnknown, words))
            }
        }
    }

    /// The solution to which a straight line of the tool leads, in shorter steps where a joint turns quickly; `None` where one would have to jump or a limit
    /// lies on it. Axes beside the pose go to their values as the tool goes.
    fn along(&self, pose: &PoseTarget, held: &[bool], q: &[f64]) -> Option<Vec<f64>> {
        let tool = pose.flange_from_tool;
        let (first, last) = (self.robot.base_from_tip(q) * tool, pose.base_from_flange() * tool);
        let (turn, way) = first.distance(&last);
        let steps = (turn.max(way) / LINE_STEP).ceil().clamp(1.0, LINE_STEPS);
        let whole = first.inverse() * last;
        let turned = Pose::new(whole.rotation, nalgebra::Vector3::zeros()).log();
        let place = |share: f64| {
            let mut place = first * Pose::exp(&(turned * share));
            place.translation = first.translation * (1.0 - share) + last.translation * share;
            if share == 1.0 { last } else { place }
        };
        let beside = |share: f64, readings: &[f64]| -> Vec<f64> {
            let at = between(q, &Self::fixed(pose, q), share);
            readings.iter().zip(&pose.fixed).zip(at).map(|((own, fixed), at)| fixed.map_or(*own, |_| at)).collect()
        };
        let (mut q, mut share, mut step) = (q.to_vec(), 0.0, 1.0 / steps);
        while share < 1.0 {
            let to = f64::min(share + step, 1.0);
            let next = self.reach(held).solve_from(&(place(to) * tool.inverse()), &beside(to, &q)).ok();
            if let Some(next) = next.filter(|next| farthest(&q, next) <= LINE_TURN) {
                (q, share, step) = (next, to, f64::min(2.0 * step, 1.0 / steps));
            } else if step * steps > SHORTEST_STEP {
                step *= 0.5;
            } else {
                return None;
            }
        }
        Some(q)
    }

    fn by_codes(
        &mut self,
        pose: &PoseTarget,
        held: &[bool],
        before: Before<'_>,
        codes: (&Codes, &[usize; 6]),
    ) -> Understood<Posture> {
        let wanted = pose.base_from_flange();
        let near = Self::fixed(pose, before.readings.or(self.start).unwrap_or(&self.middle));
        // Postures that a code had before are good starts for it.
        let known = self.by_code.get(&codes.0.shown()).map(|q| Self::fixed(pose, q));
        let direct = std::iter::once(&near)
            .chain(&known)
            .find_map(|start| self.solved(&wanted, start, &near, held, Some(codes)));
        let found = direct.or_else(|| self.searched(&wanted, &near, held, codes));
        let Some(found) = found else { return Err(self.not_in_posture(&wanted, &near, held, codes.0)) };
        self.by_code.insert(codes.0.shown(), found.clone());
        Ok((found, Known::Codes))
    }

    /// Why no joints of the posture of the codes reach a pose: in a singular posture, codes say nothing.
    fn not_in_posture(&mut self, wanted: &Pose, near: &[f64], held: &[bool], codes: &Codes) -> Why {
        let remedy = "; --nearest-posture heeds no codes";
        if self.postures(wanted, near, held).iter().any(|q| self.is_singular(q)) {
            let words = format!("it is singular: {} do not tell which of its postures is meant{remedy}", codes.shown());
            return Why::new(LeftReason::Singular, words);
        }
        let why = unreached(&format!(" in the posture {}", codes.shown()));
        Why::new(why.reason, why.words + remedy)
    }

    /// True where the robot cannot move in some direction.
    fn is_singular(&self, q: &[f64]) -> bool {
        smallest_singular_value(self.robot, q, &[]) < SINGULAR
    }

    fn reach<'r>(&'r self, held: &'r [bool]) -> Reach<'r> {
        Reach { robot: self.robot, limits: &self.limits, held, previous: None }
    }

    /// Joints found from `start`, if they are of the posture of the codes; whole turns as the codes say, else towards `near`.
    fn solved(&self, wanted: &Pose, start: &[f64], near: &[f64], held: &[bool], codes: Six<'_>) -> Option<Vec<f64>> {
        let mut q = self.reach(held).solve_from(wanted, start).ok()?;
        let Some((codes, axes)) = codes else { return Some(self.turned_towards(&q, near, held)) };
        for (axis, &i) in axes.iter().enumerate().filter(|(_, i)| !held[**i]) {
            q[i] = codes.turned(axis, q[i], near[i], self.limits[i])?;
        }
        codes.mean(Branch::of(self.robot, axes, &q)).then_some(q)
    }

    fn random_start(&mut self, near: &[f64], held: &[bool]) -> Vec<f64> {
        let draw = inverse::reading_limits(&self.robot.chain);
        let mut start = inverse::random_readings(&draw, &self.robot.chain.reading_kinds, &mut self.rng);
        start.iter_mut().enumerate().filter(|(i, _)| held[*i]).for_each(|(i, q)| *q = near[i]);
        start
    }

    /// The posture of the codes, from random starts.
    fn searched(
        &mut self,
        wanted: &Pose,
        near: &[f64],
        held: &[bool],
        codes: (&Codes, &[usize; 6]),
    ) -> Option<Vec<f64>> {
        (0..POSTURE_STARTS).find_map(|_| {
            let start = self.random_start(near, held);
            self.solved(wanted, &start, near, held, Some(codes))
        })
    }

    /// All postures that random starts find, the nearest to `near` first.
    fn postures(&mut self, wanted: &Pose, near: &[f64], held: &[bool]) -> Vec<Vec<f64>> {
        let mut all: Vec<Vec<f64>> = Vec::new();
        for k in 0..POSTURE_STARTS {
            let start = if k == 0 { near.to_vec() } else { self.random_start(near, held) };
            if let Some(q) = self.solved(wanted, &start, near, held, None) {
                FullTurns::Apart.add(q, &mut all, &self.robot.chain.reading_kinds);
            }
            if k >= POSTURE_STARTS / 4 && !all.is_empty() {
                break;
            }
        }
        all.sort_by(|a, b| farthest(a, near).total_cmp(&farthest(b, near)));
        all
    }

    /// Whole turns of revolute joints that bring `q` nearer to `near` within the limits.
    fn turned_towards(&self, q: &[f64], near: &[f64], held: &[bool]) -> Vec<f64> {
        let turns = |i: usize| !held[i] && self.robot.chain.reading_kinds[i] == JointKind::Revolute;
        let one = |i: usize| if turns(i) { inverse::turned(q[i], near[i], self.limits[i], &[-1.0, 1.0]) } else { q[i] };
        (0..q.len()).map(one).collect()
    }
}
