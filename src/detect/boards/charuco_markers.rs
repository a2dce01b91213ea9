//! Markers of a ChArUco board, read by the `calib-targets` library with one print after the other.

use std::collections::BTreeMap;
use std::sync::{Mutex, PoisonError};

use calib_targets_aruco::{Dictionary, MarkerDetection, rotate_code_u64};
use calib_targets_charuco::{CharucoAdvancedTuning, CharucoBoardSpec, CharucoDetector, CharucoParams};
use calib_targets_chessboard::ChessCorner;
use calib_targets_core::{Coord, GrayImageView};

use super::corner_finder::corner_config;
use crate::detect::corners::lattice::BoardSize;
use crate::detect::tags::scan::{other_dictionaries, usual_dictionaries};
use crate::error::{Code, Error, Result};
use crate::series::{Plate, dictionary_named};

/// Sides of a marker over that of a square that are tried where the plate does not state it.
const USUAL_RATIOS: [f64; 5] = [0.75, 0.8, 0.7, 0.6, 0.5];

/// The dictionary and the relative size of the markers.
#[derive(Debug, Clone, Copy)]
pub struct Print {
    pub dictionary: Dictionary,
    /// Side of a marker over that of a square.
    pub ratio: f64,
    /// OpenCV's layout before 4.6 on a board with an even number of rows: first square light, with marker 0.
    pub legacy: bool,
    /// Number of its first marker.
    pub first_id: u32,
}

/// What is seen of a board of one print.
pub struct Decoded {
    /// Columns and rows of inner corners, with their places in the picture.
    pub corners: Vec<((i32, i32), [f32; 2])>,
    pub markers: Vec<Marker>,
}

/// A marker in the place where the print has it.
#[derive(Debug, Clone, Copy)]
pub struct Marker {
    /// Row of squares.
    pub row: i32,
    /// Bits that were read otherwise.
    pub wrong_bits: u8,
}

/// The board in the picture; `None` where none of this print is seen.
pub(super) fn decode(
    view: &GrayImageView<'_>,
    corners: &[ChessCorner],
    print: &Print,
    board: BoardSize,
) -> Result<Option<Decoded>> {
    let [rows, columns] = [board.rows + 1, board.columns + 1].map(i32::unsigned_abs);
    // A legacy board is one of the present layout after a quarter turn. With too few codes no board is possible either way.
    let dictionary = arranged(print, [columns, rows]).unwrap_or(print.dictionary);
    let [rows, columns] = if print.legacy { [columns, rows] } else { [rows, columns] };
    let spec = CharucoBoardSpec::new(rows, columns, 1.0, print.ratio as f32, dictionary);
    let mut params = CharucoParams::for_board(spec);
    params.chess = corner_config();
    // They hold for pictures without distortion and squares of one size; what is no corner falls to the fit and its neighbours.
    let mut tuning = CharucoAdvancedTuning::new();
    tuning.grid_smoothness_threshold_rel = f32::INFINITY;
    tuning.corner_validation_threshold_rel = f32::INFINITY;
    let params = params.with_advanced(tuning);
    let detector = CharucoDetector::new(params).map_err(|e| {
        let what = format!("the ChArUco board is impossible: {e}");
        let remedy = "check `columns`, `rows` (inner corners) and [aruco] of the plate file";
        Error::new(Code::PlateNotDetectable, "plate", what, remedy)
    })?;
    let Ok(found) = detector.detect_with_corners(view, corners) else { return Ok(None) };
    // Its corners are counted from 1, its squares from 0.
    let corner = |at: Coord| if print.legacy { (at.v - 1, board.rows - at.u) } else { (at.u - 1, at.v - 1) };
    let marker = |m: &MarkerDetection| {
        let at = detector.board().marker_position(m.id)?;
        Some(Marker { row: if print.legacy { board.rows - at.u } else { at.v }, wrong_bits: m.hamming })
    };
    Ok(Some(Decoded {
        corners: found.corners.iter().map(|c| (corner(c.grid), [c.position.x, c.position.y])).collect(),
        markers: found.markers.iter().filter_map(marker).collect(),
    }))
}

/// What a dictionary is arranged for: its name, columns and rows of squares, the layout, the first marker.
type Arrangement = (&'static str, [u32; 2], bool, u32);

/// Dictionaries of [`arranged`]: the library wants their codes to live for ever, so each is made once.
static ARRANGED: Mutex<BTreeMap<Arrangement, Dictionary>> = Mutex::new(BTreeMap::new());

/// The dictionary with which a board of so many columns and rows of squares is one of the present layout whose first marker is 0: the codes stand in
/// the order of that board, and those that are not on it follow. After a quarter turn to the right the first square of a legacy board (its rows
/// even) is dark, and its codes are turned with it. `None` where there are too few.
fn arranged(print: &Print, [columns, rows]: [u32; 2]) -> Option<Dictionary> {
    let Print { dictionary, legacy, first_id, .. } = *print;
    if !legacy && first_id == 0 {
        return Some(dictionary);
    }
    let mut made = ARRANGED.lock().unwrap_or_else(PoisonError::into_inner);
    let key = (dictionary.name(), [columns, rows], legacy, first_id);
    if let Some(known) = made.get(&key) {
        return Some(*known);
    }
    let all = dictionary.codes();
    let (before, from) = all.split_at_checked(usize::try_from(first_id).ok()?)?;
    let mut codes = [from, before].concat();
    if legacy {
        let squares = (0..rows).flat_map(|row| (0..columns).map(move |column| (row, column)));
        let light = squares.filter(|(row, column)| (row + column) % 2 == 0);
        let mut places: Vec<(u32, u32, usize)> =
            light.zip(0..).map(|((row, column), id)| (column, rows - 1 - row, id)).collect();
        places.sort_unstable();
        let turn = |code: &u64| rotate_code_u64(*code, dictionary.marker_size(), 1);
        let on_board: Option<Vec<u64>> = places.iter().map(|(_, _, id)| codes.get(*id).map(turn)).collect();
        codes = [&on_board?, codes.get(places.len()..)?].concat();
    }
    let (size, bits) = (dictionary.marker_size(), dictionary.max_correction_bits());
    let arranged = Dictionary::from_static_codes(dictionary.name(), size, bits, codes.leak()).ok()?;
    made.insert(key, arranged);
    Some(arranged)
}

/// The first layouts of a plate's markers: with an odd number of rows of squares both are the same.
fn layouts(plate: &Plate, legacy: bool) -> impl Iterator<Item = bool> + Clone + use<> {
    let even_rows = plate.rows % 2 == 1;
    let first = legacy && even_rows;
    [first, !first].into_iter().take(if even_rows { 2 } else { 1 })
}

/// What is printed according to the plate and in the other layout, or all that OpenCV prints.
pub(super) fn prints(plate: &Plate) -> Result<Vec<Print>> {
    let Some(aruco) = &plate.aruco else { return Ok(usual_prints(plate, usual_dictionaries())) };
    let dictionary = dictionary_named(&aruco.dictionary, "plate")?;
    let needed = u64::from(aruco.first_id) + u64::from(needed(plate));
    if needed > dictionary.codes().len() as u64 {
        let what = format!("{} has {} markers, but {needed} are needed", dictionary.name(), dictionary.codes().len());
        let remedy = "correct dictionary and first_id of the plate file, or columns and rows";
        return Err(Error::new(Code::PlateNotDetectable, "plate", what, remedy));
    }
    let (ratio, first_id) = (aruco.side_m / plate.pitch_m, aruco.first_id);
    Ok(layouts(plate, aruco.legacy).map(|legacy| Print { dictionary, ratio, legacy, first_id }).collect())
}

/// Prints of the dictionaries that are rarely used, where the plate does not state one.
pub(super) fn rare_prints(plate: &Plate) -> Vec<Print> {
    if plate.aruco.is_none() { usual_prints(plate, other_dictionaries()) } else { Vec::new() }
}

/// All that OpenCV prints with enough markers for the plate, in the usual sizes.
fn usual_prints(plate: &Plate, dictionaries: impl Iterator<Item = Dictionary>) -> Vec<Print> {
    let able = dictionaries.filter(|d| d.codes().len() >= needed(plate) as usize);
    let sizes = able.flat_map(|dictionary| USUAL_RATIOS.map(|ratio| (dictionary, ratio)));
    let print = |dictionary, ratio, legacy| Print { dictionary, ratio, legacy, first_id: 0 };
    sizes
        .flat_map(|(dictionary, ratio)| layouts(plate, false).map(move |legacy| print(dictionary, ratio, legacy)))
        .collect()
}

/// Markers of a plate.
pub(super) fn needed(plate: &Plate) -> u32 {
    (plate.columns + 1) * (plate.rows + 1) / 2
}
