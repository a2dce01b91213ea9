//! Dark and white images: what the sensor and the lens do to an even light.

use std::path::{Path, PathBuf};

use super::flat_field_facts::{FlatFieldFacts, Light, block_means, drift};
use super::loaded::Loaded;
use crate::detect::{Picture, load};
use crate::error::{Code, Error, Result};

/// White over dark below this share of the usual difference is a pixel without signal.
const DEAD: f32 = 0.02;
/// Largest share of pixels without signal in a usable pair of averages.
const DEAD_SHARE: f64 = 0.01;

/// Averages of dark images (lens cap on) and white images (an even surface), as a correction.
#[derive(Debug, Clone, PartialEq)]
pub struct FlatField {
    width: usize,
    height: usize,
    full_scale: f32,
    dark: Vec<f32>,
    /// Sensitivity of every pixel over that of the most sensitive; 0 for a pixel without signal.
    gain: Vec<f32>,
    /// The images in numbers.
    pub facts: FlatFieldFacts,
}

impl FlatField {
    /// Averages dark and white images; either list may be empty, `None` when both are.
    ///
    /// # Errors
    /// An unreadable image, sizes or depths that differ, white images that are saturated or not brighter than the dark.
    pub fn from_images(dark_paths: &[PathBuf], white_paths: &[PathBuf], bits: Option<u32>) -> Result<Option<Self>> {
        let (dark_mean, white_mean) = (average(dark_paths, bits)?, average(white_paths, bits)?);
        if let (Some((_, d)), Some((place, w))) = (&dark_mean, &white_mean)
            && !same_kind(d, w)
        {
            return Err(Error::new(
                Code::ImageSizeDiffers,
                place.display(),
                format!("white images are {} and dark images {}", kind(w), kind(d)),
                "record dark and white images with the camera and the settings of the series",
            ));
        }
        let Some((_, first)) = dark_mean.as_ref().or(white_mean.as_ref()) else { return Ok(None) };
        let (width, height, full_scale) = (first.width, first.height, first.full_scale);
        let dark = dark_mean.map_or_else(|| vec![0.0; width * height], |(_, mean)| mean.pixels);
        let gain = match white_mean {
            Some((place, mean)) => gains(&mean, &dark, place)?,
            None => vec![1.0; width * height],
        };
        let blocks = block_means(&gain, width, height, 1.0);
        let (low, high) = blocks.iter().fold((f64::INFINITY, 0.0f64), |(l, h), b| (l.min(*b), h.max(*b)));
        let mean = dark.iter().map(|d| f64::from(*d)).sum::<f64>() / dark.len().max(1) as f64;
        let facts = FlatFieldFacts {
            dark_images: dark_paths.len(),
            white_images: white_paths.len(),
            dark_level: mean / f64::from(full_scale),
            darkest: if high > 0.0 { low / high } else { 1.0 },
            dead: gain.iter().filter(|g| **g <= 0.0).count(),
            dark_drift: drift(dark_paths, bits, Light::Dark)?,
            white_drift: drift(white_paths, bits, Light::White)?,
        };
        Ok(Some(Self { width, height, full_scale, dark, gain, facts }))
    }

    /// Corrects a picture: counts as an evenly sensitive sensor in even light would give.
    ///
    /// Pixels at or beyond saturation are at `full_scale` afterwards, so that detectors still see that they are clipped;
    /// a pixel without signal takes the mean of its neighbours in the row. A picture of few grey levels stays as it is: they are no measure of the
    /// light, and their number is to be seen.
    ///
    /// # Errors
    /// A picture of another size or depth than the dark and white images.
    pub fn apply(&self, loaded: impl Into<Loaded>) -> Result<Loaded> {
        let loaded = loaded.into();
        let picture = &loaded.picture;
        if (picture.width, picture.height, picture.full_scale) != (self.width, self.height, self.full_scale) {
            return Err(Error::new(
                Code::ImageSizeDiffers,
                "image",
                format!(
                    "is {}, but the dark and white images are {} x {} px up to {}",
                    kind(picture),
                    self.width,
                    self.height,
                    self.full_scale
                ),
                "record dark and white images with the camera and the settings of the series, or remove their folders",
            ));
        }
        if loaded.few_levels.is_some() {
            return Ok(Loaded { is_uncorrected: true, ..loaded });
        }
        let corrected = |k: usize| {
            let (raw, gain) = (picture.pixels[k], self.gain[k]);
            if gain <= 0.0 {
                None
            } else if raw >= picture.full_scale {
                Some(picture.full_scale)
            } else {
                Some(((raw - self.dark[k]) / gain).clamp(0.0, picture.full_scale))
            }
        };
        let pixels = (0..picture.pixels.len())
            .map(|k| {
                corrected(k).unwrap_or_else(|| {
                    let x = k % self.width;
                    let left = (x > 0).then(|| corrected(k - 1)).flatten();
                    let right = (x + 1 < self.width).then(|| corrected(k + 1)).flatten();
                    match (left, right) {
                        (Some(l), Some(r)) => 0.5 * (l + r),
                        (Some(one), None) | (None, Some(one)) => one,
                        (None, None) => picture.pixels[k],
                    }
                })
            })
            .collect();
        Ok(Loaded { picture: Picture { pixels, ..loaded.picture }, ..loaded })
    }
}

fn same_kind(a: &Picture, b: &Picture) -> bool {
    (a.width, a.height, a.full_scale) == (b.width, b.height, b.full_scale)
}

fn kind(picture: &Picture) -> String {
    format!("{} x {} px up to {}", picture.width, picture.height, picture.full_scale)
}

/// Mean of all images, with the first for messages.
fn average(paths: &[PathBuf], bits: Option<u32>) -> Result<Option<(&Path, Picture)>> {
    let Some((first, rest)) = paths.split_first() else { return Ok(None) };
    let mut mean = load(first, bits)?;
    let mut sums: Vec<f64> = mean.pixels.iter().map(|&p| f64::from(p)).collect();
    for path in rest {
        let picture = load(path, bits)?;
        if !same_kind(&picture, &mean) {
            return Err(Error::new(
                Code::ImageSizeDiffers,
                path.display(),
                format!("is {}, but {} is {}", kind(&picture), first.display(), kind(&mean)),
                "keep images of one camera and one setting in the folder",
            ));
        }
        for (sum, &pixel) in sums.iter_mut().zip(&picture.pixels) {
            *sum += f64::from(pixel);
        }
    }
    mean.pixels = sums.iter().map(|sum| (sum / paths.len() as f64) as f32).collect();
    Ok(Some((first, mean)))
}

/// Sensitivity per pixel from white minus dark, the thousandth brightest as 1.
fn gains(white: &Picture, dark: &[f32], place: &Path) -> Result<Vec<f32>> {
    let signal: Vec<f32> = white.pixels.iter().zip(dark).map(|(w, d)| w - d).collect();
    let mut sorted = signal.clone();
    sorted.sort_by(f32::total_cmp);
    let top = sorted[(sorted.len() - 1) * 999 / 1000];
    let clipped = white.pixels.iter().filter(|&&w| w >= white.full_scale).count();
    let dead = signal.iter().filter(|&&s| s < DEAD * top).count();
    let share = |count: usize| count as f64 / signal.len() as f64;
    if top <= 0.0 || share(dead) > DEAD_SHARE {
        return Err(Error::new(
            Code::FlatFieldUseless,
            place.display(),
            "the white images are not brighter than the dark ones everywhere",
            "photograph an evenly lit white surface that fills the whole view",
        ));
    }
    if share(clipped) > DEAD_SHARE {
        return Err(Error::new(
            Code::FlatFieldUseless,
            place.display(),
            format!("{:.0} % of the pixels of the white images are saturated", 100.0 * share(clipped)),
            "shorten the exposure of the white images",
        ));
    }
    Ok(signal.iter().map(|&s| if s < DEAD * top { 0.0 } else { s / top }).collect())
}
