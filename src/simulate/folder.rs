//! Writes a simulated series as a folder that the program reads like any other.

use std::io::BufWriter;
use std::path::Path;

use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder};
use rayon::prelude::*;

use super::conditions::ImagingConditions;
use super::render::check_drawable;
use super::world::SimulatedSeries;
use crate::detect::Picture;
use crate::error::{Code, Error, Result};
use crate::series::{observations_csv, plate_files};

/// What stands for the measurements.
#[derive(Clone, Copy)]
pub enum Content<'a> {
    /// `observations.csv`.
    Observations,
    /// Rendered pictures under these conditions; `progress` is called after each, from any thread.
    Images {
        /// Light, blur, sensor, surroundings.
        conditions: &'a ImagingConditions,
        /// Called with the file name of each finished picture.
        progress: &'a (dyn Fn(&str) + Sync),
    },
}

/// Writes the series into `folder`, which must be new or empty.
///
/// # Errors
/// A folder with something in it, pictures of a plate that cannot be drawn, and whatever the disk refuses.
pub fn write(folder: &Path, series: &SimulatedSeries, content: Content<'_>) -> Result<()> {
    let is_used = std::fs::read_dir(folder).is_ok_and(|mut entries| entries.next().is_some());
    if is_used {
        return Err(Error::new(
            Code::OutputExists,
            folder.display(),
            "is not empty",
            "give a new folder, or remove this one",
        ));
    }
    if matches!(content, Content::Images { .. }) {
        check_drawable(&series.plate)?;
    }
    std::fs::create_dir_all(folder).map_err(|e| Error::io(folder, &e))?;
    let mut manifest = series.manifest.clone();
    let mut truth = series.truth.clone();
    match content {
        Content::Observations => put(&folder.join("observations.csv"), observations_csv(&series.observations))?,
        Content::Images { conditions, progress } => {
            truth.pixel_sigma_px = None;
            let camera = manifest.cameras.first_mut();
            (camera.width_px, camera.height_px) = (None, None);
            camera.bits = (9..16).contains(&conditions.bits).then_some(u32::from(conditions.bits));
            write_images(&folder.join("images"), series, conditions, progress)?;
        }
    }
    put(&folder.join("series.toml"), manifest.to_toml()?)?;
    put(&folder.join("joints.csv"), series.stops.to_csv())?;
    for (name, text) in plate_files(&series.plate)? {
        put(&folder.join(name), text)?;
    }
    put(&folder.join("truth.toml"), truth.to_toml()?)
}

fn put(path: &Path, text: String) -> Result<()> {
    std::fs::write(path, text).map_err(|e| Error::io(path, &e))
}

fn write_images(
    folder: &Path,
    series: &SimulatedSeries,
    conditions: &ImagingConditions,
    progress: &(dyn Fn(&str) + Sync),
) -> Result<()> {
    std::fs::create_dir_all(folder).map_err(|e| Error::io(folder, &e))?;
    (0..series.truth.stops.len()).into_par_iter().try_for_each(|k| {
        let name = &series.truth.stops[k].image;
        save(&folder.join(name), &series.render(k, conditions))?;
        progress(name);
        Ok(())
    })
}

/// Saves a picture as PNG in full depth: 8 bit as it is, more as 16 bit with the counts in the low end.
///
/// # Errors
/// When the file cannot be written.
pub fn save(path: &Path, picture: &Picture) -> Result<()> {
    let file = std::fs::File::create(path).map_err(|e| Error::io(path, &e))?;
    // Noise compresses best against the mean of its neighbours.
    let encoder = PngEncoder::new_with_quality(BufWriter::new(file), CompressionType::Best, FilterType::Avg);
    let (width, height) = (picture.width as u32, picture.height as u32);
    let written = if picture.full_scale <= 255.0 {
        let bytes: Vec<u8> = picture.pixels.iter().map(|&v| v as u8).collect();
        encoder.write_image(&bytes, width, height, ExtendedColorType::L8)
    } else {
        let bytes: Vec<u8> = picture.pixels.iter().flat_map(|&v| (v as u16).to_ne_bytes()).collect();
        encoder.write_image(&bytes, width, height, ExtendedColorType::L16)
    };
    written
        .map_err(|e| Error::new(Code::OutputFailed, path.display(), e, "check that the disk is writable and not full"))
}
