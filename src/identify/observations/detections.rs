//! The images of a series to what is seen in them; needs no robot.

use std::path::{Path, PathBuf};

use super::second_pass::second_pass;
use super::seen_image::SeenImage;
use crate::assess::Limits;
use crate::detect::{FlatField, FlatFieldFacts, LightDrift, Loaded, SeriesImage, detect_series, load};
use crate::error::{Code, Error, Notice, Result};
use crate::series::{Plate, Series, Source};

/// What is seen in the images of a series.
#[derive(Debug)]
pub struct SeenSeries {
    /// In the order of the stops.
    pub images: Vec<SeenImage>,
    /// What its dark and white images correct; none where it has none.
    pub flat_field: Option<FlatField>,
}

/// Looks for the plate in the images of all stops, dark and white images taken into account, then again where a first
/// solve predicts more markers; in the order of the stops.
/// `progress` is called after every image, from any thread.
///
/// # Errors
/// A series without images; dark and white images that are of no use.
pub fn detect_stops(series: &Series, limits: &Limits, progress: impl Fn(&Path) + Sync) -> Result<SeenSeries> {
    let flat_field = flat_field(series)?;
    let picture = pictures(series, flat_field.as_ref());
    let paths: Vec<PathBuf> = series.stops.stops.iter().filter_map(|s| s.path.clone()).collect();
    let mut found = detect_series(&paths, &series.plate, &picture, progress).into_iter();
    let missing = |image: &str| {
        let table = series.readings_file();
        let remedy =
            format!("copy it into images/, or remove its row from {}", table.file_name().unwrap_or_default().display());
        SeriesImage::failed(Error::new(Code::ImageNotThere, image, "the image file is missing", remedy))
    };
    let seen = series.stops.stops.iter().map(|stop| {
        let image = stop.path.as_ref().and_then(|_| found.next()).unwrap_or_else(|| missing(&stop.image));
        SeenImage::new(&stop.image, stop.path.as_deref(), image)
    });
    let mut seen: Vec<SeenImage> = seen.collect();
    second_pass(series, &mut seen, limits, picture);
    Ok(SeenSeries { images: seen, flat_field })
}

/// Reads the images of a series as the detector sees them: dark and white images taken into account.
pub fn pictures<'a>(
    series: &Series,
    flat_field: Option<&'a FlatField>,
) -> impl Fn(&Path) -> Result<Loaded> + Sync + use<'a> {
    let bits = series.manifest.camera().bits;
    move |path: &Path| {
        let picture = load(path, bits)?;
        match flat_field {
            Some(flat_field) => flat_field.apply(picture),
            None => Ok(picture.into()),
        }
    }
}

/// Dark and white images of a series; none where it has none.
fn flat_field(series: &Series) -> Result<Option<FlatField>> {
    let (dark, white) = match &series.source {
        Source::Images { dark, white, .. } => (dark, white),
        Source::Recording(path) => return Err(recording(path)),
        Source::Observations(_) => {
            let what = "has observations and no images";
            let remedy = "add the images, or use the observations";
            return Err(Error::new(Code::ImagesMissing, series.folder.display(), what, remedy));
        }
        Source::NoImages => return Err(no_images(series)),
        Source::Cameras(_) => return Err(several_cameras(series)),
    };
    FlatField::from_images(dark, white, series.manifest.camera().bits)
}

/// Whether sensor or light changed from the dark and white frames `begin*` to the frames `end*`.
pub fn flat_field_drift(series: &Series, facts: &FlatFieldFacts, limits: &Limits) -> Vec<Notice> {
    let place = |folder: &str| series.folder.join(folder).display().to_string();
    let mut notices = Vec::new();
    if let Some(d) = facts.dark_drift.filter(|d| changed(d, [limits.dark_drift, limits.dark_drift], limits)) {
        let what = format!(
            "from the frames begin* to end* the dark images change by {:.2} % of full scale, and by {:.2} % from place to place",
            100.0 * d.level,
            100.0 * d.pattern
        );
        let remedy = "let the sensor warm up before the series, and take dark images at its temperature";
        notices.push(Notice::new(Code::FlatFieldDrift, place("dark"), what, remedy));
    }
    if let Some(d) = facts.white_drift.filter(|d| changed(d, [limits.light_drift, limits.white_drift], limits)) {
        let what = format!(
            "from the frames begin* to end* the light changes by {:.1} %, and by {:.2} % from place to place in the image",
            100.0 * d.level,
            100.0 * d.pattern
        );
        let remedy = "did aperture, focus, dust or the light change? take the white images again, evenly lit";
        notices.push(Notice::new(Code::FlatFieldDrift, place("white"), what, remedy));
    }
    notices
}

/// Beyond what matters, in common or from place to place, and there beyond what single frames scatter.
fn changed(drift: &LightDrift, [level, pattern]: [f64; 2], limits: &Limits) -> bool {
    let chance = limits.drift_sigmas * drift.noise.unwrap_or(0.0);
    drift.level.abs() > level || drift.pattern > pattern.max(chance)
}

/// Looks for a plate in single images.
pub fn detect_images(images: &[PathBuf], plate: &Plate, progress: impl Fn(&Path) + Sync) -> Vec<SeenImage> {
    let name = |path: &Path| path.file_name().map_or_else(String::new, |n| n.to_string_lossy().into_owned());
    let found = detect_series(images, plate, |path| load(path, None), progress);
    images.iter().zip(found).map(|(path, seen)| SeenImage::new(&name(path), Some(path), seen)).collect()
}

/// A recording must be taken apart before its images can be looked at.
pub(super) fn recording(path: &Path) -> Error {
    Error::new(
        Code::RecordingNotConverted,
        path.display(),
        "is a recording, not a series folder",
        "convert it first: robotcal convert run1.mcap run1/",
    )
}

/// A series of a tracker or of contacts alone.
pub(super) fn no_images(series: &Series) -> Error {
    let remedy = "add images/, or observations.csv";
    Error::new(Code::ImagesMissing, series.folder.display(), "no images: there is nothing to look at", remedy)
}

/// A series of several cameras, where one is wanted.
pub(super) fn several_cameras(series: &Series) -> Error {
    let what = "has several cameras, and one is looked at at a time";
    let remedy = "give the images of one camera with --plate";
    Error::new(Code::SettingUnsupported, series.manifest_file().display(), what, remedy)
}

/// Why an image cannot be used.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Unused<'a> {
    /// What was seen.
    pub what: &'a str,
    /// What the detector advises.
    pub remedy: Option<&'a str>,
}

impl<'a> From<&'a Error> for Unused<'a> {
    fn from(error: &'a Error) -> Self {
        Self { what: &error.what, remedy: Some(&error.remedy) }
    }
}

const NO_MARKER: Unused<'static> = Unused { what: "no marker found", remedy: None };

/// When none of the images can be used: what is wrong with all of them, or with the first ones; images are names, numbers of observations
/// and failures.
///
/// # Errors
/// When no image has an observation.
pub fn require_some<'a>(place: &str, images: impl Iterator<Item = (&'a str, usize, Option<Unused<'a>>)>) -> Result<()> {
    let mut unused = Vec::new();
    for (name, observations, failure) in images {
        if failure.is_none() && observations > 0 {
            return Ok(());
        }
        unused.push((name, failure.unwrap_or(NO_MARKER)));
    }
    let first = unused.first().map_or(NO_MARKER, |(_, first)| *first);
    let why = match unused.as_slice() {
        [(name, _), _, ..] if unused.iter().all(|(_, one)| one.what == first.what) => {
            format!("{name} and the {} others: {}", unused.len() - 1, first.what)
        }
        _ => unused.iter().take(3).map(|(name, one)| format!("{name}: {}", one.what)).collect::<Vec<_>>().join("; "),
    };
    let advised = first.remedy.filter(|_| unused.iter().all(|(_, one)| one.remedy == first.remedy));
    let look = "look at one of the images: is the plate in it, sharp, and the one that plate.toml describes?";
    Err(Error::new(Code::PlateNowhere, place, format!("no image can be used ({why})"), advised.unwrap_or(look)))
}
