//! `robotcal detect`: what is seen in the images, without any robot.

use std::path::{Path, PathBuf};

use clap::Args;
use rayon::prelude::*;

use super::image_study::{self, StudyArgs};
use crate::assess::Limits;
use crate::calibration::{Pictures, require_unchanged};
use crate::cli::Verdict;
use crate::cli::flags::recording::RecordingArgs;
use crate::cli::terminal::progress;
use crate::cli::terminal::say::{say, say_line};
use crate::detect::{FlatField, FlatFieldFacts, load};
use crate::error::{Code, Error, Notice, Result};
use crate::identify::{SeenImage, SeenSeries, Unused, detect_stops, flat_field_drift, pictures, require_some};
use crate::output::detection_files::{
    self, DetectionContext, detection_files, dropped_counts, marker_counts, picture_names,
};
use crate::output::overlay::{Palette, overlay_png};
use crate::output::{NewResult, ResultFolder, folder_name};
use crate::series::{self, InputFile, Plate, Series, series_of_images};

/// Flags of `detect`.
#[derive(Debug, Args)]
pub struct DetectArgs {
    /// Series folder or recording (.mcap, rosbag2 folder); its images are looked at even where it has observations
    #[arg(long, value_name = "FOLDER", required_unless_present_any = ["images", "study"])]
    series: Option<PathBuf>,
    /// Single images instead of a series; they need --plate
    #[arg(value_name = "IMAGE", conflicts_with = "series", requires = "plate")]
    images: Vec<PathBuf>,
    /// The plate in single images (plate.toml)
    #[arg(long, value_name = "FILE", conflicts_with = "series")]
    plate: Option<PathBuf>,
    /// Also draw what was found, what was dropped and why (overlay/, a PNG for each image)
    #[arg(long)]
    overlay: bool,
    /// Folder for the results [default: reports/<series name>-detected, for a study reports]
    #[arg(long, value_name = "FOLDER")]
    out: Option<PathBuf>,
    #[command(flatten)]
    study: StudyArgs,
    #[command(flatten)]
    recording: RecordingArgs,
}

/// What was looked at.
struct Looked {
    series: Option<Series>,
    plate: Plate,
    images: Vec<SeenImage>,
    notices: Vec<Notice>,
    inputs: Vec<InputFile>,
    /// Dark and white images.
    flat_field: Option<FlatField>,
}

pub fn run(args: &DetectArgs) -> Result<Verdict> {
    if args.study.wanted() {
        return image_study::run(&args.study, args.out.as_deref().unwrap_or(Path::new("reports")), args.overlay);
    }
    // Pictures of a recording are needed until they have been drawn on.
    let pictures = Pictures::new();
    let claim = |folder: &Path| ResultFolder::claim(folder, detection_files::FILE_NAME);
    let claimed = args.out.as_deref().map(claim).transpose()?;
    let series = args.series.as_deref().map(series::read_images).transpose()?;
    let name = series.as_ref().map_or("images", |s| s.name.as_str()).to_owned();
    let folder = format!("{}-detected", folder_name(std::slice::from_ref(&name)));
    let place = claimed.map_or_else(|| claim(&Path::new("reports").join(folder)), Ok)?;
    let looked = match (series, &args.plate) {
        (Some(series), _) => of_series(args, series, &pictures)?,
        (None, Some(plate)) => of_images(&args.images, plate)?,
        (None, None) => {
            return Err(Error::new(
                Code::OptionMissing,
                "detect",
                "no images are given",
                "give --series, or --plate and images",
            ));
        }
    };
    let out = place.path().to_path_buf();
    let written = write(args, &looked, place)?;
    say!("{}", text(&looked.images));
    looked.flat_field.iter().for_each(|f| say!("{}", of_flat_field(&f.facts)));
    let notices: Vec<Notice> =
        looked.notices.iter().cloned().chain(looked.images.iter().flat_map(SeenImage::notices)).collect();
    Notice::said_once(&notices).iter().for_each(|n| say_line!("note      {}", n.coded()));
    say_line!("results   {} ({written} files)", out.display());
    let found = |i: &SeenImage| i.detection.observations.len();
    require_some(
        &name,
        looked.images.iter().map(|i| (i.name.as_str(), found(i), i.detection.failure.as_ref().map(Unused::from))),
    )?;
    Ok(if looked.images.iter().all(is_used) { Verdict::Good } else { Verdict::GateFailed })
}

fn of_series(args: &DetectArgs, series: Series, pictures: &Pictures) -> Result<Looked> {
    let mut all = pictures.of_recordings(vec![series], &args.recording.options(&[])?)?;
    let Some(series) = all.pop() else {
        return Err(Error::new(Code::OptionMissing, "detect", "the series was lost", "report this"));
    };
    let hashes = series.image_hashes()?;
    let inputs = [series.inputs.as_slice(), &hashes].concat();
    let bar = progress::bar(series.stops.stops.len(), &series.name);
    let limits = Limits::default();
    let SeenSeries { images, flat_field } = detect_stops(&series, &limits, |_| bar.inc(1))?;
    bar.finish_and_clear();
    require_unchanged(&hashes, &series.image_hashes()?)?;
    let mut notices = series.notices.clone();
    notices.extend(flat_field.iter().flat_map(|f| flat_field_drift(&series, &f.facts, &limits)));
    Ok(Looked { plate: series.plate.clone(), images, notices, inputs, flat_field, series: Some(series) })
}

fn of_images(images: &[PathBuf], plate: &Path) -> Result<Looked> {
    let Series { plate, mut inputs, .. } = series_of_images(images, plate)?;
    let hashes = || images.iter().filter(|i| i.is_file()).map(|i| InputFile::of_file(i)).collect::<Result<Vec<_>>>();
    let before = hashes()?;
    inputs.extend(before.iter().cloned());
    let bar = progress::bar(images.len(), "images");
    let seen = crate::identify::detect_images(images, &plate, |_| bar.inc(1));
    bar.finish_and_clear();
    require_unchanged(&before, &hashes()?)?;
    Ok(Looked { series: None, plate, images: seen, notices: Vec::new(), inputs, flat_field: None })
}

/// Writes the results; returns the number of files.
fn write(args: &DetectArgs, looked: &Looked, place: ResultFolder) -> Result<usize> {
    let names = if args.overlay { picture_names(&looked.images) } else { Vec::new() };
    let drawable: Vec<(&SeenImage, &PathBuf, &String)> = looked
        .images
        .iter()
        .zip(&names)
        .filter(|(image, _)| image.size.is_some())
        .filter_map(|(image, name)| Some((image, image.path.as_ref()?, name)))
        .collect();
    let context = DetectionContext {
        plate: &looked.plate,
        series: looked.series.as_ref(),
        inputs: looked.inputs.clone(),
        command: crate::cli::command_text(),
        pictures: drawable.iter().map(|(_, _, name)| (*name).clone()).collect(),
    };
    let files = detection_files(&looked.images, &context)?;
    let result = place.begin()?;
    files.iter().try_for_each(|(name, bytes)| result.put(name, bytes))?;
    draw(looked, &drawable, &result)?;
    result.finish()?;
    Ok(files.len() + drawable.len())
}

fn draw(looked: &Looked, drawable: &[(&SeenImage, &PathBuf, &String)], result: &NewResult) -> Result<()> {
    let palette = Palette::of(&looked.images);
    let corrected = looked.series.as_ref().map(|s| pictures(s, looked.flat_field.as_ref()));
    let picture = |path: &Path| corrected.as_ref().map_or_else(|| load(path, None), |read| Ok(read(path)?.picture));
    let bar = progress::bar(drawable.len(), "drawing");
    drawable.par_iter().try_for_each(|(image, path, name)| {
        let drawn = overlay_png(&picture(path)?, image, &looked.plate, &palette)?;
        bar.inc(1);
        result.put(name, &drawn)
    })?;
    bar.finish_and_clear();
    Ok(())
}

/// Something was found, and nothing speaks against it.
fn is_used(image: &SeenImage) -> bool {
    image.detection.failure.is_none() && !image.detection.observations.is_empty()
}

/// The table: a line for every image, and the sum.
fn text(images: &[SeenImage]) -> String {
    let widest = images.iter().map(|i| i.name.chars().count()).fold(5, usize::max);
    let mut text = format!("{:widest$}  found  rescued  blur px  noise      dropped\n", "image");
    for image in images {
        let (found, rescued) = marker_counts(image);
        let facts = image.detection.circles.as_ref().filter(|c| c.blur_px.is_finite());
        let blur = facts.map_or_else(|| "-".into(), |c| format!("{:.2}", c.blur_px));
        let noise = facts.map_or_else(|| "-".into(), |c| format!("{:.1}/{:.1}", c.noise[0], c.noise[1]));
        let rest = match &image.detection.failure {
            Some(failure) => format!("NOT USED: {}", failure.what),
            None if !is_used(image) => format!("NOT USED: no marker found ({})", counts(std::iter::once(image))),
            None => counts(std::iter::once(image)),
        };
        text += &format!("{:widest$}  {found:5}  {rescued:7}  {blur:>7}  {noise:9}  {rest}\n", image.name);
    }
    let used = images.iter().filter(|i| is_used(i)).count();
    let sum = |of: fn((usize, usize)) -> usize| images.iter().map(|i| of(marker_counts(i))).sum::<usize>();
    let (found, rescued) = (sum(|c| c.0), sum(|c| c.1));
    let label = "all";
    text += &format!("{label:widest$}  {found:5}  {rescued:7}  {:>7}  {:9}  {}\n", "", "", counts(images.iter()));
    text += &format!("images    {used} of {} used\n", images.len());
    text
}

/// What dark and white images did.
fn of_flat_field(facts: &FlatFieldFacts) -> String {
    let mut text = format!("dark      {} images", facts.dark_images);
    if facts.dark_images > 0 {
        text += &format!(" averaged and taken off: {:.2} % of full scale", 100.0 * facts.dark_level);
    }
    text += &format!("\nwhite     {} images", facts.white_images);
    if facts.white_images > 0 {
        text += &format!(
            " averaged and divided by: the darkest part of the image has {:.0} % of the light of the brightest, {} pixels without signal",
            100.0 * facts.darkest,
            facts.dead
        );
    }
    for (name, drift) in [("dark", &facts.dark_drift), ("white", &facts.white_drift)] {
        if let Some(d) = drift {
            let noise = d
                .noise
                .map_or_else(String::new, |n| format!(", {:.3} % of it by the scatter of single frames", 100.0 * n));
            text += &format!(
                "\nchange    {name}, begin to end: {:+.2} %, from place to place {:.3} % RMS{noise}",
                100.0 * d.level,
                100.0 * d.pattern
            );
        }
    }
    text + "\n"
}

/// Reasons with their counts, the most frequent first.
fn counts<'a>(images: impl Iterator<Item = &'a SeenImage>) -> String {
    let mut counts: Vec<(&str, usize)> = dropped_counts(images).into_iter().collect();
    counts.sort_by_key(|(reason, n)| (std::cmp::Reverse(*n), *reason));
    let words: Vec<String> = counts.iter().map(|(reason, n)| format!("{n} {reason}")).collect();
    if words.is_empty() { "none".into() } else { words.join(", ") }
}
