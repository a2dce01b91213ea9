//! `robotcal doctor`: what is missing in a series folder, before the long work.

use std::path::{Path, PathBuf};

use clap::Args;
use rayon::prelude::*;

use crate::assess::Limits;
use crate::calibration::{Ends, Inputs, Pictures};
use crate::cli::Verdict;
use crate::cli::flags::recording::RecordingArgs;
use crate::cli::terminal::paragraph::paragraph;
use crate::cli::terminal::say::say_line;
use crate::detect::{load, turned_by_viewers};
use crate::error::{Code, Error, Notice, Result};
use crate::files::{is_whole, picture_size, word};
use crate::identify::{image_size, readings_of};
use crate::series::{self, RecordingOptions, Series, Source};

/// Most lines of a notice.
const MOST_LINES: usize = 6;

/// Flags of `doctor`.
#[derive(Debug, Args)]
pub struct DoctorArgs {
    /// Series folder, or recording
    #[arg(value_name = "SERIES")]
    series: PathBuf,
    /// Robot description (URDF): also tries whether joint names and readings fit it
    #[arg(long, value_name = "FILE")]
    urdf: Option<PathBuf>,
    #[command(flatten)]
    recording: RecordingArgs,
}

/// What was looked at, and what was found of it.
#[derive(Default)]
struct Examination {
    missing: Vec<Error>,
}

impl Examination {
    fn good(&self, what: &str, found: &str) {
        say_line!("ok        {what}: {found}");
    }

    fn missing(&mut self, error: Error) {
        let words = format!("{}: {} ({})", error.place, error.what, error.remedy);
        paragraph("TO DO     ", &words, MOST_LINES).iter().for_each(|line| say_line!("{line}"));
        self.missing.push(error);
    }

    fn note(&self, notice: &Notice) {
        paragraph("note      ", &notice.coded(), MOST_LINES).iter().for_each(|line| say_line!("{line}"));
    }
}

pub fn run(args: &DoctorArgs) -> Result<Verdict> {
    let options = args.recording.options(&[])?;
    let mut seen = Examination::default();
    files_of(&args.series, &mut seen);
    if seen.missing.is_empty() {
        match series::read(&args.series) {
            Ok(series) => examine(series, args, &options, &mut seen),
            Err(error) => seen.missing(error),
        }
    }
    match seen.missing.first() {
        None => {
            let urdf = args.urdf.as_ref().map_or("robot.urdf".to_owned(), |f| word(f.display()));
            let series = word(args.series.display());
            say_line!("ready     robotcal identify --urdf {urdf} --series {series}{}", args.recording.given());
            Ok(Verdict::Good)
        }
        Some(first) => {
            let what = format!("is not ready: {} to do, see above", seen.missing.len());
            Err(Error::new(first.code, args.series.display(), what, "complete the folder, then run doctor again"))
        }
    }
}

/// All files of a folder that are needed and not there; a recording is read as a whole.
fn files_of(folder: &Path, seen: &mut Examination) {
    if folder.is_file() || series::is_recording(folder) {
        return;
    }
    if !folder.is_dir() {
        return seen.missing(Error::new(
            Code::SeriesMissing,
            folder.display(),
            "is no folder",
            "name the folder of a series",
        ));
    }
    let has = |name: &str| folder.join(name).exists();
    let mut need = |name: &str, remedy: &str| {
        if !has(name) {
            seen.missing(Error::new(Code::FileMissing, folder.join(name).display(), "is not there", remedy));
        }
    };
    need(
        "series.toml",
        "write it: format = 1, joint_unit = \"deg\" or \"rad\", camera_mount = \"hand\" or \"fixed\", plate = \"plate.toml\", a line each",
    );
    if !has("series.toml") {
        need("plate.toml", "copy it from the folder that robotcal plate wrote, with plate.csv");
    }
    let text = std::fs::read_to_string(folder.join("series.toml")).unwrap_or_default();
    let is_recording = text.lines().any(|line| line.trim_start().starts_with("mcap"));
    if is_recording || has("controller.csv") {
        return;
    }
    let remedy = "a row each image: its name, then the reading of every joint; the columns are named as in the URDF";
    need("joints.csv", remedy);
    let measured = ["images", "images.csv", "observations.csv", "points.csv", "poses.csv", "contacts.csv"];
    if !measured.iter().any(|name| has(name)) {
        need("images", "put the images of the series there, named as in joints.csv");
    }
}

fn examine(series: Series, args: &DoctorArgs, options: &RecordingOptions, seen: &mut Examination) {
    let manifest = series.manifest_file();
    let manifest = manifest.file_name().map_or_else(|| "series.toml".into(), |name| name.to_string_lossy());
    seen.good(&manifest, &format!("plate of {} markers", series.plate.markers.len()));
    // Pictures of a recording are looked at, too.
    let pictures = Pictures::new();
    let series = match with_stops(series, &pictures, args, options) {
        Ok(series) => series,
        Err(error) => return seen.missing(error),
    };
    sources(&series, seen);
    for view in series.views().iter().filter(|view| matches!(view.source, Source::Observations(_))) {
        image_size(view, None).err().into_iter().for_each(|error| seen.missing(error));
    }
    Notice::said_once(&series.notices).iter().for_each(|n| seen.note(n));
    stops(&series, seen);
    if let Some(urdf) = &args.urdf
        && let Err(error) = robot(&series, urdf, seen)
    {
        seen.missing(error);
    }
}

/// What was measured, and the light of its images.
fn sources(series: &Series, seen: &mut Examination) {
    match &series.source {
        Source::Recording(_) => {}
        Source::Observations(all) => seen.good("observations.csv", &format!("{} images", all.len())),
        Source::Cameras(views) => {
            let cameras = views.iter().filter(|view| view.source != Source::NoImages).count();
            seen.good("images.csv", &format!("{cameras} cameras at the same stops"));
            let of_images = views.iter().filter(|view| matches!(view.source, Source::Images { .. }));
            of_images.for_each(|view| images(view, seen));
        }
        Source::NoImages => seen.good("measurements", "of the tip in space, without images"),
        Source::Images { dark, white, .. } => {
            images(series, seen);
            for (name, files) in [("dark/", dark), ("white/", white)] {
                if !files.is_empty() {
                    seen.good(name, &format!("{} images for the flat field", files.len()));
                }
            }
        }
    }
}

/// The series as it is identified: a recording with its stops, for the joints of the robot where that is given.
fn with_stops(series: Series, pictures: &Pictures, args: &DoctorArgs, options: &RecordingOptions) -> Result<Series> {
    if !matches!(series.source, Source::Recording(_)) {
        return Ok(series);
    }
    let options = match &args.urdf {
        None => options.clone(),
        Some(urdf) => {
            let inputs = Inputs::with_series(urdf, vec![series.clone()], Ends::default())?;
            options.clone().of_chain(&inputs.chain)
        }
    };
    let mut all = pictures.of_recordings(vec![series.clone()], &options)?;
    Ok(all.pop().unwrap_or(series))
}

/// All pictures can be opened, and have one size.
fn images(series: &Series, seen: &mut Examination) {
    let paths: Vec<&PathBuf> = series.stops.stops.iter().filter_map(|s| s.path.as_ref()).collect();
    let sizes: Vec<Result<(u32, u32)>> = paths.par_iter().map(|path| size_of(path)).collect();
    let mut known: Vec<(u32, u32)> = Vec::new();
    for size in sizes {
        match size {
            Ok(size) => known.push(size),
            Err(e) => seen.note(&Notice::new(e.code, e.place, format!("{}; the image is left out", e.what), e.remedy)),
        }
    }
    let Some(&(width, height)) = known.first() else {
        let what = "no image can be read";
        return seen.missing(Error::new(
            Code::ImagesMissing,
            series.folder.display(),
            what,
            "copy the images into images/",
        ));
    };
    let others = known.iter().filter(|size| **size != (width, height)).count();
    seen.good("images", &format!("{} of {width} x {height} px", known.len() - others));
    if others > 0 {
        let what = format!("{others} images have another size than {width} x {height} px");
        seen.note(&Notice::new(Code::ImageSizeDiffers, "images", what, "they are left out"));
    }
    turned_by_viewers(&paths).iter().for_each(|(_, notice)| seen.note(notice));
}

/// Of a picture that can be used: one without a mark of its end may have all of its rows, and is decoded.
fn size_of(path: &Path) -> Result<(u32, u32)> {
    let size = picture_size(path)?;
    if !is_whole(path)? {
        load(path, None)?;
    }
    Ok(size)
}

fn stops(series: &Series, seen: &mut Examination) {
    let (all, few) = (series.stops.stops.len(), Limits::default().few_images);
    let name = match series.manifest.mcap {
        Some(_) => "recording",
        None if series.controller.is_some() => "controller.csv",
        None => "joints.csv",
    };
    if all < few {
        let remedy = "take 30 to 50 stops that move every joint through its range";
        return seen.note(&Notice::new(Code::FewImages, name, format!("{all} stops are few"), remedy));
    }
    match name {
        "controller.csv" => seen.good(name, &format!("{all} stops with their poses")),
        _ => seen.good(name, &format!("{all} stops, joints {}", series.stops.joints.join(", "))),
    }
}

/// Names, units and limits of the readings against the robot.
fn robot(series: &Series, file: &Path, seen: &Examination) -> Result<()> {
    let Inputs { description, chain, tip_notice, .. } =
        Inputs::with_series(file, vec![series.clone()], Ends::default())?;
    let moving = chain.readings.join(", ");
    seen.good("urdf", &format!("{} ({} to {}; {moving})", description.name, chain.base, chain.tip));
    tip_notice.iter().chain(&Notice::said_once(&description.notices)).for_each(|n| seen.note(n));
    let readings = readings_of(series, &chain)?;
    series.reading_notices(&chain).iter().for_each(|n| seen.note(n));
    seen.good("readings", &format!("{} stops with a value for every joint", readings.iter().flatten().count()));
    Ok(())
}
