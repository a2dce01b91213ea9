//! Cameras, plates and stand-alone camera poses from images alone: the photogrammetric part by itself, no robot takes part.

use super::build::build;
use super::free_poses::adjust_free_poses;
use super::lens_choice::{choose_lens, open_cameras};
use super::start_verdict::StartVerdict;
use super::stated::focals_px;
use crate::assess::Limits;
use crate::error::{Code, Error, Notice, Result};
use crate::fit::{Fit, FreePose, FreePoses};
use crate::model::robot::Robot;
use crate::problem::{Adjustment, MeasuredSeries};
use crate::solve::PlateScale;
use crate::urdf::Chain;

/// Cameras, plates and the camera pose of every image, with their covariances.
#[derive(Debug, Clone)]
pub struct StandAlone {
    /// The adjustment: cameras, plates and free poses; nothing of a robot.
    pub fit: Fit,
    /// The poses, also in the frames of the plates.
    pub free_poses: FreePoses,
    /// How the starting values were found.
    pub starts: Vec<StartVerdict>,
    /// Why which lens was taken.
    pub notices: Vec<Notice>,
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
}

/// Adjusts cameras, plates and free camera poses; readings are not looked at. The lens of a camera that its series leaves open is that
/// which predicts best what the adjustment had not seen.
///
/// # Errors
/// Those of the free poses: no image with enough markers, a mirrored plate, a camera that the images do not determine.
pub fn stand_alone(series: &[MeasuredSeries], limits: &Limits) -> Result<StandAlone> {
    let chain = Chain::empty();
    let mut series = series.to_vec();
    series.iter_mut().flat_map(|s| &mut s.stops).for_each(|stop| stop.readings = None);
    let open: Vec<String> = open_cameras(&series).into_keys().collect();
    let notices = if open.is_empty() { Vec::new() } else { choose_lens(&chain, &mut series, &open, limits)? };
    let start = build(&Robot::nominal(chain), &series, false, limits)?;
    let stated = focals_px(&start.problem.cameras, &series);
    let (mut adjustment, free_poses, starts) = adjust_free_poses(start, &stated, limits)?;
    adjustment.hold_poses();
    Ok(StandAlone { fit: at_solution(adjustment)?, free_poses, starts, notices })
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

impl StandAlone {
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
            })
        };
        self.free_poses.poses.iter().enumerate().filter_map(of).collect()
    }

    /// Scale of every plate that was seen, common to all poses before it.
    pub fn scales(&self) -> impl Iterator<Item = PlateScale> {
        self.free_poses.scales.iter().flatten().copied()
    }
}
