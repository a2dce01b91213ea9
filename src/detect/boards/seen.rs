//! How large the chessboard in a picture is, whatever the plate file says.
//!
//! The squares go on as long as the cells of a further line alternate in their two colours, and end in view where they do not.

use super::labels::{Line, Shader, bounds, parity};
use crate::detect::corners::lattice::{BoardSize, Lattice};
use crate::detect::size_seen::{Counted, end_to_end, other_size};
use crate::error::Error;

/// Lines beyond the corners that were found at which the squares are looked for.
const REACH: i32 = 8;
/// Mean agreement with the two colours of squares of a board.
pub const SQUARES: f64 = 0.5;
/// Share of a line that must be in view.
const IN_VIEW: f64 = 0.5;

/// Least and largest coordinate of inner corners along u and v.
pub type Range = [[i32; 2]; 2];

/// What lies beyond the last corners of one side.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Beyond {
    Squares,
    /// The board ends: paper, or what it is fixed to.
    Nothing,
    /// The border of the picture, or something that is neither.
    Unclear,
}

/// The part of the lattice that is a board.
#[derive(Debug, Clone, Copy)]
pub struct BoardSeen {
    range: Range,
    /// Whether it ends there in view.
    ends: [[bool; 2]; 2],
}

impl BoardSeen {
    /// `None` where the lattice does not have the colours of a board.
    pub fn of(shader: &Shader) -> Option<Self> {
        let range = trimmed(shader.lattice())?;
        let even = even_cells(shader, range).filter(|mean| mean.abs() >= SQUARES)?.signum();
        let (range, ends) = followed(range, |range, axis, end| beyond(shader, even, range, axis, end));
        Some(Self { range, ends })
    }

    /// Inner corners along u and v, where all ends are in view.
    pub fn size(&self) -> Option<[u32; 2]> {
        Some([self.along(0)?, self.along(1)?])
    }

    /// Inner corners along u and v, each where both ends are in view.
    pub fn lines(&self) -> [Option<u32>; 2] {
        [self.along(0), self.along(1)]
    }

    /// Whether it has the size of a board, with all ends in view.
    pub fn is(&self, board: BoardSize) -> bool {
        let [columns, rows] = [board.columns, board.rows].map(i32::unsigned_abs);
        self.size().is_some_and(|size| size == [columns, rows] || size == [rows, columns])
    }

    /// Why it is not the board of the plate file; `None` where it may be.
    pub fn contradiction(&self, board: BoardSize) -> Option<Error> {
        let stated = [board.columns, board.rows].map(i32::unsigned_abs);
        match (self.size(), self.along(0).or(self.along(1))) {
            _ if self.is(board) => None,
            (Some(size), _) => Some(other_size(Counted::InnerCorners, size, stated)),
            (None, Some(one)) if !stated.contains(&one) => Some(end_to_end(Counted::InnerCorners, one, stated)),
            _ => None,
        }
    }

    fn along(&self, axis: usize) -> Option<u32> {
        let [low, high] = self.range[axis];
        (self.ends[axis] == [true; 2]).then_some((high - low + 1).unsigned_abs())
    }
}

/// The range with lines up to the end of the squares, and whether they end there, as `beyond(range, axis, end)` tells of each next line.
pub fn followed(mut range: Range, beyond: impl Fn(&Range, usize, usize) -> Beyond) -> (Range, [[bool; 2]; 2]) {
    let mut ends = [[false; 2]; 2];
    for (axis, end) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
        for _ in 1..REACH {
            match beyond(&range, axis, end) {
                Beyond::Squares => range[axis][end] += if end == 0 { -1 } else { 1 },
                side => {
                    ends[axis][end] = side == Beyond::Nothing;
                    break;
                }
            }
        }
    }
    (range, ends)
}

/// The next line of cells after the squares around the last corners; `even`: shade of the cells with an even sum.
fn beyond(shader: &Shader, even: f64, range: &Range, axis: usize, end: usize) -> Beyond {
    let at = if end == 0 { range[axis][0] - 2 } else { range[axis][1] + 1 };
    let [low, high] = range[1 - axis];
    match shader.line([axis, end], at, low - 1..=high) {
        Some((_, _, count)) if (count as f64) < IN_VIEW * f64::from(high - low + 2) => Beyond::Unclear,
        Some((Line::Squares, alternating, _)) if even * alternating >= SQUARES => Beyond::Squares,
        Some((Line::Paper | Line::Covered, ..)) => Beyond::Nothing,
        _ => Beyond::Unclear,
    }
}

/// Mean shade of the squares between the corners, those with an odd sum with the other sign.
pub(super) fn even_cells(shader: &Shader, [[u0, u1], [v0, v1]]: Range) -> Option<f64> {
    let cells = (v0..v1).flat_map(|v| (u0..u1).map(move |u| (u, v)));
    let seen: Vec<f64> = cells.filter_map(|(u, v)| Some(parity(u, v) * shader.at((u, v), [0.5; 2])?)).collect();
    (!seen.is_empty()).then(|| seen.iter().sum::<f64>() / seen.len() as f64)
}

/// The corners without outer lines of which less than half is there.
pub fn trimmed(lattice: &Lattice) -> Option<Range> {
    let (low, high) = bounds(lattice)?;
    let mut range = [[low.0, high.0], [low.1, high.1]];
    loop {
        let thin = [(0, 0), (0, 1), (1, 0), (1, 1)].into_iter().find(|&(axis, end)| {
            let [from, to] = range[1 - axis];
            let at = range[axis][end];
            let key = |other| if axis == 0 { (at, other) } else { (other, at) };
            2 * (from..=to).filter(|other| lattice.contains_key(&key(*other))).count() < (to - from + 1) as usize
        });
        let Some((axis, end)) = thin else { return Some(range) };
        range[axis][end] += if end == 0 { 1 } else { -1 };
        if range[axis][0] >= range[axis][1] {
            return None;
        }
    }
}
