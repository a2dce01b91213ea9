//! Inner corners of a ChArUco board: a chessboard with ArUco markers in its light squares.
//!
//! The `calib-targets` library decodes the markers and so tells which corner is which; the positions are measured as on
//! a plain chessboard, from the pixels along the edges that the markers leave free.

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
}

/// Finds the inner corners of a ChArUco board (OpenCV's layout: first square dark, markers in the light squares counting up
/// row by row); parts of the board may be out of view or covered.
///
/// Ids are row-major from the top-left, positions in px with (0, 0) at the centre of the top-left pixel. Where the plate
/// does not state dictionary and marker size, OpenCV's dictionaries and the usual sizes are tried; a notice says which.
///
/// # Errors
/// An unknown dictionary or one with too few markers; no board in the picture; a mirrored picture.
pub fn detect(picture: &Picture, plate: &Plate) -> Result<Detection> {
    let board = board_size(plate)?;
    let mut bytes = Bytes::of(picture);
    let prints = prints(plate)?;
    let found =
        best_of_sizes(&bytes, board, |found: &Found| &found.lattice, |scale| at_scale(&bytes, scale, &prints, board))?;
    let Some(Found { print, lattice, .. }) = found else {
        bytes.mirror();
        let mirrored = at_scale(&bytes, 1.0, &prints, board)?.is_some();
        return Err(if mirrored { mirrored_board() } else { no_board(plate) });
    };
    let window = Window { arm: 0.5 * (1.0 - print.ratio), keep_off_px: KEEP_OFF_PX, ..WINDOW };
    let mut detection = measure(picture, &lattice, Placement::on_board(board, false), window);
    if plate.aruco.is_none() {
        detection.notices.push(found_print(&print));
    }
    Ok(detection)
}

fn position_on_board(id: u32, board: BoardSize) -> (i32, i32) {
    let id = i32::try_from(id).unwrap_or(i32::MAX);
    (id % board.columns, id / board.columns)
}

/// What was found at one of the sizes.
struct Found {
    print: Print,
    markers: usize,
    /// Corners of the board in px of the picture.
    lattice: Lattice,
}

/// The print that explains most markers in the picture at another size, with what was found.
fn at_scale(bytes: &Bytes, scale: f64, prints: &[Print], board: BoardSize) -> Result<Option<Found>> {
    let scaled = bytes.scaled(scale);
    let corners = detect_corners(&scaled.view(), &corner_config());
    let least = if prints.len() > 1 { LEAST_MARKERS } else { 1 };
    let mut best: Option<Found> = None;
    for print in prints {
        let Some(found) = decode(&scaled.view(), &corners, print, board)? else { continue };
        let markers = found.markers.len();
        if markers < least || best.as_ref().is_some_and(|other| other.markers >= markers) {
            continue;
        }
        let place = |x: f32, y: f32| [x, y].map(|c| on_picture(c, scale));
        let lattice =
            found.corners.iter().map(|c| (position_on_board(c.id, board), place(c.position.x, c.position.y))).collect();
        best = Some(Found { print: *print, markers, lattice });
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
    let spec = CharucoBoardSpec::new(rows, columns, 1.0, print.ratio as f32, print.dictionary);
    let mut params = CharucoParams::for_board(spec);
    params.chess = corner_config();
    let detector = CharucoDetector::new(params).map_err(|e| {
        Error::new(
            Code::PlateNotDetectable,
            "plate",
            format!("the ChArUco board is impossible: {e}"),
            "check `columns`, `rows` (inner corners) and [aruco] of the plate file",
        )
    })?;
    Ok(detector.detect_with_corners(view, corners).ok())
}

/// What is printed according to the plate, or all that OpenCV prints.
fn prints(plate: &Plate) -> Result<Vec<Print>> {
    if let Some(aruco) = &plate.aruco {
        let dictionary = resolve_dictionary(&aruco.dictionary).ok_or_else(|| {
            Error::new(
                Code::DictionaryUnknown,
                "plate",
                format!("the dictionary {:?} is not known", aruco.dictionary),
                "use a name of OpenCV, such as DICT_4X4_50 or DICT_APRILTAG_36h11",
            )
        })?;
        return Ok(vec![Print { dictionary, ratio: aruco.side_m / plate.pitch_m }]);
    }
    let needed = (plate.columns + 1) * (plate.rows + 1) / 2;
    let largest = [builtins::DICT_4X4_1000, builtins::DICT_5X5_1000, builtins::DICT_6X6_1000, builtins::DICT_7X7_1000];
    let others = [builtins::DICT_ARUCO_ORIGINAL, builtins::DICT_APRILTAG_36h11];
    let able = largest.into_iter().chain(others).filter(|d| d.codes().len() >= needed as usize);
    Ok(able.flat_map(|dictionary| USUAL_RATIOS.map(|ratio| Print { dictionary, ratio })).collect())
}

fn found_print(print: &Print) -> Notice {
    Notice::new(
        Code::DictionaryGuessed,
        "plate",
        format!("markers of {} with a side of about {} squares were found", print.dictionary.name(), print.ratio),
        "write dictionary and side_m under [aruco] in the plate file, which is faster and safer",
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

fn mirrored_board() -> Error {
    Error::new(
        Code::PlateMirrored,
        "image",
        "the board is mirrored",
        "turn off mirroring in the camera or in the image export",
    )
}
