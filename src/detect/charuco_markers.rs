//! Markers of a ChArUco board, read by the `calib-targets` library with one print after the other.

use std::collections::BTreeMap;
use std::sync::Mutex;

use calib_targets_aruco::{Dictionary, resolve_dictionary};
use calib_targets_charuco::{
    CharucoAdvancedTuning, CharucoBoardSpec, CharucoDetection, CharucoDetector, CharucoParams,
};
use calib_targets_chessboard::ChessCorner;
use calib_targets_core::GrayImageView;

use super::board_labels::BoardSize;
use super::chessboard::corner_config;
use super::tag_scan::usual_dictionaries;
use crate::error::{Code, Error, Result};
use crate::series::Plate;

/// Sides of a marker over that of a square that are tried where the plate does not state it.
const USUAL_RATIOS: [f64; 5] = [0.75, 0.8, 0.7, 0.6, 0.5];

/// The dictionary and the relative size of the markers.
#[derive(Debug, Clone, Copy)]
pub(super) struct Print {
    pub dictionary: Dictionary,
    /// Side of a marker over that of a square.
    pub ratio: f64,
    /// OpenCV's layout before 4.6 on a board with an even number of rows: first square light, with marker 0.
    pub legacy: bool,
}

/// The board with the ids of its corners and markers; `None` where none of this print is seen.
pub(super) fn decode(
    view: &GrayImageView<'_>,
    corners: &[ChessCorner],
    print: &Print,
    board: BoardSize,
) -> Result<Option<CharucoDetection>> {
    let [rows, columns] = [board.rows + 1, board.columns + 1].map(i32::unsigned_abs);
    let (rows, dictionary) = match print.legacy {
        false => (rows, print.dictionary),
        true => match behind_a_row(print.dictionary, columns as usize / 2) {
            Some(dictionary) => (rows + 1, dictionary),
            None => return Ok(None),
        },
    };
    let spec = CharucoBoardSpec::new(rows, columns, 1.0, print.ratio as f32, dictionary);
    let mut params = CharucoParams::for_board(spec);
    params.chess = corner_config();
    // They hold for pictures without distortion and squares of one size; what is no corner falls to the fit and its neighbours.
    let mut tuning = CharucoAdvancedTuning::new();
    tuning.grid_smoothness_threshold_rel = f32::INFINITY;
    tuning.corner_validation_threshold_rel = f32::INFINITY;
    let params = params.with_advanced(tuning);
    let detector = match CharucoDetector::new(params) {
        Ok(detector) => detector,
        // The row that is not printed takes more markers than the dictionary has.
        Err(_) if print.legacy => return Ok(None),
        Err(e) => {
            let what = format!("the ChArUco board is impossible: {e}");
            let remedy = "check `columns`, `rows` (inner corners) and [aruco] of the plate file";
            return Err(Error::new(Code::PlateNotDetectable, "plate", what, remedy));
        }
    };
    Ok(detector.detect_with_corners(view, corners).ok())
}

/// Dictionaries of [`behind_a_row`]: the library wants their codes to live for ever, so each is made once.
static SHIFTED: Mutex<BTreeMap<(&'static str, usize), Dictionary>> = Mutex::new(BTreeMap::new());

/// The dictionary with its numbers `by` higher: with a row of `by` markers above it that is not printed, a legacy board is one of the
/// present layout. Its last codes, which stand for that row, are on no board that has enough.
fn behind_a_row(dictionary: Dictionary, by: usize) -> Option<Dictionary> {
    let mut made = SHIFTED.lock().ok()?;
    if let Some(known) = made.get(&(dictionary.name(), by)) {
        return Some(*known);
    }
    let codes = dictionary.codes();
    let (first, last) = codes.split_at_checked(codes.len().checked_sub(by)?)?;
    let codes = [last, first].concat().leak();
    let (size, bits) = (dictionary.marker_size(), dictionary.max_correction_bits());
    let shifted = Dictionary::from_static_codes(dictionary.name(), size, bits, codes).ok()?;
    made.insert((dictionary.name(), by), shifted);
    Some(shifted)
}

/// The first layouts of a plate's markers: with an odd number of rows of squares both are the same.
fn layouts(plate: &Plate, legacy: bool) -> impl Iterator<Item = bool> + Clone + use<> {
    let even_rows = plate.rows % 2 == 1;
    let first = legacy && even_rows;
    [first, !first].into_iter().take(if even_rows { 2 } else { 1 })
}

/// What is printed according to the plate and in the other layout, or all that OpenCV prints.
pub(super) fn prints(plate: &Plate) -> Result<Vec<Print>> {
    let Some(aruco) = &plate.aruco else { return Ok(usual_prints(plate)) };
    let dictionary = resolve_dictionary(&aruco.dictionary).ok_or_else(|| {
        Error::new(
            Code::DictionaryUnknown,
            "plate",
            format!("the dictionary {:?} is not known", aruco.dictionary),
            "use a name of OpenCV, such as DICT_4X4_50 or DICT_APRILTAG_36h11",
        )
    })?;
    let ratio = aruco.side_m / plate.pitch_m;
    Ok(layouts(plate, aruco.legacy).map(|legacy| Print { dictionary, ratio, legacy }).collect())
}

/// All that OpenCV prints with enough markers for the plate, in the usual sizes.
fn usual_prints(plate: &Plate) -> Vec<Print> {
    let needed = (plate.columns + 1) * (plate.rows + 1) / 2;
    let able = usual_dictionaries().filter(|d| d.codes().len() >= needed as usize);
    let sizes = able.flat_map(|dictionary| USUAL_RATIOS.map(|ratio| (dictionary, ratio)));
    sizes
        .flat_map(|(dictionary, ratio)| layouts(plate, false).map(move |legacy| Print { dictionary, ratio, legacy }))
        .collect()
}
