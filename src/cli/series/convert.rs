//! `robotcal convert`: a recording becomes a series folder, a series folder becomes a recording, a camera goes to another program.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use clap::Args;

use super::convert_camera::{self, Wanted};
use crate::calibration::{Ends, Inputs};
use crate::cli::Verdict;
use crate::cli::flags::recording::RecordingArgs;
use crate::cli::flags::robot::read_chain;
use crate::cli::results::show::read_solution;
use crate::cli::terminal::say::{say, say_line};
use crate::error::{Code, Error, Notice, Result};
use crate::files::{folder_of, picture_size};
use crate::model::robot::Robot;
use crate::output::recording::{MAGNIFIED, overlay};
use crate::output::{NewFolder, ResultFolder};
use crate::series::{
    self, CameraInfo, Extracted, FramePoses, ImageMarks, RecordingContent, Series, Source, convert_recording,
};
use crate::urdf::Chain;

/// Flags of `convert`.
#[derive(Debug, Args)]
pub struct ConvertArgs {
    /// Recording (an .mcap file or a rosbag2 folder), series folder, or what holds a camera
    #[arg(value_name = "FROM")]
    from: PathBuf,
    /// New series folder, new .mcap file for a series folder, or new camera file
    #[arg(value_name = "TO")]
    to: PathBuf,
    /// Robot description: its joints are taken [default: all that are recorded]; a series folder needs it
    #[arg(long, value_name = "FILE")]
    urdf: Option<PathBuf>,
    /// Base link
    #[arg(long, value_name = "LINK", requires = "urdf")]
    base: Option<String>,
    /// Tip link
    #[arg(long, value_name = "LINK", requires = "urdf")]
    tip: Option<String>,
    /// Solution of the series (solution.json): its camera, frames and residuals go into the recording, too
    #[arg(long, value_name = "SOLUTION", requires = "urdf")]
    solution: Option<PathBuf>,
    /// Write a camera for another program: opencv, kalibr, mrcal or ros; FROM is then a solution.json, poses.json or camera file
    #[arg(long = "as", value_name = "FORMAT", conflicts_with_all = ["urdf", "solution"], help_heading = "Cameras")]
    camera_format: Option<String>,
    /// Which camera, where there are several
    #[arg(long, value_name = "CAMERA", help_heading = "Cameras")]
    name: Option<String>,
    /// Write the nearest model of the format where it does not have the lens
    #[arg(long, help_heading = "Cameras")]
    nearest: bool,
    #[command(flatten)]
    recording: RecordingArgs,
}

pub fn run(args: &ConvertArgs) -> Result<Verdict> {
    let camera = Wanted {
        from: &args.from,
        to: &args.to,
        format: args.camera_format.as_deref(),
        name: args.name.as_deref(),
        nearest: args.nearest,
    };
    if let Some(format) = convert_camera::format(&camera)? {
        convert_camera::run(&camera, format)?;
        say_line!("written   {}", args.to.display());
        return Ok(Verdict::Good);
    }
    let is_recording = args.to.extension().is_some_and(|e| e == "mcap");
    let verdict = if is_recording { to_recording(args)? } else { to_series(args)? };
    say_line!("written   {}", args.to.display());
    Ok(verdict)
}

/// A recording as a series folder, with the joints of the robot where there is one.
fn to_series(args: &ConvertArgs) -> Result<Verdict> {
    let new = NewFolder::begin(&args.to)?;
    let chain = match &args.urdf {
        Some(file) => Some(read_chain(file, args.base.as_deref(), args.tip.as_deref())?),
        None => None,
    };
    let options = args.recording.options(&[])?;
    let options = chain.map_or(options.clone(), |chain| options.of_chain(&chain));
    let extracted = convert_recording(&args.from, new.path(), &options)?;
    new.finish()?;
    say!("{}", text(&extracted));
    Ok(Verdict::Good)
}

/// A series folder as a recording, with the nominal tip and the observations where there are any; not all of it where images cannot be decoded.
fn to_recording(args: &ConvertArgs) -> Result<Verdict> {
    series::require_new(&args.to)?;
    let folder = folder_of(&args.to);
    let _tried = ResultFolder::among(folder)?;
    let urdf = args.urdf.as_ref().ok_or_else(|| without_urdf(&args.from))?;
    let series = series::read_images(&args.from)?;
    refuse_more_than_one(&series)?;
    let ends = Ends { base: args.base.as_deref(), tip: args.tip.as_deref() };
    let Inputs { chain, tip_notice, description, .. } = Inputs::with_series(urdf, vec![series.clone()], ends)?;
    let readings = series.readings_for(&chain)?;
    let names: Vec<&str> = series.stops.stops.iter().map(|s| s.image.as_str()).collect();
    let found = args.solution.as_deref().map(|path| overlay(&read_solution(path)?, &names, &readings)).transpose()?;
    let (camera, frames, marks) = match &found {
        Some(o) => (Some(o.camera.clone()), o.frames.clone(), o.marks.clone()),
        None => as_given(args, &series, &chain, &readings)?,
    };
    let shown = RecordingContent {
        joints: &chain.readings,
        readings: &readings,
        camera: camera.as_ref(),
        frames: &frames,
        marks: &marks,
    };
    let written = series::write_recording(&args.to, &series, shown)?;
    let tip = if found.is_some() { "identified" } else { "nominal" };
    say_line!("stops     {} with image, joints and {tip} tip; {} with observations marked", written.stops, marks.len());
    if found.is_some() {
        say_line!("overlay   green: used, orange: left out, red: residuals, {MAGNIFIED} times their length");
    }
    let of_robot: Vec<Notice> = tip_notice.into_iter().chain(Notice::said_once(&description.notices)).collect();
    let of_readings = series.reading_notices(&chain);
    let notices = of_robot.iter().chain(&series.notices).chain(&of_readings).chain(&written.notices);
    notices.for_each(|notice| say_line!("note      {}", notice.coded()));
    written.unreadable.iter().for_each(|image| say_line!("left out  {}", image.coded()));
    Ok(if written.unreadable.is_empty() { Verdict::Good } else { Verdict::GateFailed })
}

fn without_urdf(series: &Path) -> Error {
    let what = "the joints of a series mean nothing without their robot";
    let remedy = "add --urdf robot.urdf (and --base, --tip if needed)";
    Error::new(Code::OptionMissing, series.display(), what, remedy)
}

/// A recording has one camera, and says nothing of where the plate stood.
fn refuse_more_than_one(series: &Series) -> Result<()> {
    let placements: BTreeSet<&str> = series.stops.stops.iter().map(|stop| stop.placement.as_str()).collect();
    let what = match (series.manifest.cameras.len(), placements.len()) {
        (0 | 1, 0 | 1) => return Ok(()),
        (0 | 1, places) => format!("its plate stands in {places} places, which a recording cannot tell apart"),
        (cameras, _) => format!("has {cameras} cameras, and a recording has one"),
    };
    let remedy = "make a series of each, and a recording of each of these";
    Err(Error::new(Code::StopsNotRecorded, series.folder.display(), what, remedy))
}

type Given = (Option<CameraInfo>, Vec<FramePoses>, Vec<ImageMarks>);

/// What is known without a solution: the stated focal length, the nominal tip, the observations where there are any.
fn as_given(args: &ConvertArgs, series: &Series, chain: &Chain, readings: &[Option<Vec<f64>>]) -> Result<Given> {
    let stated = series.manifest.camera();
    let size = series.stops.stops.iter().find_map(|s| picture_size(s.path.as_ref()?).ok());
    let camera = size.zip(stated.focal_px).map(|((width_px, height_px), focal)| CameraInfo {
        width_px,
        height_px,
        distortion_model: "plumb_bob".into(),
        distortion: vec![0.0; 5],
        intrinsics: Some([focal, focal, 0.5 * (f64::from(width_px) - 1.0), 0.5 * (f64::from(height_px) - 1.0)]),
    });
    let robot = Robot::nominal(chain.clone());
    let poses = readings.iter().map(|r| r.as_ref().map(|q| robot.base_from_tip(q))).collect();
    let frames = vec![FramePoses { parent: chain.base.clone(), child: chain.tip.clone(), poses }];
    let marks = match series::read(&args.from)?.source {
        Source::Observations(marks) => marks.iter().map(ImageMarks::from).collect(),
        _ => Vec::new(),
    };
    Ok((camera, frames, marks))
}

/// What was taken, as a person reads it.
fn text(extracted: &Extracted) -> String {
    let reports = &extracted.reports;
    let worst = |of: fn(&crate::series::StopReport) -> f64| reports.iter().map(of).fold(0.0, f64::max);
    let pictures: usize = reports.iter().map(|r| r.pictures).sum();
    let mut text = format!(
        "stops     {} from {pictures} images of {} and the joints {} of {}\n\
         time      images recorded {:.1} ms {} than joint states, counted from their stamps\n\
         joints    nearest sample within {:.1} ms, fastest {:.2e} rad/s (m/s) at an exposure\n",
        reports.len(),
        extracted.image_topic,
        extracted.stops.joints.join(", "),
        extracted.joint_topic,
        1e3 * extracted.image_delay_s.abs(),
        if extracted.image_delay_s < 0.0 { "earlier" } else { "later" },
        1e3 * worst(|r| r.nearest_sample_s),
        worst(|r| r.speed),
    );
    let noises: Vec<f64> = reports.iter().filter_map(|r| r.noise_counts).collect();
    if !noises.is_empty() {
        let rms = (noises.iter().map(|n| n * n).sum::<f64>() / noises.len() as f64).sqrt();
        text += &format!("noise     {rms:.2} counts in one image\n");
    }
    for notice in &extracted.notices {
        text += &format!("note      {}\n", notice.coded());
    }
    text
}
