//! Where a joint fit beats two stages: simulated series over the ratio of the robot's repeatability to the error of a camera
//! pose, and over the number of markers in an image.

use rayon::prelude::*;

use super::simulated::measured;
use crate::assess::{Limits, Ratio, bootstrap_ratio, root_mean_square};
use crate::error::{Code, Error, Result};
use crate::geom::{Pose, adjoint};
use crate::identify::{Estimator, PoseStage, RobotModel, TruthError, build, estimate_all, truth_error};
use crate::linalg::median;
use crate::problem::{Adjustment, TakenFrom, Tie};
use crate::series::{Plate, PlateKind};
use crate::simulate::{SimulatedSeries, WorldRequest, series};
use crate::urdf::Chain;

/// What is studied.
#[derive(Debug, Clone, PartialEq)]
pub struct StudyRequest {
    /// The nominal robot.
    pub chain: Chain,
    /// Worlds in every cell.
    pub seeds: u64,
    /// Images of a series.
    pub images: usize,
    /// Repeatability at the camera over the error of a camera pose.
    pub ratios: Vec<f64>,
    /// Markers on the plate, nearly all in every image.
    pub markers: Vec<(u32, u32)>,
    /// Noise of an observation, px per axis.
    pub pixel_sigma_px: f64,
}

impl StudyRequest {
    /// The study of the report: six ratios by four plates, 30 seeds, 25 images.
    pub fn full(chain: Chain) -> Self {
        Self {
            chain,
            seeds: 30,
            images: 25,
            ratios: vec![0.0, 0.1, 0.3, 1.0, 3.0, 10.0],
            markers: vec![(5, 4), (10, 5), (20, 10), (25, 20)],
            pixel_sigma_px: 0.05,
        }
    }
}

/// One cell of the study.
#[derive(Debug, Clone, PartialEq)]
pub struct StudyCell {
    /// Repeatability over pose error.
    pub ratio: f64,
    /// Markers on the plate.
    pub markers: u32,
    /// Sigma of the joint noise, rad.
    pub joint_noise_rad: f64,
    /// Sigma of the position of a free camera pose, mm per axis (median over images).
    pub pose_sigma_mm: f64,
    /// Worlds in which all estimators had a solution.
    pub worlds: usize,
    /// Worlds in which an estimator had none.
    pub failed: [usize; 6],
    /// RMS over the worlds of the flange error (gauge aligned), mm, of A to F.
    pub flange_mm: [f64; 6],
    /// RMS over the worlds of the error of the camera in the plate frame, mm.
    pub camera_mm: [f64; 6],
    /// Flange error over that of F, with bootstrap interval over worlds.
    pub to_joint: [Option<Ratio>; 6],
}

impl StudyCell {
    /// F over the best of all.
    pub fn joint_over_best(&self) -> f64 {
        self.flange_mm[5] / self.flange_mm.iter().copied().fold(f64::INFINITY, f64::min)
    }
}

/// The study.
#[derive(Debug, Clone, PartialEq)]
pub struct Study {
    /// What was asked for.
    pub request: StudyRequest,
    /// Cells, ratios within markers.
    pub cells: Vec<StudyCell>,
}

/// Size of the plate, m.
const PLATE_M: [f64; 2] = [0.30, 0.24];

/// How far a marker may be from nominal, and is.
const MARKER_SIGMA_M: f64 = 0.05e-3;

/// Share of the markers that every image shows at least.
const LEAST_SHARE: f64 = 0.9;

/// Runs the study; `progress` is called with the number of cells done and the number of all.
///
/// Every estimator starts from the true camera and poses with the nominal robot: which optimum is found is not the question here.
///
/// # Errors
/// Where the robot cannot bring the plate into view.
pub fn study(request: &StudyRequest, progress: impl Fn(usize, usize)) -> Result<Study> {
    let total = request.markers.len() * request.ratios.len();
    let mut cells = Vec::with_capacity(total);
    for &lattice in &request.markers {
        let scale = reference(request, lattice)?;
        for &ratio in &request.ratios {
            cells.push(cell(request, lattice, ratio, scale)?);
            progress(cells.len(), total);
        }
    }
    Ok(Study { request: request.clone(), cells })
}

fn world(
    request: &StudyRequest,
    (columns, rows): (u32, u32),
    joint_noise_rad: f64,
    seed: u64,
) -> Result<SimulatedSeries> {
    let gaps = |n: u32| f64::from(n.max(2) - 1);
    let pitch = (PLATE_M[0] / gaps(columns)).min(PLATE_M[1] / gaps(rows));
    let plate = Plate::lattice(PlateKind::Points, columns, rows, pitch, MARKER_SIGMA_M);
    let mut wanted = WorldRequest::typical(request.chain.clone(), plate);
    wanted.views.near_m = 0.4;
    wanted.views.far_m = 0.6;
    wanted.views.tilt_rad = 40_f64.to_radians();
    wanted.views.spread = 0.2;
    wanted.views.aside_rad = 0.05;
    wanted.images = request.images;
    wanted.joint_noise_rad = joint_noise_rad;
    wanted.pixel_sigma_px = request.pixel_sigma_px;
    wanted.marker_sigma_m = MARKER_SIGMA_M;
    wanted.least_markers = (LEAST_SHARE * f64::from(columns * rows)) as usize;
    wanted.held_out = 60;
    wanted.seed = seed;
    series(&wanted)
}

/// The problem of a world, started at the true camera and poses with the nominal robot.
fn started(request: &StudyRequest, world: &SimulatedSeries) -> Result<Adjustment> {
    let robot = RobotModel::Rigid.robot(request.chain.clone());
    let mut start = build(&robot, &[measured(world, &request.chain)], true, &Limits::default())?;
    let state = &mut start.state;
    state.cameras = vec![world.truth.camera.clone()];
    state.mountings = vec![world.truth.camera_pose.pose()];
    state.placements = world.truth.plate_poses.values().map(|p| p.pose()).collect();
    state.ties = world.truth.stops.iter().map(|s| Tie::Free(s.camera_from_plate.pose())).collect();
    Ok(start)
}

/// Position sigma of a free pose (m), and position sigma of the camera per rad of joint noise (m), medians over images.
#[derive(Debug, Clone, Copy)]
struct Scale {
    pose_m: f64,
    lever_m: f64,
}

fn reference(request: &StudyRequest, lattice: (u32, u32)) -> Result<Scale> {
    let unsolved = || {
        Error::new(
            Code::NotConverged,
            "study",
            "the free poses of the reference world do not converge",
            "take more markers",
        )
    };
    let start = started(request, &world(request, lattice, 0.0, 1)?)?;
    let Adjustment { problem, state } = &start;
    let stage = PoseStage::adjusted(&start).ok_or_else(unsolved)?;
    let exact = vec![0.0; request.chain.readings.len()];
    let (mut poses, mut levers) = (Vec::new(), Vec::new());
    for (k, &i) in stage.images.iter().enumerate() {
        let Some(posture) = problem.posture(i) else { continue };
        let from = TakenFrom::rigid(posture, &exact);
        let Some(chain) = state.chained(&problem.layout, &problem.images[i], from) else { continue };
        let position = |pose: &Pose, c: &nalgebra::Matrix6<f64>| {
            let ad = adjoint(pose);
            let turned = ad * c * ad.transpose();
            ((0..3).map(|a| turned[(a, a)]).sum::<f64>() / 3.0).sqrt()
        };
        poses.push(position(&stage.references[k], &stage.blocks[k]));
        let by_latents = &chain.d_latent * chain.d_latent.transpose();
        let by_latents = nalgebra::Matrix6::from_column_slice(by_latents.as_slice());
        levers.push(position(&chain.pose, &by_latents));
    }
    Ok(Scale { pose_m: median(&poses).ok_or_else(unsolved)?, lever_m: median(&levers).ok_or_else(unsolved)? })
}

fn cell(request: &StudyRequest, lattice: (u32, u32), ratio: f64, scale: Scale) -> Result<StudyCell> {
    let joint_noise_rad = ratio * scale.pose_m / scale.lever_m;
    let all: Vec<[Option<TruthError>; 6]> = (1..=request.seeds)
        .into_par_iter()
        .map(|seed| {
            let world = world(request, lattice, joint_noise_rad, seed)?;
            let start = started(request, &world)?;
            let mut errors = [None; 6];
            for (slot, (_, estimate)) in errors.iter_mut().zip(estimate_all(&start)) {
                *slot = match estimate {
                    Some(e) => truth_error(&e.state, &world.truth)?,
                    None => None,
                };
            }
            Ok(errors)
        })
        .collect::<Result<_>>()?;
    let failed = std::array::from_fn(|k| all.iter().filter(|e| e[k].is_none()).count());
    let solved: Vec<[TruthError; 6]> = all.iter().filter_map(complete).collect();
    let units = |k: usize, of: fn(&TruthError) -> f64| -> Vec<(f64, f64)> {
        solved.iter().map(|e| (of(&e[k]).powi(2), 1.0)).collect()
    };
    let flange = |k: usize| units(k, |e| e.flange_mm);
    let joint = flange(Estimator::ALL.len() - 1);
    Ok(StudyCell {
        ratio,
        markers: lattice.0 * lattice.1,
        joint_noise_rad,
        pose_sigma_mm: 1e3 * scale.pose_m,
        worlds: solved.len(),
        failed,
        flange_mm: std::array::from_fn(|k| root_mean_square(&flange(k))),
        camera_mm: std::array::from_fn(|k| root_mean_square(&units(k, |e| e.camera_mm))),
        to_joint: std::array::from_fn(|k| bootstrap_ratio(&flange(k), &joint)),
    })
}

fn complete(errors: &[Option<TruthError>; 6]) -> Option<[TruthError; 6]> {
    let mut whole = [TruthError { flange_mm: 0.0, camera_mm: 0.0 }; 6];
    for (slot, e) in whole.iter_mut().zip(errors) {
        *slot = (*e)?;
    }
    Some(whole)
}
