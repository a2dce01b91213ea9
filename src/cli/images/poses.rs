//! `robotcal poses`: camera, plate and stand-alone camera poses from images alone.

use std::ops::Range;
use std::path::{Path, PathBuf};

use clap::Args;

use super::against;
use crate::assess::Limits;
use crate::calibration::{Pictures, require_unchanged};
use crate::cli::Verdict;
use crate::cli::flags::camera_args::CameraArgs;
use crate::cli::flags::recording::RecordingArgs;
use crate::cli::terminal::progress;
use crate::cli::terminal::say::{say, say_line};
use crate::diagnose::Finding;
use crate::error::{Code, Error, Notice, Result};
use crate::fit::Fit;
use crate::identify::{NamedSeries, PoseSigma, StandAlone, bring_together, measure, stand_alone};
use crate::model::camera::Camera;
use crate::output::poses_record::{usual, worst};
use crate::output::stand_alone_files::{self, StandAloneContext, stand_alone_files};
use crate::output::{REPORT, ResultFolder, folder_name};
use crate::problem::{Adjustment, MeasuredSeries};
use crate::series::{Series, Source, read_without_robot, series_of_images};
use crate::urdf::Chain;

/// Images of which the table has a row each; of more, the worst.
const MOST_ROWS: usize = 40;

/// Flags of `poses`.
#[derive(Debug, Args)]
pub struct PosesArgs {
    /// Series folder, or a folder with images/ and plate.toml; several of them to adjust several series together
    #[arg(long, value_name = "FOLDER", num_args = 1.., required_unless_present = "images")]
    series: Vec<PathBuf>,
    /// Single images instead of a series; they need --plate
    #[arg(value_name = "IMAGE", conflicts_with = "series", requires = "plate")]
    images: Vec<PathBuf>,
    /// The plate in single images (plate.toml)
    #[arg(long, value_name = "FILE", conflicts_with = "series")]
    plate: Option<PathBuf>,
    /// Compare with other poses: truth.toml of a simulation, a tracker's poses.csv (stop, target, ..), or poses.csv of another program (image, .., plate_from_camera)
    #[arg(long, value_name = "FILE")]
    against: Option<PathBuf>,
    /// Folder for the results [default: reports/<series name>-poses]
    #[arg(long, value_name = "FOLDER")]
    out: Option<PathBuf>,
    #[command(flatten)]
    cameras: CameraArgs,
    #[command(flatten)]
    recording: RecordingArgs,
}

pub fn run(args: &PosesArgs) -> Result<Verdict> {
    // Pictures of a recording are needed until they have been looked at.
    let pictures = Pictures::new();
    let claim = |folder: &Path| ResultFolder::claim(folder, stand_alone_files::FILE_NAME);
    let claimed = args.out.as_deref().map(claim).transpose()?;
    let series = match &args.plate {
        Some(plate) => vec![series_of_images(&args.images, plate)?],
        None => args.series.iter().map(|folder| read_without_robot(folder)).collect::<Result<Vec<Series>>>()?,
    };
    let names: Vec<String> = series.iter().map(|s| s.name.clone()).collect();
    let place = match claimed {
        Some(place) => place,
        None => claim(&Path::new("reports").join(format!("{}-poses", folder_name(&names))))?,
    };
    let series = pictures.of_recordings(series, &args.recording.options(&[])?)?;
    let hashes = series.iter().map(Series::image_hashes).collect::<Result<Vec<_>>>()?;
    let inputs = series.iter().zip(&hashes).flat_map(|(s, hashes)| s.inputs.iter().chain(hashes)).cloned().collect();
    let of_several = series.iter().filter(|s| matches!(s.source, Source::Cameras(_)));
    let mut notices: Vec<Notice> = of_several.flat_map(|s| s.notices.iter().cloned()).collect();
    let views: Vec<Series> = series.iter().flat_map(Series::views).cloned().map(without_joints).collect();
    let limits = Limits::default();
    let (mut measured, seen) = observe(&views, &limits)?;
    notices.extend(seen);
    series.iter().zip(&hashes).try_for_each(|(s, before)| require_unchanged(before, &s.image_hashes()?))?;
    notices.extend(bring_together(&views.iter().collect::<Vec<_>>(), &hashes.concat(), &mut measured)?);
    notices.extend(args.cameras.apply(&mut measured)?);
    let found = stand_alone(&measured, &limits)?;
    notices.extend(found.notices.iter().cloned());
    let command = crate::cli::command_text();
    let against = args.against.as_deref().map(|path| Ok((path.display().to_string(), against::compare(&found, path)?)));
    let against = against.transpose()?;
    let notices = Notice::said_once(&notices);
    let names = measured.iter().map(|s| s.name.clone()).collect();
    let context = StandAloneContext { series: names, inputs, command, limits, notices, against };
    let files = stand_alone_files(&found, &context)?;
    let folder = place.path().to_path_buf();
    place.write_all(&files)?;
    say!("{}", text(&found)?);
    if let Some((path, (_, compared))) = args.against.as_deref().zip(context.against.as_ref()) {
        say!("{}", against::text(path, compared));
    }
    say_findings(&found.findings, &context.notices);
    say_line!("report    {}", folder.join(REPORT).display());
    say_line!("results   {} ({} files)", folder.display(), files.len());
    Ok(if found.findings.iter().any(Finding::fails) { Verdict::GateFailed } else { Verdict::Good })
}

fn say_findings(findings: &[Finding], notices: &[Notice]) {
    for finding in findings {
        let word = if finding.fails() { "GATE" } else { "note" };
        say_line!("{word:9} {finding}");
    }
    notices.iter().for_each(|n| say_line!("note      {}", n.coded()));
}

/// No robot takes part.
fn without_joints(mut view: Series) -> Series {
    view.stops.joints.clear();
    view.stops.stops.iter_mut().for_each(|stop| stop.raw_readings = None);
    view
}

fn observe(series: &[Series], limits: &Limits) -> Result<(Vec<MeasuredSeries>, Vec<Notice>)> {
    let (mut all, mut notices) = (Vec::new(), Vec::new());
    let watch = progress::of_series();
    for s in series {
        let named = NamedSeries { series: s, is_one_of_several: series.len() > 1 };
        let found = measure(named, &Chain::empty(), limits, |_| watch(&s.name, s.stops.stops.len()))?;
        notices.extend(found.notices);
        all.push(found.series);
    }
    Ok((all, notices))
}

/// Position in mm and direction in arcmin.
fn in_words([position_m, rotation_rad]: [f64; 2]) -> String {
    format!("{:.4} mm   {:.3} arcmin", 1e3 * position_m, 60.0 * rotation_rad.to_degrees())
}

/// What is printed: the poses as a whole, cameras, scale, and the images.
fn text(found: &StandAlone) -> Result<String> {
    let problem = &found.fit.problem;
    let sigmas = found.sigmas();
    let (usual, worst) = usual(&sigmas).zip(worst(&sigmas)).ok_or_else(|| {
        Error::new(Code::PlateNowhere, "poses", "no image has a pose", "look at one of the images: is the plate in it?")
    })?;
    let name = |image: usize| &problem.images[image].name;
    let mut text = format!(
        "poses     {} of {} images, known to {} per axis (median; one sigma, in the frame of the plate)\n          worst: {} ({})\n",
        sigmas.len(),
        problem.images.len(),
        in_words(usual),
        in_words([worst.position_m, worst.rotation_rad]),
        name(worst.image)
    );
    text += &cameras_text(&found.fit);
    text += &format!(
        "residuals {:.4} px RMS per point over {} observations\n",
        found.free_poses.rms_px, found.free_poses.observations
    );
    for scale in found.scales() {
        text += &format!(
            "scale     of all poses together, and not in their sigmas: known to {:.4} %; 0.1 % is 1 mm a metre\n",
            100.0 * scale.sigma
        );
    }
    for image in &problem.images {
        if let Some(why) = &image.rejected {
            text += &format!("left out  {}: {why}\n", image.name);
        }
    }
    Ok(text + &table(&sigmas, name))
}

fn cameras_text(fit: &Fit) -> String {
    let Adjustment { problem, state } = &fit.adjustment;
    let cameras = problem.cameras.iter().zip(&state.cameras).zip(&problem.layout.cameras);
    let line = |((name, camera), columns): ((&String, &Camera), &Range<usize>)| {
        let lens = camera.lens.name();
        let [fx, fy, x, y] = std::array::from_fn(|c| {
            format!("{:.3} +- {:.3}", camera.parameters[c], fit.covariance.sigma(columns.start + c))
        });
        format!("camera    {name}: {lens}, fx {fx}, fy {fy}, centre ({x}, {y}) px\n")
    };
    cameras.map(line).collect()
}

/// A row for every image; of many images the worst.
fn table<'a>(sigmas: &[PoseSigma], name: impl Fn(usize) -> &'a String) -> String {
    let mut rows: Vec<&PoseSigma> = sigmas.iter().collect();
    if rows.len() > MOST_ROWS {
        rows.sort_by(|a, b| b.position_m.total_cmp(&a.position_m));
        rows.truncate(MOST_ROWS);
    }
    let widest = rows.iter().map(|s| name(s.image).chars().count()).fold(5, usize::max);
    let mut text = format!(
        "{:widest$}  points  px RMS  position mm  direction arcmin  axes mm: of the camera, of the plate's centre  correlation\n",
        "image"
    );
    for s in rows {
        text += &format!(
            "{:widest$}  {:6}  {:6.4}  {:11.4}  {:16.3}  {}  {}  {:11.3}\n",
            name(s.image),
            s.observations,
            s.rms_px,
            1e3 * s.position_m,
            60.0 * s.rotation_rad.to_degrees(),
            axes(&s.camera_axes_m),
            axes(&s.centre_axes_m),
            s.correlation
        );
    }
    text
}

/// Semi-axes of an ellipsoid, mm.
fn axes(all: &[f64; 3]) -> String {
    all.map(|a| format!("{:.4}", 1e3 * a)).join(" ")
}
