//! Whether the numbers of a ChArUco board's markers are those of the plate file.
//!
//! The library places a board by the markers that agree. On a board that counts from another number some agree, too, a few squares away: so the
//! light squares of the lattice are read once more, with those just beyond the board, and what contradicts is weighed.

use std::collections::BTreeMap;

use super::charuco_cells::Cells;
use super::charuco_markers::Print;
use crate::detect::Picture;
use crate::detect::corners::lattice::{BoardSize, Lattice};

/// Squares beyond the board in which markers are looked for.
const BEYOND: i32 = 1;
/// So many markers are no chance.
const LEAST: usize = 2;

/// Column and row of a square of the board.
pub(super) type Square = (i32, i32);

/// How a board numbers its markers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Counting {
    /// Number of the first marker.
    pub first_id: u32,
    /// OpenCV's layout before 4.6.
    pub legacy: bool,
}

impl Counting {
    pub fn of(print: &Print) -> Self {
        Self { first_id: print.first_id, legacy: print.legacy }
    }
}

/// What the markers say that stand where the plate file has others or none.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Contradiction {
    /// Most markers in view are those of a board that counts so.
    Counts(Counting),
    /// They outnumber those that agree.
    Outnumbers { wrong: usize, right: usize },
}

/// The markers that are read in the squares of a board, and just beyond.
pub(super) struct Numbers {
    read: Vec<(Square, u32)>,
    board: BoardSize,
    stated: Counting,
}

impl Numbers {
    /// Of a board that was found as this print.
    pub fn read(picture: &Picture, lattice: &Lattice, print: &Print, board: BoardSize) -> Self {
        Self { read: read(picture, lattice, print, board), board, stated: Counting::of(print) }
    }

    /// What contradicts the board that was found by so many markers; `None` where nothing does.
    pub fn contradiction(&self, markers: usize) -> Option<Contradiction> {
        let right = self.right();
        let wrong = self.read.len() - right;
        // The library may read more in blur and noise.
        let right = right.max(markers);
        if wrong < LEAST {
            return None;
        }
        let (best, votes) = self.most_agree()?;
        if best != self.stated && votes >= right + LEAST && 2 * votes > self.read.len() {
            return Some(Contradiction::Counts(best));
        }
        (wrong > right).then_some(Contradiction::Outnumbers { wrong, right })
    }

    /// Whether more markers agree with the layout than with the other one, wherever the board lies then.
    pub fn tell_layout(&self) -> bool {
        let other = Counting { legacy: !self.stated.legacy, ..self.stated };
        let squares: BTreeMap<u32, Square> = numbered(self.board, other).collect();
        let mut moved: BTreeMap<Square, usize> = BTreeMap::new();
        for ((column, row), id) in &self.read {
            if let Some((to_column, to_row)) = squares.get(id) {
                *moved.entry((to_column - column, to_row - row)).or_default() += 1;
            }
        }
        moved.into_values().max().unwrap_or(0) < self.right()
    }

    fn right(&self) -> usize {
        let agrees = |(square, id): &&(Square, u32)| number(self.board, self.stated, *square) == Some(*id);
        self.read.iter().filter(agrees).count()
    }

    /// The counting with which most markers agree, wherever the board lies then, with their number; of equals the one that differs least.
    fn most_agree(&self) -> Option<(Counting, usize)> {
        let Self { read, board, stated } = self;
        // With an odd number of rows of squares there is one layout.
        let layouts = [stated.legacy, !stated.legacy].into_iter().take(if board.rows % 2 == 1 { 2 } else { 1 });
        let mut votes: BTreeMap<(Square, Counting), usize> = BTreeMap::new();
        for legacy in layouts {
            for down in -board.rows..=board.rows {
                for right in -board.columns..=board.columns {
                    let first = |((column, row), id): &(Square, u32)| {
                        id.checked_sub(before(*board, legacy, (column + right, row + down))?)
                    };
                    for first_id in read.iter().filter_map(first) {
                        *votes.entry(((right, down), Counting { first_id, legacy })).or_default() += 1;
                    }
                }
            }
        }
        let alike = |c: &Counting| (c.first_id == stated.first_id, c.legacy == stated.legacy);
        let best = votes.into_iter().max_by_key(|((_, counting), count)| (*count, alike(counting)))?;
        Some((best.0.1, best.1))
    }
}

/// The upright markers in the light squares of the lattice.
fn read(picture: &Picture, lattice: &Lattice, print: &Print, board: BoardSize) -> Vec<(Square, u32)> {
    let Some(cells) = Cells::of(picture, lattice, print) else { return Vec::new() };
    let marker = |(column, row): Square| {
        // Corners are counted from the first inner one.
        let reading = cells.read((column - 1, row - 1)).filter(|reading| reading.turns == 0)?;
        Some(((column, row), reading.id))
    };
    let rows = -BEYOND..=board.rows + BEYOND;
    let squares = rows.flat_map(|row| (-BEYOND..=board.columns + BEYOND).map(move |column| (column, row)));
    squares.filter(|square| is_light(*square, print.legacy)).filter_map(marker).collect()
}

fn is_light((column, row): Square, legacy: bool) -> bool {
    ((column + row).rem_euclid(2) == 0) == legacy
}

/// The number of the marker in a square; `None` where there is none.
pub(super) fn number(board: BoardSize, counting: Counting, square: Square) -> Option<u32> {
    counting.first_id.checked_add(before(board, counting.legacy, square)?)
}

/// The markers of a board with their squares.
pub(super) fn numbered(board: BoardSize, counting: Counting) -> impl Iterator<Item = (u32, Square)> {
    let squares = (0..=board.rows).flat_map(move |row| (0..=board.columns).map(move |column| (column, row)));
    squares.filter_map(move |square| Some((number(board, counting, square)?, square)))
}

/// Markers before that in a square; `None` where there is none.
fn before(board: BoardSize, legacy: bool, (column, row): Square) -> Option<u32> {
    let width = board.columns + 1;
    let on_board = (0..width).contains(&column) && (0..=board.rows).contains(&row);
    if !on_board || !is_light((column, row), legacy) {
        return None;
    }
    // Light squares among the first ones of a row.
    let light = |row: i32, columns: i32| (columns + i32::from(is_light((0, row), legacy))) / 2;
    u32::try_from((0..row).map(|row| light(row, width)).sum::<i32>() + light(row, column)).ok()
}
