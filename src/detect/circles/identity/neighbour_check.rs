//! Second thoughts about an identified lattice: every marker must agree with the plate and with its neighbours.

use std::collections::BTreeMap;

use super::code::MarkerCode;
use super::lattice::Cell;
use super::local_map::LocalMap;
use crate::detect::circles::candidates::candidate::Candidate;
use crate::detect::circles::types::Reason;

/// A candidate on a cell of the plate.
#[derive(Debug, Clone, Copy)]
pub struct Placed {
    pub candidate: usize,
    /// Its class as seen.
    pub class: Option<u8>,
}

/// Candidates by cell (column, row) of the plate.
pub type Board = BTreeMap<Cell, Placed>;

/// Removes the cells that cannot be trusted, with the reason for each.
pub fn check_neighbours(board: &mut Board, code: &MarkerCode, candidates: &[Candidate]) -> Vec<(Cell, usize, Reason)> {
    let mut dropped = Vec::new();
    let judge = |board: &mut Board, verdict: &dyn Fn(&Board, Cell, &Placed) -> Option<Reason>, dropped: &mut Vec<_>| {
        let bad: Vec<(Cell, usize, Reason)> =
            board.iter().filter_map(|(c, p)| verdict(board, *c, p).map(|r| (*c, p.candidate, r))).collect();
        for entry in bad {
            board.remove(&entry.0);
            dropped.push(entry);
        }
    };
    let out_of_place = |board: &Board, cell: Cell, p: &Placed| {
        let (map, tolerance) = neighbourhood(board, cell, candidates)?;
        let (expected, seen) = (map.at([0.0, 0.0]), candidates[p.candidate].ellipse.centre);
        let off = (seen[0] - expected[0]).hypot(seen[1] - expected[1]);
        (off > tolerance * map.shorter_step() + 0.5).then_some(Reason::OutOfPlace)
    };
    judge(board, &|_, cell, _| code.marker_at(cell).is_none().then_some(Reason::OffPlate), &mut dropped);
    // what goes takes its word for the others with it
    loop {
        let before = dropped.len();
        judge(board, &|board, cell, _| disputed(board, cell, code).then_some(Reason::NeighboursDisagree), &mut dropped);
        judge(board, &|_, cell, p| (p.class != code.class_at(cell)).then_some(Reason::WrongClass), &mut dropped);
        judge(board, &out_of_place, &mut dropped);
        if dropped.len() == before {
            return dropped;
        }
    }
}

/// Too few of the markers around have the class of their cell: the lattice has slipped here.
fn disputed(board: &Board, cell: Cell, code: &MarkerCode) -> bool {
    let (mut agree, mut differ) = (0, 0);
    for (c, p) in around(board, cell, 2).filter(|(c, _)| *c != cell) {
        match p.class {
            Some(k) if code.class_at(c) == Some(k) => agree += 1,
            Some(_) => differ += 1,
            None => {}
        }
    }
    agree < 3 || 3 * differ > agree
}

/// The cells of a square window.
pub fn around(board: &Board, cell: Cell, reach: i32) -> impl Iterator<Item = (Cell, &Placed)> {
    let column = move |i: i32| board.range((cell.0 + i, cell.1 - reach)..=(cell.0 + i, cell.1 + reach));
    (-reach..=reach).flat_map(column).map(|(c, p)| (*c, p))
}

/// Pairs (offset from a cell, place in the image) of the markers at most `reach` from it, without itself.
fn pairs(board: &Board, cell: Cell, reach: i32, candidates: &[Candidate]) -> Vec<([f64; 2], [f64; 2])> {
    around(board, cell, reach)
        .filter(|(c, _)| *c != cell)
        .map(|(c, p)| ([f64::from(c.0 - cell.0), f64::from(c.1 - cell.1)], candidates[p.candidate].ellipse.centre))
        .collect()
}

/// Markers that a projective map is extrapolated from, and how far from the place they may be to carry on a lattice over a gap.
const EXTRAPOLATE: usize = 9;
const FARTHEST: i32 = 6;

/// Map around a cell from its neighbours without itself, and how far (in pitches) it may be off: the eight direct
/// neighbours interpolate closely, fewer or one-sided ones extrapolate.
pub fn neighbourhood(board: &Board, cell: Cell, candidates: &[Candidate]) -> Option<(LocalMap, f64)> {
    let pairs = |reach: i32| pairs(board, cell, reach, candidates);
    let close = pairs(1);
    if close.len() == 8 {
        return LocalMap::fit(&close).map(|m| (m, 0.08));
    }
    let wide = pairs(3);
    let beyond = if wide.len() >= EXTRAPOLATE { LocalMap::beyond(&wide) } else { None };
    beyond.or_else(|| LocalMap::fit(&pairs(2))).map(|m| (m, 0.25))
}

/// Map around a cell from the nearest markers, which may all lie beyond a gap.
pub fn continuation(board: &Board, cell: Cell, candidates: &[Candidate]) -> Option<LocalMap> {
    let near = (2..=FARTHEST).map(|reach| pairs(board, cell, reach, candidates)).find(|p| p.len() >= 2 * EXTRAPOLATE);
    let near = near.unwrap_or_else(|| pairs(board, cell, FARTHEST, candidates));
    if near.len() >= EXTRAPOLATE { LocalMap::projective(&near) } else { None }
}
