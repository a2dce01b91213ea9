//! A series read for its camera and plate alone: joint readings and their unit need not be there.

use std::path::{Path, PathBuf};

use super::camera_section::CameraMount;
use super::controller_file;
use super::image_folder::image_files;
use super::joints::{DEFAULT_PLACEMENT, SeriesStop, Stops};
use super::light::{Light, unused_light_of_one};
use super::manifest::Manifest;
use super::measurement_series::{Series, Source, file_name};
use super::observation_file;
use super::plate_file::read_plate;
use super::read::{folder_name, plate_of, read};
use super::recording::is_recording;
use super::spatial::SpatialFiles;
use crate::error::{Code, Error, Result};

/// Reads a series folder, or a folder of images/ (or observations.csv) with plate.toml and nothing else. What joints.csv says is taken where it
/// is there.
///
/// # Errors
/// By file and line: whatever does not follow the format.
pub fn read_without_robot(folder: &Path) -> Result<Series> {
    let manifest_path = folder.join("series.toml");
    let is_series = ["joints.csv", controller_file::NAME].iter().any(|name| folder.join(name).is_file());
    if !folder.is_dir() || is_series || is_recording(folder) {
        return read(folder);
    }
    let name = folder_name(folder)?;
    let mut inputs = Vec::new();
    let manifest = match manifest_path.is_file() {
        true => Manifest::read(&manifest_path, &mut inputs)?,
        false => Manifest::plain(CameraMount::Hand, "plate.toml"),
    };
    if manifest.mcap.is_some() {
        return read(folder);
    }
    manifest.require_camera_and_plate(&manifest_path)?;
    let plate = plate_of(&manifest, folder, &mut inputs)?;
    let observed = folder.join("observations.csv");
    let (stops, source) = if observed.is_file() {
        let size = manifest.camera().size_px();
        let images = observation_file::read(&observed, &plate, &|_| size, &mut inputs)?;
        (
            images.keys().map(|image| stop(image.clone(), None)).collect(),
            Source::Observations(images.into_values().collect()),
        )
    } else {
        let images = folder.join("images");
        let paths = image_files(&images)?;
        if paths.is_empty() {
            let remedy = "copy the images into it, or give them one by one with --plate";
            return Err(Error::new(Code::ImagesMissing, images.display(), "holds no image", remedy));
        }
        let Light { dark, white } = Light::of(&[&images, folder])?;
        (paths.into_iter().map(of_file).collect(), Source::Images { folder: images, dark, white })
    };
    let (folder, notices) = (folder.to_path_buf(), Vec::new());
    let (stops, spatial) = (Stops { stops, ..Stops::default() }, SpatialFiles::default());
    let mut series =
        Series { name, folder, manifest, plate, stops, source, controller: None, spatial, run: None, notices, inputs };
    series.notices = unused_light_of_one(&series);
    Ok(series)
}

/// A series of single images of a plate.
///
/// # Errors
/// A plate that cannot be read; two images of one name.
pub fn series_of_images(images: &[PathBuf], plate: &Path) -> Result<Series> {
    let mut inputs = Vec::new();
    let read = read_plate(plate, &mut inputs)?;
    let twin_before = |(k, image): (usize, &PathBuf)| {
        images[..k]
            .iter()
            .find(|earlier| file_name(earlier) == file_name(image))
            .map(|earlier| (earlier, image.clone()))
    };
    if let Some((earlier, twin)) = images.iter().enumerate().find_map(twin_before) {
        let what = format!("has the name of {} as well", earlier.display());
        let remedy = "images are told apart by their names: rename one";
        return Err(Error::new(Code::ImageTwice, twin.display(), what, remedy));
    }
    let folder = plate.parent().map_or_else(PathBuf::new, Path::to_path_buf);
    Ok(Series {
        name: "images".to_owned(),
        manifest: Manifest::plain(CameraMount::Hand, &file_name(plate)),
        plate: read,
        stops: Stops { stops: images.iter().cloned().map(of_file).collect(), ..Stops::default() },
        controller: None,
        run: None,
        spatial: SpatialFiles::default(),
        source: Source::Images { folder: folder.clone(), dark: Vec::new(), white: Vec::new() },
        folder,
        notices: Vec::new(),
        inputs,
    })
}

fn of_file(path: PathBuf) -> SeriesStop {
    stop(file_name(&path), Some(path))
}

fn stop(image: String, path: Option<PathBuf>) -> SeriesStop {
    SeriesStop { image, path, placement: DEFAULT_PLACEMENT.to_owned(), ..SeriesStop::default() }
}
