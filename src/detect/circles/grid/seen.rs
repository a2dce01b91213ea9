//! How large the grid of dots in a picture is, whatever the plate file says.

use std::collections::{BTreeMap, BTreeSet};

use crate::detect::circles::candidates::candidate::Candidate;
use crate::detect::circles::identity::lattice::{Cell, Lattice, Site};
use crate::detect::shared::{LEAST_IN_VIEW, MISSING};
use crate::detect::{Outline, Picture};

/// Share of its dots that a grid must show to count as one, and share of the lattice that must belong to it: letters beside it may, too.
const FILLED: f64 = 0.9;
const OF_LATTICE: f64 = 0.7;
/// Share of a line that must be there, or in view.
const MOST: f64 = 0.5;

/// Lines of dots one way and the other.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Shape {
    /// Every other row is shifted: the lines are the diagonals of the lattice, with every other place empty.
    pub asymmetric: bool,
    pub lines: [i32; 2],
}

impl Shape {
    pub fn is_as(self, other: Self) -> bool {
        let [a, b] = other.lines;
        self.asymmetric == other.asymmetric && (self.lines == [a, b] || self.lines == [b, a])
    }

    /// Columns and rows as a plate file states them, in either order where the dots leave it open; `None` where no plate file can.
    pub fn columns_and_rows(self) -> Option<[u32; 2]> {
        let [a, b] = self.lines.map(i32::unsigned_abs);
        match (self.asymmetric, a % 2, b % 2) {
            (false, ..) => Some([a, b]),
            // the dots of a row are two steps apart
            (true, 0, _) => Some([a / 2, b]),
            (true, _, 0) => Some([b / 2, a]),
            _ => None,
        }
    }
}

/// The shape that cells make, and the part of the lattice that is in it.
#[derive(Debug, Clone, Copy)]
pub struct Extent {
    pub shape: Shape,
    low: [i32; 2],
}

impl Extent {
    /// `None` where too many places of the shape are empty.
    pub fn of(cells: impl Iterator<Item = Cell> + Clone) -> Option<Self> {
        let shapes = [false, true].into_iter().filter_map(|asymmetric| Self::among(cells.clone(), asymmetric));
        shapes.max_by_key(|(dots, _)| *dots).map(|(_, extent)| extent)
    }

    /// With the number of its dots.
    fn among(cells: impl Iterator<Item = Cell>, asymmetric: bool) -> Option<(usize, Self)> {
        let places: BTreeSet<[i32; 2]> = cells.map(|cell| on_lines(cell, asymmetric)).collect();
        let range = trimmed(&places)?;
        let lines = range.map(|[low, high]| high - low + 1);
        let inside = |p: &&[i32; 2]| (0..2).all(|a| (range[a][0]..=range[a][1]).contains(&p[a]));
        let dots = places.iter().filter(inside).count();
        let wanted = f64::from(lines[0] * lines[1]) / if asymmetric { 2.0 } else { 1.0 };
        let filled = dots as f64 >= (FILLED * wanted).max(OF_LATTICE * places.len() as f64);
        let extent = Self { shape: Shape { asymmetric, lines }, low: [range[0][0], range[1][0]] };
        (filled && lines[0].min(lines[1]) > 1).then_some((dots, extent))
    }

    /// The cells of the outer lines of the shape, and of the next lines beyond them.
    pub fn sides(&self, beyond: bool) -> [Vec<Cell>; 4] {
        let out = i32::from(beyond);
        let line = |axis: usize, at: i32| {
            let all = (0..self.shape.lines[1 - axis]).map(|k| {
                let other = self.low[1 - axis] + k;
                if axis == 0 { [at, other] } else { [other, at] }
            });
            all.filter_map(|place| from_lines(place, self.shape.asymmetric)).collect()
        };
        let last = |axis: usize| self.low[axis] + self.shape.lines[axis] - 1;
        [line(0, self.low[0] - out), line(0, last(0) + out), line(1, self.low[1] - out), line(1, last(1) + out)]
    }
}

/// Places of cells among the lines of a shape.
fn on_lines((i, j): Cell, asymmetric: bool) -> [i32; 2] {
    if asymmetric { [i - j, i + j] } else { [i, j] }
}

/// `None` for the places between dots.
fn from_lines([a, b]: [i32; 2], asymmetric: bool) -> Option<Cell> {
    match asymmetric {
        true => ((a + b).rem_euclid(2) == 0).then(|| ((a + b) / 2, (b - a) / 2)),
        false => Some((a, b)),
    }
}

/// Without outer lines that are not part of a grid: they, or the next ones, have less than half the dots of the fullest.
fn trimmed(places: &BTreeSet<[i32; 2]>) -> Option<[[i32; 2]; 2]> {
    let bounds = |axis: usize| {
        let all = places.iter().map(|p| p[axis]);
        Some([all.clone().min()?, all.max()?])
    };
    let mut range = [bounds(0)?, bounds(1)?];
    loop {
        let inside = places.iter().filter(|p| (0..2).all(|a| (range[a][0]..=range[a][1]).contains(&p[a])));
        let mut counts: [BTreeMap<i32, usize>; 2] = Default::default();
        inside.for_each(|p| (0..2).for_each(|a| *counts[a].entry(p[a]).or_default() += 1));
        let is_thin = |axis: usize, at: i32| {
            let fullest = counts[axis].values().max().copied().unwrap_or(0);
            (counts[axis].get(&at).copied().unwrap_or(0) as f64) < MOST * fullest as f64
        };
        let sides = [(0, 0, 1), (0, 1, -1), (1, 0, 1), (1, 1, -1)];
        let outside = |(axis, end, inwards): &(usize, usize, i32)| {
            let at = range[*axis][*end];
            is_thin(*axis, at) || is_thin(*axis, at + inwards)
        };
        let Some((axis, end, inwards)) = sides.into_iter().find(outside) else { return Some(range) };
        range[axis][end] += inwards;
        if range[axis][0] >= range[axis][1] {
            return None;
        }
    }
}

/// The lattice in the picture.
#[derive(Debug, Clone, Copy)]
pub struct View<'a> {
    pub picture: &'a Picture,
    pub lattice: &'a Lattice,
    pub candidates: &'a [Candidate],
}

impl View<'_> {
    /// Whether a dot in a cell would be in view, and there is paper half a step towards it from the nearest one that is there.
    pub fn is_blank(&self, (i, j): Cell) -> bool {
        let near = |&(&(a, b), _): &(&Cell, &Site)| (a - i).pow(2) + (b - j).pow(2);
        let Some(((a, b), site)) = self.lattice.cells.iter().min_by_key(near) else { return false };
        let dot = &self.candidates[site.candidate];
        let (across, down) = (i - a, j - b);
        let step = [0, 1].map(|k| f64::from(across) * site.basis[0][k] + f64::from(down) * site.basis[1][k]);
        let at = |share: f64| [0, 1].map(|k| dot.ellipse.centre[k] + share * step[k]);
        let (half, size) = (dot.ellipse.half_extent(), [self.picture.width, self.picture.height]);
        let is_inside = |uv: [f64; 2]| (0..2).all(|k| uv[k] > half[k] + 1.0 && uv[k] + half[k] + 2.0 < size[k] as f64);
        let [x, y] = at(0.5 / f64::from(across.abs().max(down.abs()).max(1))).map(|c| c.round() as usize);
        is_inside(at(1.0)) && self.picture.at(x, y) > 0.5 * (dot.paper + dot.ink)
    }

    /// The shape of the dots, and whether they end in view all around.
    pub fn shape(&self) -> Option<(Shape, bool)> {
        let extent = Extent::of(self.lattice.cells.keys().copied())?;
        let ends =
            |line: &Vec<Cell>| line.iter().filter(|c| self.is_blank(**c)).count() as f64 >= MOST * line.len() as f64;
        Some((extent.shape, extent.sides(true).iter().all(ends)))
    }
}

/// A dot of an outer line: its id, and whether there is paper and no dot in view.
pub type Outer = (u32, bool);

/// What the dots that were found say about the outer lines.
pub(super) fn outline(lines: &[Vec<Outer>], is_found: impl Fn(u32) -> bool) -> Outline {
    let found = |line: &[Outer]| line.iter().filter(|(id, _)| is_found(*id)).count();
    let visible = |line: &[Outer]| line.iter().filter(|(id, blank)| *blank || is_found(*id)).count();
    let missing =
        |line: &Vec<Outer>| visible(line) >= LEAST_IN_VIEW && (found(line) as f64) < MISSING * visible(line) as f64;
    if lines.iter().any(missing) {
        Outline::LineMissing
    } else if !lines.is_empty() && lines.iter().all(|line| found(line) as f64 >= MOST * line.len() as f64) {
        Outline::Whole
    } else {
        Outline::Open
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_make_a_shape_with_some_of_them_missing_and_others_beside_it() {
        let square: Vec<Cell> = (0..7).flat_map(|i| (0..5).map(move |j| (i - 2, j + 4))).collect();
        let shifted: Vec<Cell> =
            (0..8).flat_map(|a| (0..11).map(move |b| [a, b])).filter_map(|place| from_lines(place, true)).collect();
        for (cells, asymmetric, lines, size) in [(square, false, [7, 5], [7, 5]), (shifted, true, [8, 11], [4, 11])] {
            // letters on a line of their own
            let beside = cells.iter().filter(|c| c.1 == cells[0].1).map(|(i, _)| (*i, 30));
            let more = cells.iter().copied().filter(|c| *c != cells[9]).chain([(20, 5)]).chain(beside);
            let extent = Extent::of(more).unwrap();
            assert_eq!(extent.shape, Shape { asymmetric, lines });
            assert_eq!(extent.shape.columns_and_rows(), Some(size));
            let rim = extent.sides(false);
            assert!(rim.iter().flatten().all(|cell| cells.contains(cell)), "{rim:?}");
            assert!(extent.sides(true).iter().flatten().all(|cell| !cells.contains(cell)));
        }
        assert!(Extent::of((0..9).map(|k| (k, k))).is_none());
    }
}
