//! The table of what can be printed on a plate.
//!
//! To add a kind: a variant with its row in [`PlateKind::print`], a detector (a file in `detect`), and its row there; the compiler names both rows.

use serde::{Deserialize, Serialize};

/// What is printed on the plate.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum PlateKind {
    /// Discs and annuli of several sizes whose pattern codes the position.
    CodedCircles,
    /// A plain grid of dots.
    CircleGrid,
    /// A chessboard; the markers are its inner corners.
    Chessboard,
    /// A chessboard with ArUco markers in its light squares.
    Charuco,
    /// Points observed by someone else's detector.
    Points,
}

/// What dark figures a plate has.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ink {
    /// A disc or an annulus at every marker.
    Circles,
    /// The squares of a chessboard, between its inner corners.
    Squares,
    /// These, with tags in the light ones.
    SquaresAndTags,
    /// Nothing that is known.
    Unknown,
}

/// Where the markers of a plate lie.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Places {
    /// On a lattice, each where its id says.
    LatticeById,
    /// On a lattice; the marker file may number them otherwise.
    Lattice,
    /// Anywhere: columns, rows and pitch need not be stated.
    Anywhere,
}

/// What plate.toml and its marker file have to say of a kind of plate.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Print {
    /// What is dark.
    pub ink: Ink,
    /// Where the markers lie.
    pub places: Places,
    /// Whether a marker file is needed; else plate.toml says all that is.
    pub needs_marker_file: bool,
    /// Whether plate.toml may state one radius for all (`radius_m`) in place of a marker file.
    pub has_radius: bool,
    /// Whether plate.toml may state tags (`[aruco]`).
    pub has_tags: bool,
}

impl PlateKind {
    /// The row of a kind.
    pub fn print(self) -> Print {
        match self {
            Self::CodedCircles => Print {
                ink: Ink::Circles,
                places: Places::LatticeById,
                needs_marker_file: true,
                has_radius: false,
                has_tags: false,
            },
            Self::CircleGrid => Print {
                ink: Ink::Circles,
                places: Places::Lattice,
                needs_marker_file: false,
                has_radius: true,
                has_tags: false,
            },
            Self::Chessboard => Print {
                ink: Ink::Squares,
                places: Places::LatticeById,
                needs_marker_file: false,
                has_radius: false,
                has_tags: false,
            },
            Self::Charuco => Print {
                ink: Ink::SquaresAndTags,
                places: Places::LatticeById,
                needs_marker_file: false,
                has_radius: false,
                has_tags: true,
            },
            Self::Points => Print {
                ink: Ink::Unknown,
                places: Places::Anywhere,
                needs_marker_file: true,
                has_radius: false,
                has_tags: false,
            },
        }
    }
}
