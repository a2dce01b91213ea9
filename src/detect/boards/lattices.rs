//! The regular lattices of saddle points of a picture.
//!
//! The lattice finder of the `calib-targets` library takes two directions of edges for the whole picture: those that most corners have. Before
//! tiles, a checked cloth or a larger board, it does not see a board that is turned otherwise. So it looks again at the corners that it left over.

use std::cell::OnceCell;
use std::iter::successors;

use calib_targets_chessboard::{
    ChessCorner, ChessboardCorner, ChessboardDetection, ChessboardDetector, ChessboardParams,
};

use super::corner_finder::find_corners;
use super::sizes::on_picture;
use crate::detect::Picture;
use crate::detect::corners::lattice::{BoardSize, Lattice};
use crate::detect::pictures::bytes::Bytes;

/// Pictures with more pixels are looked at in half their size first.
const LARGE_PX: usize = 500_000;

/// The largest regular lattice of saddle points in a picture, see [`Lattices::largest`].
pub(in crate::detect) fn find_lattice(picture: &Picture, board: BoardSize) -> Option<Lattice> {
    Lattices::of(picture).largest(board).cloned()
}

/// The regular lattices of saddle points of a picture: sought once at every size, when they are asked for.
pub(super) struct Lattices {
    bytes: Bytes,
    by_scale: [(f64, OnceCell<Sorted>); 2],
}

impl Lattices {
    pub fn of(picture: &Picture) -> Self {
        Self { bytes: Bytes::of(picture), by_scale: scales(picture).map(|scale| (scale, OnceCell::new())) }
    }

    /// Of one size of the picture after the other.
    fn by_scale(&self) -> impl Iterator<Item = (f64, &Sorted)> {
        let sorted = |scale: f64| Sorted::of(&find_corners(&self.bytes.scaled(scale)), scale);
        self.by_scale.iter().map(move |(scale, found)| (*scale, found.get_or_init(|| sorted(*scale))))
    }

    /// The largest: sought in the picture at one size, and at the next unless that shows as many corners as the board has. Large pictures
    /// begin with half their size, where there are fewer pixels and a sharpened edge is one step; in small ones squares may be too small for
    /// the finder.
    pub fn largest(&self, board: BoardSize) -> Option<&Lattice> {
        let mut best: Option<&Lattice> = None;
        for lattice in self.by_scale().filter_map(|(_, found)| found.lattices.first()) {
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
    pub fn smaller(&self) -> impl Iterator<Item = Lattice> {
        let first = self.by_scale().flat_map(|(_, found)| found.lattices.iter().skip(1).cloned());
        first.chain(self.by_scale().flat_map(|(scale, found)| found.further(scale)))
    }
}

/// Corners of one size of the picture.
pub(super) struct Sorted {
    /// The largest first, in px of the picture.
    pub lattices: Vec<Lattice>,
    /// Corners that are on none, in px of the other size.
    pub left: Vec<ChessCorner>,
}

impl Sorted {
    pub fn of(corners: &[ChessCorner], scale: f64) -> Self {
        let found = lattices(corners);
        let at = |c: &ChessboardCorner| [c.position.x, c.position.y].map(|px| on_picture(px, scale));
        let lattice =
            |found: &ChessboardDetection| found.corners.iter().map(|c| ((c.grid.u, c.grid.v), at(c))).collect();
        Self { lattices: found.iter().map(lattice).collect(), left: without(corners, &found) }
    }

    /// The lattices of the corners that are left, as long as there are any.
    fn further(&self, scale: f64) -> impl Iterator<Item = Lattice> + use<> {
        let next = move |left: &[ChessCorner]| Some(Self::of(left, scale)).filter(|next| !next.lattices.is_empty());
        successors(next(&self.left), move |last| next(&last.left)).flat_map(|found| found.lattices)
    }
}

fn lattices(corners: &[ChessCorner]) -> Vec<ChessboardDetection> {
    ChessboardDetector::new(ChessboardParams::default())
        .map_or_else(|_| Vec::new(), |finder| finder.detect_all(corners))
}

/// The corners that are on no lattice of more than so many.
pub(super) fn on_no_larger(mut corners: Vec<ChessCorner>, most: usize) -> Vec<ChessCorner> {
    while corners.len() > most {
        let larger: Vec<_> = lattices(&corners).into_iter().filter(|found| found.corners.len() > most).collect();
        if larger.is_empty() {
            break;
        }
        corners = without(&corners, &larger);
    }
    corners
}

fn without(corners: &[ChessCorner], found: &[ChessboardDetection]) -> Vec<ChessCorner> {
    let mut is_left = vec![true; corners.len()];
    for corner in found.iter().flat_map(|lattice| &lattice.corners) {
        is_left[corner.input_index] = false;
    }
    corners.iter().zip(is_left).filter_map(|(corner, is_left)| is_left.then_some(*corner)).collect()
}

/// Sizes of the picture at which lattices are sought, one after the other.
fn scales(picture: &Picture) -> [f64; 2] {
    if picture.width * picture.height > LARGE_PX { [0.5, 1.0] } else { [1.0, 2.0] }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cloth_is_left_out_and_a_board_before_it_stays() {
        let (width, height) = (480, 400);
        let square = |u: f64, v: f64, side: f64| {
            if ((u / side).floor() as i32 + (v / side).floor() as i32).rem_euclid(2) == 0 { 40 } else { 200 }
        };
        let value = |k: usize| {
            let [x, y] = [k % width, k / width].map(|p| p as f64);
            let [u, v] = [0.94 * (x - 160.0) + 0.34 * (y - 100.0), 0.94 * (y - 100.0) - 0.34 * (x - 160.0)];
            match (u, v) {
                (0.0..180.0, 0.0..140.0) => square(u, v, 20.0),
                (-12.0..192.0, -12.0..152.0) => 200,
                _ => square(x, y, 12.0),
            }
        };
        let corners = find_corners(&Bytes { width, height, data: (0..width * height).map(value).collect() });
        let (most, board) = (200, 8 * 6);
        let largest = |corners: &[ChessCorner]| Sorted::of(corners, 1.0).lattices.first().map_or(0, Lattice::len);
        assert!(largest(&corners) > most);
        let left = on_no_larger(corners.clone(), most);
        assert_eq!(largest(&left), board);
        assert_eq!(on_no_larger(left.clone(), most), left);
        assert_eq!(on_no_larger(corners.clone(), corners.len()), corners);
    }
}
