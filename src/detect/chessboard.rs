//! Inner corners of a chessboard.
//!
//! The lattice of corners comes from the `calib-targets` library; which corner is which, the sub-pixel position in the
//! full depth of the picture and its covariance are found here.

use calib_targets_chessboard::{ChessboardDetector, ChessboardParams, detect_corners};
use calib_targets_core::{DetectorConfig, GrayImageView, ImageRefiner, default_chess_config};

use super::board_labels::{BoardSize, Label, Labelling, Lattice, label};
use super::corners::{Window, measure};
use super::{Detection, Picture};
use crate::error::{Code, Error, Notice, Result};
use crate::series::Plate;

/// Pixels for one corner: as far along the edges as the next corners do not disturb, and near enough that the lens
/// does not bend the edges.
pub(super) const WINDOW: Window = Window { reach: 0.4, radius_px: 16.0, arm: 1.0, keep_off_px: 0.0 };

/// Finds the inner corners of a chessboard; parts of the board may be out of view or covered.
///
/// Ids are row-major from the top-left of the printed face, whose first square is dark. Positions are in px with (0, 0)
/// at the centre of the top-left pixel.
///
/// # Errors
/// No board in the picture; colours that contradict the plate; a mirrored picture, where the colours show it (numbers
/// of squares both even: every other chessboard is its own mirror image); so little of the outline that the part seen
/// could lie in several places.
pub fn detect(picture: &Picture, plate: &Plate) -> Result<Detection> {
    let board = board_size(plate)?;
    let lattice = find_lattice(picture).ok_or_else(no_board)?;
    let mut notices = Vec::new();
    let Label { labelling, blank_line } = label(picture, &lattice, board);
    let placement = match labelling {
        Labelling::Unique(placement) => placement,
        Labelling::Symmetric(placement) => {
            notices.push(symmetric_notice(board));
            placement
        }
        Labelling::Ambiguous => return Err(ambiguous()),
        Labelling::Contradiction => return Err(contradiction(board)),
    };
    if blank_line {
        notices.push(blank_line_notice(board));
    }
    let mut detection = measure(picture, &lattice, placement, WINDOW);
    detection.notices = notices;
    Ok(detection)
}

pub(super) fn board_size(plate: &Plate) -> Result<BoardSize> {
    let size = (i32::try_from(plate.columns), i32::try_from(plate.rows));
    match size {
        (Ok(columns @ 2..=1000), Ok(rows @ 2..=1000)) => Ok(BoardSize { columns, rows }),
        _ => Err(Error::new(
            Code::PlateNotDetectable,
            "plate",
            format!("a chessboard of {} x {} inner corners", plate.columns, plate.rows),
            "set `columns` and `rows` of the plate file to the numbers of inner corners, each from 2 to 1000",
        )),
    }
}

/// The largest regular lattice of saddle points.
fn find_lattice(picture: &Picture) -> Option<Lattice> {
    let bytes = to_8_bit(picture);
    let view = GrayImageView { width: picture.width, height: picture.height, data: &bytes };
    let corners = detect_corners(&view, &corner_config());
    let detector = ChessboardDetector::new(ChessboardParams::default()).ok()?;
    let found = detector.detect(&corners)?;
    let lattice = found
        .corners
        .iter()
        .map(|c| ((c.grid.u, c.grid.v), [f64::from(c.position.x), f64::from(c.position.y)]))
        .collect();
    Some(lattice)
}

/// Saddle fit over 9 x 9 px: half the scatter of the library's default on real images.
pub(super) fn corner_config() -> DetectorConfig {
    let mut refiner = ImageRefiner::saddle_point();
    if let ImageRefiner::SaddlePoint(config) = &mut refiner {
        config.radius = 4;
        config.max_offset = 3.0;
    }
    default_chess_config().with_refiner(refiner)
}

/// Grey values scaled to 8 bits, for finding corners only: bright 8-bit pictures stay as they are, others are stretched
/// so that all but the brightest thousandth of their pixels fit.
pub(super) fn to_8_bit(picture: &Picture) -> Vec<u8> {
    let bright = bright_level(picture);
    let scale = if (128.0..=255.0).contains(&bright) && picture.full_scale <= 255.0 { 1.0 } else { 255.0 / bright };
    picture.pixels.iter().map(|&p| (p * scale + 0.5) as u8).collect()
}

/// Count below which all but a thousandth of the pixels lie.
fn bright_level(picture: &Picture) -> f32 {
    let step = 4096.0 / picture.full_scale;
    let mut histogram = [0usize; 4097];
    for &p in &picture.pixels {
        histogram[((p * step) as usize).min(4096)] += 1;
    }
    let mut above = picture.pixels.len() / 1000;
    for (bin, &count) in histogram.iter().enumerate().rev() {
        if count > above {
            return (bin + 1) as f32 / step;
        }
        above -= count;
    }
    picture.full_scale
}

fn no_board() -> Error {
    Error::new(
        Code::PlateNotFound,
        "image",
        "no chessboard found",
        "check that the board is in view, sharp and evenly lit, and that `kind` of the plate file is right",
    )
}

fn ambiguous() -> Error {
    Error::new(
        Code::PlateIncomplete,
        "image",
        "too little of the chessboard's outline is in view to tell which part of the board it is",
        "take the image so that at least two neighbouring sides of the board are in view",
    )
}

fn contradiction(board: BoardSize) -> Error {
    Error::new(
        Code::PlateContradicted,
        "image",
        format!("the squares do not have the colours of a board of {} x {} inner corners", board.columns, board.rows),
        "check `columns` and `rows` of the plate file (inner corners) and that the top-left square is dark",
    )
}

fn symmetric_notice(board: BoardSize) -> Notice {
    Notice::new(
        Code::PlateSymmetric,
        "plate",
        format!(
            "a board of {} x {} inner corners looks the same after a turn; ids assume that its top is up in the image",
            board.columns, board.rows
        ),
        "keep the camera within 90 degrees of upright, or use a board with an odd and an even number of squares",
    )
}

fn blank_line_notice(board: BoardSize) -> Notice {
    Notice::new(
        Code::PlateLineHidden,
        "image",
        "a whole line of the chessboard's squares is not seen where it should be",
        format!("if nothing covers it, the board has fewer than {} x {} inner corners", board.columns, board.rows),
    )
}
