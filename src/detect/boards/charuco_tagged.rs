//! Where a ChArUco board lies by the contours of its markers.
//!
//! Seen from hardly above its plane, its squares cross so slantwise that they are no corners for the finder; their markers are read all the same.

use std::collections::BTreeMap;

use super::charuco_markers::{Marker, Print};
use super::charuco_numbers::{Counting, Square, numbered};
use crate::detect::Picture;
use crate::detect::corners::lattice::{BoardSize, Lattice};
use crate::detect::tags::code::{Reader, Reading};
use crate::detect::tags::layout::{Layout, Steps};
use crate::detect::tags::quads::Quad;
use crate::detect::tags::scan::{corners, scan};
use crate::geom::PlaneMap;

/// Markers that say where a corner is.
const NEAREST: usize = 6;
/// Markers elsewhere that contradict a board.
const CONTRADICTING: usize = 2;

/// A marker that stands where its number says, with its corners.
struct Placed {
    square: Square,
    quad: Quad,
}

/// Markers of the stated board and the corners of their squares, in px; `None` where markers contradict it.
pub(super) fn tagged(
    picture: &Picture,
    passes: &[Vec<Quad>],
    print: &Print,
    board: BoardSize,
) -> Option<(Vec<Marker>, Lattice)> {
    let seen = scan(picture, &Reader::of_opencv(&print.dictionary), passes, false);
    let squares: BTreeMap<u32, Square> = numbered(board, Counting::of(print)).collect();
    let stated = |id: u32, (i, j): Steps| {
        let (column, row) = squares.get(&id)?;
        Some((i64::from(*column) - i, i64::from(*row) + j))
    };
    let agreeing = Layout::of(&corners(&seen)).agreeing(stated);
    if seen.len() >= agreeing.len() + CONTRADICTING {
        return None;
    }
    let readings = || agreeing.keys().filter_map(|id| Some((*squares.get(id)?, seen.get(id)?)));
    let marker = |(square, reading): (Square, &Reading)| {
        Some(Marker { row: square.1, wrong_bits: u8::try_from(reading.wrong).ok()? })
    };
    let placed: Vec<Placed> = readings().map(|(square, reading)| Placed { square, quad: reading.corners }).collect();
    Some((readings().filter_map(marker).collect(), lattice(&placed, print, board)))
}

/// The corners of the squares with markers.
fn lattice(placed: &[Placed], print: &Print, board: BoardSize) -> Lattice {
    let of_square = |(u, v): Square| [(u - 1, v - 1), (u, v - 1), (u - 1, v), (u, v)];
    let corners = placed.iter().flat_map(|marker| of_square(marker.square)).filter(|at| board.contains(*at));
    corners.filter_map(|at| Some((at, place(placed, print, at)?))).collect()
}

/// Where a corner is by the markers nearest to it.
fn place(placed: &[Placed], print: &Print, (column, row): (i32, i32)) -> Option<[f64; 2]> {
    let far = |marker: &&Placed| {
        let (u, v) = marker.square;
        (2 * (u - column) - 1).pow(2) + (2 * (v - row) - 1).pow(2)
    };
    let mut near: Vec<&Placed> = placed.iter().collect();
    near.sort_by_key(far);
    let pairs: Vec<_> = near.iter().take(NEAREST).flat_map(|marker| marker.pairs(print.ratio)).collect();
    PlaneMap::fit(&pairs)?.apply([f64::from(column), f64::from(row)])
}

impl Placed {
    /// Its corners, counter-clockwise from the bottom-left, on the board and in the picture.
    fn pairs(&self, ratio: f64) -> impl Iterator<Item = ([f64; 2], [f64; 2])> {
        let [x, y] = [self.square.0, self.square.1].map(|n| f64::from(n) - 0.5);
        let half = 0.5 * ratio;
        let printed = [[-half, half], [half, half], [half, -half], [-half, -half]];
        printed.map(|[dx, dy]| [x + dx, y + dy]).into_iter().zip(self.quad)
    }
}
