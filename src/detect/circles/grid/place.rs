//! The ways in which a lattice of dots can lie on a grid, and the one that explains it best.

use std::cmp::Reverse;
use std::collections::BTreeMap;

use crate::detect::circles::identity::code::MarkerCode;
use crate::detect::circles::identity::lattice::{Cell, Lattice};
use crate::detect::circles::types::Outcome;

/// Share of the grid's dots that must be seen.
const LEAST_SEEN: f64 = 0.7;

/// Classes of the cells of a lattice.
pub type Classes = BTreeMap<Cell, Option<u8>>;

/// A way to lay the lattice on the grid: quarter turns, then a shift.
#[derive(Debug, Clone, Copy)]
pub struct Laid {
    turns: u8,
    mirrored: bool,
    shift: Cell,
    /// Dots of the right size on their place.
    seen: usize,
    /// Cells of the lattice where the plate has nothing or a dot of another size.
    wrong: usize,
}

impl Laid {
    /// Column and row on the grid of a cell of the lattice.
    pub fn apply(&self, cell: Cell) -> Cell {
        let (i, j) = turned(cell, self.turns, self.mirrored);
        (i + self.shift.0, j + self.shift.1)
    }

    /// Middle of the grid on the lattice, doubled.
    fn middle(&self, size: Cell) -> Cell {
        let doubled = (size.0 - 2 * self.shift.0, size.1 - 2 * self.shift.1);
        let (i, j) = turned(doubled, (4 - self.turns) % 4, false);
        if self.mirrored { (j, i) } else { (i, j) }
    }

    /// Whether the plate has a dot of another size, or none, where `other` puts the same dot; neither is mirrored.
    pub fn is_told_from(&self, other: &Self, code: &MarkerCode, cells: &[Cell]) -> bool {
        let on_lattice =
            |cell: Cell| turned((cell.0 - self.shift.0, cell.1 - self.shift.1), (4 - self.turns) % 4, false);
        cells.iter().any(|&cell| code.class_at(cell) != code.class_at(other.apply(on_lattice(cell))))
    }

    fn score(&self) -> i64 {
        self.seen as i64 - self.wrong as i64
    }

    /// How far the plate's x axis points away from the image's right, as the cosine of the angle with its sign changed.
    pub fn lean(&self, lattice: &Lattice) -> f64 {
        let (origin, right) = (self.apply((0, 0)), [self.apply((1, 0)), self.apply((0, 1))]);
        let along = right.map(|r| f64::from(r.0 - origin.0));
        let sum: f64 = lattice.cells.values().map(|s| (0..2).map(|k| along[k] * s.basis[k][0]).sum::<f64>()).sum();
        -sum
    }
}

fn turned((i, j): Cell, turns: u8, mirrored: bool) -> Cell {
    let (i, j) = if mirrored { (j, i) } else { (i, j) };
    match turns {
        0 => (i, j),
        1 => (-j, i),
        2 => (-i, -j),
        _ => (j, -i),
    }
}

/// The ways that explain the classes of a lattice equally well, none of them mirrored, and how the identification went.
///
/// Empty where too little of the grid is seen, another part of it would do nearly as well, or only its mirror image fits.
pub(super) fn place(code: &MarkerCode, cells: &[Cell], classes: &Classes) -> (Vec<Laid>, Outcome) {
    let mut laid = ways(code, cells, classes);
    laid.sort_by_key(|l| Reverse(l.score()));
    let Some(best) = laid.first().copied().filter(|l| l.seen as f64 >= LEAST_SEEN * cells.len() as f64) else {
        return (Vec::new(), Outcome::Ambiguous);
    };
    // A shift of the grid loses a line of dots; half of the shortest line must make the difference.
    let margin = (shortest_line(cells) as i64 + 1) / 2;
    let size = extent(cells);
    let middle = best.middle(size);
    if laid.iter().take_while(|l| l.score() > best.score() - margin).any(|l| l.middle(size) != middle) {
        return (Vec::new(), Outcome::Ambiguous);
    }
    // A dot of another size in the wrong place costs four: twice a cell that is not right and counts as wrong.
    let equal = laid.iter().take_while(|l| l.score() > best.score() - 2);
    let direct: Vec<Laid> = equal.filter(|l| !l.mirrored).copied().collect();
    let Some(first) = direct.first() else { return (direct, Outcome::Mirrored) };
    let runner_up = laid.iter().find(|l| l.score() < best.score()).map_or(cells.len(), |l| l.wrong);
    let outcome = Outcome::Identified { agreeing: first.seen, disagreeing: first.wrong, runner_up };
    (direct, outcome)
}

/// All ways in which the lattice overlaps the grid.
fn ways(code: &MarkerCode, cells: &[Cell], classes: &Classes) -> Vec<Laid> {
    let size = extent(cells);
    let mut all = Vec::new();
    for (turns, mirrored) in (0..4).flat_map(|t| [(t, false), (t, true)]) {
        let found: Vec<(Cell, Option<u8>)> = classes.iter().map(|(&c, &k)| (turned(c, turns, mirrored), k)).collect();
        let range = |pick: fn(&Cell) -> i32, size: i32| {
            let low = found.iter().map(|(c, _)| pick(c)).min().unwrap_or(0);
            let high = found.iter().map(|(c, _)| pick(c)).max().unwrap_or(0);
            (-low).min(size - high)..=(-low).max(size - high)
        };
        for shift_j in range(|c| c.1, size.1) {
            for shift_i in range(|c| c.0, size.0) {
                let right = |(c, class): &&(Cell, Option<u8>)| {
                    class.is_some() && code.class_at((c.0 + shift_i, c.1 + shift_j)) == *class
                };
                let seen = found.iter().filter(right).count();
                let wrong = found.len() - seen;
                all.push(Laid { turns, mirrored, shift: (shift_i, shift_j), seen, wrong });
            }
        }
    }
    all
}

/// Largest column and row.
fn extent(cells: &[Cell]) -> Cell {
    let high = |pick: fn(&Cell) -> i32| cells.iter().map(pick).max().unwrap_or(0);
    (high(|c| c.0), high(|c| c.1))
}

/// Dots in the shortest outer line of the grid.
fn shortest_line(cells: &[Cell]) -> usize {
    let mut lines: BTreeMap<(u8, i32), usize> = BTreeMap::new();
    for (i, j) in cells {
        *lines.entry((0, *i)).or_default() += 1;
        *lines.entry((1, *j)).or_default() += 1;
    }
    lines.values().copied().min().unwrap_or(0)
}
