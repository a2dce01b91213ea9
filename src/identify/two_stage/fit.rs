//! Two-stage estimators: free camera poses first, then the robot from the poses; every honest way to weight the second stage.
//!
//! After the first stage everything is a least-squares fit of `log(reference^-1 * pose(theta))` to the poses that the images
//! say, with error covariance `V = V0 + sum L S L'`: a known part, and latent noise `S` of unknown size that enters through `L`.
//! The estimators differ in nothing but `V0` and `L`; sizes are variance components (REML), as in the joint fit.
//! Partial minimisation over cameras, plate and markers leaves a Schur complement, so that the full covariance of the poses,
//! taken at the joint solution, gives the joint solution again.

use nalgebra::{DMatrix, DVector, Matrix6, Vector6};

use crate::assess::refitted_near;
use crate::fit::Fit;
use crate::geom::{Pose, right_jacobian_se3};
use crate::linalg::{SymmetricFactor, dense, product};
use crate::problem::{Adjustment, Chained, Problem, SIZE_OF_DISPLACEMENT, State, Step, TakenFrom, Tie};
use crate::solve::{
    Acceleration, ComponentOptions, Elimination, JOINT_NOISE_FLOOR, LEAST_FIRST_GUESS, LinearImage,
    LinearisedAdjustment, Settings, Status, Tally, estimate_components, share_out, solve_near,
};

use super::block_diagonal::BlockDiagonal;
use crate::identify::estimator::Estimator;
use crate::identify::options::JointNoise;
use crate::identify::problem::build::FIRST_JOINT_NOISE;

/// What an estimator found.
#[derive(Debug, Clone)]
pub struct Estimate {
    /// Which.
    pub estimator: Estimator,
    /// All unknowns. Cameras and plates of the two-stage estimators are those of the first stage; the full covariance, which tells how they go
    /// with the poses, gives those that belong to the robot found.
    pub state: State,
    /// Covariance of the columns that act through the camera poses (robot, mountings, placements).
    pub covariance: DMatrix<f64>,
    /// Its variance components: isotropic position (m) and rotation (rad), a factor, or joint noise (behind it tilt) per series and reading.
    pub components: Vec<f64>,
}

/// Camera poses as measurements: in the chart `x = log(reference^-1 * pose)` they are `offset`, with a covariance.
#[derive(Debug, Clone)]
pub struct PoseStage {
    /// Images on the robot, as in the problem.
    pub images: Vec<usize>,
    /// Where the charts are.
    pub references: Vec<Pose>,
    /// Measured `x`, six a pose, body twists of `camera_from_plate` (m, rad).
    pub offset: DVector<f64>,
    /// Covariance of every pose.
    pub blocks: Vec<Matrix6<f64>>,
    /// Covariance of all poses together; none for so many that it would cost more than all the rest.
    pub covariance: Option<DMatrix<f64>>,
    /// Cameras and plates of this stage.
    pub state: State,
    /// Pixel factors of this stage.
    pub pixel_factor: Vec<f64>,
}

impl PoseStage {
    /// The free-pose adjustment of the observations in use, from the poses that `start` predicts.
    pub fn adjusted(start: &Adjustment) -> Option<Self> {
        let options = ComponentOptions { joint: false, settings: AT_POSES, ..ComponentOptions::default() };
        let outcome = estimate_components(with_free_poses(start)?, &options);
        (outcome.status == Status::Converged).then(|| Self::linearised(&outcome.adjustment)).flatten()
    }

    /// The free-pose adjustment of all observations in use, with the pixel noise that `start` has.
    pub fn solved(start: &Adjustment) -> Option<LinearisedAdjustment> {
        solve_near(with_free_poses(start)?, &AT_POSES).linearised_adjustment()
    }

    /// Of the images that are `left` of those of a solved free-pose adjustment: one step from there. Images have nothing but cameras and plates
    /// in common, which move by less than their sigmas. The covariance of all poses together is there where one of the `estimators` takes it.
    pub fn of_left(solved: &LinearisedAdjustment, left: &Adjustment, estimators: &[Estimator]) -> Option<Self> {
        let is_held = |i: &usize| left.problem.images[*i].rejected.is_some();
        let held: Vec<usize> = solved.linearised.images.iter().copied().filter(is_held).collect();
        Self::of(&solved.linear().without_images(&held), estimators.contains(&Estimator::FullAndRepeatability))
    }

    /// The adjustment linearised at its poses, cameras and plates: one step from there, not iterated.
    pub fn linearised(at: &Adjustment) -> Option<Self> {
        Self::of(&LinearisedAdjustment::of(with_free_poses(at)?)?, true)
    }

    /// One step from where the adjustment stands, with the covariance of all poses `together` where they are few.
    fn of(near: &LinearisedAdjustment, together: bool) -> Option<Self> {
        let (free, linear) = (&near.adjustment, near.linear());
        let on_robot = |own: &LinearImage| free.problem.on_robot(own.index);
        let images: Vec<LinearImage> = linear.images().filter(on_robot).collect();
        let are_together = together && images.len() <= MOST_TOGETHER;
        let which = if are_together { Elimination::Markers } else { Elimination::cheaper(linear) };
        let cov = linear.covariance_by(which).ok()?;
        let step = cov.system.step(linear, &(&cov.reduced * &cov.system.rhs));
        let offset = images.iter().flat_map(|own| step.ties[own.index].iter().copied());
        let of_images = linear.images().zip(cov.of_images(linear)).filter(|(own, _)| on_robot(own));
        let rows_of = |own: &LinearImage| -> Vec<usize> {
            let start = cov.system.latent_start[own.stop];
            own.latents().into_iter().flatten().map(|c| start + c).collect()
        };
        let together = || {
            let rows: Vec<usize> = images.iter().flat_map(rows_of).collect();
            cov.reduced.select_rows(&rows).select_columns(&rows)
        };
        Some(Self {
            images: images.iter().map(|own| own.index).collect(),
            references: images.iter().map(|own| own.chain.pose).collect(),
            offset: DVector::from_vec(offset.collect()),
            blocks: of_images.map(|(_, c)| Matrix6::from_column_slice(c.as_slice())).collect(),
            covariance: are_together.then(together),
            pixel_factor: free.problem.noise.pixel_factor.clone(),
            state: free.state.moved(&free.problem.layout, &step),
        })
    }
}

/// Every image in use with a free pose, and nothing of the robot.
fn with_free_poses(start: &Adjustment) -> Option<Adjustment> {
    let mut free = start.clone();
    free.problem.take_bodies();
    free.hold_poses();
    free.state.joint_errors.fill(Vec::new());
    for (i, ..) in start.used() {
        free.state.ties[i] = Tie::Free(start.camera_from_plate(i)?);
    }
    Some(free)
}

/// Latent noise of some poses that follow each other: `L` (6 a pose x n) and the component that each of its columns belongs to.
struct Latent {
    /// The first of the poses.
    first: usize,
    enters_by: DMatrix<f64>,
    component: Vec<usize>,
    /// Known variance beside that of the component.
    beside: Vec<f64>,
}

/// Error model of the second stage: what is known, and sizes to be found.
struct ErrorModel {
    estimator: Estimator,
    /// Covariance of all poses together, where it is taken.
    together: Option<DMatrix<f64>>,
    blocks: Vec<Matrix6<f64>>,
    /// Sizes, in the unit of the latents.
    sizes: Vec<f64>,
    /// False where the sizes are given.
    estimated: bool,
}

/// First guesses, from above: position (m) and rotation (rad) of a pose, factor on its stated sigma.
const FIRST_ISOTROPIC: f64 = 1e-2;
const FIRST_FACTOR: f64 = 30.0;

/// Images up to which the covariance of all poses is taken together: its cost grows with their cube.
const MOST_TOGETHER: usize = 100;

/// Rounds of variance components, and relative change that ends them.
const ROUNDS: usize = 60;
const STANDING: f64 = 1e-2;
/// Length of a step, in sigma, up to which poses are predicted as before it.
const PREDICTED: f64 = 1e-2;

/// Bounds of the adjustment of free poses.
const AT_POSES: Settings = Settings::new(100, 0.1);

/// Gauss-Newton steps at given weights, and the decrement (in sigma) that ends them.
const STEPS: usize = 30;
const DECREMENT: f64 = 1e-9;

impl ErrorModel {
    fn new(problem: &Problem, stage: &PoseStage, estimator: Estimator, noise: JointNoise) -> Option<Self> {
        let estimated = noise == JointNoise::Estimated;
        let first = |of_joint_fit: f64| match noise {
            JointNoise::Known(sigma) => sigma,
            JointNoise::Estimated if of_joint_fit > 0.0 => of_joint_fit.max(LEAST_FIRST_GUESS),
            JointNoise::Estimated => FIRST_JOINT_NOISE,
        };
        let count = problem.noise.displacement_sizes();
        let of_series = |(k, own): (usize, &Vec<f64>)| {
            let displacements = &problem.noise.displacement[count * k..count * (k + 1)];
            own.iter().chain(displacements).map(|s| first(*s)).collect::<Vec<_>>()
        };
        let sizes = || problem.noise.joint.iter().enumerate().flat_map(of_series).collect();
        let (together, sizes, estimated) = match estimator {
            Estimator::Isotropic => (None, vec![FIRST_ISOTROPIC; 2], true),
            Estimator::Blocks => (None, vec![FIRST_FACTOR], true),
            Estimator::BlocksAndRepeatability => (None, sizes(), estimated),
            Estimator::FullAndRepeatability => (Some(stage.covariance.clone()?), sizes(), estimated),
            Estimator::HardJoint | Estimator::Joint => return None,
        };
        Some(Self { estimator, together, blocks: stage.blocks.clone(), sizes, estimated })
    }

    /// Of a pose by itself.
    fn of_pose(&self, first: usize) -> Option<Latent> {
        let (enters_by, component) = match self.estimator {
            Estimator::Isotropic => (Matrix6::identity(), vec![0, 0, 0, 1, 1, 1]),
            _ => (self.blocks[first].cholesky()?.l(), vec![0; 6]),
        };
        let enters_by = dense(&enters_by);
        Some(Latent { first, enters_by, component, beside: vec![0.0; 6] })
    }

    /// Of the poses of one stop: they have the errors of its readings in common, and each its own apparent displacement.
    fn of_stop(problem: &Problem, first: usize, images: &[usize], d_latent: &[DMatrix<f64>]) -> Latent {
        let stop = &problem.stops[problem.images[images[0]].stop];
        let (n, per_series) = (stop.readings(), sizes_per_series(problem));
        let all = n + d_latent.iter().map(|l| l.ncols() - n).sum::<usize>();
        let mut enters_by = DMatrix::zeros(6 * images.len(), all);
        let mut component: Vec<usize> = (0..n).collect();
        for (k, l) in d_latent.iter().enumerate() {
            let own = l.ncols() - n;
            enters_by.view_mut((6 * k, 0), (6, n)).copy_from(&l.columns(0, n));
            enters_by.view_mut((6 * k, component.len()), (6, own)).copy_from(&l.columns_range(n..));
            component.extend(SIZE_OF_DISPLACEMENT[..own].iter().map(|size| n + size));
        }
        Latent {
            first,
            enters_by,
            component: component.into_iter().map(|k| stop.series * per_series + k).collect(),
            beside: (0..all).map(|k| if k < n { problem.joint_error_variance(stop, k)[1] } else { 0.0 }).collect(),
        }
    }

    /// Those of all poses.
    fn latents(&self, problem: &Problem, stage: &PoseStage, p: &Predicted) -> Option<Vec<Latent>> {
        if !self.estimator.has_joint_noise() {
            return (0..stage.images.len()).map(|k| self.of_pose(k)).collect();
        }
        let stop_of = |i: &usize| problem.images[*i].stop;
        let mut first = 0;
        let of_stop = |images: &[usize]| {
            let poses = first..first + images.len();
            first = poses.end;
            Some(Self::of_stop(problem, poses.start, images, &p.d_latent[poses]))
        };
        stage.images.chunk_by(|a, b| stop_of(a) == stop_of(b)).map(of_stop).collect()
    }

    /// What is known of `V` about the poses of a latent.
    fn known(&self, latent: &Latent) -> DMatrix<f64> {
        let rows = latent.enters_by.nrows();
        let mut known = DMatrix::zeros(rows, rows);
        if self.estimator.has_joint_noise() {
            for (k, block) in self.blocks[latent.first..latent.first + rows / 6].iter().enumerate() {
                known.fixed_view_mut::<6, 6>(6 * k, 6 * k).copy_from(block);
            }
        }
        known
    }

    /// `V`, in blocks as large as what is known of it.
    fn covariance(&self, latents: &[Latent]) -> BlockDiagonal {
        let mut v = match &self.together {
            Some(whole) => BlockDiagonal::of([whole.clone()]),
            None => BlockDiagonal::of(latents.iter().map(|l| self.known(l))),
        };
        for l in latents {
            let variances = l.component.iter().zip(&l.beside).map(|(&c, beside)| self.sizes[c].powi(2) + beside);
            let sizes = DVector::from_iterator(l.component.len(), variances);
            v.add(6 * l.first, &(&l.enters_by * DMatrix::from_diagonal(&sizes) * l.enters_by.transpose()));
        }
        v
    }

    /// New sizes from the latents that the residuals ask for; returns the largest relative change.
    ///
    /// `weighted` is `V^-1 (residual)`; `V^-1` less `taken` times its transpose is what the parameters leave of it.
    fn update(
        &mut self,
        problem: &Problem,
        kinds: &[crate::urdf::JointKind],
        latents: &[Latent],
        weighted: &DVector<f64>,
        (weight, taken): (&BlockDiagonal, &DMatrix<f64>),
    ) -> f64 {
        let mut tally = Tally::new(self.sizes.len());
        for l in latents {
            let (start, rows) = (6 * l.first, l.enters_by.nrows());
            let pull = l.enters_by.transpose() * weighted.rows(start, rows);
            let of_taken = taken.rows(start, rows).tr_mul(&l.enters_by);
            let share = l.enters_by.transpose() * weight.view(start, rows) * &l.enters_by - of_taken.tr_mul(&of_taken);
            for (a, &c) in l.component.iter().enumerate() {
                let variance = self.sizes[c].powi(2);
                tally.count(c, (variance * pull[a]).powi(2), (variance * share[(a, a)]).max(0.0));
            }
        }
        if matches!(self.estimator, Estimator::Isotropic | Estimator::Blocks) {
            let mut change: f64 = 0.0;
            for (size, (s, r)) in
                self.sizes.iter_mut().zip(tally.squares.iter().zip(&tally.redundancy)).filter(|(_, (_, r))| **r > 1e-9)
            {
                let next = (s / r).sqrt().max(f64::MIN_POSITIVE);
                change = change.max((next / *size - 1.0).abs());
                *size = next;
            }
            return change;
        }
        let mut change: f64 = 0.0;
        let per_series = sizes_per_series(problem);
        let mut groups = problem.noise.groups(kinds);
        let readings = per_series - problem.noise.displacement_sizes();
        groups.extend((readings..per_series).map(|size| vec![size]));
        for group in groups {
            let of = |series: usize| group.iter().map(move |r| series * per_series + r);
            let series = 0..problem.noise.joint.len();
            let overall = Tally::usual(series.clone().map(|s| (&tally, of(s).collect())));
            for own in series.map(|s| of(s).collect::<Vec<_>>()) {
                change = change.max(share_out(&own, &tally, tally.drawn(&own, overall), &mut self.sizes));
            }
        }
        change
    }
}

impl ErrorModel {
    /// Goes on from the sizes after a round to those where the rounds lead.
    fn accelerate(&mut self, acceleration: &mut Acceleration, before: &[f64], change: f64) {
        if change < STANDING {
            return;
        }
        let smallest = if self.estimator.has_joint_noise() { JOINT_NOISE_FLOOR } else { f64::MIN_POSITIVE };
        let logarithms = |sizes: &[f64]| DVector::from_iterator(sizes.len(), sizes.iter().map(|s| s.ln()));
        let next = acceleration.next_after(change, &logarithms(before), logarithms(&self.sizes));
        self.sizes.iter_mut().zip(next.iter()).for_each(|(size, next)| *size = next.exp().max(smallest));
    }
}

/// Sizes of the joint-noise estimators per series: one a reading, and those of the apparent displacements of the plate.
fn sizes_per_series(problem: &Problem) -> usize {
    problem.noise.joint.first().map_or(0, Vec::len) + problem.noise.displacement_sizes()
}

/// The predicted poses at a state, in the charts of the stage.
struct Predicted {
    /// Measured minus predicted.
    residual: DVector<f64>,
    /// Derivative of the prediction by the columns that act through the poses; fixed columns are zero.
    jacobian: DMatrix<f64>,
    /// Derivative of each prediction by the errors of its joint readings and its apparent displacement.
    d_latent: Vec<DMatrix<f64>>,
}

fn predict(Adjustment { problem, state }: &Adjustment, stage: &PoseStage) -> Option<Predicted> {
    let theta = problem.layout.theta_len();
    let n = stage.offset.len();
    let mut p = Predicted { residual: stage.offset.clone(), jacobian: DMatrix::zeros(n, theta), d_latent: Vec::new() };
    let (exact, upright) = (vec![0.0; state.robot.chain.readings.len()], problem.upright_ties());
    for (k, &i) in stage.images.iter().enumerate() {
        let image = &problem.images[i];
        let posture = problem.posture(i)?;
        let from = TakenFrom { posture: Some(posture), joint_errors: &exact, tie: &upright[i] };
        let Chained { pose, d_theta, d_latent } = state.chained(&problem.layout, image, from)?;
        let x: Vector6<f64> = (stage.references[k].inverse() * pose).log();
        let chart = dense(&right_jacobian_se3(&x).try_inverse()?);
        let mut residual = p.residual.fixed_rows_mut::<6>(6 * k);
        residual -= x;
        p.jacobian.rows_mut(6 * k, 6).copy_from(&(&chart * d_theta));
        p.d_latent.push(chart * d_latent);
    }
    for (c, column) in problem.layout.columns[..theta].iter().enumerate().filter(|(_, c)| !c.free) {
        debug_assert!(!column.free);
        p.jacobian.column_mut(c).fill(0.0);
    }
    Some(p)
}

/// Normal equations of the second stage.
struct Normal {
    information: DMatrix<f64>,
    rhs: DVector<f64>,
    /// `V^-1 G`.
    weighted_jacobian: DMatrix<f64>,
}

fn normal(Adjustment { problem, state }: &Adjustment, p: &Predicted, weight: &BlockDiagonal) -> Normal {
    let weighted_jacobian = weight.times(&p.jacobian);
    let mut information = product(&p.jacobian.transpose(), &weighted_jacobian);
    let mut rhs = weighted_jacobian.transpose() * &p.residual;
    let values = state.values(&problem.layout);
    for (c, column) in problem.layout.columns[..information.nrows()].iter().enumerate() {
        let prior = column.prior_sigma.powi(-2);
        if !column.free || (prior == 0.0 && information[(c, c)] == 0.0) {
            information[(c, c)] = 1.0;
            rhs[c] = 0.0;
        } else if prior > 0.0 {
            information[(c, c)] += prior;
            rhs[c] += (column.prior_mean - values[c]) * prior;
        }
    }
    Normal { information, rhs, weighted_jacobian }
}

/// The state after a step of the columns that act through the poses.
fn moved(Adjustment { problem, state }: &Adjustment, step: &DVector<f64>) -> State {
    let mut dense = DVector::zeros(problem.layout.len());
    dense.rows_mut(0, step.len()).copy_from(step);
    let markers = state.plates.iter().map(|p| vec![nalgebra::Vector3::zeros(); p.nominal.len()]).collect();
    state.moved(&problem.layout, &Step::of(dense, markers, state))
}

/// The robot from free poses, by one of the four two-stage estimators; `None` where it has no solution.
///
/// `start` gives robot, mountings and placements to start from; priors are those of the problem. `noise` is of the joint noise
/// of the estimators that have one.
pub fn fit_poses(start: &Adjustment, stage: &PoseStage, estimator: Estimator, noise: JointNoise) -> Option<Estimate> {
    let mut at = start.clone();
    at.state.cameras.clone_from(&stage.state.cameras);
    at.state.plates.clone_from(&stage.state.plates);
    at.state.joint_errors.clone_from(&stage.state.joint_errors);
    at.state.ties.clone_from(&stage.state.ties);
    if matches!(estimator, Estimator::Isotropic | Estimator::Blocks) || noise != JointNoise::Estimated {
        at.without_local_errors();
    }
    let mut model = ErrorModel::new(&at.problem, stage, estimator, noise)?;
    let weight = match model.estimated {
        true => {
            // Blocks tell where the sizes will be, at a small part of the cost.
            if let Some(together) = model.together.take() {
                estimate_sizes(&mut at, stage, &mut model)?;
                model.sizes.iter_mut().for_each(|size| *size = size.max(LEAST_FIRST_GUESS));
                model.together = Some(together);
            }
            estimate_sizes(&mut at, stage, &mut model)?
        }
        false => {
            let p = predict(&at, stage)?;
            model.covariance(&model.latents(&at.problem, stage, &p)?).inverse()?
        }
    };
    gauss_newton(&mut at, stage, &weight)?;
    let normal = normal(&at, &predict(&at, stage)?, &weight);
    let covariance = zero_fixed(&at.problem, SymmetricFactor::new(&normal.information).ok()?.inverse());
    let state = match estimator {
        Estimator::FullAndRepeatability => with_cameras_for_the_robot(at, start, &model.sizes)?,
        _ => at.state,
    };
    Some(Estimate { estimator, state, covariance, components: model.sizes })
}

/// Variance components of the second stage, with the robot that goes with them: rounds by one linear step from where the poses were last
/// predicted, which is done again where that step ends. Returns the weights of the last round.
fn estimate_sizes(at: &mut Adjustment, stage: &PoseStage, model: &mut ErrorModel) -> Option<BlockDiagonal> {
    let kinds = at.state.robot.chain.reading_kinds.clone();
    let mut acceleration = Acceleration::default();
    let mut p = predict(at, stage)?;
    let mut latents = model.latents(&at.problem, stage, &p)?;
    for _ in 0..ROUNDS {
        let weight = model.covariance(&latents).inverse()?;
        let normal = normal(at, &p, &weight);
        let factor = SymmetricFactor::new(&normal.information).ok()?;
        let step = factor.solve(&normal.rhs);
        let residual = &p.residual - &p.jacobian * &step;
        let root = factor.inverse().cholesky()?.l();
        let taken = product(&normal.weighted_jacobian, &root);
        let weighted = weight.times_vector(&residual);
        let before = model.sizes.clone();
        let change = model.update(&at.problem, &kinds, &latents, &weighted, (&weight, &taken));
        model.accelerate(&mut acceleration, &before, change);
        // Sizes that go to nothing never stand, but matter no more.
        let standing = change < STANDING;
        let is_near = step.dot(&normal.rhs).max(0.0).sqrt() < PREDICTED;
        if standing && is_near {
            return model.covariance(&latents).inverse();
        }
        if standing {
            at.state = moved(at, &step);
            p = predict(at, stage)?;
            latents = model.latents(&at.problem, stage, &p)?;
        }
    }
    model.covariance(&latents).inverse()
}

/// Cameras and plates at their optimum given robot, mountings and placements: what their covariance with the poses makes of them. They and all
/// else are near what the joint fit has.
fn with_cameras_for_the_robot(at: Adjustment, joint: &Adjustment, sizes: &[f64]) -> Option<State> {
    let problem = with_sizes(&at.problem, Estimator::FullAndRepeatability, sizes);
    let mut given = Adjustment { problem, state: at.state };
    given.hold_poses();
    given.tie_to_readings(sizes.iter().all(|s| *s == 0.0));
    given.state.cameras.clone_from(&joint.state.cameras);
    given.state.plates.clone_from(&joint.state.plates);
    let errors = given.state.joint_errors.iter_mut().zip(&joint.state.joint_errors);
    errors.filter(|(own, known)| own.len() == known.len()).for_each(|(own, known)| own.clone_from(known));
    let ties = given.state.ties.iter_mut().zip(&joint.state.ties);
    ties.filter(|(own, known)| own.len() == known.len()).for_each(|(own, known)| own.clone_from(known));
    Some(refitted_near(LinearisedAdjustment::of(given)?))
}

/// The problem with the joint noise and the apparent displacements that an estimator found; as it is for one that has none.
pub(super) fn with_sizes(problem: &Problem, estimator: Estimator, sizes: &[f64]) -> Problem {
    let mut given = problem.clone();
    if !estimator.has_joint_noise() {
        return given;
    }
    let per_series = sizes_per_series(problem);
    for (series, joint) in given.noise.joint.iter_mut().enumerate() {
        let own = sizes[series * per_series..].iter().map(|s| s.max(f64::MIN_POSITIVE));
        joint.iter_mut().zip(own).for_each(|(s, own)| *s = own);
    }
    let count = problem.noise.displacement_sizes();
    for (k, size) in given.noise.displacement.iter_mut().enumerate() {
        let (series, kind) = (k / count, k % count);
        *size = sizes[(series + 1) * per_series - count + kind].max(f64::MIN_POSITIVE);
    }
    given
}

fn zero_fixed(problem: &Problem, mut covariance: DMatrix<f64>) -> DMatrix<f64> {
    for (c, _) in problem.layout.columns[..covariance.nrows()].iter().enumerate().filter(|(_, c)| !c.free) {
        covariance[(c, c)] = 0.0;
    }
    covariance
}

/// Solves at given weights; `None` where the normal equations are singular.
fn gauss_newton(at: &mut Adjustment, stage: &PoseStage, weight: &BlockDiagonal) -> Option<()> {
    let mut before: Option<f64> = None;
    for _ in 0..STEPS {
        let p = predict(at, stage)?;
        let n = normal(at, &p, weight);
        let step = SymmetricFactor::new(&n.information).ok()?.solve(&n.rhs);
        at.state = moved(at, &step);
        let decrement = step.dot(&n.rhs).max(0.0).sqrt();
        // Gauss-Newton contracts at least linearly: the next step will be shorter by the same factor, or more.
        let shrunk = before.filter(|b| decrement < *b);
        let next = shrunk.map_or(f64::INFINITY, |b| decrement * (decrement / b));
        if decrement.min(next) < DECREMENT {
            break;
        }
        before = Some(decrement);
    }
    Some(())
}

/// One linear step of the second stage at `start`, the components given: zero where `start` solves it already.
///
/// Returns the step of the columns that act through the poses, and their covariance.
pub fn linear_step(start: &Adjustment, stage: &PoseStage, sigma: f64) -> Option<(DVector<f64>, DMatrix<f64>)> {
    let problem = &start.problem;
    let model = ErrorModel::new(problem, stage, Estimator::FullAndRepeatability, JointNoise::Known(sigma))?;
    let p = predict(start, stage)?;
    let latents = model.latents(problem, stage, &p)?;
    let weight = model.covariance(&latents).inverse()?;
    let n = normal(start, &p, &weight);
    let factor = SymmetricFactor::new(&n.information).ok()?;
    Some((factor.solve(&n.rhs), zero_fixed(problem, factor.inverse())))
}

/// One of the joint estimators on the observations in use, from `start`.
pub fn fit_joint(start: &Adjustment, estimator: Estimator, noise: JointNoise) -> Option<(Problem, Estimate)> {
    let mut own = start.clone();
    let hard = estimator == Estimator::HardJoint || noise == JointNoise::Known(0.0);
    own.tie_to_readings(hard);
    let first = if let JointNoise::Known(sigma) = noise { sigma } else { FIRST_JOINT_NOISE };
    own.problem.noise.start_at(first.max(f64::MIN_POSITIVE));
    if hard || noise != JointNoise::Estimated {
        own.without_local_errors();
    } else {
        own.hold_component_priors();
    }
    let options = ComponentOptions {
        joint: !hard && noise == JointNoise::Estimated,
        displacement: !hard && noise == JointNoise::Estimated,
        settings: Settings { decrement: 1e-4, ..Settings::default() },
        ..ComponentOptions::default()
    };
    let outcome = estimate_components(own, &options);
    if outcome.status != Status::Converged {
        return None;
    }
    let Fit { adjustment: Adjustment { problem, state }, covariance, .. } = outcome.fit().ok()?;
    let theta = problem.layout.theta_len();
    let covariance = covariance.reduced.view((0, 0), (theta, theta)).into_owned();
    let sigmas = || (0..problem.noise.joint.len()).flat_map(|s| problem.joint_sigma(s)).collect();
    let components = if hard { Vec::new() } else { sigmas() };
    Some((problem, Estimate { estimator, state, covariance, components }))
}

/// All estimators on the same observations, outliers, priors and gauge; `None` for one that has no solution.
pub fn estimate_all(start: &Adjustment) -> Vec<(Estimator, Option<Estimate>)> {
    let stage = PoseStage::adjusted(start);
    Estimator::ALL
        .into_iter()
        .map(|estimator| {
            let found = match estimator {
                Estimator::HardJoint | Estimator::Joint => {
                    fit_joint(start, estimator, JointNoise::Estimated).map(|(_, e)| e)
                }
                _ => stage.as_ref().and_then(|s| fit_poses(start, s, estimator, JointNoise::Estimated)),
            };
            (estimator, found)
        })
        .collect()
}
