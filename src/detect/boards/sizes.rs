//! At which size of the picture a board with a code is found best.

use crate::detect::corners::lattice::{BoardSize, Lattice};
use crate::detect::pictures::bytes::Bytes;
use crate::error::Result;

/// Sizes of the picture, over its own, at which a code is sought, until one shows most of the board; large pictures begin with half.
const SCALES: [f64; 3] = [1.0, 0.5, 1.5];
const SCALES_LARGE: [f64; 3] = [0.5, 1.0, 0.25];
/// Pixels of a large picture.
const LARGE_PX: usize = 2_000_000;
/// Share of the board's corners from which no other size is tried.
const MOST: f64 = 0.75;

/// The sizes of a picture, one after the other.
pub(super) fn scales(bytes: &Bytes) -> [f64; 3] {
    if bytes.width * bytes.height > LARGE_PX { SCALES_LARGE } else { SCALES }
}

/// The find with most corners of the board among these sizes; `None` where there is no board at any.
pub(super) fn best_of_sizes<S, T>(
    sizes: impl IntoIterator<Item = S>,
    board: BoardSize,
    lattice: impl Fn(&T) -> &Lattice,
    at_size: impl Fn(S) -> Result<Option<T>>,
) -> Result<Option<T>> {
    let mut best: Option<T> = None;
    for size in sizes {
        let Some(found) = at_size(size)? else { continue };
        if best.as_ref().is_none_or(|other| lattice(&found).len() > lattice(other).len()) {
            best = Some(found);
        }
        if best.as_ref().is_some_and(|best| shows_most(lattice(best), board)) {
            break;
        }
    }
    Ok(best)
}

/// Whether no other size need be tried.
pub(super) fn shows_most(lattice: &Lattice, board: BoardSize) -> bool {
    lattice.len() as f64 >= MOST * f64::from(board.columns * board.rows)
}

/// A place in a picture of another size; pixels are counted from their centres.
pub(super) fn on_picture(c: f32, scale: f64) -> f64 {
    (f64::from(c) + 0.5) / scale - 0.5
}
