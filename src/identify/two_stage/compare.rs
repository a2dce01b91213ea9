//! All estimators side by side: against truth where it is known, on held-out images where it is not.

use std::borrow::Cow;
use std::sync::atomic::{AtomicUsize, Ordering};

use super::fit::{PoseStage, fit_joint, fit_poses};
use crate::assess::{
    ImageError, bootstrap_ratio, by_cluster, camera_errors_m, cluster_of_images, error_of_predicted, flange_error_m,
    folds, refitted_near, regions, root_mean_square, root_of_mean, seen_pose,
};
use crate::error::{Code, Error, Result};
use crate::geom::Pose;
use crate::identify::comparison::{Comparison, ComparisonRow, HeldOut, TruthError};
use crate::identify::estimator::Estimator;
use crate::identify::options::JointNoise;
use crate::identify::solution::Solution;
use crate::problem::{Adjustment, Problem, State};
use crate::series::CameraMount;
use crate::simulate::truth::Truth;
use crate::solve::{LinearisedAdjustment, Parts, side_by_side};
use crate::stage::stage;

/// Stops beyond which some of them are compared, and how many those are: the ratio of two errors on the same images is then known to a percent.
const MANY_STOPS: usize = 500;
const SOME_STOPS: usize = 250;

/// Images up to which the estimator with the covariance of all poses together is beside the others in every report: with its cube of their number it is
/// soon a fifth of the whole, and it is the joint fit up to terms of second order.
const MOST_TOGETHER: usize = 80;

/// What is compared, and the errors of the joint fit where they are known: some of very many stops.
fn compared(solution: &Solution) -> (Cow<'_, Adjustment>, &[(usize, ImageError)]) {
    let joint = solution.joint_fit();
    match joint.some_stops(MANY_STOPS, SOME_STOPS) {
        Some(some) => (Cow::Owned(some), &[]),
        None => (Cow::Borrowed(joint), &solution.held_out),
    }
}

/// Compares on the observations of a solution: its outliers and rejected images are left out for all estimators.
///
/// The joint fit keeps the noise components of the solution, as in its accuracy; the others find them in the images that are left, but for the
/// pixel noise.
///
/// # Errors
/// Too few images on the robot.
pub fn compare(
    solution: &Solution,
    truth: Option<&Truth>,
    progress: impl Fn(usize, usize) + Sync,
) -> Result<Comparison> {
    let (some, known) = compared(solution);
    let (joint, problem, limits) = (some.as_ref(), &some.problem, &solution.options.limits);
    let images = on_robot(problem);
    let Some(by_image) = folds(problem, limits).filter(|_| images >= limits.compared_images) else {
        return Err(Error::new(
            Code::ImagesTooFew,
            "comparison",
            format!("{images} images of the robot are too few to hold some out"),
            format!("take at least {}, better 30", limits.compared_images),
        ));
    };
    let by_region = regions(joint, limits).unwrap_or_default();
    let all = Estimator::ALL;
    let total = by_image.len() + by_region.len() + 1;
    let done = AtomicUsize::new(0);
    let tick = || progress(done.fetch_add(1, Ordering::Relaxed) + 1, total);
    let solved = PoseStage::solved(joint);
    let against = |truth: &Truth| match &some {
        Cow::Borrowed(all) => truth_errors(all, solved.as_ref(), truth),
        Cow::Owned(_) => {
            let all = solution.joint_fit();
            truth_errors(all, PoseStage::solved(all).as_ref(), truth)
        }
    };
    let against_truth = truth.map(against).transpose()?;
    tick();
    let image_errors = held_out(joint, solved.as_ref(), &by_image, (&all, known), &tick);
    let region_errors = held_out(joint, solved.as_ref(), &by_region, (&all, &[]), &tick);
    let of_truth = |k: usize| against_truth.as_ref().and_then(|t| t[k]);
    let held = [Some(&image_errors), Some(&region_errors).filter(|e| !e.is_empty())];
    let rows = rows(&cluster_of_images(problem, limits), &all, held, of_truth);
    Ok(Comparison { rows, images, folds: [by_image.len(), by_region.len()] })
}

/// The two-stage estimators beside the joint fit, held out by image: what the report of every solution says, and the same as [`compare`] says of them.
/// `None` for too few images.
pub fn beside_two_stages(solution: &Solution) -> Option<Comparison> {
    let _stage = stage("comparison with two stages");
    let (some, known) = compared(solution);
    let (joint, problem, limits) = (some.as_ref(), &some.problem, &solution.options.limits);
    let images = on_robot(problem);
    // Camera poses know nothing of what a tracker measured.
    let is_fair = problem.body_measurements.is_empty() && images >= limits.compared_images;
    let folds = folds(problem, limits).filter(|_| is_fair)?;
    let takes_part = |e: &Estimator| match e {
        Estimator::HardJoint => false,
        Estimator::FullAndRepeatability => images <= MOST_TOGETHER,
        _ => true,
    };
    let taking_part: Vec<Estimator> = Estimator::ALL.into_iter().filter(takes_part).collect();
    let errors = held_out(joint, PoseStage::solved(joint).as_ref(), &folds, (&taking_part, known), &|| ());
    let rows = rows(&cluster_of_images(problem, limits), &taking_part, [Some(&errors), None], |_| None);
    Some(Comparison { rows, images, folds: [folds.len(), 0] })
}

fn on_robot(problem: &Problem) -> usize {
    problem.used_on_robot().count()
}

fn rows(
    clusters: &[usize],
    estimators: &[Estimator],
    [by_image, by_region]: [Option<&Errors>; 2],
    truth: impl Fn(usize) -> Option<TruthError>,
) -> Vec<ComparisonRow> {
    let joint = estimators.iter().position(|e| *e == Estimator::Joint);
    let of = |errors: Option<&Errors>, k: usize| summary(errors?, clusters, k, joint);
    let row = |(k, &estimator): (usize, &Estimator)| ComparisonRow {
        estimator,
        by_image: of(by_image, k),
        by_region: of(by_region, k),
        truth: truth(k),
    };
    estimators.iter().enumerate().map(row).collect()
}

/// What every estimator makes of the observations that are `left`, some of those whose stand-alone poses are `solved`; `None` for one that has no
/// solution. That of the joint fit is found by `joint`.
fn fitted(
    left: &Adjustment,
    solved: Option<&LinearisedAdjustment>,
    estimators: &[Estimator],
    joint: impl Fn() -> Option<State>,
) -> Vec<Option<State>> {
    let stage = solved.and_then(|solved| PoseStage::of_left(solved, left, estimators));
    let noise = JointNoise::Estimated;
    let found = |estimator: &Estimator| match estimator {
        Estimator::Joint => joint(),
        Estimator::HardJoint => fit_joint(left, *estimator, noise).map(|(_, found)| found.state),
        _ => Some(fit_poses(left, stage.as_ref()?, *estimator, noise)?.state),
    };
    estimators.iter().map(found).collect()
}

/// Error of every held-out image, with its index, by every estimator; `None` where an estimator has no solution for a fold.
type Errors = Vec<(usize, Vec<Option<ImageError>>)>;

/// Errors by some estimators, from the stand-alone poses of all images where they are `solved`; those of the joint fit may be `known`.
fn held_out(
    joint: &Adjustment,
    solved: Option<&LinearisedAdjustment>,
    folds: &[Vec<usize>],
    (estimators, known): (&[Estimator], &[(usize, ImageError)]),
    tick: &(dyn Fn() + Sync),
) -> Errors {
    let whole = if known.is_empty() { LinearisedAdjustment::of(joint.clone()) } else { None };
    let parts = whole.as_ref().and_then(|whole| Parts::of(whole.linear(), folds));
    let of_fold = |k: usize, fold: &Vec<usize>| -> Errors {
        let refit = || Some(refitted_near(whole.as_ref()?.linear().without_set(folds, k, parts.as_ref())));
        let found = fitted(&joint.without_images(fold), solved, estimators, refit);
        let alike = same_cameras(&found);
        let errors = fold.iter().map(|i| (*i, errors_of(joint, *i, (&found, &alike)))).collect();
        tick();
        errors
    };
    let mut errors = side_by_side(&joint.problem, folds, of_fold).concat();
    let of_joint = estimators.iter().position(|e| *e == Estimator::Joint).filter(|_| !known.is_empty());
    for (i, own) in &mut errors {
        let at = known.binary_search_by_key(i, |(image, _)| *image).ok();
        if let (Some(of_joint), Some(at)) = (of_joint, at) {
            own[of_joint] = Some(known[at].1);
        }
    }
    errors
}

/// The first of some states that has the cameras and plates of each: an image by itself says the same by both.
fn same_cameras(states: &[Option<State>]) -> Vec<usize> {
    let parts = |k: usize| states[k].as_ref().map(|state| (&state.cameras, &state.plates));
    (0..states.len()).map(|k| (0..k).find(|first| parts(*first) == parts(k)).unwrap_or(k)).collect()
}

/// Errors of an image by every state; `alike` is the first that has the cameras and plates of each.
fn errors_of(
    joint: &Adjustment,
    image: usize,
    (states, alike): (&[Option<State>], &[usize]),
) -> Vec<Option<ImageError>> {
    let mut seen: Vec<Option<Pose>> = Vec::with_capacity(states.len());
    let error = |(k, state): (usize, &Option<State>)| {
        let own = match alike[k] {
            first if first < k => seen[first],
            _ => state.as_ref().and_then(|state| seen_pose(joint, state, image)),
        };
        seen.push(own);
        error_of_predicted(joint, state.as_ref()?, image, &own?)
    };
    states.iter().enumerate().map(error).collect()
}

fn summary(errors: &Errors, clusters: &[usize], k: usize, joint: Option<usize>) -> Option<HeldOut> {
    let of_images: Vec<usize> = errors.iter().map(|(i, _)| clusters[*i]).collect();
    let own: Vec<_> = errors.iter().map(|(_, e)| e[k]).collect::<Option<_>>()?;
    let px: Vec<(f64, f64)> = own.iter().map(|e| (e.px2, e.count)).collect();
    let mm: Vec<(f64, f64)> = own.iter().map(|e| (e.mm2, e.count)).collect();
    let reference: Option<Vec<(f64, f64)>> =
        joint.and_then(|joint| errors.iter().map(|(_, e)| e[joint].map(|e| (e.mm2, e.count))).collect());
    Some(HeldOut {
        rms_px: root_mean_square(&px),
        rms_mm: root_mean_square(&mm),
        to_joint: reference.and_then(|r| bootstrap_ratio(&by_cluster(&of_images, &mm), &by_cluster(&of_images, &r))),
        images: own.len(),
    })
}

fn truth_errors(
    joint: &Adjustment,
    solved: Option<&LinearisedAdjustment>,
    truth: &Truth,
) -> Result<Vec<Option<TruthError>>> {
    let Some(whole) = LinearisedAdjustment::of(joint.clone()) else { return Ok(vec![None; Estimator::ALL.len()]) };
    let refit = || Some(refitted_near(whole.clone()));
    let found = fitted(joint, solved, &Estimator::ALL, refit);
    found.iter().map(|s| s.as_ref().map(|s| truth_error(s, truth)).transpose().map(Option::flatten)).collect()
}

/// Errors of a state over the held-out readings of the first placement.
pub fn truth_error(state: &State, truth: &Truth) -> Result<Option<TruthError>> {
    let Some((_, plate)) = truth.plate_poses.iter().next() else { return Ok(None) };
    let plate = plate.pose();
    let held: Vec<(Vec<f64>, Pose)> =
        truth.held_out.iter().map(|h| (h.readings.clone(), h.base_from_tip.pose())).collect();
    let (Some(mounting), Some(placement)) = (state.mountings.first(), state.placements.first()) else {
        return Ok(None);
    };
    let camera = truth.camera_pose.pose();
    let mount = truth.camera_mount;
    let pairs: Vec<(Pose, Pose)> = held
        .iter()
        .map(|(q, tip)| {
            let predicted = mount.camera_from_plate(mounting, &state.robot.base_from_tip(q), placement);
            (predicted.inverse(), mount.camera_from_plate(&camera, tip, &plate).inverse())
        })
        .collect();
    let camera_m = root_of_mean(camera_errors_m(&pairs).iter().map(|e| e.norm_squared()));
    // With the plate in the hand the flange is judged in the frame of the camera's stand, which is gauge as well.
    let frame = if mount == CameraMount::Hand { plate } else { Pose::identity() };
    Ok(flange_error_m(&state.robot, &frame, &held)
        .map(|flange| TruthError { flange_mm: 1e3 * flange, camera_mm: 1e3 * camera_m }))
}
