//! Targets of one robot to targets of another: the joints that bring the real robot where the program meant it.
//!
//! With the controller's model `N`, the robot `A` for which the program was made and the robot `B` that runs it, a target with the joints `q`
//! (those of a pose are `N^-1(pose)`) becomes the joints `q'` with `B(q') = A(q)`, and a pose becomes `N(q')`: the controller turns it back into
//! `q'` by its own model.
//!
//! With measured tools `T` and work objects `W` of both robots, `W_B^-1 B(q') T_B = W_A^-1 A(q) T_A`: the tool comes to the same place of the work object.

use std::collections::BTreeSet;
use std::path::Path;

use nalgebra::Vector6;

use super::codes::Branch;
use super::field::{Edit, FieldPlace, splice};
use super::meant::{Meant, meant};
use super::measured_frames::{FramesOfProgram, KnownError, MeasuredFrames, Moved};
use super::posture::{Finder, Known, is_parted, smallest_singular_value};
use super::program::{
    Approach, DisplacedTarget, Left, PoseTarget, Program, Target, TargetKind, Understood, write_joints,
};
use super::reason::{DeclaredPoint, LeftReason, Why};
use super::shared_points::{Fate, Written, fates};
use crate::geom::Pose;
use crate::model::inverse::{Reach, Stalled};
use crate::model::robot::Robot;
use crate::urdf::JointKind;

/// What may remain at a target, m and rad.
pub const RESIDUAL: f64 = 1e-6;
/// Joints that have to move further than this (rad or m) may leave the posture of the program: then the Jacobian is asked.
const MOST_JOINT_CHANGE: f64 = 0.3;
/// Where its smallest singular value (m and rad) is less, a mm or mrad moves a joint by more than 0.1 rad: the target is next to a singularity.
const NEAR_SINGULAR: f64 = 0.01;
/// Steps that place a displaced point exactly, though its orientation is that of another.
const PLACING_STEPS: usize = 4;

/// The three robots, with the same readings in the same order.
#[derive(Debug, Clone, Copy)]
pub struct Models<'a> {
    /// The controller's own model, by which it turns poses into joints.
    pub controller: &'a Robot,
    /// The robot for which the program was made.
    pub from: &'a Robot,
    /// The robot that runs it.
    pub to: &'a Robot,
    /// Where tool and work object really are; without them the program's own count.
    pub frames: Option<&'a MeasuredFrames>,
    /// What is known beyond the models of the robots that taught and that runs the program.
    pub beyond: [Option<&'a dyn KnownError>; 2],
}

impl Models<'_> {
    /// A pose of one of the robots moved by what is known beyond its model, forwards or back.
    fn beyond(&self, robot: usize, readings: &[f64], factor: f64, pose: Pose) -> Pose {
        let error = self.beyond[robot].map(|known| known.error_m(readings));
        error.map_or(pose, |e| Pose::new(pose.rotation, pose.translation + e * factor))
    }
}

/// What is known of the postures.
#[derive(Debug, Clone)]
pub struct Postures {
    /// True for readings that keep the value of the program.
    pub held: Vec<bool>,
    /// Joint values near which a pose is reached where the text does not tell from where the robot comes, rad or m.
    pub start: Option<Vec<f64>>,
}

/// What became of one target.
#[derive(Debug, Clone, PartialEq)]
pub enum TargetOutcome {
    /// Corrected.
    Done(Correction),
    /// Left as it is, for this reason.
    Left(Why),
}

/// A corrected target.
#[derive(Debug, Clone, PartialEq)]
pub struct Correction {
    /// Readings that the program meant, rad or m.
    pub programmed: Vec<f64>,
    /// Readings that bring the real robot there, as the new text gives them.
    pub corrected: Vec<f64>,
    /// How the posture became known.
    pub posture: Known,
    /// How far the real robot would have missed, m; at the tool where that was measured, else at the flange.
    pub shift_m: f64,
    /// The same, rad.
    pub turn_rad: f64,
    /// What remains with the numbers as written, m (at the tool of a displaced point).
    pub residual_m: f64,
    /// The same, rad.
    pub residual_rad: f64,
}

impl Correction {
    /// Reading that changes most: its index and by how much, rad or m.
    pub fn largest_change(&self) -> (usize, f64) {
        largest_change(&self.programmed, &self.corrected)
    }
}

fn largest_change(from: &[f64], to: &[f64]) -> (usize, f64) {
    let changes = from.iter().zip(to).map(|(a, b)| b - a).enumerate();
    changes.fold((0, 0.0), |best: (usize, f64), (i, d)| if d.abs() > best.1.abs() { (i, d) } else { best })
}

/// A program after correction.
#[derive(Debug, Clone)]
pub struct Compensated {
    /// New bytes of every file.
    pub files: Vec<Vec<u8>>,
    /// One for each target of the program, in its order.
    pub outcomes: Vec<TargetOutcome>,
    /// Distance (rad, m) of each target with taught joints beside its pose from where the controller's model puts these joints.
    pub taught: Vec<Option<(f64, f64)>>,
}

impl Compensated {
    /// Says of computed targets with which corrected points they move.
    pub fn tell_what_moves(&self, program: &mut Program) {
        let done = || program.targets.iter().zip(&self.outcomes).filter(|(_, o)| matches!(o, TargetOutcome::Done(_)));
        let corrected = |point: &&DeclaredPoint| done().any(|(t, _)| (t.file, t.line) == (point.file, point.line));
        let module = |file: usize| Path::new(&program.files[file].name).with_extension("");
        for Left { file, why, .. } in &mut program.left {
            // One of this module that is used with a known tool and work object as well: others may have a point of the same name.
            let is_own = |t: &Target| module(t.file) == module(*file);
            let itself =
                why.about.iter().filter(|name| done().any(|(t, _)| t.visited && t.name == **name && is_own(t)));
            let points = why.starts_from.iter().filter(corrected).map(|point| &point.name);
            let names: BTreeSet<&str> = itself.chain(points).map(String::as_str).collect();
            if !names.is_empty() {
                let names: Vec<&str> = names.into_iter().collect();
                why.words += &format!("; it moves with {}, corrected for itself", names.join(" and "));
            }
        }
    }

    /// True for a use of a point that stays as it is, which was said of an earlier use of it with another tool or work object.
    pub fn is_said(&self, program: &Program, k: usize) -> bool {
        let place = |k: usize| (program.targets[k].file, program.targets[k].line, &program.targets[k].name);
        let is_shared = |o: &TargetOutcome| matches!(o, TargetOutcome::Left(w) if w.reason == LeftReason::FramesDiffer);
        let outcome = &self.outcomes[k];
        is_shared(outcome) && (0..k).any(|earlier| place(earlier) == place(k) && self.outcomes[earlier] == *outcome)
    }

    /// All targets that stay as they are, those included that could not be read.
    pub fn left(&self, program: &Program) -> Vec<Left> {
        let all = program.targets.iter().zip(&self.outcomes).enumerate();
        let visited = all.filter(|(k, (t, _))| t.visited && !self.is_said(program, *k));
        let unreached = visited.filter_map(|(_, (t, o))| match o {
            TargetOutcome::Done(_) => None,
            TargetOutcome::Left(why) => {
                Some(Left { file: t.file, line: t.line, name: t.name.clone(), why: why.clone() })
            }
        });
        let mut all: Vec<Left> = program.left.iter().cloned().chain(unreached).collect();
        all.sort_by_key(|l| (l.file, l.line));
        all
    }
}

/// Corrects every target of a program, in the order of visiting.
pub fn compensate(program: &Program, models: Models<'_>, postures: &Postures) -> Compensated {
    let mut work = Work::new(models, program);
    let mut own_edits = Vec::with_capacity(program.targets.len());
    let mut outcomes = Vec::with_capacity(program.targets.len());
    let mut displaced = Vec::new();
    let finder = Finder::new(models.controller, &work.limits, postures.start.as_deref());
    let all_meant = meant(program, models.controller, finder, &postures.held);
    for ((k, target), meant) in program.targets.iter().enumerate().zip(all_meant) {
        match work.target(target, meant, program) {
            Ok((correction, own, later)) => {
                own_edits.push(own);
                displaced.extend(later.map(|l| (k, l)));
                outcomes.push(TargetOutcome::Done(correction));
            }
            Err(why) => {
                own_edits.push(empty_cells(target));
                outcomes.push(TargetOutcome::Left(why));
            }
        }
    }
    for (k, fate) in fates(&program.targets, &work.written, RESIDUAL).into_iter().enumerate() {
        match fate {
            Fate::Own => continue,
            Fate::Said => {}
            Fate::Left(why) if work.written[k].take().is_some() => outcomes[k] = TargetOutcome::Left(why),
            Fate::Left(_) => {}
        }
        own_edits[k].clear();
    }
    let mut edits = program.edits.clone();
    edits.extend(own_edits.into_iter().flatten());
    // Displaced points are written when the points that they start from are.
    for (k, later) in displaced {
        if let TargetOutcome::Done(correction) = &mut outcomes[k] {
            match work.displaced(&later, correction, program) {
                Ok(own) => edits.extend(own),
                Err(why) => outcomes[k] = TargetOutcome::Left(why),
            }
        }
    }
    let taught = program.targets.iter().map(|t| taught(t, models.controller)).collect();
    let files = program.files.iter().enumerate().map(|(k, f)| splice(&f.bytes, k, &edits)).collect();
    Compensated { files, outcomes, taught }
}

/// Distance (rad, m) of the tool between a pose and the joints that were taught with it.
fn taught(target: &Target, controller: &Robot) -> Option<(f64, f64)> {
    let TargetKind::Pose(pose) = &target.kind else { return None };
    let tool = &pose.flange_from_tool;
    let by_joints = controller.base_from_tip(pose.taught.as_ref()?) * *tool;
    Some(by_joints.distance(&(pose.base_from_flange() * *tool)))
}

/// Columns that a table gains stay empty in the rows that are left as they are.
pub(super) fn empty_cells(target: &Target) -> Vec<Edit> {
    let TargetKind::Pose(pose) = &target.kind else { return Vec::new() };
    let missing = pose.joint_fields.iter().flatten().filter_map(|field| match &field.place {
        FieldPlace::Missing(at, words) => Some(Edit { file: field.file, range: *at..*at, text: words.clone() }),
        FieldPlace::At(_) => None,
    });
    missing.collect()
}

/// A displaced target whose numbers are still to be written.
struct Later {
    pose: PoseTarget,
    displaced: DisplacedTarget,
    held: Vec<bool>,
    /// Readings of the target before, as corrected.
    previous: Option<Vec<f64>>,
    wanted: Pose,
}

/// Joints of a target as programmed and as corrected; `None` where they are not known.
type Reached = Option<(Vec<f64>, Vec<f64>)>;

/// The way through a program.
struct Work<'a> {
    models: Models<'a>,
    frames: Option<FramesOfProgram<'a>>,
    /// Limits of the robot that runs the program; joints without any have none.
    limits: Vec<(f64, f64)>,
    /// One for each target so far.
    places: Vec<Reached>,
    /// How the pose of each target is written, where it is: displaced ones are written last.
    written: Vec<Option<Written>>,
}

/// What became of a target: its correction, its edits, and what is written later.
type Worked = (Correction, Vec<Edit>, Option<Later>);

impl<'a> Work<'a> {
    fn new(models: Models<'a>, program: &Program) -> Self {
        let limits = models.to.chain.stated_limits();
        let limits: Vec<_> = limits.into_iter().map(|l| l.unwrap_or((f64::NEG_INFINITY, f64::INFINITY))).collect();
        let frames = models.frames.map(|measured| FramesOfProgram::new(measured, &program.targets));
        Self { models, frames, limits, places: Vec::new(), written: Vec::new() }
    }

    fn target(&mut self, target: &Target, meant: Understood<Meant>, program: &Program) -> Understood<Worked> {
        self.places.push(None);
        self.written.push(None);
        self.worked(target, meant?, program)
    }

    fn worked(&mut self, target: &Target, meant: Meant, program: &Program) -> Understood<Worked> {
        let before = match target.approach {
            Approach::From(k) => self.places.get(k).and_then(Clone::clone),
            _ => None,
        };
        let (programmed_before, previous) = before.unzip();
        let Meant { kind, readings: programmed, held, known: posture, .. } = meant;
        let meant = reach(self.models.from, &self.limits, &held, programmed_before.as_deref()).stop(&programmed);
        let moved = self.frames.as_ref().map_or_else(|| Ok(Moved::none()), |f| f.moved(&kind))?;
        let taught = self.models.from.base_from_tip_at(&meant);
        let taught = self.models.beyond(0, &programmed, 1.0, taught);
        let wanted = self.models.beyond(1, &programmed, -1.0, moved.applied(&taught));
        let to = reach(self.models.to, &self.limits, &held, previous.as_deref());
        let corrected = self.reached(&to, &wanted, &programmed);
        // The next target is approached from here also when this one stays as it is.
        let stands = corrected.clone().unwrap_or_else(|_| programmed.clone());
        if let Some(place) = self.places.last_mut() {
            *place = Some((programmed.clone(), stands));
        }
        let corrected = corrected?;
        let pose_at = |q: &[f64]| self.models.to.base_from_tip_at(&to.stop(q));
        let at_tool = |flange: Pose| flange * moved.flange_from_tool;
        let (turn_rad, shift_m) = at_tool(pose_at(&programmed)).distance(&at_tool(wanted));
        let (edits, read, written) = self.text(&kind, &held, (&programmed, &corrected), program)?;
        let (residual_rad, residual_m) = pose_at(&read).distance(&wanted);
        if residual_m > RESIDUAL || residual_rad > RESIDUAL {
            let rest = in_words(residual_m, residual_rad);
            return Err(Why::new(LeftReason::Coarse, format!("the decimals of the text leave {rest}")));
        }
        if let Some(last) = self.written.last_mut() {
            *last = written;
        }
        let correction =
            Correction { programmed, corrected: read, posture, shift_m, turn_rad, residual_m, residual_rad };
        let later = match kind {
            TargetKind::Pose(pose) if !pose.has_joint_fields() => {
                pose.displaced.clone().map(|displaced| Later { pose: *pose, displaced, held, previous, wanted })
            }
            _ => None,
        };
        Ok((correction, edits, later))
    }

    /// Edits that write corrected readings, the readings that are read of the new text, and what others may start from. A displaced target is
    /// written later.
    fn text(
        &self,
        kind: &TargetKind,
        held: &[bool],
        (programmed, corrected): (&[f64], &[f64]),
        program: &Program,
    ) -> Understood<(Vec<Edit>, Vec<f64>, Option<Written>)> {
        let (edits, read) = match kind {
            TargetKind::Joints(joints) => joints.edits(corrected, &program.files),
            TargetKind::Pose(pose) if pose.has_joint_fields() => {
                write_joints(&pose.joint_fields, corrected, &program.files)
            }
            TargetKind::Pose(pose) if pose.displaced.is_some() => (Vec::new(), corrected.to_vec()),
            TargetKind::Pose(pose) => {
                let wanted = self.models.controller.base_from_tip(corrected);
                let (edits, base_from_flange) = pose.edits(&wanted, &program.files);
                let codes = self.code_edits(pose, programmed, corrected, program);
                let read = self.commanded(&base_from_flange, held, corrected)?;
                let written = Written::new(pose, &base_from_flange, codes.clone());
                return Ok(([edits, codes].concat(), read, Some(written)));
            }
        };
        Ok((edits, read, None))
    }

    fn commanded(&self, base_from_flange: &Pose, held: &[bool], near: &[f64]) -> Understood<Vec<f64>> {
        let read = reach(self.models.controller, &self.limits, held, None).solve_from(base_from_flange, near);
        read.map_err(|_| Why::new(LeftReason::Singular, "the corrected pose is singular for the controller's model"))
    }

    /// Edits of a displaced target: its place is exact; so is its orientation where the displacement can turn, else it is that of the
    /// point that it starts from.
    fn displaced(&self, later: &Later, correction: &mut Correction, program: &Program) -> Understood<Vec<Edit>> {
        let Later { pose, displaced, held, previous, wanted } = later;
        let is_base = |target: &Target| (target.file, target.kind.first_byte()) == displaced.base;
        let mut written = program.targets.iter().zip(&self.written).filter(|(target, _)| is_base(target));
        let base = written.find_map(|(_, written)| Some(written.as_ref()?.work_from_tool));
        let base = base.unwrap_or_else(|| pose.work_from_base());
        let to = reach(self.models.to, &self.limits, held, previous.as_deref());
        let (work, tool) = (&pose.base_from_work, &pose.flange_from_tool);
        let wanted_tool = *wanted * *tool;
        let mut aim = work.inverse() * self.models.controller.base_from_tip(&correction.corrected) * *tool;
        let (mut edits, mut read) = (Vec::new(), Vec::new());
        for _ in 0..PLACING_STEPS {
            let (new, found) = displaced.edits(&base, &aim, &program.files);
            read = self.commanded(&(*work * found * tool.inverse()), held, &correction.corrected)?;
            edits = new;
            let reached = self.models.to.base_from_tip_at(&to.stop(&read)) * *tool;
            (correction.residual_rad, correction.residual_m) = reached.distance(&wanted_tool);
            if correction.residual_m < 0.1 * RESIDUAL || displaced.turned.is_some() {
                break;
            }
            aim.translation += work.rotation.transpose() * (wanted_tool.translation - reached.translation);
        }
        correction.corrected = read;
        let turns = displaced.turned.is_none() && correction.residual_rad <= correction.turn_rad + RESIDUAL;
        if correction.residual_m > RESIDUAL || (correction.residual_rad > RESIDUAL && !turns) {
            let rest = in_words(correction.residual_m, correction.residual_rad);
            return Err(Why::new(LeftReason::Coarse, format!("the point that it starts from leaves {rest}")));
        }
        Ok(edits)
    }

    fn code_edits(&self, pose: &PoseTarget, programmed: &[f64], corrected: &[f64], program: &Program) -> Vec<Edit> {
        let Some((codes, axes)) = pose.posture.codes() else { return Vec::new() };
        let six = |q: &[f64]| axes.map(|i| q[i]);
        let branch = |q: &[f64]| Branch::of(self.models.controller, axes, q);
        codes.edits((&six(programmed), branch(programmed)), (&six(corrected), branch(corrected)), &program.files)
    }

    /// Readings within the limits that reach `wanted` in the posture of `start`.
    fn reached(&self, to: &Reach<'_>, wanted: &Pose, start: &[f64]) -> Understood<Vec<f64>> {
        let beyond = |q: &[f64]| (0..q.len()).find(|&i| q[i] < self.limits[i].0 || q[i] > self.limits[i].1);
        if let Some(i) = beyond(start) {
            let words = format!("the program itself puts {}", self.beyond(i, start[i]));
            return Err(Why::new(LeftReason::ProgramBeyondLimit, words));
        }
        let found = within_limits(to, wanted, start).map_err(|stalled| {
            let free: Vec<_> = start.iter().map(|_| (f64::NEG_INFINITY, f64::INFINITY)).collect();
            match (Reach { limits: &free, ..*to }).solve_from(wanted, start) {
                Ok(q) if beyond(&q).is_some() => {
                    let all = (0..q.len())
                        .filter(|&i| beyond(&q).is_some() && (q[i] < self.limits[i].0 || q[i] > self.limits[i].1));
                    let all: Vec<String> = all.map(|i| self.beyond(i, q[i])).collect();
                    Why::new(LeftReason::BeyondLimit, format!("it would take {}", all.join(" and ")))
                }
                _ => self.unreached(to, wanted, (start, &stalled)),
            }
        })?;
        let (i, change) = largest_change(start, &found);
        if change.abs() > MOST_JOINT_CHANGE && is_left(to, start, &found) {
            let name = &self.models.to.chain.readings[i];
            let change = self.amount(i, change);
            let words = format!("{name} would have to move by {change}: the target lies next to a singular posture");
            return Err(Why::new(LeftReason::Singular, words));
        }
        Ok(found)
    }

    /// Why nothing reaches it from a posture: within the limits, fewer than six joints cannot move the tool in all directions.
    fn unreached(&self, to: &Reach<'_>, wanted: &Pose, (start, stalled): (&[f64], &Stalled)) -> Why {
        let remain = twist_in_words(&stalled.error);
        let free = || to.held.iter().enumerate().filter(|(_, held)| !**held).map(|(i, _)| i);
        let (axes, q) = (free().count(), &stalled.readings);
        let is_within = free().all(|i| q[i] > self.limits[i].0 && q[i] < self.limits[i].1);
        if axes < 6 && is_within {
            let (turn_rad, shift_m) = to.robot.base_from_tip_at(&to.stop(start)).distance(wanted);
            let errors = in_words(shift_m, turn_rad);
            let words = format!(
                "{axes} joints that may move cannot take out all six errors of the tool: of {errors}, {remain} would remain, so that nothing of it is corrected (level foot and tool so that less of it is left, or teach this target on the real robot)"
            );
            return Why::new(LeftReason::TooFewAxes, words);
        }
        Why::new(LeftReason::OutOfReach, format!("no posture next to that of the program reaches it; {remain} remain"))
    }

    fn beyond(&self, i: usize, q: f64) -> String {
        let (low, high) = self.limits[i];
        let limit = if q < low { low } else { high };
        format!(
            "{} at {}, beyond its limit {}",
            self.models.to.chain.readings[i],
            self.amount(i, q),
            self.amount(i, limit)
        )
    }

    fn amount(&self, i: usize, value: f64) -> String {
        match self.models.to.chain.reading_kinds[i] {
            JointKind::Prismatic => format!("{:.3} mm", 1e3 * value),
            _ => format!("{:.4} deg", value.to_degrees()),
        }
    }
}

fn reach<'a>(robot: &'a Robot, limits: &'a [(f64, f64)], held: &'a [bool], previous: Option<&'a [f64]>) -> Reach<'a> {
    Reach { robot, limits, held, previous }
}

/// True where the way from one posture to another leads by a singular one, or one of them is singular.
fn is_left(to: &Reach<'_>, from: &[f64], found: &[f64]) -> bool {
    let is_near = |q: &[f64]| smallest_singular_value(to.robot, q, to.held) < NEAR_SINGULAR;
    is_near(from) || is_near(found) || is_parted(to.robot, from, found, to.held)
}

/// As [`Reach::solve_from`]; a redundant robot leaves joints at their limits and moves the others.
fn within_limits(to: &Reach<'_>, wanted: &Pose, start: &[f64]) -> Result<Vec<f64>, Stalled> {
    let mut held = to.held.to_vec();
    let mut start = start.to_vec();
    loop {
        let stalled = match (Reach { held: &held, ..*to }).solve_from(wanted, &start) {
            Ok(q) => return Ok(q),
            Err(stalled) => stalled,
        };
        let at_limit = |i: &usize| {
            !held[*i] && (stalled.readings[*i] <= to.limits[*i].0 || stalled.readings[*i] >= to.limits[*i].1)
        };
        let spare = held.iter().filter(|h| !**h).count() > 6;
        let Some(i) = (0..held.len()).find(at_limit).filter(|_| spare) else { return Err(stalled) };
        start[i] = stalled.readings[i];
        held[i] = true;
    }
}

fn twist_in_words(twist: &Vector6<f64>) -> String {
    in_words(twist.fixed_rows::<3>(0).norm(), twist.fixed_rows::<3>(3).norm())
}

fn in_words(shift_m: f64, turn_rad: f64) -> String {
    format!("{:.4} mm and {:.4} mrad", 1e3 * shift_m, 1e3 * turn_rad)
}
