//! solution.json: everything that the solve went from and arrived at, so that it can be judged and repeated.
//!
//! The file has its own structures, apart from those of the solver, so that it keeps its shape when they change. A change of
//! meaning raises [`FORMAT`]. Units stand in the names; poses are `a_from_b`, perturbations body-fixed with translation first.

use std::collections::{BTreeMap, BTreeSet};

use serde::{Deserialize, Serialize};

use super::bodies_record::BodiesRecord;
use super::finding_record::FindingRecord;
use crate::assess::{Cause, Errors, FlangeErrors, Identifiability, Limits, ProjectionMap, WorkspacePoint};
use crate::error::{Notice, Result, plain_name};
use crate::identify::{Comparison, Estimator, Evidence, LensEvidence, Options, StartVerdict};
use crate::model::camera::Lens;
use crate::problem::{ImageRejection, ObservationRejection, short_name};
use crate::series::{CameraMount, Edge, InputFile, PlateKind, Puzzle, ScaleBar, Tags};
use crate::solve::PlateScale;
use crate::urdf::{FoundOrigin, JointKind, Payload};

pub use super::bytes::{read, to_bytes};
pub use super::pose_record::{PlacedRecord, PoseRecord};
pub use super::series_record::{ApparentShift, SeriesRecord, StopNoise};

/// Name of the file.
pub const FILE_NAME: &str = "solution.json";

/// Name of the file with the time of every stage, which goes with a result and is no part of it.
pub const TIMINGS: &str = "timings.json";

/// Version of the format.
pub const FORMAT: u32 = 2;

/// The program that wrote the file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ProgramRecord {
    /// Name.
    pub name: String,
    /// Version.
    pub version: String,
    /// Command line.
    pub command: String,
    /// Options in words.
    pub options: Vec<(String, String)>,
}

/// One joint of the chain with what was found.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct JointRecord {
    /// URDF name.
    pub name: String,
    /// How it moves.
    pub kind: JointKind,
    /// Unit axis in the joint frame.
    pub axis: [f64; 3],
    /// Nominal `parent_from_joint`.
    pub nominal_origin: PoseRecord,
    /// Body twist on the nominal origin, m and rad.
    pub twist: [f64; 6],
    /// Corrected `parent_from_joint` with the joint offset folded in, as in the corrected URDF.
    pub corrected_origin: PoseRecord,
    /// Limits, rad or m.
    pub limits: Option<(f64, f64)>,
    /// Reading that drives it, with factor and offset (rad or m).
    pub drive: Option<(String, f64, f64)>,
    /// True where the chain passes it from child to parent: its origins are `joint_from_parent` then.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub upwards: bool,
    /// What was found of the nominal origin before the fit, where the URDF states another.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub found: Option<FoundOrigin>,
}

/// One joint term.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TermRecord {
    /// Reading that it belongs to.
    pub reading: String,
    /// Name of the term.
    pub term: String,
    /// Value, in `unit`.
    pub value: f64,
    /// Unit.
    pub unit: String,
}

/// The robot.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RobotRecord {
    /// Name.
    pub name: String,
    /// Base link.
    pub base: String,
    /// Tip link.
    pub tip: String,
    /// Names of the readings, in chain order.
    pub readings: Vec<String>,
    /// How the joint of each reading moves.
    pub reading_kinds: Vec<JointKind>,
    /// The chain.
    pub joints: Vec<JointRecord>,
    /// Joint terms: with the twists the robot that is stated, and that of the corrected URDF with compensation.toml.
    pub terms: Vec<TermRecord>,
    /// Local errors of joints near readings that the series visited several times: latent noise of this series, needed to solve
    /// again, no part of the robot that is stated. Older files have them at the end of `terms`.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub local_errors: Vec<TermRecord>,
    /// What the tip carries, where it was stated.
    pub payload: Option<Payload>,
    /// Factor that the data ask for on the stated sizes of the twists (1 mm, 2 mrad), drawn towards 1.
    #[serde(default = "one")]
    pub twist_factor: f64,
}

/// One scalar estimate of the dense part, in the order of the covariance.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct EstimateRecord {
    /// Name, `block.component`.
    pub name: String,
    /// Unit.
    pub unit: String,
    /// Value; none for a component of a pose, whose perturbation the column is.
    pub value: Option<f64>,
    /// Posterior sigma; none where nothing determines it or it was held fixed.
    pub sigma: Option<f64>,
    /// Mean of its prior.
    pub prior_mean: Option<f64>,
    /// Sigma of its prior; none where there is no prior.
    pub prior_sigma: Option<f64>,
    /// Sigma by the noise model alone.
    pub sigma_model: Option<f64>,
    /// Sigma by the scatter between images (sandwich, clustered by image).
    pub sigma_clustered: Option<f64>,
    /// False where it was held fixed.
    pub free: bool,
    /// `1 - sigma^2 / prior_sigma^2`: how much of what is known comes from the data.
    pub share_of_data: Option<f64>,
}

/// A camera.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CameraRecord {
    /// Name.
    pub name: String,
    /// Lens model.
    pub lens: Lens,
    /// Columns of its images.
    pub width_px: u32,
    /// Rows.
    pub height_px: u32,
    /// Parameters by name.
    pub parameters: Vec<(String, f64)>,
    /// Estimated factor on the stated standard deviations of its observations.
    pub pixel_factor: f64,
    /// Joint noise of each reading with this camera, root mean square over its series, rad or m.
    pub joint_noise: Vec<f64>,
    /// 95 % interval of each of them; empty where the data do not tell it. The upper end is absent where it is not told.
    #[serde(default)]
    pub joint_noise_interval: Vec<[Option<f64>; 2]>,
    /// Apparent tilt of the plate in each image, root mean square over the series, rad; 0 where it is not part of the model.
    #[serde(default)]
    pub apparent_tilt_rad: f64,
    /// How well it is known where in the image a direction shows.
    #[serde(default)]
    pub projection: Option<ProjectionMap>,
    /// Typical displacement (factor on the prior of every control point, px) of a lens with a displacement field.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub field_sigma_px: Option<f64>,
    /// What camera.yaml loses of a lens that ROS has no model for: RMS over the image and the most, px.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub ros_loss_px: Option<[f64; 2]>,
}

/// A plate: as given, and corrected.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PlateRecord {
    /// Name: as stated in plate.toml where no other plate has it, else with that of the first series that shows it.
    pub name: String,
    /// What its plate.toml calls it, where it does.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stated_name: Option<String>,
    /// What is printed on it.
    pub kind: PlateKind,
    /// Columns.
    pub columns: u32,
    /// Rows.
    pub rows: u32,
    /// Pitch, m.
    pub pitch_m: f64,
    /// Prior sigma of a marker, m.
    pub tolerance_m: f64,
    /// The tags of a plate of them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tags: Option<Tags>,
    /// Which part of the pattern a PuzzleBoard is.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub puzzle: Option<Puzzle>,
    /// Measured distance.
    pub scale: Option<ScaleBar>,
    /// Amplitudes of its modes.
    pub modes: BTreeMap<String, f64>,
    /// Marker ids.
    pub id: Vec<u32>,
    /// Nominal positions, m.
    pub nominal_m: Vec<[f64; 3]>,
    /// Outer and inner radii, m.
    pub radii_m: Vec<[f64; 2]>,
    /// Prior sigmas as stated, m.
    pub prior_sigma_m: Vec<f64>,
    /// Ids of those that lie so far from where they were given that their prior was not used.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub moved: Vec<u32>,
    /// Estimated factor on them; 1 where the data do not tell it.
    #[serde(default = "one")]
    pub tolerance_factor: f64,
    /// Corrections beside the modes, m: they bring the markers into the frame of the nominal ones, too.
    pub correction_m: Vec<[f64; 3]>,
    /// Corrected positions in the frame of the nominal markers, m: nominal, modes and corrections.
    pub position_m: Vec<[f64; 3]>,
    /// Their sigmas in the frame of the nominal markers, m; that of the scale of all of them is not in them.
    pub sigma_m: Vec<[f64; 3]>,
    /// Size of the markers as a whole, as in `position_m`, plate.csv and plate_pose.yaml; none where no image shows the plate.
    #[serde(default)]
    pub relative_scale: Option<ScaleRecord>,
    /// Size that the stand-alone poses (poses.csv, `free_pose`) are given for: nominal, or as measured (`[scale]`). The robot takes no part
    /// in them, nor in this scale.
    #[serde(default)]
    pub relative_scale_of_poses: Option<ScaleRecord>,
}

/// Size of the markers of a plate as a whole. Lengths `d` in files in which the scale is held have a further standard deviation of
/// `sigma d`, common to all.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ScaleRecord {
    /// Size over nominal, less one.
    pub value: f64,
    /// Its standard deviation.
    pub sigma: f64,
}

impl From<PlateScale> for ScaleRecord {
    fn from(scale: PlateScale) -> Self {
        Self { value: scale.relative, sigma: scale.sigma }
    }
}

/// A stand-alone camera pose.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FreePoseRecord {
    /// `plate_from_camera`.
    pub plate_from_camera: PoseRecord,
    /// Covariance of its body twist in the frame of the nominal markers, their scale held, 36 numbers.
    pub covariance: Vec<f64>,
    /// RMS of the lengths of its residuals, px.
    pub rms_px: f64,
}

/// Observations of one image, one entry each.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct ObservationColumns {
    /// Marker ids.
    pub marker: Vec<u32>,
    /// Contours.
    pub edge: Vec<Edge>,
    /// Radius of the circle observed, m; 0 for a point or an imaged centre.
    pub radius_m: Vec<f64>,
    /// Measured, px.
    pub uv: Vec<[f64; 2]>,
    /// Stated covariance uu, uv, vv, px^2.
    pub covariance: Vec<[f64; 3]>,
    /// Measured minus predicted, px.
    pub duv: Vec<Option<[f64; 2]>>,
    /// Why it is left out.
    pub reason: Vec<Option<ObservationRejection>>,
}

/// One image.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ImageRecord {
    /// Name.
    pub name: String,
    /// Name of its series.
    pub series: String,
    /// Index of its camera.
    pub camera: usize,
    /// Index of its mounting.
    pub mounting: usize,
    /// Index of its placement.
    pub placement: usize,
    /// Index of its plate.
    pub plate: usize,
    /// Where the camera is.
    pub camera_mount: CameraMount,
    /// Readings, rad or m; none off the robot.
    pub readings: Option<Vec<f64>>,
    /// Step of every reading from the stop before.
    pub approach: Option<Vec<f64>>,
    /// Estimated joint noise, rad or m.
    pub joint_noise: Option<Vec<f64>>,
    /// `camera_from_plate` as estimated, in the frame of the nominal markers; from the readings alone for an image that is left out.
    pub camera_from_plate: Option<PoseRecord>,
    /// Stand-alone pose.
    pub free_pose: Option<FreePoseRecord>,
    /// RMS of the lengths of the residuals in use, px.
    pub rms_px: Option<f64>,
    /// Held-out error with nominal and calibrated robot, mm.
    pub held_out_mm: Option<[f64; 2]>,
    /// Why the image is left out, in words.
    pub reason: Option<String>,
    /// The same with its code and sizes; absent in files of earlier versions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rejection: Option<ImageRejection>,
    /// Place of its stop among those of the run, where several cameras saw them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub row: Option<usize>,
    /// Observations.
    pub observations: ObservationColumns,
}

/// Residuals in numbers.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct StatisticsRecord {
    /// Images given.
    pub images: usize,
    /// Images in use.
    pub images_used: usize,
    /// Observations in use.
    pub observations_used: usize,
    /// Observations left out in images in use.
    pub observations_left_out: usize,
    /// RMS of the lengths of the residuals in use, px per point.
    pub rms_px: f64,
    /// The same with free poses.
    pub free_pose_rms_px: f64,
    /// Observations that the free poses were fitted to.
    pub free_pose_observations: usize,
    /// Largest normalised residual in use.
    pub largest_normalised: f64,
    /// Cost at the solution.
    pub cost: f64,
    /// Huber bound on normalised lengths.
    pub huber: f64,
}

/// The robot description as it was read.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct UrdfRecord {
    /// File name.
    pub file: String,
    /// The whole text.
    pub text: String,
}

/// Sigmas by the noise model against those by the scatter between images.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ScatterRecord {
    /// Sigma of the flange by clusters of images over that by the noise model; none where the flange is not determined.
    pub flange_ratio: Option<f64>,
    /// True where the larger sigmas are stated in this file.
    pub larger_stated: bool,
}

/// Accuracy on held-out images.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct AccuracyRecord {
    /// Nominal robot.
    pub nominal: Errors,
    /// Calibrated robot.
    pub calibrated: Errors,
    /// Folds of the hold-out.
    pub folds: usize,
}

/// The whole file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SolutionRecord {
    /// Version of the format: [`FORMAT`].
    pub format: u32,
    /// What wrote it.
    pub program: ProgramRecord,
    /// Files of this result.
    pub files: Vec<String>,
    /// What was read.
    pub inputs: Vec<InputFile>,
    /// How the robot was fitted; files that do not say it are of joint fits.
    #[serde(default)]
    pub estimator: Estimator,
    /// Options and limits as used; absent in files of earlier versions.
    #[serde(default)]
    pub options: Option<Options>,
    /// How the last solve ended.
    pub status: String,
    /// Steps tried in all.
    pub iterations: usize,
    /// Quality gates that failed.
    pub failed_gates: Vec<String>,
    /// Accuracy.
    pub accuracy: AccuracyRecord,
    /// Residuals.
    pub statistics: StatisticsRecord,
    /// What the user should know.
    pub notices: Vec<Notice>,
    /// All that was found out about the data, for programs: the gates that failed and the notices are its sentences. Absent in files of
    /// earlier versions.
    #[serde(default)]
    pub findings: Vec<FindingRecord>,
    /// True where the corrected URDF belongs to a controller into which mastering.csv was entered: joint offsets are not in it.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub offsets_in_mastering: bool,
    /// What that controller then adds to its readings, rad or m in the order of the joints: none for an offset that the URDF holds. Absent
    /// in files of earlier versions, whose URDF holds no offset.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub offsets_to_enter: Vec<f64>,
    /// Starting values.
    pub starts: Vec<StartVerdict>,
    /// Robot.
    pub robot: RobotRecord,
    /// Cameras with their variance components.
    pub cameras: Vec<CameraRecord>,
    /// `flange_from_camera`, or `base_from_camera` of a fixed camera.
    pub mountings: Vec<PlacedRecord>,
    /// `base_from_plate`, or `flange_from_plate` for a fixed camera; covariance in the frame of the nominal markers.
    pub placements: Vec<PlacedRecord>,
    /// Plates.
    pub plates: Vec<PlateRecord>,
    /// Robot description.
    pub urdf: UrdfRecord,
    /// Series.
    pub series: Vec<SeriesRecord>,
    /// What the data tell of the robot, and what to measure next.
    pub identifiability: Option<Identifiability>,
    /// Evidence of the robot models where the data chose among them.
    pub evidences: Vec<Evidence>,
    /// Expected error of the flange in the region of the stops, before and after; none without stops, and in files of earlier versions.
    #[serde(default)]
    pub flange: Option<FlangeErrors>,
    /// Evidence of the lenses of cameras whose lens was open.
    #[serde(default)]
    pub lenses: Vec<LensEvidence>,
    /// Two-stage fits beside the joint one, on images that neither had seen; none for too few images.
    pub two_stage: Option<Comparison>,
    /// How the images scatter against the noise model; none for too few images.
    pub scatter: Option<ScatterRecord>,
    /// Sigma of the flange over the workspace: samples of the region of the stops, then within all joint limits.
    pub workspace: Vec<WorkspacePoint>,
    /// All scalar estimates.
    pub estimates: Vec<EstimateRecord>,
    /// Covariance of `estimates`: lower triangle, row by row. Poses of plates are in the frame that the marker priors define.
    pub covariance_lower: Vec<f64>,
    /// Images with their observations.
    pub images: Vec<ImageRecord>,
    /// Images in the order of poses_covariance.npy, six rows each (body twist of `plate_from_camera`, m and rad); none without `--poses`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub covariance_together: Option<Vec<String>>,
    /// What trackers and contacts measured of bodies on the tip.
    #[serde(default, skip_serializing_if = "BodiesRecord::is_empty")]
    pub bodies: BodiesRecord,
}

impl SolutionRecord {
    /// Numbers that decided its verdicts; the usual ones where a file of an earlier version holds none.
    pub fn limits(&self) -> Limits {
        self.options.as_ref().map(|o| o.limits).unwrap_or_default()
    }

    /// True where the readings are poses of a controller, and no robot was given: there is nothing to correct.
    pub fn has_no_robot(&self) -> bool {
        self.file_ending_with(crate::output::robot::corrected_robot::CALIBRATED).is_none()
    }

    /// True where the data say less of a parameter than counts.
    pub fn hardly_determines(&self, estimate: &EstimateRecord) -> bool {
        estimate.share_of_data.is_some_and(|share| share < self.limits().share_of_data)
    }

    /// Names go into programs, file names and the terminal.
    pub(super) fn plain_names(&self) -> Result<()> {
        let robot = &self.robot;
        let plain = |kind: &str, name: &String| plain_name(kind, name, FILE_NAME).map(|_| ());
        [&robot.name, &robot.base, &robot.tip].into_iter().try_for_each(|n| plain("robot or link", n))?;
        robot.readings.iter().try_for_each(|n| plain("joint", n))?;
        robot.joints.iter().try_for_each(|j| plain("joint", &j.name))?;
        self.cameras.iter().try_for_each(|c| plain("camera", &c.name))?;
        self.mountings.iter().chain(&self.placements).try_for_each(|p| plain("mounting or placement", &p.name))?;
        self.plates.iter().try_for_each(|p| plain("plate", &p.name))?;
        self.series.iter().try_for_each(|s| plain("series", &s.name))?;
        self.images.iter().try_for_each(|i| plain("image", &i.name))
    }

    /// What is known of the size of every plate whose size is free.
    pub fn plate_sizes(&self) -> impl Iterator<Item = (&EstimateRecord, &PlateRecord)> {
        let is_size = |e: &&EstimateRecord| e.name.starts_with("plate_shape") && e.name.ends_with(".scale");
        self.estimates.iter().filter(is_size).zip(&self.plates).filter(|(e, _)| e.free)
    }

    /// True where the lengths of the robot hang on the size that the file of a plate states: nobody measured it, and all else tells less of it.
    pub fn hangs_on_a_stated_size(&self) -> bool {
        let is_as_stated = |e: &EstimateRecord| e.share_of_data.is_some_and(|share| share < 0.5);
        self.flange.is_some() && self.plate_sizes().any(|(e, plate)| plate.scale.is_none() && is_as_stated(e))
    }

    /// Free parameters of the robot, without local errors, which are noise.
    pub fn robot_parameters(&self) -> impl Iterator<Item = &EstimateRecord> {
        let of_robot = |e: &&EstimateRecord| e.name.starts_with("robot/") && !e.name.contains(".local_");
        self.estimates.iter().filter(move |e| e.free && of_robot(e))
    }

    /// True where the robot model has terms that a URDF cannot hold.
    pub fn beyond_urdf(&self) -> bool {
        self.robot.terms.iter().any(|t| t.term != "offset" && !t.term.starts_with("local_"))
    }

    /// What the position of the flange is stated relative to, in words.
    pub fn flange_is_relative_to(&self) -> &'static str {
        if self.images.is_empty() { "the base and tool that fit the stops" } else { "the plate" }
    }

    /// Where the stated errors of the flange hold, in words. Between the poses of a controller its model of the robot errs in another way than at
    /// them, and nothing was found of that.
    pub fn flange_holds(&self) -> &'static str {
        if self.has_no_robot() { "at the poses of the stops" } else { "in the region of the stops" }
    }

    /// The file that was written under a name that ends so.
    pub fn file_ending_with(&self, end: &str) -> Option<&str> {
        self.files.iter().find(|f| f.ends_with(end)).map(String::as_str)
    }

    /// Robot parameters that stay near nominal for want of data, without those that no series can tell from base and tip.
    pub fn undetermined(&self) -> Vec<&EstimateRecord> {
        let told = self.identifiability.iter().flat_map(|found| &found.unknown);
        let frames: BTreeSet<&str> = (told.filter(|d| matches!(d.cause, Cause::Base | Cause::Tip)))
            .flat_map(|d| d.parameters.iter().map(|(name, _)| name.as_str()))
            .collect();
        (self.robot_parameters())
            .filter(|e| self.hardly_determines(e))
            .filter(|e| !frames.contains(short_name(&e.name).as_str()))
            .collect()
    }

    /// What scatters from stop to stop, with the name of the series; that of the camera in files that know it per camera only.
    pub fn stop_noise(&self) -> Vec<(&str, StopNoise)> {
        let of_series = self.series.iter().filter_map(|s| Some((s.name.as_str(), s.noise.clone()?)));
        let found: Vec<_> = of_series.collect();
        let of_camera = |c: &CameraRecord| StopNoise {
            joint: c.joint_noise.clone(),
            joint_interval: c.joint_noise_interval.clone(),
            apparent_tilt_rad: c.apparent_tilt_rad,
            apparent_shift: None,
        };
        if found.is_empty() { self.cameras.iter().map(|c| (c.name.as_str(), of_camera(c))).collect() } else { found }
    }
}

impl ImageRecord {
    /// True for an image taken on the robot.
    pub const fn is_on_robot(&self) -> bool {
        self.readings.is_some()
    }

    /// True where it takes part.
    pub const fn is_used(&self) -> bool {
        self.reason.is_none()
    }

    /// True for an image taken on the robot that takes part.
    pub const fn is_used_on_robot(&self) -> bool {
        self.is_on_robot() && self.is_used()
    }

    /// Why the image is left out; of files that have it in words alone, these.
    pub fn rejection(&self) -> Option<ImageRejection> {
        let in_words = || self.reason.clone().map(|what| ImageRejection::InWords { what });
        self.rejection.clone().or_else(in_words)
    }
}

impl CameraRecord {
    /// How well the projection is known, px: root mean square over the places (px) that were seen, and the worst of the image.
    pub fn projection_known(&self, seen: impl Iterator<Item = [f64; 2]>) -> Option<[f64; 2]> {
        let map = self.projection.as_ref()?;
        Some([map.rms_at(seen, self.width_px, self.height_px)?, map.largest()?])
    }
}

fn one() -> f64 {
    1.0
}
