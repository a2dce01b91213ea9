//! Plain grids of dots: symmetric, asymmetric (every other row shifted by half a step), or with larger dots that tell
//! the orientation.
//!
//! Such a grid carries no code beyond its outline and the sizes of its dots, so all of it must be in view. The markers
//! lie on a square lattice, along the axes or (asymmetric) along the diagonals; the lattice found in the picture is laid
//! on them in all four rotations, and the one that leaves the fewest cells unexplained wins.

use std::collections::{BTreeMap, BTreeSet};

use super::candidate::Candidate;
use super::code::MarkerCode;
use super::lattice::{Cell, Lattice};
use super::neighbour_check::{Board, Placed};
use super::pipeline::detect_coded;
use super::types::{Options, Outcome};
use crate::detect::{Detection, Picture};
use crate::error::{Code, Error, Notice, Result};
use crate::series::Plate;

/// How far a marker may be from its place on the lattice, in steps.
const OFF_LATTICE: f64 = 0.2;
/// Share of the grid's dots that must be seen.
const LEAST_SEEN: f64 = 0.7;

/// Finds the dots of a plain grid in one picture.
///
/// Observations are area centroids with covariance, as for coded circles. Ids are those of the plate's markers.
///
/// # Errors
/// Markers that do not lie on a square lattice or have no radius. No grid in the picture, not all of it, or a mirrored one where
/// the dots show it (a grid without larger dots is mostly its own mirror image): see [`Detection::failure`].
pub fn detect_grid(picture: &Picture, plate: &Plate, options: &Options) -> Result<Detection> {
    let (cells, step_m) = cells(plate).ok_or_else(no_lattice)?;
    let code = MarkerCode::of_cells(plate, &cells, step_m).ok_or_else(no_lattice)?;
    let mut symmetric = false;
    let on_lattice = Plate { pitch_m: step_m, ..plate.clone() };
    let found = detect_coded(picture, &on_lattice, options, &code, |lattices, candidates| {
        let Some(lattice) = lattices.first() else {
            let outcome = if candidates.is_empty() { Outcome::NoCandidates } else { Outcome::NoLattice };
            return Ok((Board::new(), outcome));
        };
        let (board, outcome, turned) = place(&code, &cells, lattice, candidates);
        symmetric = turned;
        Ok((board, outcome))
    })?;
    let mut detection = Detection::from(found);
    if symmetric {
        detection.notices.push(symmetric_notice());
    }
    Ok(detection)
}

/// Cells of all markers (in their order) on the square lattice of the plate, rows downwards, and its step in m.
fn cells(plate: &Plate) -> Option<(Vec<Cell>, f64)> {
    let first = plate.markers.first()?.position_m;
    let distance = |k: usize| (plate.markers[k].position_m - first).norm();
    let step = (1..plate.markers.len()).map(distance).fold(f64::INFINITY, f64::min);
    let half = 0.5_f64.sqrt();
    for axes in [[[1.0, 0.0], [0.0, -1.0]], [[half, -half], [-half, -half]]] {
        let along = |axis: [f64; 2], k: usize| {
            let d = plate.markers[k].position_m - first;
            (axis[0] * d.x + axis[1] * d.y) / step
        };
        let found: Option<Vec<Cell>> = (0..plate.markers.len())
            .map(|k| {
                let [x, y] = axes.map(|axis| along(axis, k));
                let near = (x - x.round()).hypot(y - y.round()) < OFF_LATTICE;
                near.then(|| (x.round() as i32, y.round() as i32))
            })
            .collect();
        if let Some(found) = found
            && found.iter().collect::<BTreeSet<_>>().len() == found.len()
        {
            let low = [found.iter().map(|c| c.0).min()?, found.iter().map(|c| c.1).min()?];
            return Some((found.iter().map(|c| (c.0 - low[0], c.1 - low[1])).collect(), step));
        }
    }
    None
}

/// A way to lay the lattice on the grid: quarter turns, then a shift.
#[derive(Debug, Clone, Copy)]
struct Laid {
    turns: u8,
    mirrored: bool,
    shift: Cell,
    /// Dots of the right size on their place.
    seen: usize,
    /// Cells of the lattice where the plate has nothing or a dot of another size.
    wrong: usize,
}

impl Laid {
    fn apply(&self, cell: Cell) -> Cell {
        let (i, j) = turned(cell, self.turns, self.mirrored);
        (i + self.shift.0, j + self.shift.1)
    }

    /// Middle of the grid on the lattice, doubled.
    fn middle(&self, cells: &[Cell]) -> Cell {
        let size = extent(cells);
        let doubled = (size.0 - 2 * self.shift.0, size.1 - 2 * self.shift.1);
        let (i, j) = turned(doubled, (4 - self.turns) % 4, false);
        if self.mirrored { (j, i) } else { (i, j) }
    }

    fn score(&self) -> i64 {
        self.seen as i64 - self.wrong as i64
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

/// Puts the lattice on the grid; true where the grid looks the same after a turn.
fn place(code: &MarkerCode, cells: &[Cell], lattice: &Lattice, candidates: &[Candidate]) -> (Board, Outcome, bool) {
    let classes = code.classes_of(lattice, candidates);
    let mut laid = ways(code, cells, &classes);
    laid.sort_by_key(|l| std::cmp::Reverse(l.score()));
    let Some(best) = laid.first().copied() else { return (Board::new(), Outcome::Ambiguous, false) };
    if (best.seen as f64) < LEAST_SEEN * cells.len() as f64 {
        return (Board::new(), Outcome::Ambiguous, false);
    }
    // A shift of the grid loses a line of dots; half of the shortest line must make the difference.
    let margin = (shortest_line(cells) as i64 + 1) / 2;
    let middle = best.middle(cells);
    if laid.iter().take_while(|l| l.score() > best.score() - margin).any(|l| l.middle(cells) != middle) {
        return (Board::new(), Outcome::Ambiguous, false);
    }
    // A dot of another size in the wrong place costs four: twice a cell that is not right and counts as wrong.
    let equal = laid.iter().take_while(|l| l.score() > best.score() - 2);
    let direct: Vec<&Laid> = equal.filter(|l| !l.mirrored).collect();
    let upright = direct.iter().min_by(|a, b| lean(a, lattice).total_cmp(&lean(b, lattice)));
    let Some(chosen) = upright.map(|l| **l) else {
        return (Board::new(), Outcome::Mirrored, false);
    };
    let board: Board = lattice
        .cells
        .iter()
        .map(|(cell, site)| {
            let class = classes.get(cell).copied().flatten();
            (chosen.apply(*cell), Placed { candidate: site.candidate, class })
        })
        .collect();
    let runner_up = laid.iter().find(|l| l.score() < best.score()).map_or(cells.len(), |l| l.wrong);
    let outcome = Outcome::Identified { agreeing: chosen.seen, disagreeing: chosen.wrong, runner_up };
    (board, outcome, direct.len() > 1)
}

/// All ways in which the lattice overlaps the grid.
fn ways(code: &MarkerCode, cells: &[Cell], classes: &BTreeMap<Cell, Option<u8>>) -> Vec<Laid> {
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

/// How far the plate's x axis points away from the image's right, as the cosine of the angle with its sign changed.
fn lean(laid: &Laid, lattice: &Lattice) -> f64 {
    let (origin, right) = (laid.apply((0, 0)), [laid.apply((1, 0)), laid.apply((0, 1))]);
    let along = right.map(|r| f64::from(r.0 - origin.0));
    let sum: f64 = lattice.cells.values().map(|s| (0..2).map(|k| along[k] * s.basis[k][0]).sum::<f64>()).sum();
    -sum
}

fn no_lattice() -> Error {
    Error::new(
        Code::PlateNotDetectable,
        "plate",
        "the markers do not lie on a square lattice of circles with a radius",
        "check positions and radii in the plate file: a symmetric grid, or every other row shifted by half a step",
    )
}

fn symmetric_notice() -> Notice {
    Notice::new(
        Code::PlateSymmetric,
        "plate",
        "the grid of dots looks the same after a turn; ids assume that its top is up in the image",
        "keep the camera within 90 degrees of upright, or use an asymmetric grid or one with a larger dot",
    )
}
