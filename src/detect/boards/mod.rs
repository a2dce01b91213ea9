//! Boards of squares: chessboards, ChArUco boards and PuzzleBoards.
//!
//! ```text
//! picture -> corner_finder (about where corners are; sizes: at which size of the picture) -> lattices (which are neighbours)
//!         -> labels (which corner of the board each is)
//!         -> chessboard, or charuco with charuco_markers, charuco_placed and charuco_tagged, or puzzleboard (one file a kind; corners are measured in
//!            `corners`)
//!         -> ends, seen, charuco_numbers, charuco_seen (is it the board of the plate file, and all of it that is in view)
//! ```

pub mod charuco;
mod charuco_cells;
mod charuco_markers;
mod charuco_numbers;
mod charuco_placed;
pub(super) mod charuco_seen;
mod charuco_tagged;
pub mod chessboard;
mod corner_finder;
mod ends;
pub(super) mod labels;
pub(super) mod lattices;
pub mod puzzleboard;
pub(super) mod seen;
mod sizes;
