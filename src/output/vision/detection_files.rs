//! What was seen in the images of a series, as files: a series with observations in the place of images.

use std::collections::{BTreeMap, BTreeSet};

use serde::Serialize;

use crate::error::{Code, Result};
use crate::identify::SeenImage;
use crate::output::names::file_parts;
use crate::output::text::{as_written, json};
use crate::series::{
    CirclePoint, Edge, ImageObservations, InputFile, Plate, Series, observations_csv, plate_files, to_csv,
};

/// Name of the file that lists all others.
pub const FILE_NAME: &str = "detection.json";
/// Folder of the pictures.
pub const OVERLAY_FOLDER: &str = "overlay";

/// What the files need beside the images.
#[derive(Debug, Clone)]
pub struct DetectionContext<'a> {
    /// The plate that was looked for.
    pub plate: &'a Plate,
    /// The series that the images belong to; `None` for single images.
    pub series: Option<&'a Series>,
    /// All files that were read, with their hashes.
    pub inputs: Vec<InputFile>,
    /// The command line.
    pub command: String,
    /// Names of the pictures that are drawn; see [`picture_names`].
    pub pictures: Vec<String>,
}

/// Names of the pictures in the folder of the result, one for every image.
pub fn picture_names(images: &[SeenImage]) -> Vec<String> {
    let stems = images.iter().map(|i| i.name.strip_suffix(".png").unwrap_or(&i.name));
    file_parts(stems).iter().map(|part| format!("{OVERLAY_FOLDER}/{part}.png")).collect()
}

/// Dropped candidates for every reason.
pub fn dropped_counts<'a>(images: impl Iterator<Item = &'a SeenImage>) -> BTreeMap<&'static str, usize> {
    let mut counts = BTreeMap::new();
    images.flat_map(|i| &i.detection.dropped).for_each(|d| *counts.entry(d.reason).or_default() += 1);
    counts
}

/// Markers that were identified in an image: all, and those found by looking where they were predicted.
pub fn marker_counts(image: &SeenImage) -> (usize, usize) {
    let outer = image.detection.observations.iter().filter(|o| o.edge == Edge::Outer).count();
    let found = image.detection.circles.iter().flat_map(|c| &c.found);
    (outer, found.filter(|f| f.rescued).count())
}

/// Every file of a detection but the pictures: name -> bytes. Those of a series can be read as a series.
///
/// # Errors
/// None in practice: everything can be written.
pub fn detection_files(images: &[SeenImage], context: &DetectionContext) -> Result<BTreeMap<String, Vec<u8>>> {
    let mut files = BTreeMap::new();
    let mut add = |name: &str, text: String| files.insert(name.to_owned(), text.into_bytes());
    let observed =
        |i: &SeenImage| ImageObservations { image: i.name.clone(), observations: i.detection.observations.clone() };
    let used = images.iter().filter(|i| !i.detection.observations.is_empty());
    add("observations.csv", observations_csv(&used.map(observed).collect::<Vec<_>>()));
    add("dropped.csv", dropped_csv(images));
    if let Some(series) = context.series {
        add("series.toml", manifest(series, images)?);
        add("joints.csv", series.stops.to_csv());
        for (name, text) in plate_files(context.plate)? {
            add(name, text);
        }
    }
    let mut names: BTreeSet<String> = files.keys().cloned().collect();
    names.extend(context.pictures.iter().cloned());
    names.insert(FILE_NAME.to_owned());
    let record = Record {
        format: 2,
        program: concat!("robotcal ", env!("CARGO_PKG_VERSION")),
        command: &context.command,
        files: names,
        as_written: as_written(&files),
        inputs: &context.inputs,
        images: images.iter().map(ImageRecord::of).collect(),
    };
    files.insert(FILE_NAME.to_owned(), json(&record, FILE_NAME)?);
    Ok(files)
}

/// The manifest for the observations: named as the series was, sizes stated.
fn manifest(series: &Series, images: &[SeenImage]) -> Result<String> {
    let mut manifest = series.manifest.clone();
    manifest.mcap = None;
    manifest.plate = Some("plate.toml".to_owned());
    manifest.joint_unit = Some(series.joint_unit());
    manifest.observations.point = CirclePoint::Centroid;
    let camera = manifest.cameras.first_mut();
    camera.name = Some(series.camera_name().to_owned());
    camera.mounting = Some(series.mounting().to_owned());
    let size = images.iter().filter(|i| i.detection.failure.is_none()).find_map(|i| i.size);
    if let Some((width, height)) = size {
        (camera.width_px, camera.height_px) = (Some(width as u32), Some(height as u32));
    }
    manifest.to_toml()
}

const DROPPED_HEADER: [&str; 7] = ["image", "u", "v", "reason", "marker", "semi_major_px", "semi_minor_px"];

fn dropped_csv(images: &[SeenImage]) -> String {
    let mut rows = vec![DROPPED_HEADER.map(String::from).to_vec()];
    for (image, d) in images.iter().flat_map(|i| i.detection.dropped.iter().map(move |d| (i, d))) {
        let mut row = vec![image.name.clone()];
        row.extend(d.uv.map(|v| format!("{v:.3}")));
        row.push(d.reason.to_owned());
        row.push(d.marker.map_or_else(String::new, |m| m.to_string()));
        match d.ellipse {
            Some(e) => row.extend(e.semi_axes().map(|a| format!("{a:.3}"))),
            None => row.extend([String::new(), String::new()]),
        }
        rows.push(row);
    }
    to_csv(&rows)
}

#[derive(Serialize)]
struct Record<'a> {
    format: u32,
    program: &'static str,
    command: &'a str,
    files: BTreeSet<String>,
    as_written: BTreeMap<String, String>,
    inputs: &'a [InputFile],
    images: Vec<ImageRecord>,
}

/// What is wrong with an image, or was noticed in it.
#[derive(Serialize)]
struct Said {
    code: Code,
    text: String,
}

#[derive(Serialize)]
struct ImageRecord {
    name: String,
    width_px: Option<usize>,
    height_px: Option<usize>,
    /// Identified markers, and how many of them were found where they were predicted.
    markers: usize,
    rescued: usize,
    observations: usize,
    dropped: BTreeMap<&'static str, usize>,
    /// Blur (optics and pixel aperture together), px.
    blur_px: Option<f64>,
    /// Noise on paper and on ink, counts.
    noise: Option<[f64; 2]>,
    failure: Option<Said>,
    notices: Vec<Said>,
}

impl ImageRecord {
    fn of(image: &SeenImage) -> Self {
        let (markers, rescued) = marker_counts(image);
        let detection = &image.detection;
        let circles = detection.circles.as_ref().filter(|c| c.blur_px.is_finite());
        Self {
            name: image.name.clone(),
            width_px: image.size.map(|s| s.0),
            height_px: image.size.map(|s| s.1),
            markers,
            rescued,
            observations: detection.observations.len(),
            dropped: dropped_counts(std::iter::once(image)),
            blur_px: circles.map(|c| c.blur_px),
            noise: circles.map(|c| c.noise),
            failure: detection.failure.as_ref().map(|e| Said { code: e.code, text: e.to_string() }),
            notices: detection.notices.iter().map(|n| Said { code: n.code, text: n.to_string() }).collect(),
        }
    }
}
