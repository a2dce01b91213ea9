//! Hold-out by image and by region of the workspace: a model fitted without an image predicts it from its joint readings alone.

use std::collections::BTreeSet;

use nalgebra::{DMatrix, Vector3};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::limits::Limits;
use crate::geom::Pose;
use crate::init::resect_near;
use crate::linalg::{dense, symmetric_eigen};
use crate::model::robot::Robot;
use crate::problem::{Adjustment, Image, Problem, State, TakenFrom, Weighting, posture_groups, predict};
use crate::solve::{
    ComponentOptions, LinearProblem, LinearisedAdjustment, Outcome, Parts, Settings, Status, estimate_components,
    side_by_side, solve,
};
use crate::stage::stage;

/// Errors of predicted images.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Errors {
    /// RMS distance between measured and predicted markers in the image, px.
    pub rms_px: f64,
    /// RMS distance in space between where the image shows the markers and where the joint readings put them, mm.
    pub rms_mm: f64,
    /// Largest error of a single image, mm.
    pub worst_mm: f64,
    /// Number of images predicted.
    pub images: usize,
}

/// Before and after.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Accuracy {
    /// Nominal robot, with camera, hand-eye transform and plate fitted to the other images.
    pub nominal: Errors,
    /// Calibrated robot, fitted to the other images.
    pub calibrated: Errors,
    /// Error of each held-out image, nominal and calibrated, mm; in the order of the problem's images.
    pub per_image_mm: Vec<Option<[f64; 2]>>,
    /// The same of each measurement of a body that was held out.
    pub per_body_mm: Vec<Option<[f64; 2]>>,
    /// Number of folds.
    pub folds: usize,
}

/// A fit of the images that are left, from where the adjustment stands.
pub type Refit<'a> = dyn Fn(LinearisedAdjustment) -> Option<State> + Sync + 'a;

const FOLDS: usize = 6;

/// Joint error that a nominal robot is allowed per stop at first, rad or m, so that its geometric errors do not bend camera and plate. The images then
/// say how large it is: of a robot that is nearly right, base and tool would else be no better known than by the pose of each image alone.
const NOMINAL_JOINT_ERROR: f64 = 3e-3;

/// Rounds in which the joint error of the nominal robot is estimated, and stops that tell it: it is a weight, and need not be known well.
const NOMINAL_ROUNDS: usize = 8;
const NOMINAL_NOISE_STOPS: usize = 40;

/// Error of its pose that it is allowed in place of that where no image is, m and rad: base and tool are then where it misses least. By joint errors
/// the few stops at which these cannot be what it misses by would decide.
const NOMINAL_POSE_ERROR: f64 = 3e-3;

/// Stops of a series that is held out; of more, so many take part. What they leave open of the model is small beside what scatters from stop to stop.
pub(super) const MOST_STOPS: usize = 2000;

/// Predicts every image on the robot by models that have not seen it: of what is calibrated by `fitted`, from the images that are left, which is
/// [`refitted_near`] for the joint fit. Also returns the errors of what is calibrated.
pub fn hold_out(fit: LinearProblem, fitted: &Refit, limits: &Limits) -> Option<(Accuracy, Vec<(usize, ImageError)>)> {
    let _stage = stage("hold-out");
    let some = fit.some_stops(MOST_STOPS, MOST_STOPS);
    let fit = some.as_ref().map_or(fit, LinearisedAdjustment::linear);
    let problem = &fit.adjustment.problem;
    let folds = folds(problem, limits)?;
    let nominal = nominal(fit.adjustment);
    let nominal = predictions(nominal.linear()?, &folds, &joint)?;
    let calibrated = predictions(fit, &folds, fitted)?;
    let mut per_image_mm = vec![None; problem.images.len()];
    for ((i, a), (_, b)) in nominal.iter().zip(&calibrated) {
        per_image_mm[*i] = Some([a.mm(), b.mm()]);
    }
    let [nominal, of_calibrated] = [summary(&nominal), summary(&calibrated)];
    let per_body_mm = Vec::new();
    let accuracy = Accuracy { nominal, calibrated: of_calibrated, per_image_mm, per_body_mm, folds: folds.len() };
    Some((accuracy, calibrated))
}

/// Stops that are enough for what is fitted beside the nominal robot.
const NOMINAL_STOPS: usize = 500;

/// The fit of what is beside the nominal robot, to some of very many stops.
pub(super) fn nominal(fit: &Adjustment) -> Outcome {
    let nominal = of_nominal(fit);
    let settings = of_fold(&nominal);
    if nominal.problem.used().next().is_none() {
        return solve(nominal, &settings);
    }
    let rounds = NOMINAL_ROUNDS;
    let sizes = ComponentOptions { factors: false, joint: true, displacement: false, rounds, settings };
    let Some(some) = nominal.some_stops(NOMINAL_NOISE_STOPS, NOMINAL_NOISE_STOPS) else {
        return estimate_components(nominal, &sizes);
    };
    let some = estimate_components(some, &sizes);
    let mut nominal = nominal;
    if some.status == Status::Converged {
        nominal.start_near_some(&some.adjustment, 0.0);
    }
    solve(nominal, &settings)
}

fn of_nominal(fit: &Adjustment) -> Adjustment {
    let mut nominal = fit.some_stops(NOMINAL_STOPS, NOMINAL_STOPS).unwrap_or_else(|| fit.clone());
    let Adjustment { problem, state } = &mut nominal;
    state.robot = Robot { terms: fit.state.robot.terms.clone(), ..Robot::nominal(fit.state.robot.chain.clone()) };
    state.robot.terms.iter_mut().for_each(|t| t.value = 0.0);
    let robot = problem.layout.twists.start..problem.layout.terms.end;
    // Readings that count as exact miss by what the robot is off.
    for (stop, errors) in problem.stops.iter().zip(&mut state.joint_errors).filter(|(_, errors)| errors.is_empty()) {
        *errors = vec![0.0; stop.readings()];
    }
    let known: Vec<usize> = robot.filter(|c| !problem.layout.is_between_bases(*c)).collect();
    known.into_iter().for_each(|c| problem.layout.columns[c].free = false);
    problem.noise.local.fill(0.0);
    if problem.used().next().is_some() {
        problem.noise.joint.iter_mut().flatten().for_each(|s| *s = s.max(NOMINAL_JOINT_ERROR));
        return nominal;
    }
    for measured in &mut problem.body_measurements {
        let sigmas = [&mut measured.sigma_m, &mut measured.sigma_rad];
        sigmas.into_iter().filter(|sigma| **sigma > 0.0).for_each(|sigma| *sigma = sigma.max(NOMINAL_POSE_ERROR));
    }
    nominal
}

/// Error of every image on the robot, predicted by fits of the free columns to the images of the other folds; `None` for too few.
pub fn hold_out_images(fit: LinearProblem, limits: &Limits) -> Option<Vec<(usize, ImageError)>> {
    predictions(fit, &folds(&fit.adjustment.problem, limits)?, &joint)
}

fn joint(left: LinearisedAdjustment) -> Option<State> {
    Some(refitted_near(left))
}

/// Squared errors of one predicted image, summed over its markers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ImageError {
    /// Between measured and predicted markers in the image, px^2; the diagonal of the picture where the lens images no such place.
    pub px2: f64,
    /// Between where the image shows the markers and where the joint readings put them, mm^2.
    pub mm2: f64,
    /// Number of markers.
    pub count: f64,
}

impl ImageError {
    fn mm(&self) -> f64 {
        (self.mm2 / self.count).sqrt()
    }
}

fn summary(errors: &[(usize, ImageError)]) -> Errors {
    let sum = |f: fn(&ImageError) -> f64| errors.iter().map(|(_, e)| f(e)).sum::<f64>();
    let count = sum(|e| e.count).max(1.0);
    Errors {
        rms_px: (sum(|e| e.px2) / count).sqrt(),
        rms_mm: (sum(|e| e.mm2) / count).sqrt(),
        worst_mm: errors.iter().map(|(_, e)| e.mm()).fold(0.0, f64::max),
        images: errors.len(),
    }
}

/// Images on the robot that share joint readings: they are off by the same local errors, and one of them would tell of the others.
/// Each by itself where there are too few such sets to compare.
fn clusters(problem: &Problem, limits: &Limits) -> Vec<Vec<usize>> {
    let on_robot: Vec<usize> = problem.used_on_robot().collect();
    let groups = posture_groups(problem, &on_robot);
    if groups.len() < limits.regions { on_robot.into_iter().map(|i| vec![i]).collect() } else { groups }
}

/// Index of the set of every image whose errors are its own: images on the robot that share joint readings have one set.
pub fn cluster_of_images(problem: &Problem, limits: &Limits) -> Vec<usize> {
    let clusters = clusters(problem, limits);
    let mut found: Vec<usize> = (clusters.len()..).take(problem.images.len()).collect();
    clusters.iter().enumerate().for_each(|(k, images)| images.iter().for_each(|&i| found[i] = k));
    found
}

/// Images that are held out together, fold by fold; those that share joint readings stay together. `None` for too few images on the robot.
pub fn folds(problem: &Problem, limits: &Limits) -> Option<Vec<Vec<usize>>> {
    let groups = clusters(problem, limits);
    (groups.len() >= 2).then(|| dealt(groups))
}

/// Groups that stay together, dealt to the folds one after the other.
pub(super) fn dealt(groups: Vec<Vec<usize>>) -> Vec<Vec<usize>> {
    let mut folds = vec![Vec::new(); FOLDS.min(groups.len())];
    let count = folds.len();
    groups.into_iter().enumerate().for_each(|(k, group)| folds[k % count].extend(group));
    folds
}

/// Regions of the workspace that are held out one after the other: postures (images that share joint readings) next to each other along the direction
/// in which the tip moved most. `None` for too few postures, and where these would be the folds once more.
pub fn regions(fit: &Adjustment, limits: &Limits) -> Option<Vec<Vec<usize>>> {
    let problem = &fit.problem;
    let on_robot: Vec<usize> = problem.used_on_robot().collect();
    let postures = posture_groups(problem, &on_robot);
    let count = FOLDS.min(postures.len() / limits.region_postures.max(1));
    if count < limits.regions {
        return None;
    }
    let mut regions = vec![Vec::new(); count];
    let mut before = 0;
    for posture in along_the_workspace(fit, postures) {
        // The middle of a posture decides, so that regions are alike in number of images.
        let middle = 2 * before + posture.len();
        before += posture.len();
        regions[middle * count / (2 * on_robot.len())].extend(posture);
    }
    regions.retain(|r| !r.is_empty());
    let sets = |folds: &[Vec<usize>]| -> BTreeSet<BTreeSet<usize>> {
        folds.iter().map(|fold| fold.iter().copied().collect()).collect()
    };
    let repeated = folds(problem, limits).is_some_and(|folds| sets(&folds) == sets(&regions));
    (regions.len() >= limits.regions && !repeated).then_some(regions)
}

/// Postures in the order of their mean place along the direction in which the tip moved most.
fn along_the_workspace(Adjustment { problem, state }: &Adjustment, postures: Vec<Vec<usize>>) -> Vec<Vec<usize>> {
    let place = |i: &usize| {
        let readings = problem.posture(*i).map(|s| s.readings.as_slice()).unwrap_or_default();
        state.robot.base_from_tip(readings).translation
    };
    let mean_of = |images: &[usize]| images.iter().map(place).sum::<Vector3<f64>>() / images.len().max(1) as f64;
    let all: Vec<usize> = postures.iter().flatten().copied().collect();
    let mean = mean_of(&all);
    let mut spread = DMatrix::<f64>::zeros(3, 3);
    for d in all.iter().map(|i| place(i) - mean) {
        spread += dense(&(d * d.transpose()));
    }
    let main = symmetric_eigen(&spread).map_or(Vector3::x(), |(_, v)| Vector3::new(v[(0, 2)], v[(1, 2)], v[(2, 2)]));
    let mut placed: Vec<(f64, Vec<usize>)> =
        postures.into_iter().map(|posture| (main.dot(&(mean_of(&posture) - mean)), posture)).collect();
    placed.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    placed.into_iter().map(|(_, posture)| posture).collect()
}

/// Error of every held-out image, with its index.
fn predictions(fit: LinearProblem, folds: &[Vec<usize>], fitted: &Refit) -> Option<Vec<(usize, ImageError)>> {
    let problem = &fit.adjustment.problem;
    let parts = Parts::of(fit, folds);
    let of_fold = |k: usize, _: &Vec<usize>| fitted(fit.without_set(folds, k, parts.as_ref()));
    let states: Vec<State> = side_by_side(problem, folds, of_fold).into_iter().collect::<Option<_>>()?;
    let held: Vec<(usize, &State)> =
        folds.iter().zip(&states).flat_map(|(held, fitted)| held.iter().map(move |&i| (i, fitted))).collect();
    let predicted = held.par_iter().map(|(i, fitted)| Some((*i, predict_image(fit.adjustment, fitted, *i)?)));
    let mut errors: Vec<(usize, ImageError)> = predicted.collect::<Option<_>>()?;
    errors.sort_by_key(|(i, _)| *i);
    Some(errors)
}

/// Bounds of the fit of a fold: no unknown is off by more than a tenth of its sigma, of very many stops a little more.
pub(super) fn of_fold(adjustment: &Adjustment) -> Settings {
    Settings { iterations: 30, decrement: 0.1, margin: 0.3 }.of_stops(adjustment.used_stops().len())
}

/// The free columns fitted to the images in use, from where the adjustment stands, at its noise.
pub fn refitted(adjustment: Adjustment) -> State {
    let settings = of_fold(&adjustment);
    solve(adjustment, &settings).adjustment.state
}

/// The same from near the end.
pub fn refitted_near(start: LinearisedAdjustment) -> State {
    let settings = of_fold(&start.adjustment);
    start.settled(&settings)
}

/// Error of an image that `state` was not fitted to, predicted from its joint readings alone; `None` off the robot, or where
/// its markers do not give a pose, which is near to that of the adjustment.
pub fn predict_image(near: &Adjustment, state: &State, image: usize) -> Option<ImageError> {
    error_of_predicted(near, state, image, &seen_pose(near, state, image)?)
}

/// Where an image by itself says that its camera was, with camera and plate of `state`; `None` where its markers do not give a pose, which is near
/// to that of the adjustment.
pub fn seen_pose(near: &Adjustment, state: &State, image: usize) -> Option<Pose> {
    let start = near.camera_from_plate(image)?;
    let image = &near.problem.images[image];
    resect_near(image, state, &start, &Weighting::of(&near.problem, image))
}

/// As [`predict_image`], where the image by itself says that its camera was.
pub fn error_of_predicted(near: &Adjustment, state: &State, image: usize, seen: &Pose) -> Option<ImageError> {
    let problem = &near.problem;
    let (image, posture) = (&problem.images[image], problem.posture(image)?);
    let predicted = state.camera_from_plate(image, TakenFrom::exact(posture))?;
    Some(image_error(image, state, &predicted, seen))
}

fn image_error(image: &Image, state: &State, predicted: &Pose, seen: &Pose) -> ImageError {
    let camera = &state.cameras[image.camera];
    let diagonal_px2 = f64::from(camera.width_px).powi(2) + f64::from(camera.height_px).powi(2);
    let mut e = ImageError { px2: 0.0, mm2: 0.0, count: 0.0 };
    for o in image.used() {
        let x = state.plates[image.plate].position(o.marker);
        e.px2 += predict(image, state, predicted, o).map_or(diagonal_px2, |p| (o.uv - p.uv).norm_squared());
        e.mm2 += 1e6 * (predicted.transform(&x) - seen.transform(&x)).norm_squared();
        e.count += 1.0;
    }
    e
}
