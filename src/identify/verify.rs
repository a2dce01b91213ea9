//! A robot model judged by a series that it was not fitted to: camera, hand-camera offset and plate are fitted, the robot is not.

use super::controller::choice::Before;
use super::controller::computed_postures::told_by_seen;
use super::joint_fit::unpredicted::nothing_held_out;
use super::options::JointNoise;
use super::photogrammetry::free_poses::free_poses_of;
use super::start::robot::{StartGiven, ZerosElsewhere, start_robot};
use super::start::turns;
use super::start::zeros::other_zeros;
use crate::assess::Limits;
use crate::assess::{ImageError, cluster_of_images, hold_out_images};
use crate::diagnose::{SizeDifference, ZeroOff, sizes_by_robot, zeros_off};
use crate::error::{Code, Error, Result};
use crate::model::robot::Robot;
use crate::problem::{Adjustment, MeasuredSeries};
use crate::solve::{ComponentOptions, Status, estimate_components};

/// Error of one image, predicted from its joint readings by a fit of camera and plate to the other images.
#[derive(Debug, Clone, PartialEq)]
pub struct JudgedImage {
    /// Index of its series.
    pub series: usize,
    /// File name.
    pub name: String,
    /// Images of the same posture share joint readings, and their errors.
    pub posture: usize,
    /// Its error.
    pub error: ImageError,
}

/// What a series says of a robot that it was not fitted to.
#[derive(Debug, Clone)]
pub enum JudgedSeries {
    /// The errors of all images, with the fit that tells the sizes of the plates.
    Images(Box<JudgedByImages>),
    /// Its readings and the images do not belong together, and do with other zeros of its joints.
    OtherZeros(Box<RobotOfOtherZeros>),
}

impl JudgedSeries {
    /// Its images; none with the zeros as they are where others are needed.
    pub fn into_images(self) -> Vec<JudgedImage> {
        match self {
            Self::Images(judged) => judged.images,
            Self::OtherZeros(_) => Vec::new(),
        }
    }
}

/// What images say of a robot.
#[derive(Debug, Clone)]
pub struct JudgedByImages {
    /// The error of each.
    pub images: Vec<JudgedImage>,
    /// Camera and plates, fitted to this robot.
    fitted: Adjustment,
}

impl JudgedByImages {
    /// How large the plates are for this robot, by their names: no error of an image holds what all its lengths are off by.
    pub fn plate_sizes(&self) -> Vec<(String, SizeDifference)> {
        sizes_by_robot(&self.fitted)
    }
}

/// A robot with other zeros than those of the one that is judged.
#[derive(Debug, Clone, PartialEq)]
pub struct RobotOfOtherZeros {
    /// With these zeros.
    pub robot: Robot,
    /// Which they are.
    pub zeros: Vec<ZeroOff>,
    /// Median misfit of readings and images without them, rad + m.
    pub misfit: f64,
}

/// Series with readings that were computed from poses of a controller in the postures that the images tell with this robot: a better one tells
/// them for a worse one, and that by which they were computed tells none. Ids of plates that look the same when they are turned are settled, too.
pub fn in_told_postures(robot: &Robot, series: &[MeasuredSeries], limits: &Limits) -> Vec<MeasuredSeries> {
    let settled = turns::settled(robot, series, limits);
    let (told, _) = told_by_seen(robot, (&settled, Before::Nearest), limits, with_robot_held);
    let mut told = told.into_owned();
    told.iter_mut().for_each(|s| s.postures.clear());
    told
}

fn with_robot_held(start: &mut Adjustment) -> Result<()> {
    let layout = &mut start.problem.layout;
    let columns = layout.robot();
    layout.columns[columns].iter_mut().for_each(|c| c.free = false);
    Ok(())
}

/// Errors of all images on the robot that a fixed robot model leaves, with the zeros of its joints as they are.
///
/// Joint noise is a variance component of its own for each model, so that a bad model does not bend camera and plate. Poses of a controller are
/// taken in the postures that the images tell with this robot. Other zeros are looked for only where readings and images do not belong together.
///
/// # Errors
/// Input errors of the series; unsolved where the data do not determine camera or hand-camera offset.
pub fn verify_series(robot: &Robot, series: &[MeasuredSeries], limits: &Limits) -> Result<JudgedSeries> {
    let series = in_told_postures(robot, series, limits);
    let (mut adjustment, free, mut starts) = free_poses_of(robot, &series, limits, with_robot_held)?;
    let given = StartGiven { zeros: ZerosElsewhere::Left, ..StartGiven::of(&series, limits) };
    if let Err(error) = start_robot(&mut adjustment, &free, given, &mut starts) {
        let found = other_zeros(&adjustment, &free, limits).ok_or(error)?;
        let zeros = zeros_off(&found.chain, limits);
        let robot = Robot { chain: found.chain, ..adjustment.state.robot };
        let other = RobotOfOtherZeros { robot, zeros, misfit: found.as_described };
        return Ok(JudgedSeries::OtherZeros(Box::new(other)));
    }
    adjustment.tie_to_readings(false);
    Ok(JudgedSeries::Images(Box::new(held_out(adjustment, limits)?)))
}

/// Errors of images that camera and plate were not fitted to.
fn held_out(adjustment: Adjustment, limits: &Limits) -> Result<JudgedByImages> {
    let outcome = estimate_components(adjustment, &ComponentOptions::default());
    if outcome.status != Status::Converged {
        return Err(Error::new(
            Code::NotConverged,
            "verification",
            format!("the fit of camera and plate with this robot {}", outcome.status.words()),
            format!("check that URDF, base, tip and series belong together; else {}", outcome.status.remedy()),
        ));
    }
    let problem = &outcome.adjustment.problem;
    let errors = outcome.linear().and_then(|fit| hold_out_images(fit, limits));
    let errors = errors.ok_or_else(|| nothing_held_out("verification", problem, limits, JointNoise::Estimated))?;
    let postures = cluster_of_images(problem, limits);
    let judged = |(i, error): (usize, ImageError)| JudgedImage {
        series: problem.images[i].series,
        name: problem.images[i].name.clone(),
        posture: postures[i],
        error,
    };
    let images = errors.into_iter().map(judged).collect();
    Ok(JudgedByImages { images, fitted: outcome.adjustment })
}
