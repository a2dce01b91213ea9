//! Workable poses: views of the plate that the robot reaches inside its limits, sees enough in, and can stand in.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use super::inverse::{random_readings, reading_limits, solve_from};
use super::scene::{Scene, arm_length_m};
use super::setting::Setting;
use super::viewpoint::{ViewRange, random_view};
use super::visibility::{SightLimits, seen_markers};
use crate::error::{Error, Result};
use crate::geom::Pose;

/// A pose that could be planned.
#[derive(Debug, Clone, PartialEq)]
pub struct Candidate {
    /// Readings, rad or m.
    pub readings: Vec<f64>,
    /// Where the plate stands.
    pub placement: usize,
    /// The camera.
    pub camera_from_plate: Pose,
    /// Markers seen.
    pub markers: usize,
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
    pub sight: SightLimits,
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
            sight: SightLimits::default(),
            limit_margin: 0.02,
            seed: 1,
        }
    }
}

/// Why views fell out.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Tally {
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
}

impl Tally {
    fn add(&mut self, other: &Self) {
        self.views += other.views;
        self.unseen += other.unseen;
        self.most_markers = self.most_markers.max(other.most_markers);
        self.out_of_reach += other.out_of_reach;
        self.colliding += other.colliding;
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
/// Views tried for each candidate wanted before the search ends.
const VIEWS_PER_CANDIDATE: usize = 12;

/// Joint limits with a margin.
pub fn narrowed_limits(setting: &Setting, margin: f64) -> Vec<(f64, f64)> {
    let limits = reading_limits(&setting.robot.chain);
    limits.iter().map(|&(l, h)| if h - l > 4.0 * margin { (l + margin, h - margin) } else { (l, h) }).collect()
}

/// Workable poses, spread over all placements; the same options give the same poses with any number of threads.
///
/// # Errors
/// Where there are none: which condition excludes them, and what to change.
pub fn candidates(setting: &Setting, scene: &Scene, options: &CandidateOptions) -> Result<(Vec<Candidate>, Tally)> {
    let limits = narrowed_limits(setting, options.limit_margin);
    let (mut found, mut tally) = (Vec::new(), Tally::default());
    let mut first = 0;
    while found.len() < options.count && first < VIEWS_PER_CANDIDATE * options.count {
        let round: Vec<(Vec<Candidate>, Tally)> =
            (first..first + ROUND).into_par_iter().map(|k| one_view(setting, scene, options, &limits, k)).collect();
        for (some, counted) in round {
            found.extend(some);
            tally.add(&counted);
        }
        first += ROUND;
    }
    found.truncate(options.count);
    if found.is_empty() { Err(impossible(setting, scene, options, &tally)) } else { Ok((found, tally)) }
}

fn one_view(
    setting: &Setting,
    scene: &Scene,
    options: &CandidateOptions,
    limits: &[(f64, f64)],
    index: usize,
) -> (Vec<Candidate>, Tally) {
    let mut rng = ChaCha8Rng::seed_from_u64(options.seed);
    rng.set_stream(index as u64);
    let mut tally = Tally { views: 1, ..Tally::default() };
    let placement = index % setting.placements.len();
    let view = random_view(&setting.plate, &options.views, &mut rng);
    let camera_from_plate = view.inverse();
    let seen = seen_markers(&setting.plate, &setting.camera, &camera_from_plate);
    tally.most_markers = seen.len();
    if !options.sight.allow(&setting.plate, &camera_from_plate, &seen) {
        tally.unseen = 1;
        return (Vec::new(), tally);
    }
    let wanted = setting.base_from_tip(&view, placement);
    let mut solutions: Vec<Vec<f64>> = Vec::new();
    for _ in 0..STARTS {
        let start = random_readings(limits, &setting.robot.chain.reading_kinds, &mut rng);
        let Some(q) = solve_from(&setting.robot, limits, &wanted, &start) else { continue };
        let inside = q.iter().zip(limits).all(|(q, (l, h))| q >= l && q <= h);
        let known = |s: &Vec<f64>| s.iter().zip(&q).all(|(a, b)| (a - b).abs() < SAME);
        if inside && !solutions.iter().any(known) {
            solutions.push(q);
        }
    }
    tally.out_of_reach = usize::from(solutions.is_empty());
    let before = solutions.len();
    solutions.retain(|q| scene.collision(q, placement).is_none());
    tally.colliding = before - solutions.len();
    while solutions.len() > CONFIGURATIONS {
        solutions.swap_remove(rng.random_range(0..solutions.len()));
    }
    let made = solutions.into_iter().map(|readings| Candidate {
        posture: posture(&readings, limits),
        readings,
        placement,
        camera_from_plate,
        markers: seen.len(),
    });
    (made.collect(), tally)
}

fn posture(readings: &[f64], limits: &[(f64, f64)]) -> u32 {
    let inner = 1..readings.len().saturating_sub(1).max(1);
    inner.filter(|&k| readings[k] > 0.5 * (limits[k].0 + limits[k].1)).map(|k| 1 << (k % 32)).sum()
}

/// Why there is no candidate at all.
fn impossible(setting: &Setting, scene: &Scene, options: &CandidateOptions, tally: &Tally) -> Error {
    let sight = &options.sight;
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
        return Error::unsolved("plan: views", what, remedy);
    }
    let arm = arm_length_m(&setting.robot);
    if tally.out_of_reach + tally.unseen == tally.views {
        let farthest = setting.placements.iter().map(|p| p.1.translation.norm()).fold(0.0, f64::max);
        let what = format!(
            "none of {} workable views is in reach: the plate stands {farthest:.2} m from the base, the arm is {arm:.2} m long",
            tally.out_of_reach
        );
        let remedy = format!(
            "put the plate (--plate-pose) nearer, about {:.2} m from the base with its face up and towards the robot, \
             or check --hand-camera",
            0.55 * arm
        );
        return Error::unsolved("plan: plate", what, remedy);
    }
    let example = (0..64).find_map(|k| {
        let mut rng = ChaCha8Rng::seed_from_u64(k);
        let limits = narrowed_limits(setting, options.limit_margin);
        scene.collision(&random_readings(&limits, &setting.robot.chain.reading_kinds, &mut rng), 0)
    });
    let what = format!(
        "all {} postures that reach a workable view collide{}",
        tally.colliding,
        example.map_or(String::new(), |e| format!(" (for example {e})"))
    );
    let remedy = "check boxes and table (--box, --table-z-m), allow less clearance (--clearance-mm) or thinner links \
                  (--link-radius-mm), or put the plate elsewhere";
    Error::unsolved("plan: collisions", what, remedy)
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
