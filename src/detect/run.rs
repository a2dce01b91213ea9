//! Detection over the images of a series.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use rayon::prelude::*;

use super::{Detection, Picture, detect, load};
use crate::error::{Error, Result};
use crate::series::Plate;

/// One image of a series with what was found in it.
#[derive(Debug, Clone, PartialEq)]
pub struct SeriesImage {
    /// Width and height in px.
    pub size: (usize, usize),
    /// What was found.
    pub detection: Detection,
}

/// Detects the plate in all images of a series.
///
/// Results stand in the order of `images`, whatever the number of threads; an image that cannot be read or shows no
/// plate is an error in its own place only, and so is one whose size differs from that of most. Each thread holds one image at a time. `prepare` is applied to every picture
/// before detection (flat-field correction; identity where there is none) and `progress` is called after every image,
/// from any thread.
pub fn detect_series(
    images: &[PathBuf],
    bits: Option<u32>,
    plate: &Plate,
    prepare: impl Fn(Picture) -> Result<Picture> + Sync,
    progress: impl Fn(&Path) + Sync,
) -> Vec<Result<SeriesImage>> {
    let mut found: Vec<Result<SeriesImage>> = images
        .par_iter()
        .map(|path| {
            let found = load(path, bits).and_then(&prepare).and_then(|picture| {
                let detection = detect(&picture, plate)?;
                Ok(SeriesImage { size: (picture.width, picture.height), detection })
            });
            progress(path);
            found.map_err(|error| in_image(error, path))
        })
        .collect();
    refuse_odd_sizes(images, &mut found);
    found
}

/// One camera records one size: images of another than the most frequent one are errors.
fn refuse_odd_sizes(images: &[PathBuf], found: &mut [Result<SeriesImage>]) {
    let mut counts: BTreeMap<(usize, usize), usize> = BTreeMap::new();
    for image in found.iter().flatten() {
        *counts.entry(image.size).or_default() += 1;
    }
    let Some((&usual, &count)) = counts.iter().max_by_key(|(_, count)| **count) else { return };
    for (path, result) in images.iter().zip(found) {
        let Ok(image) = result else { continue };
        if image.size != usual {
            *result = Err(Error::input(
                path.display(),
                format!(
                    "is {} x {} px, but {count} images are {} x {} px",
                    image.size.0, image.size.1, usual.0, usual.1
                ),
                "record a series with one camera at one resolution; put other images into a series of their own",
            ));
        }
    }
}

/// Names the image where the detector could only say `image`.
fn in_image(error: Error, path: &Path) -> Error {
    if error.place == "image" { Error { place: path.display().to_string(), ..error } } else { error }
}
