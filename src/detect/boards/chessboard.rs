//! Inner corners of a chessboard.
//!
//! The lattice of corners comes from the `calib-targets` library; which corner is which, the sub-pixel position in the
//! full depth of the picture and its covariance are found here.

use std::cell::{LazyCell, OnceCell};

use calib_targets_chessboard::{ChessboardCorner, ChessboardDetection, ChessboardDetector, ChessboardParams};

use super::corner_finder::find_corners;
use super::ends::Ends;
use super::labels::{Labelling, label};
use super::seen::BoardSeen;
use super::sizes::on_picture;
use crate::detect::corners::lattice::{BoardSize, Lattice, Placement};
use crate::detect::corners::{Window, measure};
use crate::detect::pictures::bytes::Bytes;
use crate::detect::{Detection, Outline, Picture};
use crate::error::{Code, Error, Notice, Result};
use crate::series::Plate;

/// Pixels for one corner: as far along the edges as the next corners do not disturb, and near enough that the lens
/// does not bend the edges.
pub(super) const WINDOW: Window = Window { reach: 0.4, radius_px: 16.0, arm: 1.0, dot: 0.0, keep_off_px: 0.0 };

/// Pictures with more pixels are looked at in half their size first.
const LARGE_PX: usize = 500_000;

/// Finds the inner corners of a chessboard; parts of the board may be out of view or covered.
///
/// Ids are row-major from the top-left of the printed face. With an odd and an even number of columns and rows the first square is
/// dark; other boards look the same after half a turn (a quarter, where square and even), may have a first square of either colour,
/// and take the turn in which they are most upright, with a notice. Positions are in px with (0, 0)
/// at the centre of the top-left pixel.
///
/// # Errors
/// No board in the picture; colours that contradict the plate; so little of the outline that the part seen could lie in several
/// places. A board of another size is a failure of the detection.
pub fn detect(picture: &Picture, plate: &Plate) -> Result<Detection> {
    let board = board_size(plate)?;
    let seen = Lattices::of(picture);
    let largest = on_lattice(picture, seen.largest(board).ok_or_else(no_board)?, board);
    match &largest {
        Ok(detection) if detection.failure.is_none() => largest,
        _ => beside(picture, &seen, board).map_or(largest, Ok),
    }
}

/// The stated board from end to end beside a larger one.
fn beside(picture: &Picture, seen: &Lattices, board: BoardSize) -> Option<Detection> {
    seen.smaller().find_map(|lattice| {
        BoardSeen::of(picture, lattice).filter(|seen| seen.is(board))?;
        let found = on_lattice(picture, lattice, board).ok()?;
        let is_whole = found.failure.is_none() && found.outline == Outline::Whole;
        is_whole.then_some(Detection { outline: Outline::Beside, ..found })
    })
}

fn on_lattice(picture: &Picture, lattice: &Lattice, board: BoardSize) -> Result<Detection> {
    let ends = LazyCell::new(|| Ends::of(picture, lattice));
    let placed = |labelling: Labelling| Some((labelling, labelling.placement()?));
    let by_ends = || placed(ends.as_ref()?.place(board)?);
    let measured = |placement: Placement| measure(picture, lattice, placement, WINDOW);
    let by_colours = label(picture, lattice, board);
    let Some((mut labelling, placement)) = placed(by_colours).or_else(by_ends) else {
        let why = if by_colours == Labelling::Ambiguous { ambiguous() } else { contradiction(board) };
        return refusal(picture, lattice, board, why);
    };
    let mut detection = measured(placement);
    // Light that hides a line looks like the end of the board: what is taken for hidden may as well be what is taken for paper.
    if detection.outline == Outline::LineMissing && ends.is_none_or(|ends| !ends.leave_only(board, placement)) {
        let Some((other, placement)) = by_ends() else { return refusal(picture, lattice, board, ambiguous()) };
        (labelling, detection) = (other, measured(placement));
    }
    let mut notices = Vec::new();
    if matches!(labelling, Labelling::Symmetric(_)) {
        notices.push(symmetric_notice(board));
    }
    if detection.outline == Outline::LineMissing {
        detection.size_seen = BoardSeen::of(picture, lattice).and_then(|seen| seen.size());
        notices.push(hidden_line(board));
    }
    detection.notices = notices;
    Ok(detection)
}

/// A board of another size is named as that, whatever else there is to say.
fn refusal(picture: &Picture, lattice: &Lattice, board: BoardSize, otherwise: Error) -> Result<Detection> {
    let seen = BoardSeen::of(picture, lattice);
    match seen.and_then(|seen| Some((seen.lines(), seen.contradiction(board)?))) {
        Some((other_lines, error)) => Ok(Detection { other_lines, ..Detection::other_size(error) }),
        None => Err(otherwise),
    }
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

/// The largest regular lattice of saddle points in a picture, see [`Lattices::largest`].
pub(in crate::detect) fn find_lattice(picture: &Picture, board: BoardSize) -> Option<Lattice> {
    Lattices::of(picture).largest(board).cloned()
}

/// The regular lattices of saddle points of a picture: sought once at every size, when they are asked for.
struct Lattices {
    bytes: Bytes,
    by_scale: [(f64, OnceCell<Vec<Lattice>>); 2],
}

impl Lattices {
    fn of(picture: &Picture) -> Self {
        Self { bytes: Bytes::of(picture), by_scale: scales(picture).map(|scale| (scale, OnceCell::new())) }
    }

    /// Of one size of the picture after the other.
    fn by_scale(&self) -> impl Iterator<Item = &[Lattice]> {
        self.by_scale.iter().map(|(scale, found)| found.get_or_init(|| lattices(&self.bytes, *scale)).as_slice())
    }

    /// The largest: sought in the picture at one size, and at the next unless that shows as many corners as the board has. Large pictures
    /// begin with half their size, where there are fewer pixels and a sharpened edge is one step; in small ones squares may be too small for
    /// the finder.
    fn largest(&self, board: BoardSize) -> Option<&Lattice> {
        let mut best: Option<&Lattice> = None;
        for lattice in self.by_scale().filter_map(<[Lattice]>::first) {
            if best.is_none_or(|other| lattice.len() >= other.len()) {
                best = Some(lattice);
            }
            if best.is_some_and(|found| found.len() >= (board.columns * board.rows) as usize) {
                break;
            }
        }
        best
    }

    /// Those beside the largest of either size.
    fn smaller(&self) -> impl Iterator<Item = &Lattice> {
        self.by_scale().flat_map(|found| found.iter().skip(1))
    }
}

/// Sizes of the picture at which lattices are sought, one after the other.
fn scales(picture: &Picture) -> [f64; 2] {
    if picture.width * picture.height > LARGE_PX { [0.5, 1.0] } else { [1.0, 2.0] }
}

/// The regular lattices at another size of the picture, the largest first, in px of the picture.
fn lattices(bytes: &Bytes, scale: f64) -> Vec<Lattice> {
    let Ok(detector) = ChessboardDetector::new(ChessboardParams::default()) else { return Vec::new() };
    let at = |c: &ChessboardCorner| [c.position.x, c.position.y].map(|px| on_picture(px, scale));
    let lattice = |found: ChessboardDetection| found.corners.iter().map(|c| ((c.grid.u, c.grid.v), at(c))).collect();
    detector.detect_all(&find_corners(&bytes.scaled(scale))).into_iter().map(lattice).collect()
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
            "a board of {} x {} inner corners looks the same after a turn; in single images its top is taken to be up",
            board.columns, board.rows
        ),
        "with joint readings `identify` settles the turn; without, use a board with an odd and an even number of squares",
    )
}

fn hidden_line(board: BoardSize) -> Notice {
    Notice::new(
        Code::PlateLineHidden,
        "image",
        "a whole outer line of the chessboard is not seen where it should be",
        format!("if nothing covers it, the board has fewer than {} x {} inner corners", board.columns, board.rows),
    )
}
