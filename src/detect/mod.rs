//! Pixels to identified observations; knows no robot.
//!
//! ```text
//! pictures (files to grey values) -> run (a series: image after image) -> circles, boards or tags (one folder a family of plates;
//!         corners: where edges cross, to parts of a pixel) -> detection -> grey_levels (what rounding adds), size_seen, other_kind, dot_sizes (is it another plate)
//! ```
//!
//! A new kind of plate is one file that maps a [`Picture`] and a [`Plate`] to a [`Detection`], and one row in `by_kind`.

mod boards;
pub mod circles;
mod corners;
mod correlated;
mod detection;
mod dot_sizes;
mod grey_levels;
mod other_kind;
mod pictures;
mod run;
mod shared;
mod size_seen;
pub mod tags;

pub use boards::{charuco, chessboard, puzzleboard};
pub use detection::{Circles, Detection, Dropped, Outline, Sizes};
pub use dot_sizes::set_radii;
pub use pictures::flat_field::FlatField;
pub use pictures::flat_field_facts::{FlatFieldFacts, LightDrift};
pub use pictures::load::{load, load_bytes};
pub use pictures::loaded::Loaded;
pub use pictures::picture::Picture;
pub use run::{SeriesImage, detect_series, turned_by_viewers};

use std::collections::BTreeSet;

use crate::error::{Code, Error, Result};
use crate::series::{Plate, PlateKind};
use grey_levels::{allow_for_rounding, few_grey_levels, flat_field_left_out};
use pictures::few_levels::few_levels;
use pictures::hot_pixels::{hot_pixels, without_hot_pixels};

/// Finds and identifies the markers of a plate in a picture.
///
/// # Errors
/// What the detector of the plate's kind says; a chessboard or grid of dots of which an outer line is not where it should be in view. The place is
/// then `image`, for the caller to fill in the name.
pub fn detect(picture: &Picture, plate: &Plate) -> Result<Detection> {
    let detection = examine(picture, plate);
    if detection.outline == Outline::LineMissing {
        return Err(size_seen::line_missing(plate, &detection));
    }
    match detection.failure {
        None => Ok(detection),
        Some(error) => Err(error),
    }
}

/// As [`detect`], but a picture in which nothing can be identified still says what was seen: see [`Detection::failure`].
pub fn examine(picture: &Picture, plate: &Plate) -> Detection {
    examine_with(picture, few_levels(picture), plate)
}

/// As [`examine`], a picture that was loaded.
fn examine_loaded(loaded: &Loaded, plate: &Plate) -> Detection {
    let mut detection = examine_with(&loaded.picture, loaded.few_levels, plate);
    let is_said = loaded.is_uncorrected && !detection.observations.is_empty();
    detection.notices.extend(is_said.then(flat_field_left_out));
    detection
}

fn examine_with(picture: &Picture, levels: Option<usize>, plate: &Plate) -> Detection {
    let mended = mended(picture, levels);
    let looked_at = mended.as_ref().map_or(picture, |(mended, _)| mended);
    let mut detection =
        by_kind(looked_at, plate).unwrap_or_else(|error| Detection { failure: Some(error), ..Detection::default() });
    if let Some(levels) = levels {
        allow_for_rounding(&mut detection, levels, |_| true);
        let said = few_grey_levels(&detection, levels);
        detection.notices.extend(said);
    }
    detection.notices.extend(mended.map(|(_, count)| hot_pixels(count)));
    detection
}

/// Looks once more in a picture that was examined, for the markers that are predicted and were not found: see [`circles::detect_predicted`].
pub fn examine_predicted(loaded: Loaded, detection: &mut Detection, predicted: &[circles::Predicted]) {
    let Loaded { picture, few_levels: levels, .. } = if detection.is_of_negative { loaded.negative() } else { loaded };
    let mended = mended(&picture, levels);
    let looked_at = mended.as_ref().map_or(&picture, |(mended, _)| mended);
    let known: BTreeSet<u32> = detection.observations.iter().map(|o| o.marker).collect();
    circles::detect_predicted(looked_at, detection, predicted);
    if let Some(levels) = levels {
        allow_for_rounding(detection, levels, |marker| !known.contains(&marker));
    }
}

/// The picture without its hot pixels, and how many they were; in one of few grey levels they are no such, but specks of its threshold.
fn mended(picture: &Picture, levels: Option<usize>) -> Option<(Picture, usize)> {
    levels.map_or_else(|| without_hot_pixels(picture), |_| None)
}

fn by_kind(picture: &Picture, plate: &Plate) -> Result<Detection> {
    match plate.kind {
        PlateKind::Chessboard => chessboard::detect(picture, plate),
        PlateKind::CodedCircles => circles::detect(picture, plate, &circles::Options::default()).map(Detection::from),
        PlateKind::CircleGrid => circles::detect_grid(picture, plate, &circles::Options::default()),
        PlateKind::Charuco => charuco::detect(picture, plate),
        PlateKind::Puzzleboard => puzzleboard::detect(picture, plate),
        PlateKind::Aprilgrid | PlateKind::ArucoGrid | PlateKind::Tag => tags::detect(picture, plate),
        PlateKind::Points => Err(Error::new(
            Code::PlateNotDetectable,
            "plate",
            "a plate of kind \"points\" has no markers that can be seen in an image",
            "give observations.csv in the series folder, or set the `kind` that is printed",
        )),
    }
}
