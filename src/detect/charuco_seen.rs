//! Which ChArUco board is in a picture that does not show the one of the plate file.

use calib_targets_chessboard::detect_corners;

use super::board_labels::BoardSize;
use super::charuco_markers::{Print, decode, usual_prints};
use super::chessboard::{Bytes, corner_config};
use crate::series::Plate;

/// Markers that must agree.
const LEAST_MARKERS: usize = 6;
/// Most inner corners in a row that are tried.
const MOST_COLUMNS: i32 = 30;

/// What the markers of the picture say.
#[derive(Debug, Clone, Copy)]
pub(super) enum Seen {
    /// Markers of the stated dictionary, as on a board with so many inner corners in a row.
    Columns(i32),
    /// A board of the stated size with markers of another dictionary or size: least and largest side over that of a square.
    Print { dictionary: &'static str, sides: [f64; 2] },
}

/// The board that most markers agree with: of the stated print with other columns, or of the stated size with another print.
pub(super) fn instead(bytes: &Bytes, plate: &Plate, stated: &[Print], board: BoardSize) -> Option<Seen> {
    let view = bytes.view();
    let corners = detect_corners(&view, &corner_config());
    let markers = |print: &Print, board: BoardSize| {
        // A size that the dictionary cannot fill is none.
        decode(&view, &corners, print, board).ok().flatten().map_or(0, |found| found.markers.len())
    };
    let sizes = (2..=MOST_COLUMNS).filter(|&columns| columns != board.columns);
    let sizes = sizes.flat_map(|columns| stated.iter().map(move |print| (columns, print)));
    let by_size = sizes.map(|(columns, print)| {
        let codes = i32::try_from(print.dictionary.codes().len()).unwrap_or(i32::MAX);
        // Rows below the board's own hold no marker of it.
        let rows = (2 * codes / (columns + 1) - 1).clamp(3, MOST_COLUMNS);
        (markers(print, BoardSize { columns, rows: rows - (rows - board.rows).rem_euclid(2) }), columns)
    });
    let prints = usual_prints(plate);
    let by_print: Vec<(usize, &Print)> = prints.iter().map(|print| (markers(print, board), print)).collect();
    let (columns, print) = (by_size.max_by_key(|(count, _)| *count)?, by_print.iter().max_by_key(|(count, _)| *count)?);
    if columns.0.max(print.0) < LEAST_MARKERS {
        return None;
    }
    if columns.0 > print.0 {
        return Some(Seen::Columns(columns.1));
    }
    let dictionary = print.1.dictionary.name();
    let alike = by_print.iter().filter(|(count, p)| *count == print.0 && p.dictionary.name() == dictionary);
    let sides = alike.fold([f64::MAX, 0.0], |[least, most], (_, p)| [p.ratio.min(least), p.ratio.max(most)]);
    Some(Seen::Print { dictionary, sides })
}
