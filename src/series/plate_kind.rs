//! The table of what can be printed on a plate.
//!
//! To add a kind: a row below, and a detector (a file in `detect`) with its row there, which the compiler asks for. This room reads
//! files and knows no pixels, hence the second row.

use serde::{Deserialize, Serialize};

/// What dark figures a plate has.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ink {
    /// A disc or an annulus at every marker.
    Circles,
    /// The squares of a chessboard, between its inner corners.
    Squares,
    /// These, with tags in the light ones.
    SquaresAndTags,
    /// These, with a dot at the middle of every edge between two.
    SquaresAndDots,
    /// Square tags with a code.
    Tags,
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

/// Turns after which the print of a plate looks the same, where its places do.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Turns {
    /// None: a code tells how it is turned.
    Never,
    /// Those that bring dark squares to dark ones.
    KeepingColours,
    /// All.
    Any,
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
    /// Whether markers that were missed, or are cut by the border, are looked for where a first solve predicts them.
    pub is_predicted: bool,
    /// After which turns it may look the same.
    pub turns: Turns,
}

/// What most kinds have in common.
const PLAIN: Print = Print {
    ink: Ink::Unknown,
    places: Places::LatticeById,
    needs_marker_file: false,
    has_radius: false,
    has_tags: false,
    is_predicted: false,
    turns: Turns::Never,
};

macro_rules! plate_kinds {
    ($($(#[$doc:meta])+ $kind:ident { $($field:ident: $value:expr),* $(,)? })+) => {
        /// What is printed on the plate.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
        #[serde(rename_all = "kebab-case")]
        pub enum PlateKind {
            $($(#[$doc])+ $kind,)+
        }

        impl PlateKind {
            /// The row of a kind.
            pub fn print(self) -> Print {
                match self {
                    $(Self::$kind => Print { $($field: $value,)* ..PLAIN },)+
                }
            }
        }
    };
}

plate_kinds! {
    /// Discs and annuli of several sizes whose pattern codes the position.
    CodedCircles { ink: Ink::Circles, needs_marker_file: true, is_predicted: true }
    /// A plain grid of dots.
    CircleGrid { ink: Ink::Circles, places: Places::Lattice, has_radius: true, turns: Turns::Any }
    /// A chessboard; the markers are its inner corners.
    Chessboard { ink: Ink::Squares, turns: Turns::KeepingColours }
    /// A chessboard with ArUco markers in its light squares.
    Charuco { ink: Ink::SquaresAndTags, has_tags: true }
    /// A chessboard with dots that code the place; the markers are its inner corners.
    Puzzleboard { ink: Ink::SquaresAndDots }
    /// Kalibr's grid of AprilTags; the markers are the corners of the tags.
    Aprilgrid { ink: Ink::Tags, places: Places::Lattice }
    /// OpenCV's grid of ArUco markers.
    ArucoGrid { ink: Ink::Tags, places: Places::Lattice }
    /// A single AprilTag or ArUco marker.
    Tag { ink: Ink::Tags, places: Places::Lattice }
    /// Points observed by someone else's detector.
    Points { places: Places::Anywhere, needs_marker_file: true }
}
