//! Inner corners of a ChArUco board: a chessboard with ArUco markers in its light squares.
//!
//! The `calib-targets` library decodes the markers and so tells which corner is which; the positions are measured as on
//! a plain chessboard, from the pixels along the edges that the markers leave free.

use std::collections::BTreeMap;
use std::sync::Mutex;

use calib_targets_aruco::{Dictionary, builtins, resolve_dictionary};
use calib_targets_charuco::{CharucoBoardSpec, CharucoDetection, CharucoDetector, CharucoParams};
use calib_targets_chessboard::{ChessCorner, detect_corners};
use calib_targets_core::GrayImageView;

use super::board_labels::{BoardSize, Lattice, Placement};
use super::chessboard::{Bytes, WINDOW, board_size, corner_config};
use super::corners::{Window, measure};
use super::sizes::{best_of_sizes, on_picture};
use super::{Detection, Picture};
use crate::error::{Code, Error, Notice, Result};
use crate::series::Plate;

/// Blur of a marker's border that the window of a corner stays clear of, px.
const KEEP_OFF_PX: f64 = 2.0;
/// Sides of a marker over that of a square that are tried where the plate does not state it.
const USUAL_RATIOS: [f64; 5] = [0.75, 0.8, 0.7, 0.6, 0.5];
/// Markers that must be read where the dictionary is not stated.
const LEAST_MARKERS: usize = 4;

/// The dictionary and the relative size of the markers.
#[derive(Debug, Clone, Copy)]
struct Print {
    dictionary: Dictionary,
    /// Side of a marker over that of a square.
    ratio: f64,
    /// OpenCV's layout before 4.6 on a board with an even number of rows: first square light, with marker 0.
    legacy: bool,
}

/// Finds the inner corners of a ChArUco board (markers in the light squares counting up row by row; first square dark, or light in
/// OpenCV's layout before 4.6); parts of the board may be out of view or covered.
///
/// Ids are row-major from the top-left, positions in px with (0, 0) at the centre of the top-left pixel. Where the plate
/// does not state dictionary and marker size, OpenCV's dictionaries and the usual sizes are tried; a notice says which.
///
/// # Errors
/// An unknown dictionary or one with too few markers; no board in the picture; a mirrored picture; a board of the other layout.
pub fn detect(picture: &Picture, plate: &Plate) -> Result<Detection> {
    let board = board_size(plate)?;
    let mut bytes = Bytes::of(picture);
    let prints = prints(plate)?;
    let least = if plate.aruco.is_some() { 1 } else { LEAST_MARKERS };
    let at_scale = |bytes: &Bytes, scale: f64| at_scale(bytes, scale, &prints, board, least);
    let found = best_of_sizes(&bytes, board, |found: &Found| &found.lattice, |scale| at_scale(&bytes, scale))?;
    let Some(Found { print, lattice, .. }) = found else {
        bytes.mirror();
        let mirrored = at_scale(&bytes, 1.0)?.is_some();
        return Err(if mirrored { mirrored_board() } else { no_board(plate) });
    };
    if plate.aruco.is_some() && prints.first().is_some_and(|stated| stated.legacy != print.legacy) {
        return Err(other_layout(print.legacy));
    }
    let window = Window { arm: 0.5 * (1.0 - print.ratio), keep_off_px: KEEP_OFF_PX, ..WINDOW };
    let mut detection = measure(picture, &lattice, Placement::on_board(board, print.legacy), window);
    if plate.aruco.is_none() {
        detection.notices.push(found_print(&print));
    }
    Ok(detection)
}

/// Column and row of an inner corner; a legacy board is sought as one with a further row above it, whose corners are none.
fn position_on_board(id: u32, board: BoardSize, legacy: bool) -> Option<(i32, i32)> {
    let id = i32::try_from(id).unwrap_or(i32::MAX);
    let row = id / board.columns - i32::from(legacy);
    (row >= 0).then_some((id % board.columns, row))
}

/// What was found at one of the sizes.
struct Found {
    print: Print,
    markers: usize,
    /// Corners of the board in px of the picture.
    lattice: Lattice,
}

impl Found {
    /// Markers that were read, then corners that are on the board: in the other layout most markers agree, moved by a column.
    fn explains(&self) -> (usize, usize) {
        (self.markers, self.lattice.len())
    }
}

/// The print that explains most markers in the picture at another size, with what was found.
fn at_scale(bytes: &Bytes, scale: f64, prints: &[Print], board: BoardSize, least: usize) -> Result<Option<Found>> {
    let scaled = bytes.scaled(scale);
    let corners = detect_corners(&scaled.view(), &corner_config());
    let mut best: Option<Found> = None;
    for print in prints {
        let Some(found) = decode(&scaled.view(), &corners, print, board)? else { continue };
        let markers = found.markers.len();
        if markers < least {
            continue;
        }
        let place = |x: f32, y: f32| [x, y].map(|c| on_picture(c, scale));
        let on_board = |id| position_on_board(id, board, print.legacy);
        let corners = found.corners.iter();
        let lattice: Lattice =
            corners.filter_map(|c| Some((on_board(c.id)?, place(c.position.x, c.position.y)))).collect();
        let found = Found { print: *print, markers, lattice };
        if best.as_ref().is_none_or(|other| other.explains() < found.explains()) {
            best = Some(found);
        }
    }
    Ok(best)
}

fn decode(
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

/// What is printed according to the plate and in the other layout, or all that OpenCV prints.
fn prints(plate: &Plate) -> Result<Vec<Print>> {
    let even_rows = plate.rows % 2 == 1;
    let layouts = |legacy: bool| [legacy, !legacy].into_iter().take(if even_rows { 2 } else { 1 });
    if let Some(aruco) = &plate.aruco {
        let dictionary = resolve_dictionary(&aruco.dictionary).ok_or_else(|| {
            Error::new(
                Code::DictionaryUnknown,
                "plate",
                format!("the dictionary {:?} is not known", aruco.dictionary),
                "use a name of OpenCV, such as DICT_4X4_50 or DICT_APRILTAG_36h11",
            )
        })?;
        let ratio = aruco.side_m / plate.pitch_m;
        return Ok(layouts(aruco.legacy && even_rows).map(|legacy| Print { dictionary, ratio, legacy }).collect());
    }
    let needed = (plate.columns + 1) * (plate.rows + 1) / 2;
    let largest = [builtins::DICT_4X4_1000, builtins::DICT_5X5_1000, builtins::DICT_6X6_1000, builtins::DICT_7X7_1000];
    let others = [builtins::DICT_ARUCO_ORIGINAL, builtins::DICT_APRILTAG_36h11];
    let able = largest.into_iter().chain(others).filter(|d| d.codes().len() >= needed as usize);
    let sizes = able.flat_map(|dictionary| USUAL_RATIOS.map(|ratio| (dictionary, ratio)));
    Ok(sizes
        .flat_map(|(dictionary, ratio)| layouts(false).map(move |legacy| Print { dictionary, ratio, legacy }))
        .collect())
}

fn found_print(print: &Print) -> Notice {
    Notice::new(
        Code::DictionaryGuessed,
        "plate",
        format!(
            "markers of {} with a side of about {} squares were found{}",
            print.dictionary.name(),
            print.ratio,
            if print.legacy { ", in OpenCV's layout before 4.6" } else { "" }
        ),
        match print.legacy {
            false => "write dictionary and side_m under [aruco] in the plate file, which is faster and safer",
            true => {
                "write dictionary, side_m and legacy = true under [aruco] in the plate file, which is faster and safer"
            }
        },
    )
}

fn no_board(plate: &Plate) -> Error {
    let what = match &plate.aruco {
        Some(aruco) => format!("no ChArUco board with markers of {} found", aruco.dictionary),
        None => "no ChArUco board with markers of a usual kind found".to_owned(),
    };
    let remedy =
        "check that the board is in view and sharp, and columns, rows (inner corners) and [aruco] of the plate file";
    Error::new(Code::PlateNotFound, "image", what, remedy)
}

fn other_layout(legacy: bool) -> Error {
    let (what, remedy) = match legacy {
        true => (
            "the board has OpenCV's layout before 4.6: its first square is light",
            "write legacy = true under [aruco] in the plate file",
        ),
        false => (
            "the first square of the board is dark, which is not OpenCV's layout before 4.6",
            "remove legacy from [aruco] in the plate file",
        ),
    };
    Error::new(Code::PlateNotDetectable, "image", what, remedy)
}

fn mirrored_board() -> Error {
    Error::new(
        Code::PlateMirrored,
        "image",
        "the board is mirrored",
        "turn off mirroring in the camera or in the image export",
    )
}
