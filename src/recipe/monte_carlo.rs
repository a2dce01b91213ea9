//! Are the stated uncertainties true? Worlds whose errors are drawn from the priors, identified from nothing, and the errors of
//! the estimates in units of their stated covariance.
//!
//! The normalised squared error `e' C^-1 e` of a block of `n` parameters has the mean `n`. Over `N` worlds the mean of
//! `e' C^-1 e / n` lies within `1 +- 2.576 sqrt(2 / (n N))` with a probability of 99 %.

use nalgebra::{DMatrix, DVector, Matrix6, Vector6};
use rayon::prelude::*;

use super::evidence::identify;
use super::joint::{Options, RobotModel};
use super::simulated::measured;
use super::solution::Solution;
use crate::error::Result;
use crate::geom::Pose;
use crate::linalg::SymmetricFactor;
use crate::model::robot::Stop;
use crate::problem::{Slack, chained};
use crate::series::{Plate, PlateKind};
use crate::simulate::{RobotErrors, SimulatedSeries, WorldRequest, series};
use crate::solve::joint_noise_sigmas;
use crate::urdf::{Chain, JointKind};

/// What is tried.
#[derive(Debug, Clone, PartialEq)]
pub struct MonteCarloRequest {
    /// The nominal robot; without fixed joints, whose errors belong to the hand-camera offset.
    pub chain: Chain,
    /// Worlds for each joint noise.
    pub seeds: u64,
    /// Images of a series.
    pub images: usize,
    /// Joint noise, rad.
    pub joint_noise_rad: Vec<f64>,
}

/// Blocks of parameters that are judged.
pub const BLOCKS: [&str; 6] = ["robot", "camera", "hand-camera", "plate", "free pose", "flange"];

/// Normalised squared error of one block over all worlds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BlockResult {
    /// Mean of `e' C^-1 e / n`.
    pub mean: f64,
    /// Half the width of the 99 % interval about 1.
    pub half_width: f64,
}

impl BlockResult {
    /// True where the mean is what the stated covariance promises.
    pub fn holds(&self) -> bool {
        (self.mean - 1.0).abs() <= self.half_width
    }
}

/// One joint noise.
#[derive(Debug, Clone, PartialEq)]
pub struct MonteCarloCell {
    /// Put in, rad.
    pub joint_noise_rad: f64,
    /// Worlds identified.
    pub worlds: usize,
    /// Worlds without a solution.
    pub failed: usize,
    /// In the order of [`BLOCKS`].
    pub blocks: [BlockResult; 6],
    /// Joint noise found, RMS over the joints, mean over the worlds, rad.
    pub found_rad: f64,
    /// Its standard deviation over the worlds, rad.
    pub found_spread_rad: f64,
    /// Its standard deviation as the program states it, mean over the worlds, rad.
    pub stated_spread_rad: f64,
}

/// Size of a marker, m; how far it may be from nominal, and is; noise of an observation, px.
const RADIUS_M: f64 = 0.01;
const MARKER_SIGMA_M: f64 = 0.1e-3;
const PIXEL_SIGMA_PX: f64 = 0.05;

/// Runs all worlds; `progress` is called with the number of cells done and of all.
///
/// # Errors
/// Where the robot cannot bring the plate into view.
pub fn monte_carlo(request: &MonteCarloRequest, progress: impl Fn(usize, usize)) -> Result<Vec<MonteCarloCell>> {
    let mut cells = Vec::new();
    for &noise in &request.joint_noise_rad {
        let worlds: Vec<Option<World>> =
            (1..=request.seeds).into_par_iter().map(|seed| world(request, noise, seed)).collect::<Result<_>>()?;
        cells.push(cell(noise, &worlds));
        progress(cells.len(), request.joint_noise_rad.len());
    }
    Ok(cells)
}

/// Errors that the estimator's own priors describe.
fn errors_of_the_priors() -> RobotErrors {
    RobotErrors {
        translation_m: 1e-3,
        rotation_rad: 2e-3,
        offset_rad: 10e-3,
        gear: 5e-4,
        harmonic_rad: 0.1e-3,
        gravity_rad: 0.3e-3,
        backlash_rad: 0.3e-3,
    }
}

/// Squared normalised errors and dimensions of the blocks in one world; joint noise found and its stated sigma.
#[derive(Debug, Clone, Copy)]
struct World {
    squared: [(f64, usize); 6],
    found: f64,
    stated: f64,
}

fn world(request: &MonteCarloRequest, joint_noise_rad: f64, seed: u64) -> Result<Option<World>> {
    let mut plate = Plate::lattice(PlateKind::Points, 8, 6, 0.038, MARKER_SIGMA_M);
    plate.markers.iter_mut().for_each(|m| m.outer_radius_m = RADIUS_M);
    let wanted = WorldRequest {
        images: request.images,
        errors: errors_of_the_priors(),
        joint_noise_rad,
        pixel_sigma_px: PIXEL_SIGMA_PX,
        marker_sigma_m: MARKER_SIGMA_M,
        plate_modes: true,
        least_markers: 12,
        held_out: 1,
        seed,
        ..WorldRequest::typical(request.chain.clone(), plate)
    };
    let simulated = series(&wanted)?;
    let options = Options { model: RobotModel::Full, ..Options::default() };
    let Ok(solution) = identify(request.chain.clone(), &[measured(&simulated, &request.chain)], &options) else {
        return Ok(None);
    };
    judged(&solution, &simulated, &request.chain)
}

fn judged(s: &Solution, world: &SimulatedSeries, chain: &Chain) -> Result<Option<World>> {
    let truth = world.truth.robot(chain)?;
    let blocks = [
        robot_error(s, &truth),
        camera_error(s, world),
        mounting_error(s, world),
        plate_error(s, world),
        free_pose_error(s, world),
        flange_error(s, world, &truth),
    ];
    let mut squared = [(0.0, 0); 6];
    for (slot, block) in squared.iter_mut().zip(blocks) {
        let Some(found) = block.and_then(|(e, c)| normalised(&e, &c)) else { return Ok(None) };
        *slot = found;
    }
    let noise = s.problem.joint_sigma(0);
    let sigmas = joint_noise_sigmas(&s.problem, &s.state, &s.linearised, &s.covariance);
    let n = noise.len() as f64;
    let found = (noise.iter().map(|v| v * v).sum::<f64>() / n).sqrt();
    // Each joint's sigma moves the RMS by sigma_i / (n rms).
    let stated = (noise.iter().zip(&sigmas[0]).map(|(v, s)| (v * s / (n * found)).powi(2)).sum::<f64>()).sqrt();
    Ok(Some(World { squared, found, stated }))
}

type ErrorWithCovariance = Option<(DVector<f64>, DMatrix<f64>)>;

fn normalised(error: &DVector<f64>, covariance: &DMatrix<f64>) -> Option<(f64, usize)> {
    let factor = SymmetricFactor::new(covariance).ok()?;
    Some((error.dot(&factor.solve(error)), error.len()))
}

fn robot_error(s: &Solution, truth: &crate::model::robot::Robot) -> ErrorWithCovariance {
    let layout = &s.problem.layout;
    let estimates = s.state.values(layout);
    let mut columns = Vec::new();
    for (k, joint) in truth.chain.joints.iter().enumerate().filter(|(_, j)| j.kind != JointKind::Fixed) {
        debug_assert!(joint.drive.is_some());
        for a in 0..6 {
            columns.push((layout.twists.start + 6 * k + a, truth.twists[k][a]));
        }
    }
    for (k, t) in s.state.robot.terms.iter().enumerate().take(layout.locals.start - layout.terms.start) {
        let value = truth.terms.iter().find(|u| (u.reading, u.term) == (t.reading, t.term)).map_or(0.0, |u| u.value);
        columns.push((layout.terms.start + k, value));
    }
    let error = DVector::from_iterator(columns.len(), columns.iter().map(|&(c, value)| estimates[c] - value));
    let reduced = &s.covariance.reduced;
    let covariance = DMatrix::from_fn(columns.len(), columns.len(), |i, j| reduced[(columns[i].0, columns[j].0)]);
    Some((error, covariance))
}

fn camera_error(s: &Solution, world: &SimulatedSeries) -> ErrorWithCovariance {
    let columns = s.problem.layout.cameras[0].clone();
    let off = s.state.cameras[0].parameters.iter().zip(&world.truth.camera.parameters).map(|(a, b)| a - b);
    let covariance = s.covariance.reduced.view((columns.start, columns.start), (columns.len(), columns.len()));
    Some((DVector::from_iterator(columns.len(), off), covariance.into_owned()))
}

fn pose_error(estimate: &Pose, truth: &Pose, covariance: &Matrix6<f64>) -> ErrorWithCovariance {
    let error = (truth.inverse() * *estimate).log();
    Some((DVector::from_column_slice(error.as_slice()), DMatrix::from_column_slice(6, 6, covariance.as_slice())))
}

fn mounting_error(s: &Solution, world: &SimulatedSeries) -> ErrorWithCovariance {
    let block = s.covariance.block(s.problem.layout.mountings[0].start);
    pose_error(&s.state.mountings[0], &world.truth.camera_pose.pose(), &block)
}

fn plate_error(s: &Solution, world: &SimulatedSeries) -> ErrorWithCovariance {
    let block = s.covariance.block(s.problem.layout.placements[0].start);
    pose_error(&s.state.placements[0], &world.truth.plate_poses.values().next()?.pose(), &block)
}

/// The free-pose adjustment states `camera_from_plate` for the plate frame of its priors, as the truth does.
fn free_pose_error(s: &Solution, world: &SimulatedSeries) -> ErrorWithCovariance {
    let k = s.free_poses.poses.iter().position(Option::is_some)?;
    let free = s.free_poses.poses[k].as_ref()?;
    pose_error(&free.camera_from_plate, &world.truth.stops[k].camera_from_plate.pose(), &free.covariance)
}

/// The flange in the plate frame at a joint vector that was not measured: the camera of the solution, as if it were exact, on
/// the robot and plate of the solution against the same camera on the true ones.
fn flange_error(s: &Solution, world: &SimulatedSeries, truth: &crate::model::robot::Robot) -> ErrorWithCovariance {
    let mut image = s.problem.images.iter().find(|i| i.stop.is_some())?.clone();
    let readings = &world.truth.held_out.first()?.readings;
    image.stop = Some(Stop::at(readings));
    let exact = Slack::exact(readings.len(), false);
    let chain = chained(&s.problem, &s.state, &image, &exact)?;
    let (theta, mounting) = (s.problem.layout.theta_len(), s.problem.layout.mountings[0].clone());
    let mut g = chain.d_theta;
    g.columns_mut(mounting.start, 6).fill(0.0);
    let covariance = &g * s.covariance.reduced.view((0, 0), (theta, theta)) * g.transpose();
    let plate = world.truth.plate_poses.values().next()?.pose();
    let actual = image.mount.camera_from_plate(&s.state.mountings[0], &truth.base_from_tip(readings), &plate);
    let error: Vector6<f64> = (actual.inverse() * chain.pose).log();
    Some((DVector::from_column_slice(error.as_slice()), covariance))
}

fn cell(joint_noise_rad: f64, worlds: &[Option<World>]) -> MonteCarloCell {
    let solved: Vec<&World> = worlds.iter().flatten().collect();
    let n = solved.len().max(1) as f64;
    let blocks = std::array::from_fn(|k| {
        let sum: f64 = solved.iter().map(|w| w.squared[k].0).sum();
        let all: usize = solved.iter().map(|w| w.squared[k].1).sum();
        let all = all.max(1) as f64;
        BlockResult { mean: sum / all, half_width: 2.576 * (2.0 / all).sqrt() }
    });
    let found_rad = solved.iter().map(|w| w.found).sum::<f64>() / n;
    let spread = solved.iter().map(|w| (w.found - found_rad).powi(2)).sum::<f64>() / (n - 1.0).max(1.0);
    MonteCarloCell {
        joint_noise_rad,
        worlds: solved.len(),
        failed: worlds.len() - solved.len(),
        blocks,
        found_rad,
        found_spread_rad: spread.sqrt(),
        stated_spread_rad: solved.iter().map(|w| w.stated).sum::<f64>() / n,
    }
}
