//! Files of cameras, plates and stand-alone poses that were adjusted without a robot.

use std::collections::BTreeMap;

use serde::Serialize;

use super::gauge::Gauge;
use super::names::{ImageNames, plate_name};
use super::npy;
#[cfg(feature = "report")]
use super::report::{self, Thumbnails, poses_html};
use super::solution::estimates::covariance_of_columns;
use super::solution::finding_record::FindingRecord;
use super::solution::image_records::ImageRecords;
use super::solution::solution_json::{ProgramRecord, StatisticsRecord};
use super::text::json;
use super::vision::poses_record::PosesRecord;
use super::vision::{camera_file, observation_table, plate_files, pose_files};
use crate::assess::Limits;
use crate::diagnose::Finding;
use crate::error::{Notice, Result};
use crate::identify::{PoseComparison, PoseSigma, StandAlone, depths_m};
use crate::model::camera::Lens;
use crate::problem::{Adjustment, Image};
use crate::series::InputFile;

pub use super::vision::poses_record::FILE_NAME;

/// What the files need beside the adjustment.
#[derive(Debug, Clone)]
pub struct StandAloneContext {
    /// Names of the series.
    pub series: Vec<String>,
    /// All files that were read, with their hashes.
    pub inputs: Vec<InputFile>,
    /// The command line.
    pub command: String,
    /// Numbers that decided.
    pub limits: Limits,
    /// What the user should know.
    pub notices: Vec<Notice>,
    /// The poses of another source, by the name of their file.
    pub against: Option<(String, PoseComparison)>,
}

#[derive(Serialize)]
struct Record<'a> {
    format: u32,
    program: &'static str,
    command: &'a str,
    inputs: &'a [InputFile],
    cameras: Vec<CameraOf<'a>>,
    plates: Vec<PlateOf>,
    images: Vec<ImageOf<'a>>,
    statistics: &'a StatisticsRecord,
    /// Images in the order of poses_covariance.npy, six rows each (body twist of `plate_from_camera`, m and rad).
    #[serde(skip_serializing_if = "Option::is_none")]
    covariance_together: Option<Vec<&'a str>>,
    /// The poses of another source, after the common frame.
    #[serde(skip_serializing_if = "Option::is_none")]
    against: Option<AgainstOf<'a>>,
    findings: Vec<FindingRecord>,
    notices: Vec<String>,
    files: Vec<String>,
}

/// A number with its standard deviation; none where it was held.
#[derive(Serialize)]
struct Value {
    value: f64,
    sigma: Option<f64>,
}

#[derive(Serialize)]
struct CameraOf<'a> {
    name: &'a str,
    lens: Lens,
    width_px: u32,
    height_px: u32,
    parameters: BTreeMap<String, Value>,
    /// Nearest and farthest plate centre that it saw, m.
    depths_m: [f64; 2],
    /// Factor on the stated standard deviations of its observations.
    pixel_factor: f64,
}

#[derive(Serialize)]
struct PlateOf {
    name: String,
    /// Size over the nominal one, less one: common to all poses and markers before the plate, and not in their covariances.
    relative_scale: Option<Value>,
}

#[derive(Serialize)]
struct AgainstOf<'a> {
    file: &'a str,
    poses: usize,
    rms_m: f64,
    rms_rad: f64,
    relative_scale: f64,
    normalised_error_squared: f64,
    /// Body twist from the pose of the other source to that found, m and rad.
    twists: BTreeMap<&'a str, [f64; 6]>,
}

#[derive(Serialize)]
struct ImageOf<'a> {
    image: &'a str,
    /// Why it is left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    left_out: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    observations: Option<usize>,
    #[serde(skip_serializing_if = "Option::is_none")]
    rms_px: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    position_sigma_m: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    rotation_sigma_rad: Option<f64>,
    /// Semi-axes of the ellipsoids of one sigma: of the camera, and of the plate's centre as the camera sees it.
    #[serde(skip_serializing_if = "Option::is_none")]
    camera_axes_m: Option<[f64; 3]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    centre_axes_m: Option<[f64; 3]>,
    /// Largest correlation of position and rotation.
    #[serde(skip_serializing_if = "Option::is_none")]
    correlation: Option<f64>,
}

/// Every file of the result: name -> bytes.
///
/// # Errors
/// Markers that lie on a line; estimates that are not finite.
pub fn stand_alone_files(found: &StandAlone, context: &StandAloneContext) -> Result<BTreeMap<String, Vec<u8>>> {
    let Adjustment { problem, state } = &found.fit.adjustment;
    let (series, depths) = (&context.series, depths_m(problem, &found.free_poses));
    let (names, gauge) = (ImageNames::new(problem, series), Gauge::of_images(&found.fit, &found.free_poses.scales)?);
    let cameras = camera_file::cameras(&problem.cameras, &state.cameras, &depths);
    let plates = plate_files::plates(problem, series, &gauge)?;
    let poses = [("poses.csv".to_owned(), pose_files::poses_csv(&names, &found.free_poses))];
    let texts = cameras.into_iter().chain(plates).chain(poses);
    let mut files: BTreeMap<String, Vec<u8>> = texts.map(|(name, text)| (name, text.into_bytes())).collect();
    let together = found.covariance_together()?;
    if let Some((_, covariance)) = &together {
        files.insert(pose_files::TOGETHER.to_owned(), npy::matrix(covariance));
    }
    files.insert(
        observation_table::FILE_NAME.to_owned(),
        observation_table::observations_csv(&found.fit, series).into(),
    );
    let mut listed: Vec<String> = files.keys().cloned().chain([FILE_NAME.to_owned()]).collect();
    #[cfg(feature = "report")]
    listed.push(report::FILE_NAME.to_owned());
    listed.sort();
    let seen = poses_record(found, context, &gauge, listed)?;
    #[cfg(feature = "report")]
    let pictures = Thumbnails::of_files(seen.photogrammetry());
    #[cfg(feature = "report")]
    files.insert(report::FILE_NAME.to_owned(), poses_html(&seen, &pictures).into_bytes());
    let order = together.map(|(images, _)| images.into_iter().map(|i| names.of(i)).collect());
    let record = Record { covariance_together: order, ..record(found, context, &names, &seen) };
    files.insert(FILE_NAME.to_owned(), json(&record, FILE_NAME)?);
    Ok(files)
}

/// What the report is made from.
///
/// # Errors
/// Estimates that are not finite.
fn poses_record(
    found: &StandAlone,
    context: &StandAloneContext,
    gauge: &Gauge,
    files: Vec<String>,
) -> Result<PosesRecord> {
    let seen = ImageRecords {
        fit: &found.fit,
        free_poses: &found.free_poses,
        measured: &found.series,
        names: &context.series,
        gauge,
        uncertainty: None,
        held_out_mm: &[],
    };
    let notes = found.findings.iter().filter(|f| !f.fails()).map(Finding::notice);
    Ok(PosesRecord {
        program: ProgramRecord {
            name: env!("CARGO_PKG_NAME").into(),
            version: env!("CARGO_PKG_VERSION").into(),
            command: context.command.clone(),
            options: Vec::new(),
        },
        files,
        inputs: context.inputs.clone(),
        limits: context.limits,
        findings: found.findings.iter().map(FindingRecord::from).collect(),
        notices: context.notices.iter().cloned().chain(notes).collect(),
        series: seen.series(),
        statistics: seen.statistics(),
        starts: found.starts.clone(),
        cameras: seen.cameras(),
        plates: seen.plates(),
        images: seen.images(),
        estimates: seen.estimates(&covariance_of_columns(&found.fit, gauge, None))?,
        known: found.sigmas(),
        against: context.against.clone(),
    })
}

fn cameras_of<'a>(found: &'a StandAlone) -> Vec<CameraOf<'a>> {
    let Adjustment { problem, state } = &found.fit.adjustment;
    let depths = depths_m(problem, &found.free_poses);
    let value = |(column, value): (usize, &f64)| {
        let is_free = problem.layout.columns[column].free;
        Value { value: *value, sigma: is_free.then(|| found.fit.covariance.sigma(column)) }
    };
    let camera = |(k, name): (usize, &'a String)| {
        let camera = &state.cameras[k];
        let values = problem.layout.cameras[k].clone().zip(&camera.parameters).map(value);
        CameraOf {
            name,
            lens: camera.lens,
            width_px: camera.width_px,
            height_px: camera.height_px,
            parameters: camera.parameter_names().map(Into::into).zip(values).collect(),
            depths_m: depths[k],
            pixel_factor: problem.noise.pixel_factor[k],
        }
    };
    problem.cameras.iter().enumerate().map(camera).collect()
}

fn image_of<'a>(name: &'a str, image: &Image, known: Option<&PoseSigma>) -> ImageOf<'a> {
    ImageOf {
        image: name,
        left_out: image.rejected.as_ref().map(ToString::to_string),
        observations: known.map(|s| s.observations),
        rms_px: known.map(|s| s.rms_px),
        position_sigma_m: known.map(|s| s.position_m),
        rotation_sigma_rad: known.map(|s| s.rotation_rad),
        camera_axes_m: known.map(|s| s.camera_axes_m),
        centre_axes_m: known.map(|s| s.centre_axes_m),
        correlation: known.map(|s| s.correlation),
    }
}

fn against_of<'a>(file: &'a str, compared: &'a PoseComparison) -> AgainstOf<'a> {
    AgainstOf {
        file,
        poses: compared.differences.len(),
        rms_m: compared.rms[0],
        rms_rad: compared.rms[1],
        relative_scale: compared.relative_scale,
        normalised_error_squared: compared.normalised,
        twists: compared.differences.iter().map(|d| (d.image.as_str(), d.twist.into())).collect(),
    }
}

fn record<'a>(
    found: &'a StandAlone,
    context: &'a StandAloneContext,
    names: &'a ImageNames,
    seen: &'a PosesRecord,
) -> Record<'a> {
    let problem = &found.fit.problem;
    let plate = |k: usize| PlateOf {
        name: plate_name(problem, &context.series, k),
        relative_scale: found.free_poses.scales[k].map(|s| Value { value: s.relative, sigma: Some(s.sigma) }),
    };
    let sigmas: BTreeMap<usize, &PoseSigma> = seen.known.iter().map(|s| (s.image, s)).collect();
    let image = |k: usize| image_of(names.of(k), &problem.images[k], sigmas.get(&k).copied());
    Record {
        format: 1,
        program: concat!("robotcal ", env!("CARGO_PKG_VERSION")),
        command: &context.command,
        inputs: &context.inputs,
        cameras: cameras_of(found),
        plates: (0..problem.plates.len()).map(plate).collect(),
        images: (0..problem.images.len()).map(image).collect(),
        statistics: &seen.statistics,
        covariance_together: None,
        against: context.against.as_ref().map(|(file, compared)| against_of(file, compared)),
        findings: found.findings.iter().map(FindingRecord::from).collect(),
        notices: context.notices.iter().map(Notice::coded).collect(),
        files: seen.files.clone(),
    }
}
