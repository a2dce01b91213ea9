//! Free-pose adjustment: cameras, plate and one free camera pose an image; the robot takes no part.

use std::collections::BTreeSet;

use nalgebra::{DMatrix, Matrix6, Vector2};

use super::camera_start::{CameraStart, camera_starts};
use super::first_camera::{GOOD_START_PX, rms_px, start_camera};
use super::numbering::with_numbering;
use crate::assess::Limits;
use crate::error::{Code, Error, Result};
use crate::fit::{FocalLength, FreePose, FreePoses, PlacedCamera};
use crate::geom::{Pose, adjoint};
use crate::identify::problem::build::build;
use crate::identify::start_verdict::{StartReached, StartVerdict};
use crate::init::Homography;
use crate::model::camera::Camera;
use crate::model::robot::Robot;
use crate::problem::{
    Adjustment, Family, Image, ImageRejection, Layout, MeasuredSeries, ObservationRejection, Problem, State, Tie,
    size_by_distance,
};
use crate::series::spread;
use crate::solve::{
    ComponentOptions, Elimination, Fit, LinearImage, Linearised, PlateScale, Similarity, Status,
    estimate_components_judged, frames, in_frame, in_frame_by, reject_contradictory, reject_observations,
};
use crate::stage::stage;

/// Images that are enough to tell a lens that is none of a camera.
const ENOUGH_IMAGES: usize = 24;

/// Most rounds of rejection.
const ROUNDS: usize = 12;

/// What a free-pose adjustment leaves to a joint fit, whatever the robot model.
#[derive(Debug, Clone)]
pub(in crate::identify) struct FreeStart {
    /// The poses.
    pub free: FreePoses,
    /// Starting values of the cameras.
    pub verdicts: Vec<StartVerdict>,
    /// Poses of the images.
    ties: Vec<Tie>,
    images: Vec<LeftOut>,
    marker_factor: Vec<f64>,
    families: Vec<Family>,
}

/// What was left out of an image.
#[derive(Debug, Clone)]
struct LeftOut {
    image: Option<ImageRejection>,
    observations: Vec<Option<ObservationRejection>>,
}

impl FreeStart {
    /// Of an adjustment as [`adjust_free_poses`] leaves it.
    pub fn of(Adjustment { problem, state }: &Adjustment, free: FreePoses, verdicts: Vec<StartVerdict>) -> Self {
        let left_out = |image: &Image| LeftOut {
            image: image.rejected.clone(),
            observations: image.observations.iter().map(|o| o.rejected).collect(),
        };
        Self {
            free,
            verdicts,
            ties: state.ties.clone(),
            images: problem.images.iter().map(left_out).collect(),
            marker_factor: problem.noise.marker.clone(),
            families: problem.families.clone(),
        }
    }

    /// Brings an adjustment of the same series with another robot model to where its own free-pose adjustment would.
    pub fn carry_to(&self, Adjustment { problem, state }: &mut Adjustment) {
        state.cameras.clone_from(&self.free.state.cameras);
        state.plates.clone_from(&self.free.state.plates);
        state.ties.clone_from(&self.ties);
        for (image, left) in problem.images.iter_mut().zip(&self.images) {
            image.rejected.clone_from(&left.image);
            image.leave_out_as(left.observations.iter().copied());
        }
        problem.noise.pixel_factor.clone_from(&self.free.pixel_factor);
        problem.noise.marker.clone_from(&self.marker_factor);
        problem.families.iter_mut().for_each(|f| f.take_factor(&self.families));
        problem.families.iter().for_each(|f| f.hold(&mut problem.layout));
    }

    /// True for poses by the lenses of a state.
    pub fn has_lenses_of(&self, state: &State) -> bool {
        self.free.state.cameras.iter().map(|c| c.lens).eq(state.cameras.iter().map(|c| c.lens))
    }

    /// The free-pose adjustment with the lenses of an adjustment that was solved `near` this one, from these poses; `adjustment` is left where it ends.
    ///
    /// # Errors
    /// As of [`adjust_free_poses`].
    pub fn with_lenses_of(
        self,
        near: &Adjustment,
        adjustment: Adjustment,
        limits: &Limits,
    ) -> Result<(Adjustment, Self)> {
        let mut adjustment = adjustment;
        self.carry_to(&mut adjustment);
        let Adjustment { problem, state } = &mut adjustment;
        state.cameras.clone_from(&near.state.cameras);
        problem.noise.pixel_factor.clone_from(&near.problem.noise.pixel_factor);
        problem.families.iter_mut().for_each(|f| f.take_factor(&near.problem.families));
        problem.families.iter().for_each(|f| f.hold(&mut problem.layout));
        let (adjustment, free) = of_images_alone(adjustment, limits, |_| Ok(()))?;
        let start = Self::of(&adjustment, free, self.verdicts);
        Ok((adjustment, start))
    }
}

/// The adjustment of what the images of some series say by themselves, with exact readings; `prepare` may hold columns or leave observations out.
///
/// # Errors
/// Those of [`build`], of `prepare` and of [`adjust_free_poses`].
pub(in crate::identify) fn free_poses_of(
    robot: &Robot,
    series: &[MeasuredSeries],
    limits: &Limits,
    prepare: impl FnOnce(&mut Adjustment) -> Result<()>,
) -> Result<(Adjustment, FreePoses, Vec<StartVerdict>)> {
    let mut start = build(robot, series, false, limits)?;
    prepare(&mut start)?;
    let stated = camera_starts(&start.problem.cameras, series);
    adjust_free_poses(start, &stated, limits)
}

/// Start of a camera whose lens explains some of its images, to where no further focal length is tried; `None` where it does not.
///
/// # Errors
/// Those of [`build`]; no image shows the plate, or no start leads to camera poses.
pub(in crate::identify) fn good_start(
    robot: &Robot,
    series: &[MeasuredSeries],
    camera: &str,
    limits: &Limits,
) -> Result<Option<Camera>> {
    let mut adjustment = build(robot, series, false, limits)?;
    adjustment.problem.take_bodies();
    adjustment.hold_poses();
    let Problem { cameras, images, .. } = &mut adjustment.problem;
    let Some(k) = cameras.iter().position(|c| c == camera) else { return Ok(None) };
    let stated = camera_starts(cameras, series);
    let own = images.iter().filter(|image| image.camera == k && image.rejected.is_none()).count();
    let enough: BTreeSet<usize> = spread(own, ENOUGH_IMAGES).collect();
    let all = images.iter_mut().filter(|image| image.rejected.is_none());
    let (of_camera, others): (Vec<_>, Vec<_>) = all.partition(|image| image.camera == k);
    let rest = of_camera.into_iter().enumerate().filter(|(at, _)| !enough.contains(at)).map(|(_, image)| image);
    rest.chain(others).for_each(|image| image.rejected = Some(ImageRejection::Excluded));
    let homographies = fit_homographies(&mut adjustment)?;
    let mut verdicts = Vec::new();
    let mut state = start_camera(&adjustment, k, &homographies, &stated[k], &mut verdicts)?;
    let is_good = |reached: &StartReached| match reached {
        StartReached::CameraPoses { rms_px } => rms_px.is_some_and(|rms| rms < GOOD_START_PX),
        _ => false,
    };
    Ok(verdicts.iter().any(|verdict| is_good(&verdict.reached)).then(|| state.cameras.swap_remove(k)))
}

/// Adjusts from nothing. The adjustment that is left holds rejections and pixel factors, cameras, plates and poses.
///
/// # Errors
/// When no image shows enough markers, when the plate is mirrored, when no start converges or the focal length is not determined.
pub fn adjust_free_poses(
    adjustment: Adjustment,
    starts: &[CameraStart],
    limits: &Limits,
) -> Result<(Adjustment, FreePoses, Vec<StartVerdict>)> {
    let mut verdicts = Vec::new();
    let (adjustment, free) = of_images_alone(adjustment, limits, |adjustment| {
        let homographies = fit_homographies(adjustment)?;
        for (camera, start) in starts.iter().enumerate() {
            let started = start_camera(adjustment, camera, &homographies, start, &mut verdicts);
            let explained = |e| with_numbering(e, &adjustment.problem, camera, limits.mistake_explains);
            adjustment.state = started.map_err(explained)?;
        }
        Ok(())
    })?;
    Ok((adjustment, free, verdicts))
}

/// Adjusts cameras, plates and poses from where `start` brings them; the robot and what was measured of bodies take no part.
fn of_images_alone(
    mut adjustment: Adjustment,
    limits: &Limits,
    start: impl FnOnce(&mut Adjustment) -> Result<()>,
) -> Result<(Adjustment, FreePoses)> {
    let _stage = stage("free poses");
    let bodies = adjustment.problem.take_bodies();
    let free_before: Vec<bool> = adjustment.problem.layout.columns.iter().map(|c| c.free).collect();
    adjustment.hold_poses();
    start(&mut adjustment)?;
    let (mut adjustment, free) = finish(adjustment, limits)?;
    for (column, free) in adjustment.problem.layout.columns.iter_mut().zip(free_before) {
        column.free = free;
    }
    adjustment.problem.put_bodies(bodies);
    Ok((adjustment, free))
}

fn fit_homographies(Adjustment { problem, state }: &mut Adjustment) -> Result<Vec<Option<Homography>>> {
    let mut all = Vec::with_capacity(problem.images.len());
    for image in &mut problem.images {
        let plane: Vec<Vector2<f64>> = image.used().map(|o| state.plates[image.plate].nominal[o.marker].xy()).collect();
        let pixels: Vec<Vector2<f64>> = image.used().map(|o| o.uv).collect();
        let homography = if image.rejected.is_none() { Homography::fit(&plane, &pixels) } else { None };
        if image.rejected.is_none() && homography.is_none() {
            image.rejected = Some(ImageRejection::Collinear);
        }
        all.push(homography);
    }
    if problem.used().count() == 0 {
        let reasons: Vec<String> = (problem.images.iter().take(3))
            .map(|i| format!("{}: {}", i.name, i.rejected.as_ref().map(ToString::to_string).unwrap_or_default()))
            .collect();
        return Err(Error::new(
            Code::PlateNowhere,
            "images",
            format!("no image shows the plate ({})", reasons.join("; ")),
            "check that plate.toml describes the plate in the images, and look at one of them",
        ));
    }
    Ok(all)
}

/// A camera is determined by views from different directions only, if it is not held.
fn check_views(adjustment: &Adjustment, least_turn: f64) -> Result<()> {
    for (camera, name) in adjustment.problem.cameras.iter().enumerate() {
        let views: Vec<&Pose> = views(adjustment, camera).collect();
        let Some(first) = views.first() else { continue };
        let Layout { cameras, columns, .. } = &adjustment.problem.layout;
        if columns[cameras[camera].clone()].iter().all(|c| !c.free) {
            continue;
        }
        let turn = views.iter().map(|v| first.distance(v).0).fold(0.0, f64::max);
        if turn < least_turn {
            return Err(undetermined(
                Code::ViewsAlike,
                &format!("the images of {name} are all alike: they differ by {:.1} degrees at most", turn.to_degrees()),
            ));
        }
    }
    Ok(())
}

/// The free poses of a camera.
fn views(adjustment: &Adjustment, camera: usize) -> impl Iterator<Item = &Pose> {
    let own = adjustment.used().filter(move |(_, image, _)| image.camera == camera);
    own.filter_map(|(_, _, tie)| tie.free_pose())
}

/// Names a camera that looked at the plate from straight ahead only, whatever its distance and roll: a longer focal length and a
/// greater distance show the same.
fn facing(adjustment: &Adjustment, least_tilt: f64) -> Option<Error> {
    let tilt = |pose: &Pose| pose.rotation[(2, 2)].abs().min(1.0).acos();
    adjustment.problem.cameras.iter().enumerate().find_map(|(camera, name)| {
        let tilts: Vec<f64> = views(adjustment, camera).map(tilt).collect();
        let largest = tilts.iter().copied().reduce(f64::max)?;
        (largest < least_tilt).then(|| {
            undetermined(Code::ViewsFrontal, &format!(
                "all {} images of {name} look straight at the plate (tilted by {:.1} degrees at most), so that focal length and distance \
                 cannot be told apart",
                tilts.len(),
                largest.to_degrees()
            ))
        })
    })
}

fn finish(start: Adjustment, limits: &Limits) -> Result<(Adjustment, FreePoses)> {
    check_views(&start, limits.alike_views_rad)?;
    let options = ComponentOptions { joint: false, rounds: 20, ..ComponentOptions::default() };
    let judge = |adjustment: &mut Adjustment| {
        let has_changed = reject_observations(adjustment) > 0;
        reject_contradictory(adjustment).is_some() || has_changed
    };
    let outcome = estimate_components_judged(start, &options, (ROUNDS, judge));
    if outcome.status != Status::Converged {
        let problem = &outcome.adjustment.problem;
        let not_converged = || {
            let what = format!("the adjustment {}", outcome.status.words());
            let remedy = "look at the images for a wrong plate, motion blur or changed focus";
            let error = Error::new(Code::NotConverged, "free camera poses", what, remedy);
            let numbered = |e, camera| with_numbering(e, problem, camera, limits.mistake_explains);
            (0..problem.cameras.len()).fold(error, numbered)
        };
        return Err(facing(&outcome.adjustment, limits.facing_tilt_rad).unwrap_or_else(not_converged));
    }
    let fit = outcome.fit().map_err(|e| undetermined(Code::CameraUndetermined, &e.to_string()))?;
    check_focal(&fit, limits)?;
    let free = collect(&fit)?;
    Ok((fit.adjustment, free))
}

fn undetermined(code: Code, what: &str) -> Error {
    Error::new(
        code,
        "camera",
        format!("{what}: the images do not determine the camera"),
        "take images from different directions: tilt the camera by 20 to 45 degrees to all sides, at two or more distances, rolled by 90 degrees",
    )
}

fn check_focal(fit: &Fit, limits: &Limits) -> Result<()> {
    let (Adjustment { problem, state }, cov) = (&fit.adjustment, &fit.covariance);
    for (k, range) in problem.layout.cameras.iter().enumerate() {
        for (c, axis) in [(range.start, "fx"), (range.start + 1, "fy")] {
            let focal = state.cameras[k].parameters[c - range.start];
            let relative = cov.sigma(c) / focal.abs();
            if problem.layout.columns[c].free && (relative.is_nan() || relative > limits.focal_sigma || focal <= 0.0) {
                let what = format!("{axis} of {} is known to {:.1} % only", problem.cameras[k], 100.0 * relative);
                return Err(facing(fit, limits.facing_tilt_rad)
                    .unwrap_or_else(|| undetermined(Code::CameraUndetermined, &what)));
            }
        }
    }
    Ok(())
}

fn collect(fit: &Fit) -> Result<FreePoses> {
    let Fit { adjustment: Adjustment { problem, state }, linearised: lin, covariance } = fit;
    let (placed, scales) = placed_cameras(fit)?;
    let mut poses = vec![None; problem.images.len()];
    let covariances = covariance.of_images(fit.linear());
    for ((LinearImage { index, image, terms, chain, .. }, c), in_frame) in
        fit.linear().images().zip(covariances).zip(placed)
    {
        let intrinsics = &state.cameras[image.camera].parameters;
        let squares: f64 = terms.residuals.iter().map(|r| r.duv.norm_squared()).sum();
        poses[index] = Some(FreePose {
            camera_from_plate: chain.pose,
            covariance: Matrix6::from_column_slice(c.as_slice()),
            in_frame,
            rms_px: (squares / terms.residuals.len().max(1) as f64).sqrt(),
            focal: FocalLength::of(terms, [intrinsics[0], intrinsics[1]]),
        });
    }
    Ok(FreePoses {
        poses,
        rms_px: rms_px(lin),
        observations: lin.terms.iter().map(|t| t.residuals.len()).sum(),
        state: state.clone(),
        scales,
        pixel_factor: problem.noise.pixel_factor.clone(),
    })
}

/// The adjustment with every plate in its frame, and the sizes of the plates.
fn in_own_frames(fit: &Fit) -> Result<(Adjustment, Vec<f64>)> {
    let Adjustment { problem, state } = &fit.adjustment;
    let mut moved = state.clone();
    let mut sizes = vec![1.0; problem.plates.len()];
    for frame in frames(fit)? {
        let similarity = Similarity::of(&frame, &fit.adjustment)?;
        for &plate in &frame.plates {
            let as_made = similarity.shape(plate, &state.plates[plate], 1.0);
            let size = size_by_distance(&problem.plates[plate], &as_made).unwrap_or(1.0);
            moved.plates[plate] = similarity.shape(plate, &state.plates[plate], size);
            for (i, _) in problem.used().filter(|(_, image)| image.plate == plate) {
                if let Tie::Free(pose) = &mut moved.ties[i] {
                    *pose = similarity.pose(plate, pose, size);
                }
            }
            sizes[plate] = size;
        }
    }
    Ok((Adjustment { problem: problem.clone(), state: moved }, sizes))
}

fn linearised(moved: &Adjustment) -> Result<Linearised> {
    moved.linearise().ok_or_else(|| undetermined(Code::CameraUndetermined, "a marker lies behind its camera"))
}

/// Covariance of all poses `plate_from_camera` together, in the frames of their plates: images in use, six rows each, m and rad.
///
/// # Errors
/// Markers that define no frame.
pub(in crate::identify) fn covariance_together(fit: &Fit) -> Result<DMatrix<f64>> {
    let (moved, _) = in_own_frames(fit)?;
    let lin = linearised(&moved)?;
    let linear = moved.linear(&lin);
    let together = in_frame_by(Elimination::Markers, linear, &fit.covariance)?.poses_together(linear);
    let mut all = together.unwrap_or_else(|| DMatrix::zeros(0, 0));
    let turns: Vec<Matrix6<f64>> = linear.images().map(|own| adjoint(&own.chain.pose)).collect();
    let images = all.nrows() / 6;
    for (i, turn) in turns.iter().enumerate().take(images) {
        let rows = turn * all.rows(6 * i, 6);
        all.rows_mut(6 * i, 6).copy_from(&rows);
        let columns = all.columns(6 * i, 6) * turn.transpose();
        all.columns_mut(6 * i, 6).copy_from(&columns);
    }
    Ok((&all + all.transpose()) * 0.5)
}

/// The cameras of the images in use in the frames of their plates, and the scales of the plates.
fn placed_cameras(fit: &Fit) -> Result<(Vec<PlacedCamera>, Vec<Option<PlateScale>>)> {
    let problem = &fit.problem;
    let (moved, sizes) = in_own_frames(fit)?;
    let lin = linearised(&moved)?;
    let linear = moved.linear(&lin);
    let covariance = in_frame(linear, &fit.covariance)?;
    let scale = |(plate, size): (usize, f64)| {
        let frame = covariance.frame(plate)?;
        let sigma = match problem.plates[plate].scale {
            Some(_) => covariance.scale_sigma(problem, plate)?,
            // Images alone see no size: what is known of it was stated.
            None => frame.scale_sigma_of_priors(problem, plate),
        };
        Some(PlateScale { relative: size - 1.0, sigma })
    };
    let scales = sizes.into_iter().enumerate().map(scale).collect();
    let of_images = linear.images().zip(covariance.poses(linear));
    Ok((of_images.map(|(own, c)| PlacedCamera::of(&own.chain.pose, &c)).collect(), scales))
}

impl PlacedCamera {
    /// From `camera_from_plate`: the inverse of `T Exp(x)` is `T^-1 Exp(-Ad_T x)`.
    fn of(camera_from_plate: &Pose, covariance: &Matrix6<f64>) -> Self {
        let ad = adjoint(camera_from_plate);
        let covariance = ad * covariance * ad.transpose();
        let covariance = 0.5 * (covariance + covariance.transpose());
        Self { plate_from_camera: camera_from_plate.inverse(), covariance }
    }
}
