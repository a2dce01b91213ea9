//! Free-pose adjustment: cameras, plate and one free camera pose an image; the robot takes no part.

use std::collections::BTreeSet;

use nalgebra::{DMatrix, Matrix6, Vector2};

use super::camera_start::{CameraStart, camera_starts};
use super::numbering::with_numbering;
use crate::assess::Limits;
use crate::error::{Code, Error, Result};
use crate::fit::{FocalLength, FreePose, FreePoses, PlacedCamera};
use crate::geom::{Pose, adjoint};
use crate::identify::problem::build::build;
use crate::identify::start_verdict::{StartReached, StartVerdict};
use crate::init::{FocalCandidate, Homography, focal_candidates, resect};
use crate::model::camera::Camera;
use crate::model::robot::Robot;
use crate::problem::{
    Adjustment, Family, Image, ImageRejection, Layout, Mark, MarkerObservation, MeasuredSeries, ObservationRejection,
    Problem, State, Tie, Weighting, size_by_distance,
};
use crate::series::spread;
use crate::solve::{
    ComponentOptions, Elimination, Fit, LinearImage, Linearised, PlateScale, Settings, Similarity, Status,
    estimate_components_judged, frames, in_frame, in_frame_by, reject_contradictory, reject_observations, solve,
};
use crate::stage::stage;

/// RMS of a start, px per point, from which no further focal length is tried.
const GOOD_START_PX: f64 = 2.0;

/// Images that are enough to tell a lens that is none of a camera.
const ENOUGH_IMAGES: usize = 24;

/// Newton decrement at which a start is left to the adjustment, in roots of the cost that it began with.
const START_DECREMENT: f64 = 0.01;

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

/// Starts the poses of all images of a camera from homographies, refined, for one focal length; counts views from behind and those that fail.
fn start_poses(
    Adjustment { problem, state }: &mut Adjustment,
    camera: usize,
    homographies: &[Option<Homography>],
) -> [usize; 2] {
    let mut ties = state.ties.clone();
    let (mut behind, mut failed) = (0, 0);
    let lens = &state.cameras[camera];
    let centre = Vector2::new(lens.parameters[2], lens.parameters[3]);
    for (i, image) in problem.used().filter(|(_, image)| image.camera == camera) {
        let planar = homographies[i].as_ref().and_then(|h| h.pose(lens.parameters[0], centre));
        let Some(planar) = planar else {
            failed += 1;
            continue;
        };
        behind += usize::from(planar.from_behind);
        let weighting = Weighting::of(problem, image);
        let tries = [planar, planar.flipped()].map(|p| resect(image, state, &p.camera_from_plate, &weighting));
        let best = tries.into_iter().flatten().min_by(|a, b| a.1.total_cmp(&b.1));
        ties[i] = Tie::Free(best.map_or(planar.camera_from_plate, |(pose, _)| pose));
    }
    state.ties = ties;
    [behind, failed]
}

/// Observations of an image that are enough to tell good starts from bad ones.
const ENOUGH: usize = 64;

/// Points instead of circles, some of each image, one camera, markers as printed: a quick problem that tells good starts from bad ones.
fn quick_problem(problem: &Problem, camera: usize) -> Problem {
    let mut quick = problem.clone();
    for image in &mut quick.images {
        if image.camera != camera && image.rejected.is_none() {
            image.rejected = Some(ImageRejection::Excluded);
        }
        let every = Weighting::of(problem, image).thinned(image, ENOUGH).every;
        let some = image.observations.iter().step_by(every);
        image.observations = some.map(|o| MarkerObservation { mark: Mark::Corner, ..o.clone() }).collect();
    }
    quick.plates.iter_mut().flat_map(|p| &mut p.markers).for_each(|m| m.sigma_m = 0.0);
    let shapes = quick.layout.shapes.clone();
    for c in shapes.into_iter().flatten() {
        quick.layout.columns[c].free = false;
    }
    quick
}

/// The best start of a camera.
fn start_camera(
    adjustment: &Adjustment,
    camera: usize,
    homographies: &[Option<Homography>],
    start: &CameraStart,
    verdicts: &mut Vec<StartVerdict>,
) -> Result<State> {
    let Adjustment { problem, state } = adjustment;
    let name = &problem.cameras[camera];
    let own: Vec<Homography> =
        problem.used().filter(|(_, i)| i.camera == camera).filter_map(|(i, _)| homographies[i]).collect();
    if own.is_empty() {
        return Err(Error::new(
            Code::PlateNowhere,
            format!("camera {name}"),
            "none of its images shows the plate",
            "check that plate.toml describes the plate in the images",
        ));
    }
    let (width, height) = (state.cameras[camera].width_px, state.cameras[camera].height_px);
    let mut best: Option<(f64, State, usize)> = None;
    let before = verdicts.len();
    let pinhole = |FocalCandidate { focal_px, origin }: FocalCandidate| {
        let lens = state.cameras[camera].lens;
        (Camera::pinhole(lens, width, height, focal_px), format!("{origin}: {focal_px:.0} px"))
    };
    let (known, stated) = match start {
        CameraStart::Known(known) => (Some(known), None),
        CameraStart::Focal(focal_px) => (None, Some(*focal_px)),
        CameraStart::Unknown => (None, None),
    };
    let given = known.map(|k| (k.camera.clone(), format!("camera file: {:.0} px", k.camera.parameters[0])));
    let others = if known.is_some_and(|k| k.held) { Vec::new() } else { focal_candidates(&own, width, height, stated) };
    for (first, origin) in given.into_iter().chain(others.into_iter().map(pinhole)) {
        let of = format!("focal length of camera {name}");
        if best.as_ref().is_some_and(|b| b.0 < GOOD_START_PX) {
            verdicts.push(StartVerdict { of, origin, reached: StartReached::NotNeeded, won: false });
            continue;
        }
        let (rms, candidate, behind) = try_camera(adjustment, camera, homographies, first);
        let reached = StartReached::CameraPoses { rms_px: Some(rms).filter(|rms| rms.is_finite()) };
        verdicts.push(StartVerdict { of, origin, reached, won: false });
        if best.as_ref().is_none_or(|b| rms < b.0) {
            verdicts[before..].iter_mut().for_each(|v| v.won = false);
            if let Some(last) = verdicts.last_mut() {
                last.won = rms.is_finite();
            }
            best = Some((rms, candidate, behind));
        }
    }
    match best {
        Some((rms, _, behind)) if rms.is_finite() && 2 * behind > own.len() => Err(Error::new(
            Code::PlateMirrored,
            format!("camera {name}"),
            format!("{behind} of {} images show the plate mirrored, as if seen from behind", own.len()),
            "check that the images are not flipped, that u is the column in observations.csv, and that the plate was not printed or described mirrored",
        )),
        Some((rms, state, _)) if rms.is_finite() => Ok(state),
        _ => Err(Error::new(
            Code::FocalNotFound,
            format!("camera {name}"),
            "no starting focal length leads to camera poses that explain the markers",
            "check pitch, columns and rows in plate.toml, or state focal_px in [camera] of series.toml",
        )),
    }
}

/// RMS that a first camera reaches, px, with the state and the number of views from behind.
fn try_camera(
    Adjustment { problem, state }: &Adjustment,
    camera: usize,
    homographies: &[Option<Homography>],
    first: Camera,
) -> (f64, State, usize) {
    let mut quick = Adjustment { problem: quick_problem(problem, camera), state: state.clone() };
    let parametric = first.parametric();
    quick.state.cameras[camera] = first;
    let [behind, failed] = start_poses(&mut quick, camera, homographies);
    if failed > 0 {
        return (f64::INFINITY, quick.state, behind);
    }
    // Focal lengths and the first radial coefficient first, then all.
    let columns = problem.layout.cameras[camera].clone();
    let early = [0, 1, 4];
    for stage in 0..2 {
        for (k, c) in columns.clone().enumerate() {
            let wanted = early.contains(&k) || (stage == 1 && k < parametric);
            quick.problem.layout.columns[c].free = problem.layout.columns[c].free && wanted;
        }
        let cost = quick.linearise().map_or(0.0, |lin| lin.cost);
        let settings = Settings::new(40, (START_DECREMENT * cost.sqrt()).max(0.1));
        let outcome = solve(quick, &settings);
        quick = outcome.adjustment;
        let Some(lin) = outcome.linearised else { break };
        if stage == 1 {
            return (rms_px(&lin), quick.state, behind);
        }
    }
    (f64::INFINITY, quick.state, behind)
}

fn rms_px(lin: &Linearised) -> f64 {
    let (sum, count) = lin.terms.iter().fold((0.0, 0), |(s, n), t| {
        (s + t.residuals.iter().map(|r| r.duv.norm_squared()).sum::<f64>(), n + t.residuals.len())
    });
    (sum / count.max(1) as f64).sqrt()
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
