//! Where a ChArUco board lies on a lattice of corners.
//!
//! The library takes the cells for flat squares and reads hardly any marker behind a fisheye. Here the markers that the cells say vote where on the
//! lattice the board lies and how it is turned.

use std::collections::BTreeMap;

use super::charuco_cells::Cells;
use super::charuco_markers::{Marker, Print};
use super::charuco_numbers::{Counting, Square, numbered};
use crate::detect::Picture;
use crate::detect::corners::lattice::{BoardSize, Lattice, Placement};

/// So many times as many markers must agree with a place as stand elsewhere or are on no board.
const AGREEING: usize = 3;

/// The place of a board on a lattice that most markers agree with, with those that do.
pub(super) fn placed(
    picture: &Picture,
    lattice: &Lattice,
    print: &Print,
    board: BoardSize,
) -> Option<(Placement, Vec<Marker>)> {
    let cells = Cells::of(picture, lattice, print)?;
    let squares: BTreeMap<u32, Square> = numbered(board, Counting::of(print)).collect();
    let mut votes: BTreeMap<(u8, (i32, i32)), Vec<Marker>> = BTreeMap::new();
    // A row of markers that ends in view has no corners below it.
    let is_whole =
        |(u, v): &(i32, i32)| [(1, 0), (0, 1), (1, 1)].iter().all(|(i, j)| lattice.contains_key(&(u + i, v + j)));
    let whole = lattice.keys().copied().filter(is_whole);
    let mut all = 0;
    for (cell, reading) in whole.filter_map(|cell| Some((cell, cells.read(cell)?))) {
        all += 1;
        let Some(square) = squares.get(&reading.id) else { continue };
        let marker = Marker { row: square.1, wrong_bits: reading.wrong_bits };
        votes.entry((reading.turns, origin(board, reading.turns, cell, *square))).or_default().push(marker);
    }
    let ((turns, origin), markers) = votes.into_iter().max_by_key(|(_, markers)| markers.len())?;
    let placement = Placement { board, turns, light_first: print.legacy, origin };
    (all - markers.len() <= markers.len() / AGREEING).then_some((placement, markers))
}

/// Least lattice coordinates of the corners of a board that has a square in this cell; its corners are counted from the first inner one.
fn origin(board: BoardSize, turns: u8, (u, v): (i32, i32), (column, row): Square) -> (i32, i32) {
    let (right, down) = match turns % 4 {
        0 => (column - 1, row - 1),
        1 => (board.rows - 1 - row, column - 1),
        2 => (board.columns - 1 - column, board.rows - 1 - row),
        _ => (row - 1, board.columns - 1 - column),
    };
    (u - right, v - down)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_square_in_a_cell_tells_where_the_board_begins() {
        let board = BoardSize { columns: 8, rows: 5 };
        for turns in 0..4 {
            let placement = Placement { board, turns, light_first: false, origin: (-3, 4) };
            for cell in placement.squares() {
                let corners = [(0, 0), (1, 0), (1, 1), (0, 1)].map(|(i, j)| (cell.0 + i, cell.1 + j));
                let on_board = corners.map(|corner| placement.board_from_lattice(corner));
                let least = (on_board.map(|c| c.0).into_iter().min(), on_board.map(|c| c.1).into_iter().min());
                let square = (least.0.unwrap() + 1, least.1.unwrap() + 1);
                assert_eq!(origin(board, turns, cell, square), placement.origin, "{turns} {cell:?}");
            }
        }
    }
}
