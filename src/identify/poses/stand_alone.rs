//! Cameras, plates and stand-alone camera poses from images alone: the photogrammetric part by itself, no robot takes part.

use nalgebra::{DMatrix, Matrix3, Matrix3x6, Matrix6};

use crate::assess::{Limits, camera_shows_pattern};
use crate::diagnose::{
    CheckContext, Diagnosis, DoubtedSize, Finding, many_left_out, named_markers_off, observations_left_out,
    residual_pattern, tags_off, uneven_plates,
};
use crate::error::{Code, Error, Notice, Result};
use crate::fit::{Fit, FreePose, FreePoses, PlacedCamera};
use crate::geom::skew;
use crate::identify::model_choice::lens_choice::{choose_lens, losses, open_cameras};
use crate::identify::photogrammetry::free_poses::{covariance_together, free_poses_of};
use crate::identify::solution::Solution;
use crate::identify::start_verdict::StartVerdict;
use crate::model::camera::Lens;
use crate::model::robot::Robot;
use crate::problem::{Adjustment, LensChoice, MeasuredSeries};
use crate::solve::PlateScale;
use crate::urdf::Chain;

/// Cameras, plates and the camera pose of every image, with their covariances.
#[derive(Debug, Clone)]
pub struct StandAlone {
    /// The adjustment: cameras, plates and free poses; nothing of a robot.
    pub fit: Fit,
    /// The poses, also in the frames of the plates.
    pub free_poses: FreePoses,
    /// What they were found from, with the lenses that were taken.
    pub series: Vec<MeasuredSeries>,
    /// How the starting values were found.
    pub starts: Vec<StartVerdict>,
    /// Why which lens was taken.
    pub notices: Vec<Notice>,
    /// What the images contradict.
    pub findings: Vec<Finding>,
}

/// How well the pose of one camera is known, in the frame of the plate that its nominal markers define; the scale is apart.
#[derive(Debug, Clone, Copy)]
pub struct PoseSigma {
    /// Index of the image.
    pub image: usize,
    /// Residuals, px RMS per point.
    pub rms_px: f64,
    /// Number of observations in use.
    pub observations: usize,
    /// Standard deviation of the position, m: root of the mean variance of an axis.
    pub position_m: f64,
    /// Standard deviation of the direction, rad: root of the mean variance about an axis.
    pub rotation_rad: f64,
    /// Semi-axes of the ellipsoid of one sigma of the camera in the frame of the plate, m, the largest first.
    pub camera_axes_m: [f64; 3],
    /// The same of the plate's centre as the camera sees it: errors of position and direction of a pose go together, so that the
    /// centre is known better than the camera.
    pub centre_axes_m: [f64; 3],
    /// Largest correlation of a direction of the position with one of the rotation (canonical correlation).
    pub correlation: f64,
}

/// Semi-axes of the ellipsoid of one sigma, the largest first.
fn semi_axes(covariance: &Matrix3<f64>) -> [f64; 3] {
    let mut axes: [f64; 3] = covariance.symmetric_eigenvalues().map(|v| v.max(0.0).sqrt()).into();
    axes.sort_by(|a, b| b.total_cmp(a));
    axes
}

/// Largest canonical correlation of position and rotation.
fn canonical_correlation(c: &Matrix6<f64>) -> f64 {
    let part = |i: usize, k: usize| c.fixed_view::<3, 3>(3 * i, 3 * k).into_owned();
    let whitening = |m: Matrix3<f64>| m.cholesky().and_then(|f| f.l().try_inverse());
    let both = whitening(part(0, 0)).zip(whitening(part(1, 1)));
    both.map_or(f64::NAN, |(a, b)| (a * part(0, 1) * b.transpose()).singular_values().max())
}

/// Most images of which the covariance between poses is stated: the square of their number counts.
const MOST_TOGETHER: usize = 400;

/// Adjusts cameras, plates and free camera poses; readings, and what trackers and contacts measured, are not looked at. The lens of a camera that its series leaves open is that
/// which predicts best what the adjustment had not seen.
///
/// # Errors
/// Those of the free poses: no image with enough markers, a mirrored plate, a camera that the images do not determine.
pub fn stand_alone(series: &[MeasuredSeries], limits: &Limits) -> Result<StandAlone> {
    let chain = Chain::empty();
    let mut series = series.to_vec();
    for own in &mut series {
        own.stops.iter_mut().for_each(|stop| stop.readings = None);
        (own.bodies, own.lengths) = (Vec::new(), Vec::new());
    }
    let open: Vec<String> = open_cameras(&series).into_keys().collect();
    series.iter_mut().filter(|s| open.contains(&s.camera)).for_each(|s| s.lens = Lens::ALL[0]);
    let by_first = adjusted(&series, limits);
    let (poses, notices) = match by_first {
        Ok(poses) if !poses.shows_pattern(&open, limits) => (poses, Vec::new()),
        Err(error) if open.is_empty() => return Err(error),
        _ => {
            let notices = choose_lens(&chain, &mut series, &open, limits)?;
            (adjusted(&series, limits)?, notices)
        }
    };
    let Adjusted { fit, free_poses, starts } = poses;
    let mut diagnosis = Diagnosis::new(CheckContext {
        series: &series,
        free: &free_poses,
        on_robot: 0,
        stated_noise: None,
        fixed: &[],
        limits,
    });
    diagnosis.after_free_poses(&fit.problem);
    let mut findings = diagnosis.findings();
    findings.extend(many_left_out(&fit.problem, limits).map(Finding::from));
    findings.extend(observations_left_out(&fit, limits).map(|found| found.given_by(&series).into()));
    findings.extend(residual_pattern(&fit, limits).map(|found| found.given_by(&series).into()));
    findings.extend(named_markers_off(&fit, limits).into_iter().map(Finding::from));
    findings.extend(tags_off(&fit, limits).into_iter().map(Finding::from));
    let is_doubted = findings.iter().any(Finding::fails);
    findings.extend(uneven(&fit, &series, is_doubted, limits).into_iter().map(Finding::from));
    let lost = losses(&fit.adjustment, &free_poses, &series).into_iter().filter(|lens| lens.loss_px.is_none());
    findings.extend(lost.map(Finding::from));
    Ok(StandAlone { fit, free_poses, series, starts, notices, findings })
}

/// Plates whose rows and columns differ in scale. Where series that are taken for ones of a single plate do not go together, each is looked at by
/// itself: one print may be another than the others.
fn uneven(fit: &Fit, series: &[MeasuredSeries], is_doubted: bool, limits: &Limits) -> Vec<DoubtedSize> {
    let together = uneven_plates(fit, limits);
    if fit.problem.plates.len() == series.len() || together.is_empty() && !is_doubted {
        return together;
    }
    let alone = |own: &MeasuredSeries| {
        let fit = adjusted(std::slice::from_ref(own), limits).ok()?.fit;
        Some(uneven_plates(&fit, limits).into_iter().map(|doubted| doubted.of_series(&own.name)).collect::<Vec<_>>())
    };
    let alone: Vec<Vec<DoubtedSize>> = series.iter().filter_map(alone).collect();
    let is_one = alone.len() < series.len() || alone.iter().all(|own| own.is_empty() == alone[0].is_empty());
    if is_one { together } else { alone.concat() }
}

/// Free poses with the lenses that the series have.
struct Adjusted {
    fit: Fit,
    free_poses: FreePoses,
    starts: Vec<StartVerdict>,
}

fn adjusted(series: &[MeasuredSeries], limits: &Limits) -> Result<Adjusted> {
    let robot = Robot::nominal(Chain::empty());
    let (mut adjustment, free_poses, starts) = free_poses_of(&robot, series, limits, |_| Ok(()))?;
    adjustment.hold_poses();
    Ok(Adjusted { fit: at_solution(adjustment)?, free_poses, starts })
}

impl Adjusted {
    /// True where the residuals of one of some cameras show a pattern, or do not tell.
    fn shows_pattern(&self, cameras: &[String], limits: &Limits) -> bool {
        let own = self.fit.problem.cameras.iter().enumerate().filter(|(_, name)| cameras.contains(name));
        own.into_iter().any(|(k, _)| camera_shows_pattern(&self.fit, k, limits).unwrap_or(true))
    }
}

impl Solution {
    /// Covariance of the stand-alone poses of all images together, as [`StandAlone::covariance_together`] has it; none without such poses.
    ///
    /// # Errors
    /// As of [`stand_alone`].
    pub fn poses_together(&self) -> Result<Option<(Vec<usize>, DMatrix<f64>)>> {
        if self.free_poses.poses.iter().all(Option::is_none) {
            return Ok(None);
        }
        let mut series = self.series.clone();
        series.iter_mut().for_each(|s| s.lens_choice = LensChoice::Settled);
        stand_alone(&series, &self.options.limits)?.covariance_together()
    }
}

/// The fit where the adjustment stands.
fn at_solution(adjustment: Adjustment) -> Result<Fit> {
    let remedy = "take images of more of the plate, tilted to all sides";
    let undetermined = |what: String| Error::new(Code::FitUndetermined, "free camera poses", what, remedy);
    let linearised =
        adjustment.linearise().ok_or_else(|| undetermined("a marker lies behind its camera".to_owned()))?;
    let covariance = adjustment.linear(&linearised).covariance().map_err(|e| undetermined(e.to_string()))?;
    Ok(Fit { adjustment, linearised, covariance })
}

/// Covariance of the plate's centre in the frame of the camera: with `p` that centre, `dp = -rho - phi x p`.
fn centre_covariance(placed: &PlacedCamera) -> Matrix3<f64> {
    let p = placed.plate_from_camera.inverse().translation;
    let mut j = Matrix3x6::zeros();
    j.fixed_view_mut::<3, 3>(0, 0).copy_from(&-Matrix3::identity());
    j.fixed_view_mut::<3, 3>(0, 3).copy_from(&skew(&p));
    j * placed.covariance * j.transpose()
}

impl StandAlone {
    /// Covariance of all poses together, in the frames of their plates, six rows an image, with the indices of the images; none of very many.
    ///
    /// # Errors
    /// Markers that define no frame.
    pub fn covariance_together(&self) -> Result<Option<(Vec<usize>, DMatrix<f64>)>> {
        let images = self.fit.linearised.images.clone();
        if images.len() > MOST_TOGETHER {
            return Ok(None);
        }
        Ok(Some((images, covariance_together(&self.fit)?)))
    }

    /// How well every pose is known, in the order of the images.
    pub fn sigmas(&self) -> Vec<PoseSigma> {
        let of = |(image, pose): (usize, &Option<FreePose>)| {
            let pose = pose.as_ref()?;
            let c = &pose.in_frame.covariance;
            let mean = |first: usize| ((first..first + 3).map(|k| c[(k, k)]).sum::<f64>() / 3.0).max(0.0).sqrt();
            Some(PoseSigma {
                image,
                rms_px: pose.rms_px,
                observations: self.fit.problem.images[image].used().count(),
                position_m: mean(0),
                rotation_rad: mean(3),
                camera_axes_m: semi_axes(&c.fixed_view::<3, 3>(0, 0).into_owned()),
                centre_axes_m: semi_axes(&centre_covariance(&pose.in_frame)),
                correlation: canonical_correlation(c),
            })
        };
        self.free_poses.poses.iter().enumerate().filter_map(of).collect()
    }

    /// Scale of every plate that was seen, common to all poses before it.
    pub fn scales(&self) -> impl Iterator<Item = PlateScale> {
        self.free_poses.scales.iter().flatten().copied()
    }
}
