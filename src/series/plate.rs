//! The plate: what was printed, nominally.
//!
//! Plate frame: right-handed, origin at the plate's centre; looking at the printed face x is right, y is up,
//! z comes out of the plate. Ids are row-major from the top-left.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use super::plate_kind::PlateKind;
use super::puzzle::Puzzle;
use super::tags::Tags;

/// One marker in the plate frame.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Marker {
    /// Identity.
    pub id: u32,
    /// Nominal centre in the plate frame, m.
    pub position_m: Vector3<f64>,
    /// Radius of the outer circle, m; 0 for a point.
    pub outer_radius_m: f64,
    /// Radius of the inner circle, m; 0 for a disc.
    pub inner_radius_m: f64,
    /// Prior sigma of the centre per axis, m; the plate's tolerance where none is stated.
    pub sigma_m: f64,
}

/// A measured distance between two markers: the only absolute length.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ScaleBar {
    /// Marker id at one end.
    pub from: u32,
    /// Marker id at the other end.
    pub to: u32,
    /// Measured distance, m.
    pub distance_m: f64,
    /// Its standard deviation, m.
    pub sigma_m: f64,
}

/// The ArUco markers of a ChArUco board; ids count up row by row, as OpenCV prints them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Aruco {
    /// Name of the dictionary as OpenCV spells it, such as `DICT_4X4_50`.
    pub dictionary: String,
    /// Side of a marker with its black border, m.
    pub side_m: f64,
    /// OpenCV's layout before 4.6 (`setLegacyPattern` since): with an even number of rows of squares the first one is light and has
    /// marker 0. With an odd number both layouts are the same.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub legacy: bool,
    /// Number of the first marker in the dictionary: boards that share one begin elsewhere.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub first_id: u32,
}

fn is_zero(number: &u32) -> bool {
    *number == 0
}

/// A plate of markers as designed (or as corrected by an earlier calibration).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Plate {
    /// What it is called, where that is stated: a plate of another name is another plate, however alike they are.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
    /// What is printed.
    pub kind: PlateKind,
    /// Markers in a row (inner corners of a chessboard).
    pub columns: u32,
    /// Number of rows.
    pub rows: u32,
    /// Distance of neighbouring markers, m.
    pub pitch_m: f64,
    /// Prior sigma of a marker coordinate, m.
    pub tolerance_m: f64,
    /// What is printed in the light squares of a ChArUco board; the detector looks for it where it is not stated.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub aruco: Option<Aruco>,
    /// The tags of a plate of them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tags: Option<Tags>,
    /// Which part of the pattern a PuzzleBoard is.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub puzzle: Option<Puzzle>,
    /// Ids of the dots of a grid that are larger than most, or ringed; the detector finds them where none is stated.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub large: Vec<u32>,
    /// Measured distance, if any.
    pub scale: Option<ScaleBar>,
    /// All markers, in the order of their ids.
    pub markers: Vec<Marker>,
}

impl Plate {
    /// Index in `markers` of a marker id.
    pub fn index_of(&self, id: u32) -> Option<usize> {
        self.markers.binary_search_by_key(&id, |m| m.id).ok()
    }

    /// Makes a lattice an asymmetric one as OpenCV has it: rows are a pitch apart, the dots of a row two, and those of every other
    /// row are a pitch further to the right; the origin stays at the centre.
    pub(super) fn shift_rows(&mut self) {
        let middle = f64::from(self.columns) - 0.5;
        for marker in &mut self.markers {
            let (column, row) = (marker.id % self.columns, marker.id / self.columns);
            marker.position_m.x = (f64::from(2 * column + row % 2) - middle) * self.pitch_m;
        }
    }

    /// The rows are those of [`Plate::shift_rows`].
    pub(super) fn has_shifted_rows(&self) -> bool {
        let x = |index: Option<usize>| index.map(|k| self.markers[k].position_m.x);
        let first = x(self.index_of(0));
        let [next, below] = [1, self.columns].map(|id| Some(x(self.index_of(id))? - first?));
        let near = |seen: Option<f64>, pitches: f64| seen.is_some_and(|d| (d / self.pitch_m - pitches).abs() < 0.25);
        near(next, 2.0) && near(below, 1.0)
    }

    /// No plate: nothing is seen of it.
    pub fn none() -> Self {
        Self::lattice(PlateKind::Points, 0, 0, 0.0, 0.0)
    }

    /// A regular lattice of points, ids row-major from the top-left, origin at the centre.
    pub fn lattice(kind: PlateKind, columns: u32, rows: u32, pitch_m: f64, tolerance_m: f64) -> Self {
        let centre = |n: u32| (f64::from(n) - 1.0) / 2.0;
        let markers = (0..columns * rows)
            .map(|id| Marker {
                id,
                position_m: Vector3::new(
                    (f64::from(id % columns) - centre(columns)) * pitch_m,
                    (centre(rows) - f64::from(id / columns)) * pitch_m,
                    0.0,
                ),
                outer_radius_m: 0.0,
                inner_radius_m: 0.0,
                sigma_m: tolerance_m,
            })
            .collect();
        Self { markers, ..Self::without_markers(kind, [columns, rows], pitch_m, tolerance_m) }
    }

    /// A plate whose markers are told elsewhere.
    pub(super) fn without_markers(kind: PlateKind, [columns, rows]: [u32; 2], pitch_m: f64, tolerance_m: f64) -> Self {
        Self {
            name: None,
            kind,
            columns,
            rows,
            pitch_m,
            tolerance_m,
            aruco: None,
            tags: None,
            puzzle: None,
            large: Vec::new(),
            scale: None,
            markers: Vec::new(),
        }
    }
}
