//! A lattice of corners, and which rectangle of it is the board.

use std::collections::BTreeMap;

/// Number of inner corners of the board.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct BoardSize {
    pub columns: i32,
    pub rows: i32,
}

impl BoardSize {
    /// Whether an inner corner of this column and row is on the board.
    pub fn contains(self, (column, row): (i32, i32)) -> bool {
        (0..self.columns).contains(&column) && (0..self.rows).contains(&row)
    }

    /// Quarter turns and colours of the first square (whether light) under which the board may be seen.
    ///
    /// With an odd and an even number of columns and rows the first square is dark, which settles the turn; else half a turn keeps the
    /// colours, and boards of both colours are printed. A square board with odd numbers has dark and light corners.
    pub(in crate::detect) fn looks(self) -> impl Iterator<Item = (u8, bool)> {
        let odd = |n: i32| n % 2 == 1;
        let fixed = odd(self.columns) != odd(self.rows) || (odd(self.rows) && self.columns == self.rows);
        (0..4).flat_map(move |turns| {
            [false, true].into_iter().take(if fixed { 1 } else { 2 }).map(move |light| (turns, light))
        })
    }
}

/// Corners in pixels by lattice coordinates (u to the right, v down).
pub type Lattice = BTreeMap<(i32, i32), [f64; 2]>;

/// Which rectangle of the lattice is the board, and how it is turned there.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Placement {
    pub(in crate::detect) board: BoardSize,
    /// Quarter turns of the board in the image.
    pub(in crate::detect) turns: u8,
    /// Whether the board's first square is light.
    pub(in crate::detect) light_first: bool,
    /// Least lattice coordinates of the board's corners.
    pub(in crate::detect) origin: (i32, i32),
}

impl Placement {
    /// Lattice coordinates that are board coordinates already; the first square may be light.
    pub fn on_board(board: BoardSize, light_first: bool) -> Self {
        Self { board, turns: 0, light_first, origin: (0, 0) }
    }

    /// All placements of a board around the corners with these least and largest coordinates along u and v.
    pub fn around(board: BoardSize, [u, v]: [[i32; 2]; 2]) -> impl Iterator<Item = Self> {
        board.looks().flat_map(move |(turns, light_first)| {
            let at = move |origin| Self { board, turns, light_first, origin };
            let (width, height) = at((0, 0)).extent();
            (v[1] - height + 1..=v[0]).flat_map(move |v0| (u[1] - width + 1..=u[0]).map(move |u0| at((u0, v0))))
        })
    }

    /// Least and largest coordinate of the board's corners along u and v.
    pub fn range(self) -> [[i32; 2]; 2] {
        let ((u, v), (width, height)) = (self.origin, self.extent());
        [[u, u + width - 1], [v, v + height - 1]]
    }

    /// Quarter turns away from upright.
    pub fn tilt(self) -> u8 {
        self.turns.min(4 - self.turns)
    }

    /// Extent of the board along u and v.
    pub(in crate::detect) fn extent(self) -> (i32, i32) {
        let BoardSize { columns, rows } = self.board;
        if self.turns.is_multiple_of(2) { (columns, rows) } else { (rows, columns) }
    }

    /// Board coordinates (column, row) of a lattice corner, also off the board.
    pub(in crate::detect) fn board_from_lattice(self, (u, v): (i32, i32)) -> (i32, i32) {
        let BoardSize { columns, rows } = self.board;
        let (a, b) = (u - self.origin.0, v - self.origin.1);
        match self.turns % 4 {
            0 => (a, b),
            1 => (b, rows - 1 - a),
            2 => (columns - 1 - a, rows - 1 - b),
            _ => (columns - 1 - b, a),
        }
    }

    /// Marker id of a lattice corner; `None` off the board.
    pub fn id(self, lattice: (i32, i32)) -> Option<u32> {
        let (column, row) = self.board_from_lattice(lattice);
        self.board.contains((column, row)).then(|| u32::try_from(row * self.board.columns + column).ok()).flatten()
    }

    /// Lattice coordinates of all corners of the board.
    pub fn corners(self) -> impl Iterator<Item = (i32, i32)> {
        let ((u0, v0), (width, height)) = (self.origin, self.extent());
        (v0..v0 + height).flat_map(move |v| (u0..u0 + width).map(move |u| (u, v)))
    }

    /// Lattice coordinates of the lines of corners, from each of the four sides inwards.
    pub fn lines_inwards(self) -> [Vec<Vec<(i32, i32)>>; 4] {
        let ((u0, v0), (width, height)) = (self.origin, self.extent());
        let row = |v: i32| (u0..u0 + width).map(|u| (u, v)).collect();
        let column = |u: i32| (v0..v0 + height).map(|v| (u, v)).collect();
        [
            (v0..v0 + height).map(row).collect(),
            (v0..v0 + height).rev().map(row).collect(),
            (u0..u0 + width).map(column).collect(),
            (u0..u0 + width).rev().map(column).collect(),
        ]
    }

    /// Whether the square whose corners of least u and v is `cell` is dark.
    pub fn is_dark(self, (u, v): (i32, i32)) -> bool {
        let (a, b) = (self.board_from_lattice((u, v)), self.board_from_lattice((u + 1, v + 1)));
        ((a.0.min(b.0) + a.1.min(b.1)).rem_euclid(2) == 0) != self.light_first
    }

    /// Lattice cells of all squares of the board.
    pub(in crate::detect) fn squares(self) -> impl Iterator<Item = (i32, i32)> {
        let ((u0, v0), (width, height)) = (self.origin, self.extent());
        (v0 - 1..v0 + height).flat_map(move |v| (u0 - 1..u0 + width).map(move |u| (u, v)))
    }
}
