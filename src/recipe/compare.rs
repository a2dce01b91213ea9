//! All estimators side by side: against truth where it is known, on held-out images where it is not.

use nalgebra::{DMatrix, Vector3};
use serde::{Deserialize, Serialize};

use super::joint::JointNoise;
use super::solution::Solution;
use super::two_stage::{Estimator, PoseStage, estimate_all, fit_poses};
use crate::assess::{
    Ratio, bootstrap_ratio, by_cluster, camera_errors_m, cluster_of_images, flange_error_m, folds, predict_image,
    refitted, root_mean_square, without_images,
};
use crate::error::{Error, Result};
use crate::geom::Pose;
use crate::linalg::symmetric_eigen;
use crate::problem::{Problem, State};
use crate::series::CameraMount;
use crate::simulate::truth::Truth;

/// Errors on images that the estimator did not see.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct HeldOut {
    /// RMS distance between measured and predicted markers, px.
    pub rms_px: f64,
    /// RMS distance in space at the plate, mm.
    pub rms_mm: f64,
    /// RMS in mm over that of the joint estimator, with bootstrap interval over images; those that share joint readings count once.
    pub to_joint: Option<Ratio>,
    /// Number of images predicted.
    pub images: usize,
}

/// Errors against what was put in.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct TruthError {
    /// RMS error of the flange relative to the plate over held-out readings, gauge aligned, mm.
    pub flange_mm: f64,
    /// RMS error of the camera's position in the plate frame over held-out readings, nothing aligned, mm.
    pub camera_mm: f64,
}

/// One estimator.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ComparisonRow {
    /// Which.
    pub estimator: Estimator,
    /// Held out fold by fold; images that share joint readings stay together.
    pub by_image: Option<HeldOut>,
    /// Held out one region of the workspace after the other.
    pub by_region: Option<HeldOut>,
    /// Against truth.
    pub truth: Option<TruthError>,
}

/// The comparison.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Comparison {
    /// Rows in the order A to F, of the estimators that took part.
    pub rows: Vec<ComparisonRow>,
    /// Images on the robot that took part.
    pub images: usize,
    /// Number of folds by image, and of slabs of the workspace.
    pub folds: [usize; 2],
}

impl Comparison {
    /// The two-stage fits that predicted held-out images, with their error over that of the joint fit.
    pub fn two_stage(&self) -> impl Iterator<Item = (&ComparisonRow, Ratio)> {
        let staged = |row: &&ComparisonRow| !matches!(row.estimator, Estimator::HardJoint | Estimator::Joint);
        self.rows.iter().filter(staged).filter_map(|row| Some((row, row.by_image?.to_joint?)))
    }

    /// The one of them with the smallest error.
    pub fn best_two_stage(&self) -> Option<(&ComparisonRow, Ratio)> {
        self.two_stage().min_by(|a, b| a.1.value.total_cmp(&b.1.value))
    }
}

const FOLDS: usize = 6;

/// Fewest images on the robot that leave enough for a fit when a region is held out.
const FEWEST_IMAGES: usize = 12;

/// Compares on the observations of a solution: its outliers and rejected images are left out for all estimators.
///
/// # Errors
/// Too few images on the robot.
pub fn compare(solution: &Solution, truth: Option<&Truth>, progress: impl Fn(usize, usize)) -> Result<Comparison> {
    let (problem, state) = (&solution.problem, &solution.state);
    let on_robot: Vec<usize> = problem.used().filter(|(_, i)| i.stop.is_some()).map(|(i, _)| i).collect();
    if on_robot.len() < FEWEST_IMAGES {
        return Err(Error::unsolved(
            "comparison",
            format!("{} images of the robot are too few to hold regions out", on_robot.len()),
            format!("take at least {FEWEST_IMAGES}, better 30"),
        ));
    }
    let by_image = folds(problem).unwrap_or_default();
    let total = by_image.len() + FOLDS + 1;
    let mut done = 0;
    let mut tick = || {
        done += 1;
        progress(done, total);
    };
    let clusters = cluster_of_images(problem);
    let all =
        |p: &Problem, s: &State| estimate_all(p, s).into_iter().map(|(e, found)| (e, found.map(|f| f.state))).collect();
    let image_errors = held_out(problem, state, &by_image, all, &mut tick);
    let region_errors = held_out(problem, state, &regions(problem, state, &on_robot), all, &mut tick);
    let against_truth = truth.map(|t| truth_errors(problem, state, t)).transpose()?;
    tick();
    let rows = Estimator::ALL
        .into_iter()
        .enumerate()
        .map(|(k, estimator)| ComparisonRow {
            estimator,
            by_image: summary(&image_errors, &clusters, k),
            by_region: summary(&region_errors, &clusters, k),
            truth: against_truth.as_ref().and_then(|t| t[k]),
        })
        .collect();
    Ok(Comparison { rows, images: on_robot.len(), folds: [by_image.len(), FOLDS] })
}

/// The two-stage estimators beside the joint fit, held out by image: what the report of every solution says. `None` for too few images.
///
/// The joint fit keeps the noise components of the solution; those of the two-stage estimators are from the images that are left.
pub fn beside_two_stages(solution: &Solution) -> Option<Comparison> {
    let (problem, state) = (&solution.problem, &solution.state);
    let images = problem.used().filter(|(_, i)| i.stop.is_some()).count();
    let folds = folds(problem).filter(|_| images >= FEWEST_IMAGES)?;
    let errors = held_out(problem, state, &folds, two_stages_and_joint, &mut || ());
    let clusters = cluster_of_images(problem);
    let taking_part = Estimator::ALL.into_iter().enumerate().filter(|(_, e)| *e != Estimator::HardJoint);
    let rows = taking_part
        .map(|(k, estimator)| {
            let by_image = summary(&errors, &clusters, k);
            ComparisonRow { estimator, by_image, by_region: None, truth: None }
        })
        .collect();
    Some(Comparison { rows, images, folds: [folds.len(), 0] })
}

fn two_stages_and_joint(problem: &Problem, state: &State) -> Vec<(Estimator, Option<State>)> {
    let stage = PoseStage::adjusted(problem, state);
    let found = |estimator| match estimator {
        Estimator::HardJoint => None,
        Estimator::Joint => Some(refitted(problem, state)),
        _ => Some(fit_poses(problem, stage.as_ref()?, state, estimator, JointNoise::Estimated)?.state),
    };
    Estimator::ALL.map(|estimator| (estimator, found(estimator))).into()
}

/// Error of every held-out image, with its index, by every estimator; `None` where an estimator has no solution for a fold.
type Errors = Vec<(usize, [Option<crate::assess::ImageError>; 6])>;

fn held_out(
    problem: &Problem,
    state: &State,
    folds: &[Vec<usize>],
    estimate: impl Fn(&Problem, &State) -> Vec<(Estimator, Option<State>)>,
    tick: &mut dyn FnMut(),
) -> Errors {
    let mut errors = Vec::new();
    for fold in folds {
        let found = estimate(&without_images(problem, fold), state);
        for &i in fold {
            let of = |(_, state): &(Estimator, Option<State>)| predict_image(problem, state.as_ref()?, i);
            errors.push((i, std::array::from_fn(|k| found.get(k).and_then(of))));
        }
        tick();
    }
    errors
}

fn summary(errors: &Errors, clusters: &[usize], k: usize) -> Option<HeldOut> {
    let joint = Estimator::ALL.len() - 1;
    let of_images: Vec<usize> = errors.iter().map(|(i, _)| clusters[*i]).collect();
    let own: Vec<_> = errors.iter().map(|(_, e)| e[k]).collect::<Option<_>>()?;
    let px: Vec<(f64, f64)> = own.iter().map(|e| (e.px2, e.count)).collect();
    let mm: Vec<(f64, f64)> = own.iter().map(|e| (e.mm2, e.count)).collect();
    let reference: Option<Vec<(f64, f64)>> = errors.iter().map(|(_, e)| e[joint].map(|e| (e.mm2, e.count))).collect();
    Some(HeldOut {
        rms_px: root_mean_square(&px),
        rms_mm: root_mean_square(&mm),
        to_joint: reference.and_then(|r| bootstrap_ratio(&by_cluster(&of_images, &mm), &by_cluster(&of_images, &r))),
        images: own.len(),
    })
}

/// Slabs of the workspace, equal in number of images, along the direction in which the tip moved most.
fn regions(problem: &Problem, state: &State, on_robot: &[usize]) -> Vec<Vec<usize>> {
    let position = |i: &usize| {
        let readings = problem.images[*i].stop.as_ref().map(|s| s.readings.as_slice()).unwrap_or_default();
        (*i, state.robot.base_from_tip(readings).translation)
    };
    let places: Vec<(usize, Vector3<f64>)> = on_robot.iter().map(position).collect();
    let mean = places.iter().map(|(_, p)| p).sum::<Vector3<f64>>() / places.len() as f64;
    let mut spread = DMatrix::<f64>::zeros(3, 3);
    for (_, p) in &places {
        let d = p - mean;
        spread += DMatrix::from_column_slice(3, 3, (d * d.transpose()).as_slice());
    }
    let main = symmetric_eigen(&spread).map_or(Vector3::x(), |(_, v)| Vector3::new(v[(0, 2)], v[(1, 2)], v[(2, 2)]));
    let mut order: Vec<(usize, f64)> = places.iter().map(|(i, p)| (*i, main.dot(&(p - mean)))).collect();
    order.sort_by(|a, b| a.1.total_cmp(&b.1).then(a.0.cmp(&b.0)));
    let n = order.len();
    (0..FOLDS).map(|f| order[f * n / FOLDS..(f + 1) * n / FOLDS].iter().map(|(i, _)| *i).collect()).collect()
}

fn truth_errors(problem: &Problem, state: &State, truth: &Truth) -> Result<Vec<Option<TruthError>>> {
    let found = estimate_all(problem, state);
    found
        .iter()
        .map(|(_, e)| e.as_ref().map(|e| truth_error(&e.state, truth)).transpose().map(Option::flatten))
        .collect()
}

/// Errors of a state over the held-out readings of the first placement.
pub(super) fn truth_error(state: &State, truth: &Truth) -> Result<Option<TruthError>> {
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
    let off: Vec<(f64, f64)> = camera_errors_m(&pairs).iter().map(|e| (e.norm_squared(), 1.0)).collect();
    // With the plate in the hand the flange is judged in the frame of the camera's stand, which is gauge as well.
    let frame = if mount == CameraMount::Hand { plate } else { Pose::identity() };
    Ok(flange_error_m(&state.robot, &frame, &held)
        .map(|flange| TruthError { flange_mm: 1e3 * flange, camera_mm: 1e3 * root_mean_square(&off) }))
}
