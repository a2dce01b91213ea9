//! Are the stated uncertainties true? Worlds whose errors are drawn from the priors, identified from nothing, and the errors of
//! the estimates in units of their stated covariance.
//!
//! The normalised squared error `e' C^-1 e` of a block of `n` parameters has the mean `n`. Over `N` worlds the mean of
//! `e' C^-1 e / n` lies within `1 +- 2.576 sqrt(2 / (n N))` with a probability of 99 %. Single parameters with the correlations `rho`, each by
//! itself, have `sum rho^2` in the place of `n` in the variance: `1 +- 2.576 sqrt(2 sum rho^2 / (n^2 N))`.
//!
//! The parameters of the robot are known a thousand times better in some directions than in others, and the good directions turn
//! along the bad ones. The covariance is that of the tangent at the estimate; the truth lies many good sigmas beside that tangent.
//! A chord of a parabola is parallel to its tangent half-way: to second order, `e` has the covariance that the same formula gives
//! half-way between estimate and truth. Both are listed.
//!
//! The covariance contains what the uncertainty of the estimated joint noise adds. That uncertainty is common to all parameters of
//! a world, and makes the interval wider. The half-way covariance with the joint noise that was put in needs neither, and is
//! judged beside.

use nalgebra::{DMatrix, DVector, Matrix6, Vector6};
use rayon::prelude::*;

use super::simulated::measured;
use crate::assess::NORMAL_95;
use crate::error::Result;
use crate::fit::Fit;
use crate::geom::Pose;
use crate::identify::{Options, RobotModel, Solution, identify};
use crate::linalg::{SymmetricFactor, dense};
use crate::model::robot::{Posture, Robot};
use crate::problem::{Adjustment, Problem, State, TakenFrom};
use crate::series::{Plate, PlateKind};
use crate::simulate::{RobotErrors, SimulatedSeries, WorldRequest, series};
use crate::solve::{JOINT_NOISE_FLOOR, NoiseUncertainty, Settings, noise_information, solve};
use crate::urdf::Chain;

/// What is tried.
#[derive(Debug, Clone, PartialEq)]
pub struct MonteCarloRequest {
    /// The nominal robot; without fixed joints, whose errors belong to the hand-eye transform.
    pub chain: Chain,
    /// Worlds for each joint noise.
    pub seeds: u64,
    /// Images of a series.
    pub images: usize,
    /// Joint noise, rad.
    pub joint_noise_rad: Vec<f64>,
}

/// Blocks of parameters that are judged.
pub const BLOCKS: [&str; 9] = [
    "robot",
    "robot, joint noise as put in",
    "robot, tangent at the estimate",
    "robot, single parameters",
    "camera",
    "hand-camera",
    "plate",
    "free pose",
    "flange",
];

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
    pub blocks: [BlockResult; BLOCKS.len()],
    /// Joint noise found, RMS over the joints, mean over the worlds, rad.
    pub found_rad: f64,
    /// Its standard deviation over the worlds, rad.
    pub found_spread_rad: f64,
    /// Its standard deviation as the program states it, mean over the worlds, rad.
    pub stated_spread_rad: f64,
    /// Worlds in which the noise put in lies within the stated 95 % interval of the RMS over the joints.
    pub within: usize,
    /// Share of the joints of all worlds for which it lies within the stated 95 % interval of their own.
    pub joints_within: f64,
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

/// One world.
#[derive(Debug, Clone, Copy)]
struct World {
    blocks: [Normalised; BLOCKS.len()],
    /// Joint noise found, RMS over the joints; its stated sigma, rad.
    found: f64,
    stated: f64,
    within: bool,
    joints_within: f64,
}

/// Sum of squared normalised errors; its expectation and half its variance where the covariance is true.
#[derive(Debug, Clone, Copy, Default)]
struct Normalised {
    sum: f64,
    mean: f64,
    half_variance: f64,
}

fn world(request: &MonteCarloRequest, joint_noise_rad: f64, seed: u64) -> Result<Option<World>> {
    let mut plate = Plate::lattice(PlateKind::Points, 8, 6, 0.038, MARKER_SIGMA_M);
    plate.markers.iter_mut().for_each(|m| m.outer_radius_m = RADIUS_M);
    let wanted = WorldRequest {
        images: request.images,
        errors: RobotErrors::of_priors(),
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
    let columns = robot_columns(s, &truth);
    let half_way = half_way_to_truth(s, &columns);
    let robot_by = |problem: Problem, joint_noise_is_estimated: bool| {
        let mut stated = fit_at(Adjustment { problem, state: half_way.clone() })?;
        if !joint_noise_is_estimated {
            return normalised(&robot_error(s, &columns, &stated.covariance.reduced));
        }
        let told = noise_information(&stated)?;
        let uncertainty = NoiseUncertainty::of(&told, &stated);
        uncertainty.iter().for_each(|u| stated.covariance.add(&u.added()));
        let error = robot_error(s, &columns, &stated.covariance.reduced);
        let places: Vec<usize> = columns.iter().map(|(c, _)| *c).collect();
        let common = uncertainty.map_or(Some(0.0), |u| u.of_normalised(&places, &error.1))?;
        normalised(&error).map(|n| Normalised { half_variance: n.half_variance + 0.5 * common, ..n })
    };
    let blocks = [
        robot_by(s.fit.problem.clone(), true),
        robot_by(with_joint_noise(&s.fit.problem, &world.truth.joint_noise_sigma), false),
        normalised(&robot_error(s, &columns, &s.fit.covariance.reduced)),
        Some(single(&robot_error(s, &columns, &s.fit.covariance.reduced))),
        normalised(&camera_error(s, world)),
        normalised(&mounting_error(s, world)),
        plate_error(s, world).and_then(|e| normalised(&e)),
        free_pose_error(s, world).and_then(|e| normalised(&e)),
        flange_error(s, world, &truth).and_then(|e| normalised(&e)),
    ];
    let Some(told) = &s.uncertainty.noise_information else { return Ok(None) };
    let mut found = [Normalised::default(); BLOCKS.len()];
    for (slot, block) in found.iter_mut().zip(blocks) {
        let Some(block) = block else { return Ok(None) };
        *slot = block;
    }
    let sigmas = &world.truth.joint_noise_sigma;
    let holds = |readings: &[usize], sigma: f64| {
        let [low, high] = told.mean_variance(&[0], readings).interval(NORMAL_95);
        (low..=high).contains(&sigma)
    };
    let n = sigmas.len() as f64;
    let all: Vec<usize> = (0..sigmas.len()).collect();
    let together = told.mean_variance(&[0], &all);
    Ok(Some(World {
        blocks: found,
        found: together.variance.sqrt(),
        stated: together.of_root(),
        within: holds(&all, (sigmas.iter().map(|s| s * s).sum::<f64>() / n).sqrt()),
        joints_within: all.iter().filter(|&&r| holds(&[r], sigmas[r])).count() as f64 / n,
    }))
}

/// An error and the covariance that is stated of it.
pub type ErrorWithCovariance = (DVector<f64>, DMatrix<f64>);

fn normalised((error, covariance): &ErrorWithCovariance) -> Option<Normalised> {
    let n = error.len() as f64;
    let factor = SymmetricFactor::new(covariance).ok()?;
    Some(Normalised { sum: error.dot(&factor.solve(error)), mean: n, half_variance: n })
}

/// Every parameter by itself.
fn single((error, covariance): &ErrorWithCovariance) -> Normalised {
    let n = error.len();
    let squared_correlation =
        |i: usize, k: usize| covariance[(i, k)].powi(2) / (covariance[(i, i)] * covariance[(k, k)]);
    Normalised {
        sum: (0..n).map(|i| error[i].powi(2) / covariance[(i, i)]).sum(),
        mean: n as f64,
        half_variance: (0..n).flat_map(|i| (0..n).map(move |k| squared_correlation(i, k))).sum(),
    }
}

/// Columns of the robot with their true values.
fn robot_columns(s: &Solution, truth: &Robot) -> Vec<(usize, f64)> {
    let layout = &s.fit.problem.layout;
    let moving = (0..truth.twists.len()).filter(|&k| truth.chain.is_origin_of_moving(k));
    let twists = moving.flat_map(|k| (0..6).map(move |a| (k, a)));
    let twists = twists.map(|(k, a)| (layout.twists.start + 6 * k + a, truth.twists[k][a]));
    let terms = s.fit.state.robot.terms.iter().take(layout.locals.start - layout.terms.start).enumerate();
    let terms = terms.map(|(k, t)| {
        let value = truth.terms.iter().find(|u| (u.reading, u.term) == (t.reading, t.term)).map_or(0.0, |u| u.value);
        (layout.terms.start + k, value)
    });
    twists.chain(terms).collect()
}

fn robot_error(s: &Solution, columns: &[(usize, f64)], reduced: &DMatrix<f64>) -> ErrorWithCovariance {
    let estimates = s.fit.state.values(&s.fit.problem.layout);
    let n = columns.len();
    let error = DVector::from_iterator(n, columns.iter().map(|&(c, value)| estimates[c] - value));
    (error, DMatrix::from_fn(n, n, |i, k| reduced[(columns[i].0, columns[k].0)]))
}

/// The robot half-way to the truth, and everything else adjusted to that.
fn half_way_to_truth(s: &Solution, columns: &[(usize, f64)]) -> State {
    let mut held = s.fit.adjustment.clone();
    let Adjustment { problem, state } = &mut held;
    let estimates = state.values(&problem.layout);
    for &(c, value) in columns {
        state.set_value(&problem.layout, c, 0.5 * (estimates[c] + value));
        problem.layout.columns[c].free = false;
    }
    solve(held, &Settings::default()).adjustment.state
}

/// What is known where the adjustment stands, nothing solved.
fn fit_at(adjustment: Adjustment) -> Option<Fit> {
    let linearised = adjustment.linearise()?;
    let covariance = adjustment.linear(&linearised).covariance().ok()?;
    Some(Fit { adjustment, linearised, covariance })
}

/// The problem with another joint noise, rad or m per reading.
fn with_joint_noise(problem: &Problem, sigma: &[f64]) -> Problem {
    let mut problem = problem.clone();
    for of_series in &mut problem.noise.joint {
        of_series.iter_mut().zip(sigma).for_each(|(known, s)| *known = s.max(JOINT_NOISE_FLOOR));
    }
    problem
}

fn camera_error(s: &Solution, world: &SimulatedSeries) -> ErrorWithCovariance {
    let columns = s.fit.problem.layout.cameras[0].clone();
    let off = s.fit.state.cameras[0].parameters.iter().zip(&world.truth.camera.parameters).map(|(a, b)| a - b);
    let covariance = s.fit.covariance.reduced.view((columns.start, columns.start), (columns.len(), columns.len()));
    (DVector::from_iterator(columns.len(), off), covariance.into_owned())
}

fn pose_error(estimate: &Pose, truth: &Pose, covariance: &Matrix6<f64>) -> ErrorWithCovariance {
    let error = (truth.inverse() * *estimate).log();
    (DVector::from_column_slice(error.as_slice()), dense(covariance))
}

fn mounting_error(s: &Solution, world: &SimulatedSeries) -> ErrorWithCovariance {
    let block = s.fit.covariance.block(s.fit.problem.layout.mountings[0].start);
    pose_error(&s.fit.state.mountings[0], &world.truth.camera_pose.pose(), &block)
}

fn plate_error(s: &Solution, world: &SimulatedSeries) -> Option<ErrorWithCovariance> {
    let block = s.fit.covariance.block(s.fit.problem.layout.placements[0].start);
    Some(pose_error(&s.fit.state.placements[0], &world.truth.plate_poses.values().next()?.pose(), &block))
}

/// The free-pose adjustment states `camera_from_plate` for the plate frame of its priors, as the truth does.
fn free_pose_error(s: &Solution, world: &SimulatedSeries) -> Option<ErrorWithCovariance> {
    let k = s.free_poses.poses.iter().position(Option::is_some)?;
    let free = s.free_poses.poses[k].as_ref()?;
    Some(pose_error(&free.camera_from_plate, &world.truth.stops[k].camera_from_plate.pose(), &free.covariance))
}

/// The flange in the plate frame at the first joint vector that was kept aside: the camera of the solution, as if it were exact, on
/// the robot and plate of the solution against the same camera on the true ones. Its error (m, rad) and the stated covariance.
pub fn flange_error(s: &Solution, world: &SimulatedSeries, truth: &Robot) -> Option<ErrorWithCovariance> {
    let problem = &s.fit.problem;
    let image = &problem.images[(0..problem.images.len()).find(|&i| problem.on_robot(i))?];
    let readings = &world.truth.held_out.first()?.readings;
    let posture = Posture::at(readings);
    let chain = s.fit.state.chained(&problem.layout, image, TakenFrom::exact(&posture))?;
    let (theta, mounting) = (problem.layout.theta_len(), problem.layout.mountings[0].clone());
    let mut g = chain.d_theta;
    g.columns_mut(mounting.start, 6).fill(0.0);
    let covariance = &g * s.fit.covariance.reduced.view((0, 0), (theta, theta)) * g.transpose();
    let plate = world.truth.plate_poses.values().next()?.pose();
    let actual = image.mount.camera_from_plate(&s.fit.state.mountings[0], &truth.base_from_tip(readings), &plate);
    let error: Vector6<f64> = (actual.inverse() * chain.pose).log();
    Some((DVector::from_column_slice(error.as_slice()), covariance))
}

fn cell(joint_noise_rad: f64, worlds: &[Option<World>]) -> MonteCarloCell {
    let solved: Vec<&World> = worlds.iter().flatten().collect();
    let n = solved.len().max(1) as f64;
    let blocks = std::array::from_fn(|k| {
        let total = |of: fn(&Normalised) -> f64| solved.iter().map(|w| of(&w.blocks[k])).sum::<f64>();
        let all = total(|b| b.mean).max(1.0);
        BlockResult {
            mean: total(|b| b.sum) / all,
            half_width: 2.576 * (2.0 * total(|b| b.half_variance)).sqrt() / all,
        }
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
        within: solved.iter().filter(|w| w.within).count(),
        joints_within: solved.iter().map(|w| w.joints_within).sum::<f64>() / n,
    }
}
