//! Inner corners of a ChArUco board: a chessboard with ArUco markers in its light squares.
//!
//! The `calib-targets` library decodes the markers and so tells which corner is which; the positions are measured as on
//! a plain chessboard, from the pixels along the edges that the markers leave free.

use calib_targets_aruco::{Dictionary, builtins, resolve_dictionary};
use calib_targets_charuco::{CharucoBoardSpec, CharucoDetection, CharucoDetector, CharucoParams};
use calib_targets_chessboard::{ChessCorner, detect_corners};
use calib_targets_core::GrayImageView;

use super::board_labels::{BoardSize, Lattice, Placement};
use super::chessboard::{WINDOW, board_size, corner_config, to_8_bit};
use super::corners::{Window, measure};
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
    let mut view = View::of(picture);
    let prints = prints(plate)?;
    let (print, found) = match view.decode(&prints, board)? {
        Some(found) => found,
        None => {
            let mirrored = view.mirrored().decode(&prints, board)?.is_some();
            return Err(if mirrored { mirrored_board() } else { no_board(plate) });
        }
    };
    let lattice: Lattice = found
        .corners
        .iter()
        .map(|c| (position_on_board(c.id, board), [f64::from(c.position.x), f64::from(c.position.y)]))
        .collect();
    let window = Window { arm: 0.5 * (1.0 - print.ratio), keep_off_px: KEEP_OFF_PX, ..WINDOW };
    let mut detection = measure(picture, &lattice, Placement::identity(board), window);
    if plate.aruco.is_none() {
        detection.notices.push(found_print(&print));
    }
    Ok(detection)
}

fn position_on_board(id: u32, board: BoardSize) -> (i32, i32) {
    let id = i32::try_from(id).unwrap_or(i32::MAX);
    (id % board.columns, id / board.columns)
}

/// A picture in 8 bits, for decoding only.
struct View {
    width: usize,
    height: usize,
    bytes: Vec<u8>,
}

impl View {
    fn of(picture: &Picture) -> Self {
        Self { width: picture.width, height: picture.height, bytes: to_8_bit(picture) }
    }

    fn mirrored(&mut self) -> &mut Self {
        self.bytes.chunks_exact_mut(self.width).for_each(<[u8]>::reverse);
        self
    }

    /// The print that explains most markers, with what was found; `None` where there is no board.
    fn decode(&self, prints: &[Print], board: BoardSize) -> Result<Option<(Print, CharucoDetection)>> {
        let view = GrayImageView { width: self.width, height: self.height, data: &self.bytes };
        let corners = detect_corners(&view, &corner_config());
        let least = if prints.len() > 1 { LEAST_MARKERS } else { 1 };
        let mut best: Option<(Print, CharucoDetection)> = None;
        for print in prints {
            let Some(found) = decode(&view, &corners, print, board)? else { continue };
            let more = best.as_ref().is_none_or(|(_, other)| found.markers.len() > other.markers.len());
            if found.markers.len() >= least && more {
                best = Some((*print, found));
            }
        }
        Ok(best)
    }
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
