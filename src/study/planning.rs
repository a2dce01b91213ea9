//! What planning is worth: planned poses against random ones in simulated worlds, identified end to end.

use nalgebra::{DMatrix, Vector6};
use rand::SeedableRng;
use rand::seq::index::sample;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use rayon::prelude::*;

use super::simulated::measured;
use crate::assess::{Ratio, bootstrap_ratio, flange_error_m, root_of_mean};
use crate::error::{Code, Result};
use crate::geom::Pose;
use crate::identify::{JointNoise, Options, RobotModel, identify};
use crate::model::camera::{Camera, Lens};
use crate::model::joint_terms::TermSizes;
use crate::plan::candidates::{CandidateOptions, candidates, workspace};
use crate::plan::information::flange_weight;
use crate::plan::scene::{Scene, SceneOptions};
use crate::plan::setting::{Beside, Setting, scale_sigma};
use crate::plan::visibility::VisibilityLimits;
use crate::plan::{Budget, Demand, PlanRequest, choose, exact_covariance, flange_m};
use crate::problem::Adjustment;
use crate::series::{CameraMount, Plate, PlateKind, ScaleBar};
use crate::simulate::truth::Truth;
use crate::simulate::{RobotErrors, SimulatedSeries, WorldRequest, series};
use crate::urdf::{Chain, JointKind};

/// What is studied.
#[derive(Debug, Clone, PartialEq)]
pub struct PlanStudyRequest {
    /// The nominal robot.
    pub chain: Chain,
    /// Where the camera is.
    pub mount: CameraMount,
    /// Seed of the first world.
    pub first: u64,
    /// Worlds.
    pub seeds: u64,
    /// Planned images.
    pub planned: usize,
    /// Random images.
    pub random: usize,
    /// Candidates of every plan.
    pub candidates: usize,
    /// Rounds of search for further ones.
    pub rounds: usize,
}

/// One world.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlanStudyRow {
    /// Seed.
    pub seed: u64,
    /// Flange error with the planned images: found and predicted, RMS over held-out joint vectors of the workspace, m.
    pub planned_m: [f64; 2],
    /// The same with the random images.
    pub random_m: [f64; 2],
    /// Error found over held-out views of the plate, planned and random, m.
    pub views_m: [f64; 2],
    /// Certified efficiency of relaxation and whole images.
    pub efficiency: [f64; 2],
}

/// The study.
#[derive(Debug, Clone, PartialEq)]
pub struct PlanStudy {
    /// Worlds in which both series could be identified.
    pub rows: Vec<PlanStudyRow>,
    /// Seeds of the others, with the reason.
    pub failed: Vec<(u64, String)>,
    /// Error of the planned over the random images, with bootstrap interval over the worlds.
    pub planned_to_random: Option<Ratio>,
}

/// Standard deviation of a marker, believed and true, m: a plate that a measuring machine has measured.
const MARKER_SIGMA_M: f64 = 0.003e-3;
/// Standard deviation of the distance of its outermost markers, m.
const BAR_SIGMA_M: f64 = 0.002e-3;
/// Held-out joint vectors of the workspace, and the first seed of their draw (those of plans are small).
const HELD_OUT: usize = 150;
const HELD_OUT_SEED: u64 = 1_000_000;
/// First seeds of the random poses and of the held-out ones that see the plate, and how many are drawn for each of them.
const RANDOM_SEED: u64 = 2_000_000;
const VIEWS_SEED: u64 = 3_000_000;
const DRAWN_PER_RANDOM: usize = 4;
/// Noise of an observation, px.
const PIXEL_SIGMA_PX: f64 = 0.05;
/// Joint noise, rad.
const JOINT_SIGMA_RAD: f64 = 0.03e-3;
/// How well the user knows where camera and plate are: m and rad per axis.
const ROUGH: (f64, f64) = (5e-3, 0.01);

impl PlanStudy {
    /// RMS over the worlds of the error found over views of the plate: planned, random, m.
    pub fn views_m(&self) -> [f64; 2] {
        [0, 1].map(|k| root_of_mean(self.rows.iter().map(|r| r.views_m[k].powi(2))))
    }

    /// RMS over the worlds of (planned found, planned predicted, random found, random predicted), m.
    pub fn overall_m(&self) -> [f64; 4] {
        let rms = |of: fn(&PlanStudyRow) -> f64| root_of_mean(self.rows.iter().map(|r| of(r).powi(2)));
        [rms(|r| r.planned_m[0]), rms(|r| r.planned_m[1]), rms(|r| r.random_m[0]), rms(|r| r.random_m[1])]
    }
}

/// A plate of 96 points, 0.33 m by 0.21 m.
fn plate() -> Plate {
    let mut plate = Plate::lattice(PlateKind::Points, 12, 8, 0.03, MARKER_SIGMA_M);
    plate.markers.iter_mut().for_each(|m| m.sigma_m = MARKER_SIGMA_M);
    let [a, b] = [0, plate.markers.len() - 1].map(|k| plate.markers[k]);
    let distance_m = (a.position_m - b.position_m).norm();
    plate.scale = Some(ScaleBar { from: a.id, to: b.id, distance_m, sigma_m: BAR_SIGMA_M });
    plate
}

/// Runs the study.
///
/// The robot's errors are drawn from the priors of the fit (origins 1 mm and 2 mrad, offsets 10 mrad), the scale of the plate
/// from its prior: so a prediction that is right agrees with the errors found, over many worlds. Camera, hand-eye transform and
/// plate pose are known to the planner only roughly (5 mm, 10 mrad, no distortion).
///
/// # Errors
/// Where no world can be made at all.
pub fn plan_study(request: &PlanStudyRequest, progress: impl Fn(u64) + Sync) -> Result<PlanStudy> {
    let all: Vec<(u64, Result<PlanStudyRow>)> = (request.first..request.first + request.seeds)
        .into_par_iter()
        .map(|seed| {
            let row = one_world(request, seed);
            progress(seed);
            (seed, row)
        })
        .collect();
    let (mut rows, mut failed) = (Vec::new(), Vec::new());
    for (seed, row) in all {
        match row {
            Ok(row) => rows.push(row),
            Err(e) => failed.push((seed, e.to_string())),
        }
    }
    let squares = |of: fn(&PlanStudyRow) -> f64| rows.iter().map(|r| (of(r).powi(2), 1.0)).collect::<Vec<_>>();
    let planned_to_random = bootstrap_ratio(&squares(|r| r.planned_m[0]), &squares(|r| r.random_m[0]));
    Ok(PlanStudy { rows, failed, planned_to_random })
}

fn world_request(request: &PlanStudyRequest, plate: Plate, seed: u64) -> WorldRequest {
    let mut world = WorldRequest::typical(request.chain.clone(), plate);
    world.errors = RobotErrors { terms: TermSizes::of_priors(RobotModel::Rigid), ..RobotErrors::of_priors() };
    world.mount = request.mount;
    world.joint_noise_rad = JOINT_SIGMA_RAD;
    world.pixel_sigma_px = PIXEL_SIGMA_PX;
    world.marker_sigma_m = MARKER_SIGMA_M;
    world.views.near_m = 0.2;
    world.seed = seed;
    world
}

/// The cell as the user knows it before the first image.
fn roughly_known(
    request: &PlanStudyRequest,
    truth: &Truth,
    plate: Plate,
    mut rough: impl FnMut() -> Vector6<f64>,
) -> Setting {
    let [width_px, height_px] = [truth.camera.width_px, truth.camera.height_px];
    Setting {
        robot: RobotModel::Rigid.robot(request.chain.clone()),
        camera: Camera::pinhole(Lens::Brown, width_px, height_px, truth.camera.parameters[0].round()),
        mount: request.mount,
        mounting: truth.camera_pose.pose().perturbed(&rough()),
        placements: truth.plate_poses.iter().map(|(n, p)| (n.clone(), p.pose().perturbed(&rough()))).collect(),
        plate,
        pixel_sigma_px: PIXEL_SIGMA_PX,
        joint_sigma: joint_sigma(&request.chain),
        beside: Beside::default(),
    }
}

/// A plan of images as the world takes them.
fn plan_request(request: &PlanStudyRequest, world: &WorldRequest, setting: Setting) -> PlanRequest {
    PlanRequest {
        setting,
        taken: Vec::new(),
        count: request.planned,
        demand: Demand::Workspace,
        budget: Budget::default(),
        candidates: CandidateOptions {
            count: request.candidates,
            views: world.views,
            sight: VisibilityLimits { least_markers: world.least_markers, ..VisibilityLimits::default() },
            seed: world.seed,
            ..CandidateOptions::default()
        },
        rounds: request.rounds,
        scene: SceneOptions::default(),
    }
}

fn one_world(request: &PlanStudyRequest, seed: u64) -> Result<PlanStudyRow> {
    let mut rng = ChaCha8Rng::seed_from_u64(1000 + seed);
    let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
    let believed = plate();
    let scale = 1.0 + normal() * scale_sigma(&believed).unwrap_or(0.0);
    let mut printed = believed.clone();
    printed.markers.iter_mut().for_each(|m| m.position_m *= scale);
    let mut wanted = world_request(request, printed, seed);
    wanted.images = 1;
    let world = series(&wanted)?;
    let truth = &world.truth;
    let rough = || Vector6::from_fn(|k, _| normal() * if k < 3 { ROUGH.0 } else { ROUGH.1 });
    let chosen = plan_request(request, &wanted, roughly_known(request, truth, believed.clone(), rough));
    let choice = choose(&chosen)?;
    let scene = Scene::new(&chosen.setting, &chosen.scene);
    let mut visited = |postures: Vec<Vec<f64>>| -> Result<SimulatedSeries> {
        wanted.images = postures.len();
        wanted.postures = Some(postures);
        Ok(SimulatedSeries { plate: believed.clone(), ..series(&wanted)? })
    };
    let planned = visited(choice.chosen.iter().map(|&k| choice.pool[k].readings.clone()).collect())?;
    let random = visited(random_postures(&chosen, &scene, request.random, RANDOM_SEED + seed)?)?;
    let held_out = workspace(&chosen.setting, &scene, HELD_OUT, 0.0, HELD_OUT_SEED + seed);
    let weight = flange_weight(&choice.adjustment.problem, &chosen.setting.robot, &held_out);
    let predicted = |visits: &[Vec<f64>]| predict(&chosen, &choice.adjustment, visits, &weight);
    let kinds = &request.chain;
    let visits = |s: &SimulatedSeries| -> Vec<Vec<f64>> {
        measured(s, kinds).stops.into_iter().filter_map(|s| s.readings).collect()
    };
    let actual = truth.robot(&request.chain)?;
    let found_at = |all: Vec<Vec<f64>>| -> Vec<(Vec<f64>, Pose)> {
        all.into_iter().map(|q| (q.clone(), actual.base_from_tip(&q))).collect()
    };
    let in_workspace = found_at(held_out);
    let at_plate = found_at(random_postures(&chosen, &scene, HELD_OUT, VIEWS_SEED + seed)?);
    let [planned_found, random_found] = [&planned, &random].map(|s| found(request, s, [&in_workspace, &at_plate]));
    let (planned_found, random_found) = (planned_found?, random_found?);
    Ok(PlanStudyRow {
        seed,
        planned_m: [planned_found[0], predicted(&visits(&planned))?],
        random_m: [random_found[0], predicted(&visits(&random))?],
        views_m: [planned_found[1], random_found[1]],
        efficiency: choice.efficiency,
    })
}

/// Workable poses as they come: by the conditions of the plan, of views of their own.
fn random_postures(plan: &PlanRequest, scene: &Scene, count: usize, seed: u64) -> Result<Vec<Vec<f64>>> {
    let options = CandidateOptions { count: DRAWN_PER_RANDOM * count, seed, ..plan.candidates.clone() };
    let (drawn, _) = candidates(&plan.setting, scene, &options)?;
    let taken = sample(&mut ChaCha8Rng::seed_from_u64(seed), drawn.len(), count.min(drawn.len()));
    Ok(taken.iter().map(|k| drawn[k].readings.clone()).collect())
}

fn joint_sigma(chain: &Chain) -> Vec<f64> {
    let one = |kind: &JointKind| if *kind == JointKind::Prismatic { 0.1 * JOINT_SIGMA_RAD } else { JOINT_SIGMA_RAD };
    chain.reading_kinds.iter().map(one).collect()
}

fn predict(request: &PlanRequest, planned: &Adjustment, visits: &[Vec<f64>], weight: &DMatrix<f64>) -> Result<f64> {
    let setting = &request.setting;
    let stops = visits.iter().filter_map(|q| setting.stop(&planned.state, "", q, 0)).collect();
    Ok(flange_m(weight, &exact_covariance(planned, setting, stops)?))
}

/// Flange errors after the whole identification of a series, over two sets of joint vectors.
fn found(request: &PlanStudyRequest, series: &SimulatedSeries, sets: [&[(Vec<f64>, Pose)]; 2]) -> Result<[f64; 2]> {
    let options = Options { joint_noise: JointNoise::Estimated, model: RobotModel::Rigid, ..Options::default() };
    let solution = identify(request.chain.clone(), &[measured(series, &request.chain)], &options)?;
    // The frame in which the flange is measured is fitted: any will do.
    let [a, b] = sets.map(|poses| flange_error_m(&solution.fit.state.robot, &Pose::identity(), poses));
    a.zip(b).map(|(a, b)| [a, b]).ok_or_else(|| {
        crate::error::Error::new(
            Code::PlanUndetermined,
            "study",
            "the held-out joint vectors determine no error",
            "take more of them",
        )
    })
}
