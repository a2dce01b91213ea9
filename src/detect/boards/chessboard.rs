//! Inner corners of a chessboard.
//!
//! The lattice of corners comes from the `calib-targets` library; which corner is which, the sub-pixel position in the
//! full depth of the picture and its covariance are found here.

use std::cell::OnceCell;

use super::ends::Ends;
use super::labels::{Labelling, Shader, label};
use super::lattices::Lattices;
use super::seen::BoardSeen;
use crate::detect::corners::lattice::{BoardSize, Lattice, Placement};
use crate::detect::corners::{Window, measure};
use crate::detect::{Detection, Outline, Picture};
use crate::error::{Code, Error, Notice, Result};
use crate::series::Plate;

/// Pixels for one corner: as far along the edges as the next corners do not disturb, and near enough that the lens
/// does not bend the edges.
pub(super) const WINDOW: Window = Window { reach: 0.4, radius_px: 16.0, arm: 1.0, dot: 0.0, keep_off_px: 0.0 };

/// Finds the inner corners of a chessboard; parts of the board may be out of view or covered.
///
/// Ids are row-major from the top-left of the printed face. With an odd and an even number of columns and rows the first square is
/// dark; other boards look the same after half a turn (a quarter, where square and even), may have a first square of either colour,
/// and take the turn in which they are most upright, with a notice. Positions are in px with (0, 0)
/// at the centre of the top-left pixel.
///
/// # Errors
/// No board in the picture; colours that contradict the plate; squares beyond those of the plate; so little of the outline that the part seen could
/// lie in several places. A board of another size is a failure of the detection.
pub fn detect(picture: &Picture, plate: &Plate) -> Result<Detection> {
    let board = board_size(plate)?;
    let seen = Lattices::of(picture);
    let largest = on_lattice(&Looked::at(picture, seen.largest(board).ok_or_else(no_board)?), board);
    match &largest {
        Ok(detection) if detection.failure.is_none() => largest,
        _ => beside(picture, &seen, board).map_or(largest, Ok),
    }
}

/// The stated board from end to end beside a larger one, or before a floor of tiles.
fn beside(picture: &Picture, seen: &Lattices, board: BoardSize) -> Option<Detection> {
    seen.smaller().find_map(|lattice| {
        let looked = Looked::at(picture, &lattice);
        looked.seen().filter(|seen| seen.is(board))?;
        let found = on_lattice(&looked, board).ok()?;
        let is_whole = found.failure.is_none() && found.outline == Outline::Whole;
        is_whole.then_some(Detection { outline: Outline::Beside, ..found })
    })
}

/// A lattice with what is seen of it, looked for once, when it is asked for.
struct Looked<'a> {
    picture: &'a Picture,
    lattice: &'a Lattice,
    shader: OnceCell<Option<Shader<'a>>>,
    ends: OnceCell<Option<Ends>>,
    seen: OnceCell<Option<BoardSeen>>,
}

impl<'a> Looked<'a> {
    fn at(picture: &'a Picture, lattice: &'a Lattice) -> Self {
        Self { picture, lattice, shader: OnceCell::new(), ends: OnceCell::new(), seen: OnceCell::new() }
    }

    fn shader(&self) -> Option<&Shader<'a>> {
        self.shader.get_or_init(|| Shader::of(self.picture, self.lattice)).as_ref()
    }

    fn ends(&self) -> Option<Ends> {
        *self.ends.get_or_init(|| Ends::of(self.shader()?))
    }

    fn seen(&self) -> Option<BoardSeen> {
        *self.seen.get_or_init(|| BoardSeen::of(self.shader()?))
    }

    /// Where the board lies by its colours.
    fn labelling(&self, board: BoardSize) -> Labelling {
        // Of a larger lattice no placement covers half.
        let may_be = self.lattice.len() <= 2 * (board.columns * board.rows) as usize;
        let shader = may_be.then(|| self.shader()).flatten();
        shader.map_or(Labelling::Contradiction, |shader| label(shader, board))
    }
}

fn on_lattice(looked: &Looked, board: BoardSize) -> Result<Detection> {
    let placed = |labelling: Labelling| Some((labelling, labelling.placement()?));
    let by_ends = || placed(looked.ends()?.place(board)?);
    let measured = |placement: Placement| measure(looked.picture, looked.lattice, placement, WINDOW);
    let by_colours = looked.labelling(board);
    let exceeded = |placement: Placement| looked.ends().is_some_and(|ends| ends.exceed(placement));
    let of_colours = placed(by_colours);
    let Some((mut labelling, placement)) = of_colours.filter(|(_, p)| !exceeded(*p)).or_else(by_ends) else {
        let why = match by_colours {
            _ if of_colours.is_some() => larger(board),
            Labelling::Ambiguous => ambiguous(),
            _ => contradiction(board),
        };
        return refusal(looked, board, why);
    };
    let mut detection = measured(placement);
    // Light that hides a line looks like the end of the board: what is taken for hidden may as well be what is taken for paper.
    if detection.outline == Outline::LineMissing && looked.ends().is_none_or(|ends| !ends.leave_only(board, placement))
    {
        let Some((other, placement)) = by_ends() else { return refusal(looked, board, ambiguous()) };
        (labelling, detection) = (other, measured(placement));
    }
    // Lines that are all there may be the first ones of more, where the border of the picture cuts the squares beyond them.
    if detection.outline == Outline::Whole && looked.seen().is_none_or(|seen| !seen.is(board)) {
        detection.outline = Outline::Lines;
    }
    let mut notices = Vec::new();
    if matches!(labelling, Labelling::Symmetric(_)) {
        notices.push(symmetric_notice(board));
    }
    if detection.outline == Outline::LineMissing {
        detection.size_seen = looked.seen().and_then(|seen| seen.size());
        notices.push(hidden_line(board));
    }
    detection.notices = notices;
    Ok(detection)
}

/// A board of another size is named as that, whatever else there is to say.
fn refusal(looked: &Looked, board: BoardSize, otherwise: Error) -> Result<Detection> {
    match looked.seen().and_then(|seen| Some((seen.lines(), seen.contradiction(board)?))) {
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

fn larger(board: BoardSize) -> Error {
    Error::new(
        Code::PlateContradicted,
        "image",
        format!("squares are seen beyond those of a board of {} x {} inner corners", board.columns, board.rows),
        "correct `columns` and `rows` of the plate file: they count inner corners, one less than squares",
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
