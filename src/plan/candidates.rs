//! Workable poses: views of the plate that the robot reaches inside its limits, sees enough in, and can stand in.

use std::ops::Range;

use nalgebra::Vector3;
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use rayon::prelude::*;

use super::scene::{PlacedScene, Scene};
use super::setting::Setting;
use super::viewpoint::{ViewRange, Viewpoint};
use super::visibility::{VisibilityLimits, seen_markers};
use crate::error::{Code, Error, Quantity, Result};
use crate::geom::Pose;
use crate::model::inverse::{random_readings, reading_limits, solve_from};
use crate::series::CameraMount;

/// A pose that could be planned.
#[derive(Debug, Clone, PartialEq)]
pub struct Candidate {
    /// Readings, rad or m.
    pub readings: Vec<f64>,
    /// Where the plate stands.
    pub placement: usize,
    /// The view.
    pub view: Viewpoint,
    /// The camera.
    pub camera_from_plate: Pose,
    /// Indices of the markers seen.
    pub seen: Vec<usize>,
    /// Side of the middle of its range on which each joint from the second to the last but one stands, one bit each.
    pub posture: u32,
}

/// How candidates are made.
#[derive(Debug, Clone, PartialEq)]
pub struct CandidateOptions {
    /// Candidates wanted.
    pub count: usize,
    /// Range of views.
    pub views: ViewRange,
    /// What a view must fulfil.
    pub sight: VisibilityLimits,
    /// Distance kept from joint limits, rad or m.
    pub limit_margin: f64,
    /// Seed.
    pub seed: u64,
}

impl Default for CandidateOptions {
    fn default() -> Self {
        Self {
            count: 1000,
            views: ViewRange { tilt_rad: 55_f64.to_radians(), ..ViewRange::default() },
            sight: VisibilityLimits::default(),
            limit_margin: 0.02,
            seed: 1,
        }
    }
}

/// Why views fell out.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct CandidateCounts {
    /// Views tried.
    pub views: usize,
    /// Views that show too little of the plate, or too obliquely, or unsharp.
    pub unseen: usize,
    /// Most markers in any view.
    pub most_markers: usize,
    /// Workable views out of reach.
    pub out_of_reach: usize,
    /// Joint vectors that collide.
    pub colliding: usize,
    /// Joint vectors at which something stands between the camera and the plate.
    pub hidden: usize,
}

impl CandidateCounts {
    /// Adds the counts of other views.
    pub fn add(&mut self, other: &Self) {
        self.views += other.views;
        self.unseen += other.unseen;
        self.most_markers = self.most_markers.max(other.most_markers);
        self.out_of_reach += other.out_of_reach;
        self.colliding += other.colliding;
        self.hidden += other.hidden;
    }

    /// Why postures that reach a view fell out.
    fn of_postures(&self) -> Vec<Quantity> {
        let of = [("colliding", self.colliding), ("hidden", self.hidden)];
        of.map(|(name, count)| Quantity::new(name, count as f64, "1")).to_vec()
    }
}

/// Starts of the inverse kinematics for each view.
const STARTS: usize = 10;
/// Configurations kept of each view.
const CONFIGURATIONS: usize = 3;
/// Joint vectors nearer than this in every joint are one, rad or m.
const SAME: f64 = 0.2;
/// Views that are tried together.
const ROUND: usize = 256;
/// Share of the poses near others for which the arm starts anywhere.
const ANEW: f64 = 0.2;
/// Views tried for each candidate wanted before the search ends.
const VIEWS_PER_CANDIDATE: usize = 12;

/// Joint limits with a margin.
fn narrowed_limits(setting: &Setting, margin: f64) -> Vec<(f64, f64)> {
    let limits = reading_limits(&setting.robot.chain);
    limits.iter().map(|&(l, h)| if h - l > 4.0 * margin { (l + margin, h - margin) } else { (l, h) }).collect()
}

/// A robot with its surroundings, and what a pose has to fulfil there.
#[derive(Debug)]
pub struct Search<'a> {
    setting: &'a Setting,
    scene: &'a Scene,
    options: &'a CandidateOptions,
    limits: Vec<(f64, f64)>,
}

/// Workable poses, spread over all placements; the same options give the same poses with any number of threads.
///
/// # Errors
/// Where there are none: which condition excludes them, and what to change.
pub fn candidates(
    setting: &Setting,
    scene: &Scene,
    options: &CandidateOptions,
) -> Result<(Vec<Candidate>, CandidateCounts)> {
    let search = Search::new(setting, scene, options);
    let (mut found, mut tally) = (Vec::new(), CandidateCounts::default());
    let mut first = 0;
    while found.len() < options.count && first < VIEWS_PER_CANDIDATE * options.count {
        let (some, counted) = search.drawn(first..first + ROUND);
        found.extend(some);
        tally.add(&counted);
        first += ROUND;
    }
    found.truncate(options.count);
    if found.is_empty() { Err(impossible(setting, scene, options, &tally)) } else { Ok((found, tally)) }
}

impl<'a> Search<'a> {
    /// A search under these conditions.
    pub fn new(setting: &'a Setting, scene: &'a Scene, options: &'a CandidateOptions) -> Self {
        Self { setting, scene, options, limits: narrowed_limits(setting, options.limit_margin) }
    }

    /// Workable poses of the random views with these numbers, each in several configurations of the arm.
    pub fn drawn(&self, views: Range<usize>) -> (Vec<Candidate>, CandidateCounts) {
        let one = |index: usize| {
            let mut rng = self.rng(index as u64);
            let placement = index % self.setting.placements.len();
            let view = Viewpoint::random(&self.setting.plate, &self.options.views, &mut rng);
            let starts: Vec<Vec<f64>> = (0..STARTS).map(|_| self.random_start(&mut rng)).collect();
            let (mut found, tally) = self.workable(view, placement, &starts);
            while found.len() > CONFIGURATIONS {
                found.swap_remove(rng.random_range(0..found.len()));
            }
            (found, tally)
        };
        let each: Vec<(Vec<Candidate>, CandidateCounts)> = views.into_par_iter().map(one).collect();
        let (mut found, mut tally) = (Vec::new(), CandidateCounts::default());
        for (some, counted) in each {
            found.extend(some);
            tally.add(&counted);
        }
        (found, tally)
    }

    /// A workable pose near another one: the view moved by `size` of its ranges (standard deviation), the arm by as much before the
    /// inverse kinematics (which turns redundant axes), or in another configuration. `None` where the view that was tried is not workable.
    pub fn near(&self, other: &Candidate, size: f64, rng: &mut impl Rng) -> Option<Candidate> {
        let view = other.view.near(size, &self.setting.plate, &self.options.views, rng);
        let start = if rng.random_bool(ANEW) {
            self.random_start(rng)
        } else {
            let shifted = |(q, (low, high)): (&f64, &(f64, f64))| {
                (q + size * (high - low) * rng.sample::<f64, _>(StandardNormal)).clamp(*low, *high)
            };
            other.readings.iter().zip(&self.limits).map(shifted).collect()
        };
        self.workable(view, other.placement, &[start]).0.pop()
    }

    /// Random numbers of one view or pose; streams below 2^32 belong to [`Self::drawn`].
    pub fn rng(&self, stream: u64) -> ChaCha8Rng {
        let mut rng = ChaCha8Rng::seed_from_u64(self.options.seed);
        rng.set_stream(stream);
        rng
    }

    fn random_start(&self, rng: &mut impl Rng) -> Vec<f64> {
        random_readings(&self.limits, &self.setting.robot.chain.reading_kinds, rng)
    }

    /// The poses that bring about a view from these starts, if it is workable: every condition is checked here.
    fn workable(&self, view: Viewpoint, placement: usize, starts: &[Vec<f64>]) -> (Vec<Candidate>, CandidateCounts) {
        let Self { setting, scene, options, limits } = self;
        let mut tally = CandidateCounts { views: 1, ..CandidateCounts::default() };
        let plate_from_camera = view.plate_from_camera();
        let camera_from_plate = plate_from_camera.inverse();
        let seen = seen_markers(&setting.plate, &setting.camera, &camera_from_plate);
        tally.most_markers = seen.len();
        if !options.sight.allow(&setting.plate, &camera_from_plate, &seen) {
            tally.unseen = 1;
            return (Vec::new(), tally);
        }
        let wanted = setting.base_from_tip(&plate_from_camera, placement);
        let mut solutions: Vec<Vec<f64>> = Vec::new();
        for start in starts {
            let Some(q) = solve_from(&setting.robot, limits, &wanted, start) else { continue };
            let inside = q.iter().zip(limits).all(|(q, (l, h))| q >= l && q <= h);
            let known = |s: &Vec<f64>| s.iter().zip(&q).all(|(a, b)| (a - b).abs() < SAME);
            if inside && !solutions.iter().any(known) {
                solutions.push(q);
            }
        }
        tally.out_of_reach = usize::from(solutions.is_empty());
        let before = solutions.len();
        let placed = solutions.into_iter().map(|readings| (scene.at(&readings), readings));
        let free: Vec<_> = placed.filter(|(placed, _)| placed.collision(placement).is_none()).collect();
        tally.colliding = before - free.len();
        let count = free.len();
        let made = free.into_iter().map(|(placed, readings)| Candidate {
            seen: self.unhidden(&placed, (placement, &plate_from_camera), &seen),
            posture: posture(&readings, limits),
            readings,
            placement,
            view,
            camera_from_plate,
        });
        let made = made.filter(|c| options.sight.allow(&setting.plate, &camera_from_plate, &c.seen));
        let made: Vec<Candidate> = made.collect();
        tally.hidden = count - made.len();
        (made, tally)
    }

    /// Those of the markers (indices) before which nothing stands.
    fn unhidden(
        &self,
        placed: &PlacedScene,
        (placement, plate_from_camera): (usize, &Pose),
        seen: &[usize],
    ) -> Vec<usize> {
        let Self { setting, scene, .. } = self;
        let base_from_plate = setting.base_from_plate(plate_from_camera, placement);
        let in_sight = placed.in_sight(base_from_plate.transform(&plate_from_camera.translation));
        // What is no higher above the plate carries it.
        let over_plate = |k: usize| {
            let marker = setting.plate.markers[k].position_m;
            let sight = plate_from_camera.translation - marker;
            marker + sight * (scene.support_m() / sight.z).min(1.0)
        };
        seen.iter().copied().filter(|&k| !in_sight.hides(&base_from_plate.transform(&over_plate(k)))).collect()
    }
}

fn posture(readings: &[f64], limits: &[(f64, f64)]) -> u32 {
    let inner = 1..readings.len().saturating_sub(1).max(1);
    inner.filter(|&k| readings[k] > 0.5 * (limits[k].0 + limits[k].1)).map(|k| 1 << (k % 32)).sum()
}

/// Why there is no candidate at all.
fn impossible(setting: &Setting, scene: &Scene, options: &CandidateOptions, tally: &CandidateCounts) -> Error {
    let sight = &options.sight;
    let markers = setting.plate.markers.len();
    if markers < sight.least_markers {
        let what = format!("every view shall show {} markers, the plate has {markers}", sight.least_markers);
        return Error::new(
            Code::PlanContradiction,
            "plan: --markers",
            what,
            "ask for fewer markers, or give a plate with more",
        );
    }
    if tally.unseen == tally.views {
        let what = format!(
            "no view from {:.2} to {:.2} m shows {} sharp markers at most {:.0} degrees obliquely (most seen in any: {})",
            options.views.near_m,
            options.views.far_m,
            sight.least_markers,
            sight.incidence_rad.to_degrees(),
            tally.most_markers
        );
        let remedy = "allow other distances (--distance-m), fewer markers (--markers), a wider focus (--focus-m), or use a \
                      plate whose markers suit the camera (robotcal plate --focal-px)";
        return Error::new(Code::PlanViewless, "plan: views", what, remedy);
    }
    if tally.out_of_reach + tally.unseen == tally.views {
        return out_of_reach(setting, options, tally.out_of_reach);
    }
    if tally.hidden > tally.colliding {
        return all_hidden(tally);
    }
    all_collide(setting, scene, options, tally)
}

/// None of the `workable` views is in reach of the arm.
fn out_of_reach(setting: &Setting, options: &CandidateOptions, workable: usize) -> Error {
    let chain = &setting.robot.chain;
    let axes = chain.readings.len();
    if axes < 6 {
        let what =
            format!("an arm of {axes} axes cannot take the views that are drawn, which are free in all six directions");
        let remedy = "choose its postures by hand, spread over all joints; identify --dry-run says what they tell";
        return Error::new(Code::PlanOutOfReach, "plan: robot", what, remedy);
    }
    let arm = chain.arm_length_m();
    let Foot { position, name: stands, place } = Foot::of(setting);
    let well = 0.55 * arm;
    let far = |pose: &Pose| (pose.translation - position).norm();
    let (thing, distance, remedy) = match setting.mount {
        CameraMount::Hand => (
            "plate",
            setting.placements.iter().map(|p| far(&p.1)).fold(0.0, f64::max),
            format!(
                "put the plate (--plate-pose) nearer, about {well:.2} m from the {stands}{place} with its face up and towards the robot, \
                 or check --hand-camera"
            ),
        ),
        CameraMount::Fixed => (
            "camera",
            far(&setting.mounting),
            format!(
                "put the camera (--hand-camera) where its view, {:.2} to {:.2} m long, ends about {well:.2} m from the {stands}{place} (its z \
                 looks along the view), allow other distances (--distance-m), or check --plate-pose on the flange",
                options.views.near_m, options.views.far_m
            ),
        ),
    };
    let what = format!(
        "none of {workable} workable views is in reach: the {thing} stands {distance:.2} m from the {stands}, the arm is {arm:.2} m long"
    );
    Error::new(Code::PlanOutOfReach, format!("plan: {thing}"), what, remedy)
}

/// Where the arm stands, for messages.
struct Foot {
    /// In the base frame, m.
    position: Vector3<f64>,
    name: &'static str,
    /// Where it is in the frame of a base that joints carry; empty of one that stands still.
    place: String,
}

impl Foot {
    /// The foot of the arm; where joints carry the base, with these in the middle of their ranges.
    fn of(setting: &Setting) -> Self {
        let chain = &setting.robot.chain;
        let middle: Vec<f64> = reading_limits(chain).iter().map(|(low, high)| 0.5 * (low + high)).collect();
        if let Some(foot) = setting.robot.moving_base_from_foot(&middle) {
            let position = foot.translation;
            let place = format!(
                " (which is at {:.2}, {:.2}, {:.2} m in the frame of \"{}\", in which poses are given, with the joints that carry it in the \
                 middle of their ranges)",
                position.x, position.y, position.z, chain.base
            );
            return Self { position, name: "foot of the arm", place };
        }
        let foot = chain.base_from_foot();
        let name = if foot.is_some() { "foot of the robot" } else { "base" };
        Self { position: foot.map_or_else(Vector3::zeros, |foot| foot.translation), name, place: String::new() }
    }
}

/// Every posture that reaches a workable view touches something, or most of them do and nothing is seen in the others.
fn all_collide(setting: &Setting, scene: &Scene, options: &CandidateOptions, tally: &CandidateCounts) -> Error {
    let example = (0..64).find_map(|k| {
        let mut rng = ChaCha8Rng::seed_from_u64(k);
        let limits = narrowed_limits(setting, options.limit_margin);
        scene.collision(&random_readings(&limits, &setting.robot.chain.reading_kinds, &mut rng), 0)
    });
    let example = example.map_or(String::new(), |e| format!(" (for example {e})"));
    let CandidateCounts { colliding, hidden, .. } = *tally;
    let what = match hidden {
        0 => format!("all {colliding} postures that reach a workable view collide{example}"),
        _ => format!(
            "of {} postures that reach a workable view {colliding} collide{example}, and in {hidden} a box or the arm hides the plate from the camera",
            colliding + hidden
        ),
    };
    let remedy = "check boxes and table (--box, --table-z-m), allow less clearance (--clearance-mm) or thinner links \
                  (--link-radius-mm), or put the plate elsewhere";
    Error { quantities: tally.of_postures(), ..Error::new(Code::PlanCollides, "plan: collisions", what, remedy) }
}

/// In most postures that reach a workable view something stands before the plate, and the others collide.
fn all_hidden(tally: &CandidateCounts) -> Error {
    let CandidateCounts { colliding, hidden, .. } = *tally;
    let what = format!(
        "of {} postures that reach a workable view {colliding} collide, and in {hidden} a box or the arm hides the plate from the camera",
        colliding + hidden
    );
    let remedy = "check the boxes (--box) and where plate and camera are (--plate-pose, --hand-camera), or ask for fewer markers (--markers)";
    Error { quantities: tally.of_postures(), ..Error::new(Code::PlanViewless, "plan: sight", what, remedy) }
}

/// Random postures over the joint ranges that touch nothing: the workspace over which accuracy is meant.
pub fn workspace(setting: &Setting, scene: &Scene, count: usize, limit_margin: f64, seed: u64) -> Vec<Vec<f64>> {
    let limits = narrowed_limits(setting, limit_margin);
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream(u64::MAX);
    let draw = |_| random_readings(&limits, &setting.robot.chain.reading_kinds, &mut rng);
    let free = |q: &Vec<f64>| scene.collision(q, 0).is_none();
    (0..200 * count).map(draw).filter(free).take(count).collect()
}
