//! Targets of one robot to targets of another: the joints that bring the real robot where the program meant it.
//!
//! With the controller's model `N`, the robot `A` for which the program was made and the robot `B` that runs it, a target with the joints `q`
//! (those of a pose are `N^-1(pose)`) becomes the joints `q'` with `B(q') = A(q)`, and a pose becomes `N(q')`: the controller turns it back into
//! `q'` by its own model.

use std::collections::BTreeMap;

use nalgebra::Vector6;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::codes::{Branch, Codes};
use super::field::{Edit, Place, splice};
use super::program::{Kind, Left, PoseTarget, Posture, Program, Target, Understood, write_joints};
use crate::geom::Pose;
use crate::model::robot::Robot;
use crate::plan::inverse::{self, Reach, Stalled};
use crate::urdf::JointKind;

/// What may remain at a target, m and rad.
pub const RESIDUAL: f64 = 1e-6;
/// A joint that has to move further than this (rad or m) leaves the posture of the program: the target is next to a singularity.
const MOST_JOINT_CHANGE: f64 = 0.3;
/// Random starts for the joints of a pose that no earlier target is near to.
const STARTS: usize = 200;
/// Seed of these starts.
const SEED: u64 = 5;

/// The three robots, with the same readings in the same order.
#[derive(Debug, Clone, Copy)]
pub struct Models<'a> {
    /// The controller's own model, by which it turns poses into joints.
    pub controller: &'a Robot,
    /// The robot for which the program was made.
    pub from: &'a Robot,
    /// The robot that runs it.
    pub to: &'a Robot,
}

/// What is known of the postures.
#[derive(Debug, Clone)]
pub struct Postures {
    /// True for readings that keep the value of the program.
    pub held: Vec<bool>,
    /// Joint values near which the first pose is reached, rad or m.
    pub start: Vec<f64>,
}

/// What became of one target.
#[derive(Debug, Clone, PartialEq)]
pub enum Outcome {
    /// Corrected.
    Done(Correction),
    /// Left as it is, for this reason.
    Left(String),
}

/// A corrected target.
#[derive(Debug, Clone, PartialEq)]
pub struct Correction {
    /// Readings that the program meant, rad or m.
    pub programmed: Vec<f64>,
    /// Readings that bring the real robot there, as the new text gives them.
    pub corrected: Vec<f64>,
    /// How far the real robot would have missed, m.
    pub shift_m: f64,
    /// The same, rad.
    pub turn_rad: f64,
    /// What remains with the numbers as written, m.
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
    pub outcomes: Vec<Outcome>,
}

impl Compensated {
    /// All targets that stay as they are, those included that could not be read.
    pub fn left(&self, program: &Program) -> Vec<Left> {
        let unreached = program.targets.iter().zip(&self.outcomes).filter_map(|(t, o)| match o {
            Outcome::Done(_) => None,
            Outcome::Left(why) => Some(Left { file: t.file, line: t.line, name: t.name.clone(), why: why.clone() }),
        });
        let mut all: Vec<Left> = program.left.iter().cloned().chain(unreached).collect();
        all.sort_by_key(|l| (l.file, l.line));
        all
    }
}

/// Corrects every target of a program, in the order of visiting.
pub fn compensate(program: &Program, models: Models<'_>, postures: &Postures) -> Compensated {
    let mut work = Work::new(models, postures);
    let mut edits = program.edits.clone();
    let mut outcomes = Vec::with_capacity(program.targets.len());
    for target in &program.targets {
        match work.target(target, program) {
            Ok((correction, own)) => {
                edits.extend(own);
                outcomes.push(Outcome::Done(correction));
            }
            Err(why) => {
                edits.extend(empty_cells(target));
                outcomes.push(Outcome::Left(why));
            }
        }
    }
    let files = program.files.iter().enumerate().map(|(k, f)| splice(&f.bytes, k, &edits)).collect();
    Compensated { files, outcomes }
}

/// Columns that a table gains stay empty in the rows that are left as they are.
fn empty_cells(target: &Target) -> Vec<Edit> {
    let Kind::Pose(pose) = &target.kind else { return Vec::new() };
    let missing = pose.joint_fields.iter().flatten().filter_map(|field| match &field.place {
        Place::Missing(at, words) => Some(Edit { file: field.file, range: *at..*at, text: words.clone() }),
        Place::At(_) => None,
    });
    missing.collect()
}

/// The way through a program.
struct Work<'a> {
    models: Models<'a>,
    postures: &'a Postures,
    /// Limits of the robot that runs the program; joints without any have none.
    limits: Vec<(f64, f64)>,
    /// Readings of the target before: as programmed, and as corrected.
    before: Option<(Vec<f64>, Vec<f64>)>,
    /// True after a target whose joints are not known.
    lost: bool,
    /// Joints of the last pose with each code.
    by_code: BTreeMap<String, Vec<f64>>,
    rng: ChaCha8Rng,
}

impl<'a> Work<'a> {
    fn new(models: Models<'a>, postures: &'a Postures) -> Self {
        let limits = inverse::stated_limits(&models.to.chain);
        let limits = limits.into_iter().map(|l| l.unwrap_or((f64::NEG_INFINITY, f64::INFINITY))).collect();
        Self {
            models,
            postures,
            limits,
            before: None,
            lost: false,
            by_code: BTreeMap::new(),
            rng: ChaCha8Rng::seed_from_u64(SEED),
        }
    }

    fn target(&mut self, target: &Target, program: &Program) -> Understood<(Correction, Vec<Edit>)> {
        let follows = target.follows && !std::mem::replace(&mut self.lost, true);
        let kind = &self.completed(target, follows)?;
        let (programmed, held) = match kind {
            Kind::Joints(joints) => {
                let absent = joints.fields.iter().map(Option::is_none);
                (joints.readings.clone(), absent.zip(&self.postures.held).map(|(a, h)| a || *h).collect())
            }
            Kind::Pose(pose) => {
                let fixed = pose.fixed.iter().map(Option::is_some);
                let held: Vec<bool> = fixed.zip(&self.postures.held).map(|(a, h)| a || *h).collect();
                (self.joints_of(pose, &held)?, held)
            }
        };
        let before = if follows { self.before.take() } else { None };
        let (programmed_before, corrected_before) = before.unzip();
        let meant = reach(self.models.from, &self.limits, &held, programmed_before.as_deref()).stop(&programmed);
        let wanted = self.models.from.pose_at(&meant, &vec![0.0; programmed.len()]);
        let to = reach(self.models.to, &self.limits, &held, corrected_before.as_deref());
        let corrected = self.reached(&to, &wanted, &programmed);
        // The next target is approached from here also when this one stays as it is.
        self.before = Some((programmed.clone(), corrected.clone().unwrap_or_else(|_| programmed.clone())));
        self.lost = false;
        let corrected = corrected?;
        let (edits, read) = match kind {
            Kind::Joints(joints) => joints.edits(&corrected, &program.files),
            Kind::Pose(pose) if pose.joint_fields.iter().any(Option::is_some) => {
                write_joints(&pose.joint_fields, &corrected, &program.files)
            }
            Kind::Pose(pose) => {
                let (mut edits, base_from_flange) =
                    pose.edits(&self.models.controller.base_from_tip(&corrected), &program.files);
                edits.extend(self.code_edits(pose, &programmed, &corrected, program));
                let controller = reach(self.models.controller, &self.limits, &held, None);
                let read = controller.solve_from(&base_from_flange, &corrected);
                (edits, read.map_err(|_| "the corrected pose is singular for the controller's model".to_owned())?)
            }
        };
        let pose_at = |q: &[f64]| self.models.to.pose_at(&to.stop(q), &vec![0.0; q.len()]);
        let (turn_rad, shift_m) = pose_at(&programmed).distance(&wanted);
        let (residual_rad, residual_m) = pose_at(&read).distance(&wanted);
        if residual_m > RESIDUAL || residual_rad > RESIDUAL {
            let rest = in_words(residual_m, residual_rad);
            return Err(format!("the decimals of the text leave {rest}"));
        }
        let correction = Correction { programmed, corrected: read, shift_m, turn_rad, residual_m, residual_rad };
        Ok((correction, edits))
    }

    /// The target with what its text leaves out, which is what the target before it says.
    fn completed(&self, target: &Target, follows: bool) -> Understood<Kind> {
        let before = self.before.as_ref().filter(|_| follows).map(|(q, _)| q);
        let unknown = || "it leaves numbers out, and the target before it is not known".to_owned();
        let mut kind = target.kind.clone();
        match &mut kind {
            Kind::Joints(joints) => {
                for (i, q) in joints.readings.iter_mut().enumerate().filter(|(_, q)| !q.is_finite()) {
                    // Axes that the target does not have keep their place, wherever that is.
                    let known = before.map(|b| b[i]);
                    *q = match joints.fields[i] {
                        None => known.unwrap_or(self.postures.start[i]),
                        Some(_) => known.ok_or_else(unknown)?,
                    };
                }
            }
            Kind::Pose(pose) if pose.is_partial() => {
                pose.complete(&self.models.controller.base_from_tip(before.ok_or_else(unknown)?));
            }
            Kind::Pose(_) => {}
        }
        Ok(kind)
    }

    fn code_edits(&self, pose: &PoseTarget, programmed: &[f64], corrected: &[f64], program: &Program) -> Vec<Edit> {
        let Posture::Coded(codes, axes) = &pose.posture else { return Vec::new() };
        let six = |q: &[f64]| axes.map(|i| q[i]);
        let branch = |q: &[f64]| Branch::of(self.models.controller, axes, q);
        codes.edits((&six(programmed), branch(programmed)), (&six(corrected), branch(corrected)), &program.files)
    }

    /// Readings within the limits that reach `wanted` in the posture of `start`.
    fn reached(&self, to: &Reach<'_>, wanted: &Pose, start: &[f64]) -> Understood<Vec<f64>> {
        let beyond = |q: &[f64]| (0..q.len()).find(|&i| q[i] < self.limits[i].0 || q[i] > self.limits[i].1);
        if let Some(i) = beyond(start) {
            return Err(format!("the program itself puts {}", self.beyond(i, start[i])));
        }
        let found = within_limits(to, wanted, start).map_err(|stalled| {
            let free: Vec<_> = start.iter().map(|_| (f64::NEG_INFINITY, f64::INFINITY)).collect();
            match (Reach { limits: &free, ..*to }).solve_from(wanted, start) {
                Ok(q) if beyond(&q).is_some() => {
                    let all = (0..q.len())
                        .filter(|&i| beyond(&q).is_some() && (q[i] < self.limits[i].0 || q[i] > self.limits[i].1));
                    let all: Vec<String> = all.map(|i| self.beyond(i, q[i])).collect();
                    format!("it would take {}", all.join(" and "))
                }
                _ => format!(
                    "no posture next to that of the program reaches it; {} remain",
                    twist_in_words(&stalled.error)
                ),
            }
        })?;
        let (i, change) = largest_change(start, &found);
        if change.abs() > MOST_JOINT_CHANGE {
            let name = &self.models.to.chain.readings[i];
            let change = self.amount(i, change);
            return Err(format!("{name} would have to move by {change}: the target lies next to a singular posture"));
        }
        Ok(found)
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

    /// Joints by which the controller reaches a pose.
    fn joints_of(&mut self, pose: &PoseTarget, held: &[bool]) -> Understood<Vec<f64>> {
        let wanted = pose.base_from_flange();
        let fix = |q: &[f64]| q.iter().zip(&pose.fixed).map(|(q, f)| f.unwrap_or(*q)).collect::<Vec<f64>>();
        let near = match (&pose.posture, &self.before) {
            (Posture::Near(q), _) => fix(q),
            (_, Some((q, _))) => fix(q),
            (_, None) => fix(&self.postures.start),
        };
        let codes = match &pose.posture {
            Posture::Coded(codes, axes) => Some((codes, axes)),
            _ => None,
        };
        // Postures that a code had before are good starts for it.
        let known = codes.and_then(|(c, _)| self.by_code.get(&c.shown()).map(|q| fix(q)));
        for start in std::iter::once(&near).chain(&known) {
            if let Some(q) = self.coded(&wanted, start, &near, held, codes)
                && (codes.is_some() || largest_change(&near, &q).1.abs() < 1.0)
            {
                self.remember(codes, &q);
                return Ok(q);
            }
        }
        let found = self.nearest(&wanted, &near, held, codes).ok_or_else(|| {
            let remedy = "look at the base and tip link, and at tool and work frame";
            let posture = codes.map_or(String::new(), |(c, _)| format!(" in the posture {}", c.shown()));
            format!("the controller's model does not reach this pose{posture} ({remedy})")
        })?;
        self.remember(codes, &found);
        Ok(found)
    }

    fn remember(&mut self, codes: Option<(&Codes, &[usize; 6])>, q: &[f64]) {
        if let Some((codes, _)) = codes {
            self.by_code.insert(codes.shown(), q.to_vec());
        }
    }

    /// Joints that reach a pose, found from `start`, if they are of the posture that is meant; whole turns as the codes say, else towards `near`.
    fn coded(
        &self,
        wanted: &Pose,
        start: &[f64],
        near: &[f64],
        held: &[bool],
        codes: Option<(&Codes, &[usize; 6])>,
    ) -> Option<Vec<f64>> {
        let robot = self.models.controller;
        let q = reach(robot, &self.limits, held, None).solve_from(wanted, start).ok()?;
        let Some((codes, axes)) = codes else { return Some(self.turned_towards(&q, near, held)) };
        let mut q = q;
        for (axis, &i) in axes.iter().enumerate().filter(|(_, i)| !held[**i]) {
            q[i] = codes.turned(axis, q[i], near[i], self.limits[i])?;
        }
        codes.mean(Branch::of(robot, axes, &q)).then_some(q)
    }

    /// Of the postures that random starts find the one nearest to `near`.
    fn nearest(
        &mut self,
        wanted: &Pose,
        near: &[f64],
        held: &[bool],
        codes: Option<(&Codes, &[usize; 6])>,
    ) -> Option<Vec<f64>> {
        let robot = self.models.controller;
        let draw = inverse::reading_limits(&robot.chain);
        let mut best: Option<(f64, Vec<f64>)> = None;
        for k in 0..STARTS {
            let mut start = match k {
                0 => near.to_vec(),
                _ => inverse::random_readings(&draw, &robot.chain.reading_kinds, &mut self.rng),
            };
            for (i, q) in start.iter_mut().enumerate().filter(|(i, _)| held[*i]) {
                *q = near[i];
            }
            let Some(q) = self.coded(wanted, &start, near, held, codes) else { continue };
            let distance = q.iter().zip(near).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            if best.as_ref().is_none_or(|(d, _)| distance < *d - 1e-9) {
                best = Some((distance, q));
            }
            // Codes leave one posture; without them a six-axis arm has eight, found several times by then.
            if best.is_some() && (codes.is_some() || k >= STARTS / 4) {
                break;
            }
        }
        best.map(|(_, q)| q)
    }

    /// Whole turns of revolute joints that bring `q` nearer to `near` within the limits.
    fn turned_towards(&self, q: &[f64], near: &[f64], held: &[bool]) -> Vec<f64> {
        let turn = std::f64::consts::TAU;
        let one = |i: usize| {
            if held[i] || self.models.controller.chain.reading_kinds[i] != JointKind::Revolute {
                return q[i];
            }
            let wished = q[i] + turn * ((near[i] - q[i]) / turn).round();
            let (low, high) = self.limits[i];
            [wished, wished - turn, wished + turn].into_iter().find(|v| (low..=high).contains(v)).unwrap_or(q[i])
        };
        (0..q.len()).map(one).collect()
    }
}

fn reach<'a>(robot: &'a Robot, limits: &'a [(f64, f64)], held: &'a [bool], previous: Option<&'a [f64]>) -> Reach<'a> {
    Reach { robot, limits, held, previous }
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
