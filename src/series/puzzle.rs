//! PuzzleBoards: a chessboard with a dot at the middle of every edge between two squares.
//!
//! Light and dark dots are the bits of a pattern of 501 x 501 squares (Stelldinger 2024, arXiv:2409.20127), of which a board is a
//! rectangle: any 6 x 6 squares say where on the pattern they are, and how they are turned. The pattern itself comes from
//! `calib-targets-puzzleboard`, which has it from its makers.

use std::f64::consts::PI;
use std::path::Path;

use calib_targets_puzzleboard::code_maps::{horizontal_edge_bit, vertical_edge_bit};
use calib_targets_puzzleboard::{MASTER_COLS, MASTER_ROWS};
use serde::{Deserialize, Serialize};

use super::tags::Region;
use crate::error::{Code, Error, Result};

/// Diameter of a dot over the side of a square, as its makers recommend it.
const DOT_DIAMETER: f64 = 1.0 / 3.0;
/// Dots of other sizes are not read, or touch each other.
const DOT_DIAMETERS: std::ops::RangeInclusive<f64> = 0.2..=0.5;
/// Fewer corners on a side do not say which part of the pattern they are.
const LEAST_CORNERS: u32 = 7;
/// Straight pieces of half a dot.
const ARC: usize = 24;

/// Which part of the pattern a PuzzleBoard is, and how it is printed.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Puzzle {
    /// Row of the pattern at the top of the board.
    pub origin_row: u32,
    /// Column of the pattern at the left of the board.
    pub origin_col: u32,
    /// Diameter of a dot over the side of a square.
    pub dot_diameter_rel: f64,
}

/// Two neighbouring corners: where the second one is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Next {
    /// To the right.
    Right,
    /// Below.
    Below,
}

impl Puzzle {
    /// The board that these keys of plate.toml describe, with so many inner corners.
    ///
    /// # Errors
    /// A board that is too small to be read or not within the pattern; dots of an impossible size.
    pub(super) fn new(
        path: &Path,
        [columns, rows]: [u32; 2],
        [origin_col, origin_row]: [Option<u32>; 2],
        dot_diameter_rel: Option<f64>,
    ) -> Result<Self> {
        let (origin_row, origin_col) = (origin_row.unwrap_or(0), origin_col.unwrap_or(0));
        let dot_diameter_rel = dot_diameter_rel.unwrap_or(DOT_DIAMETER);
        let refuse = |what: String, remedy: &str| Err(Error::new(Code::SettingRange, path.display(), what, remedy));
        if columns.min(rows) < LEAST_CORNERS {
            let what = format!("a puzzleboard of {columns} x {rows} inner corners");
            return refuse(
                what,
                "print at least 7 x 7 inner corners: fewer do not tell which part of the pattern they are",
            );
        }
        let beyond = |origin: u32, corners: u32, all: u32| origin.saturating_add(corners + 1) > all;
        if beyond(origin_row, rows, MASTER_ROWS) || beyond(origin_col, columns, MASTER_COLS) {
            let what = format!("origin_row = {origin_row}, origin_col = {origin_col} put the board beyond the pattern");
            return refuse(what, "the pattern has 501 x 501 squares; count both from 0");
        }
        if !DOT_DIAMETERS.contains(&dot_diameter_rel) {
            let what = format!("dot_diameter_rel = {dot_diameter_rel}");
            return refuse(what, "give the diameter of a dot over the side of a square, 0.2 to 0.5 (usual: one third)");
        }
        Ok(Self { origin_row, origin_col, dot_diameter_rel })
    }

    /// Whether the square at the top-left is light.
    pub fn is_light_first(&self) -> bool {
        (self.origin_row + self.origin_col) % 2 == 1
    }

    /// Whether the dot between an inner corner (column and row, counted from 0 at the top-left) and the next is light. Where squares end
    /// at the outline, one of the two corners is -1 or the number of them.
    pub fn is_light(&self, [column, row]: [i32; 2], next: Next) -> bool {
        let at = |origin: u32, k: i32| i32::try_from(origin).unwrap_or(0) + k;
        let bit = match next {
            Next::Right => horizontal_edge_bit(at(self.origin_row, row), at(self.origin_col, column + 1)),
            Next::Below => vertical_edge_bit(at(self.origin_row, row + 1), at(self.origin_col, column)),
        };
        bit == 1
    }

    /// The dark squares around the inner corners, with their share of the dots.
    pub(super) fn regions(&self, [columns, rows]: [u32; 2], pitch_m: f64) -> Vec<Region> {
        let light = u32::from(self.is_light_first());
        let squares = (0..=rows).flat_map(|row| (0..=columns).map(move |column| [column, row]));
        let dark = squares.filter(|[column, row]| (column + row + light).is_multiple_of(2));
        dark.map(|square| vec![self.outline(square, [columns, rows], pitch_m)]).collect()
    }

    /// Outline of a dark square: dark dots bulge out of it, light ones into it.
    fn outline(&self, [column, row]: [u32; 2], [columns, rows]: [u32; 2], pitch_m: f64) -> Vec<[f64; 2]> {
        let at = |k: u32, n: u32| (f64::from(k) - f64::from(n) / 2.0) * pitch_m;
        let [x, y] = [at(column, columns), -at(row, rows)];
        let (h, radius) = (pitch_m / 2.0, self.dot_diameter_rel * pitch_m / 2.0);
        let corner = [column, row].map(|k| i32::try_from(k).unwrap_or(i32::MAX));
        let [right, below] = corner;
        // Direction and outward normal of each side, counter-clockwise from the bottom, and its dot where another square follows.
        let sides = [
            ([1.0, 0.0], [0.0, -1.0], (row < rows).then_some(([right - 1, below], Next::Right))),
            ([0.0, 1.0], [1.0, 0.0], (column < columns).then_some(([right, below - 1], Next::Below))),
            ([-1.0, 0.0], [0.0, 1.0], (row > 0).then_some(([right - 1, below - 1], Next::Right))),
            ([0.0, -1.0], [-1.0, 0.0], (column > 0).then_some(([right - 1, below - 1], Next::Below))),
        ];
        let mut outline = Vec::new();
        for (along, out, dot) in sides {
            let point = |t: f64, s: f64| {
                [x + h * out[0] + t * along[0] + s * out[0], y + h * out[1] + t * along[1] + s * out[1]]
            };
            outline.push(point(-h, 0.0));
            let Some((corner, next)) = dot else { continue };
            let bulge = if self.is_light(corner, next) { -radius } else { radius };
            outline.extend((0..=ARC).map(|k| {
                let (sin, cos) = (PI * k as f64 / ARC as f64).sin_cos();
                point(-radius * cos, bulge * sin)
            }));
        }
        outline
    }
}
