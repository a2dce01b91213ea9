//! Cameras are started from their homographies: focal lengths are tried on a quick problem, and the best one counts.

use nalgebra::Vector2;

use super::camera_start::CameraStart;
use crate::error::{Code, Error, Result};
use crate::identify::start_verdict::{StartReached, StartVerdict};
use crate::init::{FocalCandidate, Homography, focal_candidates, resect};
use crate::model::camera::Camera;
use crate::problem::{Adjustment, ImageRejection, Mark, MarkerObservation, Problem, State, Tie, Weighting};
use crate::solve::{Linearised, Settings, solve};

/// RMS of a start, px per point, from which no further focal length is tried.
pub(super) const GOOD_START_PX: f64 = 2.0;

/// Newton decrement at which a start is left to the adjustment, in roots of the cost that it began with.
const START_DECREMENT: f64 = 0.01;

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
///
/// # Errors
/// Where no image of it shows the plate, or most show it mirrored, and where no focal length explains the markers.
pub(super) fn start_camera(
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
    let firsts = first_cameras(&state.cameras[camera], &own, start);
    match best_start(adjustment, (camera, homographies), firsts, verdicts) {
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

/// Cameras to begin with, and where each comes from: as given, and by the views of the plate.
fn first_cameras(camera: &Camera, own: &[Homography], start: &CameraStart) -> Vec<(Camera, String)> {
    let (width, height) = (camera.width_px, camera.height_px);
    let pinhole = |FocalCandidate { focal_px, origin }: FocalCandidate| {
        (Camera::pinhole(camera.lens, width, height, focal_px), format!("{origin}: {focal_px:.0} px"))
    };
    let (known, stated) = match start {
        CameraStart::Known(known) => (Some(known), None),
        CameraStart::Focal(focal_px) => (None, Some(*focal_px)),
        CameraStart::Unknown => (None, None),
    };
    let given = known.map(|k| (k.camera.clone(), format!("camera file: {:.0} px", k.camera.parameters[0])));
    let others = if known.is_some_and(|k| k.held) { Vec::new() } else { focal_candidates(own, width, height, stated) };
    given.into_iter().chain(others.into_iter().map(pinhole)).collect()
}

/// What a first camera leads to: RMS, px, the state, and the number of views from behind.
type Tried = (f64, State, usize);

/// The best of these cameras to begin with; none is tried after a good one.
fn best_start(
    adjustment: &Adjustment,
    (camera, homographies): (usize, &[Option<Homography>]),
    firsts: Vec<(Camera, String)>,
    verdicts: &mut Vec<StartVerdict>,
) -> Option<Tried> {
    let mut best: Option<Tried> = None;
    let before = verdicts.len();
    for (first, origin) in firsts {
        let of = format!("focal length of camera {}", adjustment.problem.cameras[camera]);
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
    best
}

/// RMS that a first camera reaches, px, with the state and the number of views from behind.
fn try_camera(
    Adjustment { problem, state }: &Adjustment,
    camera: usize,
    homographies: &[Option<Homography>],
    first: Camera,
) -> Tried {
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

/// RMS of the residuals of an adjustment, px.
pub(super) fn rms_px(lin: &Linearised) -> f64 {
    let (sum, count) = lin.terms.iter().fold((0.0, 0), |(s, n), t| {
        (s + t.residuals.iter().map(|r| r.duv.norm_squared()).sum::<f64>(), n + t.residuals.len())
    });
    (sum / count.max(1) as f64).sqrt()
}
