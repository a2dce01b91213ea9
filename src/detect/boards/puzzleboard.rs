//! Inner corners of a PuzzleBoard: a chessboard with dots at the edges between its squares, whose colours tell the place.
//!
//! The `calib-targets` library reads the dots and so tells which corner is which. Here that is accepted only where it can hardly be
//! chance, every corner is compared once more with the dots around it, and the positions are measured as on a plain chessboard, from
//! the pixels that the dots leave free.

use calib_targets_puzzleboard::{
    MASTER_COLS, MASTER_ROWS, PuzzleBoardDetector, PuzzleBoardParams, PuzzleBoardSearchMode, PuzzleBoardSpec,
    PuzzleBoardSpecError,
};

use super::chessboard::{WINDOW, board_size};
use super::corner_finder::find_corners;
use super::labels::brightness;
use super::sizes::{best_of_sizes, on_picture, scales};
use crate::detect::circles::{FALSE_ALARMS, binomial_tail};
use crate::detect::corners::lattice::{BoardSize, Lattice, Placement};
use crate::detect::corners::{Window, measure};
use crate::detect::pictures::bytes::Bytes;
use crate::detect::shared::KEEP_OFF_PX;
use crate::detect::{Detection, Dropped, Outline, Picture};
use crate::error::{Code, Error, Result};
use crate::series::{Next, Plate, Puzzle};

/// A board elsewhere on the pattern is only named: more places, and a looser limit on chance.
const FALSE_NAMES: f64 = 1e-3;
/// Squares around a corner whose dots must agree with its place.
const AROUND: i32 = 2;
/// Share of these dots that may be read wrongly: a corner at another place has half of them wrong.
const MOST_WRONG: f64 = 0.25;
/// Dots that must be read around a corner for a verdict.
const LEAST_READ: usize = 4;

/// Finds the inner corners of a PuzzleBoard; parts of the board may be out of view or covered.
///
/// Ids are row-major from the top-left of the board, positions in px with (0, 0) at the centre of the top-left pixel.
///
/// # Errors
/// No board in the picture; another part of the pattern than the plate says; a mirrored picture.
pub fn detect(picture: &Picture, plate: &Plate) -> Result<Detection> {
    let board = board_size(plate)?;
    let puzzle = plate.puzzle.ok_or_else(|| nothing(plate))?;
    let mut bytes = Bytes::of(picture);
    let declared = Reader::declared(board, puzzle).map_err(impossible)?;
    let look =
        |bytes: &Bytes| best_of_sizes(scales(bytes), board, |lattice| lattice, |scale| Ok(declared.read(bytes, scale)));
    let Some(lattice) = look(&bytes)? else {
        if let Some(found) = Reader::anywhere(puzzle).map_err(impossible)?.read(&bytes, 1.0) {
            return Err(elsewhere(&found, [0, 0]));
        }
        bytes.mirror();
        return Err(if look(&bytes)?.is_some() { mirrored() } else { nothing(plate) });
    };
    let (lattice, dropped) = Dots { picture, puzzle, lattice: &lattice }.checked();
    let beyond = lattice.keys().filter(|key| !board.contains(**key)).count();
    if 2 * beyond as i32 > board.columns.min(board.rows) {
        return Err(elsewhere(&lattice, [puzzle.origin_col, puzzle.origin_row].map(|k| k as i32)));
    }
    let window = Window { dot: puzzle.dot_diameter_rel / 2.0, keep_off_px: KEEP_OFF_PX, ..WINDOW };
    let mut detection = measure(picture, &lattice, Placement::on_board(board, puzzle.is_light_first()), window);
    detection.dropped.extend(dropped);
    // The dots tell the place of every corner, whatever hides a line of them.
    if detection.outline == Outline::LineMissing {
        detection.outline = Outline::TagsMissing;
    }
    if detection.observations.is_empty() { Err(nothing(plate)) } else { Ok(detection) }
}

/// Reads the dots of some part of the pattern.
struct Reader {
    detector: PuzzleBoardDetector,
    /// Row and column of the pattern at the first inner corner.
    first: [i32; 2],
    /// Places and turns at which a part of the board may be taken to be.
    places: f64,
    /// Expected number of readings by chance up to which one is believed.
    false_alarms: f64,
}

impl Reader {
    /// Of the board as the plate describes it.
    fn declared(board: BoardSize, puzzle: Puzzle) -> std::result::Result<Self, PuzzleBoardSpecError> {
        let [rows, columns] = [board.rows + 1, board.columns + 1].map(i32::unsigned_abs);
        let spec = PuzzleBoardSpec::with_origin(rows, columns, 1.0, puzzle.origin_row, puzzle.origin_col)?;
        Self::new(spec, PuzzleBoardSearchMode::FixedBoard, puzzle, FALSE_ALARMS)
    }

    /// Of any part of the pattern.
    fn anywhere(puzzle: Puzzle) -> std::result::Result<Self, PuzzleBoardSpecError> {
        Self::new(PuzzleBoardSpec::master(1.0)?, PuzzleBoardSearchMode::Full, puzzle, FALSE_NAMES)
    }

    fn new(
        spec: PuzzleBoardSpec,
        mode: PuzzleBoardSearchMode,
        puzzle: Puzzle,
        false_alarms: f64,
    ) -> std::result::Result<Self, PuzzleBoardSpecError> {
        let mut params = PuzzleBoardParams::for_board(spec);
        params.decode.search_mode = mode;
        params.decode.sample_radius_rel = (puzzle.dot_diameter_rel / 2.0) as f32;
        let first = [spec.origin_row, spec.origin_col].map(|k| i32::try_from(k + 1).unwrap_or(i32::MAX));
        let places = 4.0 * f64::from(spec.rows) * f64::from(spec.cols);
        Ok(Self { detector: PuzzleBoardDetector::new(params)?, first, places, false_alarms })
    }

    /// Corners in px of the picture by column and row of the board, seen at another size, where that is hardly a chance.
    fn read(&self, bytes: &Bytes, scale: f64) -> Option<Lattice> {
        let scaled = bytes.scaled(scale);
        let corners = find_corners(&scaled);
        let found = self.detector.detect_with_corners(&scaled.view(), &corners).ok()?;
        let bits = found.decode.logical_bits;
        let wrong = (f64::from(found.decode.logical_bit_error_rate) * bits as f64).round() as usize;
        if self.places * binomial_tail(bits, wrong, 0.5) > self.false_alarms {
            return None;
        }
        let [row, column] = self.first;
        let corner = |c: &calib_targets_puzzleboard::PuzzleBoardCorner| {
            let at = [c.position.x, c.position.y].map(|p| on_picture(p, scale));
            ((c.grid.u - column, c.grid.v - row), at)
        };
        Some(found.corners.iter().map(corner).collect())
    }
}

/// The dots of a picture as the corners of a lattice say where they are.
struct Dots<'a> {
    picture: &'a Picture,
    puzzle: Puzzle,
    lattice: &'a Lattice,
}

impl Dots<'_> {
    /// The corners with whose places the dots around them agree, and the others.
    fn checked(&self) -> (Lattice, Vec<Dropped>) {
        let agrees = |&(u, v): &(i32, i32)| {
            let around = (v - AROUND..=v + AROUND).flat_map(|j| (u - AROUND..=u + AROUND).map(move |i| (i, j)));
            let sides = around.flat_map(|key| [(key, Next::Right), (key, Next::Below)]);
            let read: Vec<bool> = sides.filter_map(|(key, next)| self.agrees(key, next)).collect();
            let wrong = read.iter().filter(|agrees| !**agrees).count();
            read.len() < LEAST_READ || wrong as f64 <= MOST_WRONG * read.len() as f64
        };
        let (kept, wrong): (Lattice, Lattice) = self.lattice.iter().partition(|(key, _)| agrees(key));
        (kept, wrong.into_values().map(|uv| Dropped::point(uv, "wrong class")).collect())
    }

    /// Whether the dot between a corner and the next has its colour; `None` where it cannot be read.
    fn agrees(&self, (u, v): (i32, i32), next: Next) -> Option<bool> {
        let corner = |i: i32, j: i32| self.lattice.get(&(u + i, v + j)).copied();
        let mean =
            |corners: &[[f64; 2]]| [0, 1].map(|k| corners.iter().map(|c| c[k]).sum::<f64>() / corners.len() as f64);
        let square = |i: i32, j: i32| {
            let corners = [corner(i, j)?, corner(i + 1, j)?, corner(i, j + 1)?, corner(i + 1, j + 1)?];
            brightness(self.picture, mean(&corners))
        };
        let (end, other) = match next {
            Next::Right => (corner(1, 0)?, square(0, -1)?),
            Next::Below => (corner(0, 1)?, square(-1, 0)?),
        };
        let dot = brightness(self.picture, mean(&[corner(0, 0)?, end]))?;
        Some((dot > 0.5 * (other + square(0, 0)?)) == self.puzzle.is_light([u, v], next))
    }
}

fn impossible(error: PuzzleBoardSpecError) -> Error {
    let what = format!("the puzzleboard is impossible: {error}");
    let remedy = "check columns, rows (inner corners), origin_row and origin_col of the plate file";
    Error::new(Code::PlateNotDetectable, "plate", what, remedy)
}

fn nothing(plate: &Plate) -> Error {
    Error::new(
        Code::PlateNotFound,
        "image",
        format!("no puzzleboard of {} x {} inner corners found", plate.columns, plate.rows),
        "check that at least 7 x 7 inner corners with their dots are in view, sharp and evenly lit",
    )
}

/// Column and row of the pattern at the first square of the board that the lattice counts from.
fn elsewhere(lattice: &Lattice, origin: [i32; 2]) -> Error {
    let along = |pick: fn(&(i32, i32)) -> i32, origin: i32, pattern: u32| {
        let all = || lattice.keys().map(pick);
        let (least, most) = (all().min().unwrap_or(0), all().max().unwrap_or(0));
        (most - least + 1, (origin + least).rem_euclid(pattern as i32))
    };
    let (columns, column) = along(|k| k.0, origin[0], MASTER_COLS);
    let (rows, row) = along(|k| k.1, origin[1], MASTER_ROWS);
    Error::new(
        Code::PlateContradicted,
        "image",
        format!(
            "the puzzleboard that is seen is another part of the pattern: {columns} x {rows} inner corners from origin_row = {row}, \
             origin_col = {column}"
        ),
        "check columns, rows (inner corners), origin_row and origin_col of the plate file, or whether it is the right board",
    )
}

fn mirrored() -> Error {
    Error::new(
        Code::PlateMirrored,
        "image",
        "the board is mirrored",
        "turn off mirroring in the camera or in the image export",
    )
}
