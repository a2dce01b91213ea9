//! From a lattice of corners in arbitrary orientation to ids on the board.
//!
//! The lattice finder numbers corners from an arbitrary origin, u to the right and v down in the image. Every quarter
//! turn and every shift is compared with the colours that the squares must have: with row r and column c counted from
//! the top-left square, a square is dark when r + c is even.

use std::collections::BTreeMap;
use std::ops::RangeInclusive;

use crate::detect::Picture;
use crate::detect::corners::lattice::{BoardSize, Lattice, Placement};
use crate::geom::PlaneMap;

/// A square seen in the wrong colour counts against a placement this much more than one in the right colour counts for it:
/// half the squares of a blank margin are right by chance.
const WRONG_COLOUR: f64 = 3.0;
/// Least mean agreement (-1 to 1) of the visible squares.
const LEAST_AGREEMENT: f64 = 0.65;

/// Cells whose shades agree less with the two colours in turn are no squares: three uniform ones do by a third.
const NO_SQUARES: f64 = 0.35;
/// Mean shade of paper.
const PAPER: f64 = 0.5;
/// Where in a cell beyond the board paper is looked for, in squares from the side of the board.
const NEAR: f64 = 0.25;

/// Corners further from the map of all than this share of a square show that the lens bends the board.
const BENT: f64 = 0.1;
/// Cells with all corners found that are compared one by one with any cell; among more of them those up to so many lines away, which have 99 % of
/// the weight inside; cells further beyond them have no shade.
const MOST_COMPARED: usize = 2500;
const COMPARED_LINES: i32 = 12;
/// Corners that a map of a neighbourhood needs.
const LEAST_LOCAL: usize = 6;

/// What the colours say about where the lattice lies on the board.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Labelling {
    /// One placement agrees clearly better than all others.
    Unique(Placement),
    /// The colours of the whole board are symmetric under a turn; this is the most upright placement.
    Symmetric(Placement),
    /// Different parts of the board agree equally well: too little of its outline is seen.
    Ambiguous,
    /// No placement agrees with the colours, or the lattice is larger than the board.
    Contradiction,
}

impl Labelling {
    /// Where the board lies, if that can be told.
    pub fn placement(self) -> Option<Placement> {
        match self {
            Self::Unique(placement) | Self::Symmetric(placement) => Some(placement),
            Self::Ambiguous | Self::Contradiction => None,
        }
    }
}

/// A placement with how well it explains the picture.
struct Scored {
    placement: Placement,
    /// Lattice corners on the board.
    corners: usize,
    score: f64,
    /// Mean agreement of the visible squares, -1 to 1.
    agreement: f64,
}

/// Finds where the lattice lies on the board from the colours of the squares.
pub(super) fn label(shader: &Shader, board: BoardSize) -> Labelling {
    let reach = board.columns.max(board.rows) + 1;
    let Some(mut shades) = Shades::read(shader, reach) else { return Labelling::Contradiction };
    shades.forget_covered(shader);
    choose(shader.lattice(), &shades, board)
}

fn choose(lattice: &Lattice, shades: &Shades, board: BoardSize) -> Labelling {
    let scored = candidates(lattice, shades, board);
    let Some(best) = scored.first().filter(|s| s.agreement >= LEAST_AGREEMENT) else {
        return Labelling::Contradiction;
    };
    // A shift past the edge of the board costs at least half a row of squares in the wrong colour; half of that is asked for.
    let margin = 0.25 * (WRONG_COLOUR - 1.0) * f64::from(board.columns.min(board.rows) + 1);
    if goes_on(lattice, best.placement) {
        return Labelling::Contradiction;
    }
    let rivals: Vec<Placement> = scored.iter().filter(|s| s.score > best.score - margin).map(|s| s.placement).collect();
    if rivals.len() == 1 {
        return Labelling::Unique(best.placement);
    }
    let same_part = |p: &Placement| p.origin == best.placement.origin && p.extent() == best.placement.extent();
    if !rivals.iter().all(same_part) {
        return Labelling::Ambiguous;
    }
    let upright = rivals.iter().min_by_key(|p| p.tilt());
    Labelling::Symmetric(*upright.unwrap_or(&best.placement))
}

/// Whether the lattice goes on beyond a side of the board by most of a further line: then it is a larger board.
fn goes_on(lattice: &Lattice, placement: Placement) -> bool {
    let ((u0, v0), (width, height)) = (placement.origin, placement.extent());
    let present = |key: (i32, i32)| lattice.contains_key(&key);
    let column = |u: i32| 2 * (v0..v0 + height).filter(|&v| present((u, v))).count() >= height as usize;
    let row = |v: i32| 2 * (u0..u0 + width).filter(|&u| present((u, v))).count() >= width as usize;
    column(u0 - 1) || column(u0 + width) || row(v0 - 1) || row(v0 + height)
}

/// Placements that cover at least half of the lattice, best first.
fn candidates(lattice: &Lattice, shades: &Shades, board: BoardSize) -> Vec<Scored> {
    let Some((low, high)) = bounds(lattice) else { return Vec::new() };
    let counts = Counts::of(lattice, low, high);
    let mut all = Vec::new();
    for (turns, light_first) in board.looks() {
        let (width, height) = Placement { board, turns, light_first, origin: (0, 0) }.extent();
        for v in low.1 - height + 1..=high.1 {
            for u in low.0 - width + 1..=high.0 {
                let placement = Placement { board, turns, light_first, origin: (u, v) };
                let corners = counts.within((u, v), (u + width, v + height));
                if 2 * corners >= lattice.len() {
                    all.push(score(placement, corners, shades));
                }
            }
        }
    }
    all.sort_by(|a, b| b.score.total_cmp(&a.score).then(b.corners.cmp(&a.corners)));
    all
}

/// How many corners of a lattice lie in a rectangle, from sums over all that begin at its least corner.
struct Counts {
    low: (i32, i32),
    columns: usize,
    rows: usize,
    sums: Vec<usize>,
}

impl Counts {
    fn of(lattice: &Lattice, low: (i32, i32), high: (i32, i32)) -> Self {
        let [columns, rows] = [high.0 - low.0 + 2, high.1 - low.1 + 2].map(|n| n as usize);
        let mut sums = vec![0; columns * rows];
        for row in 1..rows {
            let mut in_row = 0;
            for column in 1..columns {
                in_row += usize::from(lattice.contains_key(&(low.0 + column as i32 - 1, low.1 + row as i32 - 1)));
                sums[row * columns + column] = sums[(row - 1) * columns + column] + in_row;
            }
        }
        Self { low, columns, rows, sums }
    }

    /// From `first` up to before `end`.
    fn within(&self, first: (i32, i32), end: (i32, i32)) -> usize {
        let column = |u: i32| (u - self.low.0).clamp(0, self.columns as i32 - 1) as usize;
        let row = |v: i32| (v - self.low.1).clamp(0, self.rows as i32 - 1) as usize;
        let below = |u: i32, v: i32| self.sums[row(v) * self.columns + column(u)];
        below(end.0, end.1) + below(first.0, first.1) - below(first.0, end.1) - below(end.0, first.1)
    }
}

fn score(placement: Placement, corners: usize, shades: &Shades) -> Scored {
    let (mut colours, mut agreement, mut seen) = (0.0, 0.0, 0.0);
    // Squares have the two colours in turn.
    let even = if placement.is_dark((0, 0)) { -1.0 } else { 1.0 };
    for (u, v) in placement.squares() {
        let Some(shade) = shades.at((u, v)) else { continue };
        let signed = even * parity(u, v) * shade;
        colours += if signed < 0.0 { WRONG_COLOUR * signed } else { signed };
        agreement += signed;
        seen += 1.0;
    }
    Scored { placement, corners, score: corners as f64 + colours, agreement: agreement / f64::max(seen, 1.0) }
}

pub fn bounds(lattice: &Lattice) -> Option<((i32, i32), (i32, i32))> {
    let us = lattice.keys().map(|k| k.0);
    let vs = lattice.keys().map(|k| k.1);
    Some(((us.clone().min()?, vs.clone().min()?), (us.max()?, vs.max()?)))
}

/// What a line of cells shows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Line {
    /// The two colours in turn, at least along a part of it.
    Squares,
    Paper,
    /// Neither.
    Covered,
}

/// Reads the shade of lattice cells: -1 as dark as the dark squares near it, 1 as light as the light ones.
pub struct Shader<'a> {
    picture: &'a Picture,
    maps: Maps<'a>,
    inner: BTreeMap<(i32, i32), f64>,
}

impl<'a> Shader<'a> {
    pub fn of(picture: &'a Picture, lattice: &'a Lattice) -> Option<Self> {
        Some(Self { picture, maps: Maps::of(lattice)?, inner: inner_cells(picture, lattice) })
    }

    pub fn lattice(&self) -> &'a Lattice {
        self.maps.lattice
    }

    /// At a place within a cell, whose corners are 0 and 1; `None` out of view.
    pub fn at(&self, cell: (i32, i32), place: [f64; 2]) -> Option<f64> {
        relative_shade(brightness(self.picture, self.maps.place(cell, place)?)?, cell, &self.inner)
    }

    /// Where a place in the frame of a cell lies, px.
    pub fn place(&self, cell: (i32, i32), place: [f64; 2]) -> Option<[f64; 2]> {
        self.maps.place(cell, place)
    }

    /// Counts at a place in the frame of a cell.
    pub fn brightness(&self, cell: (i32, i32), place: [f64; 2]) -> Option<f64> {
        brightness(self.picture, self.maps.place(cell, place)?)
    }

    /// Length of a cell along an axis, px.
    pub fn side_px(&self, cell: (i32, i32), axis: usize) -> Option<f64> {
        let ends = if axis == 0 { [[0.0, 0.5], [1.0, 0.5]] } else { [[0.5, 0.0], [0.5, 1.0]] };
        let [Some(a), Some(b)] = ends.map(|place| self.maps.place(cell, place)) else { return None };
        Some((a[0] - b[0]).hypot(a[1] - b[1]))
    }

    /// Mean of light squares less that of dark ones, counts.
    pub fn contrast(&self) -> f64 {
        let mean = |sign: f64| {
            let of = self.inner.iter().filter(|((u, v), _)| parity(*u, *v) == sign);
            of.clone().map(|(_, counts)| counts).sum::<f64>() / of.count() as f64
        };
        (mean(1.0) - mean(-1.0)).abs()
    }

    /// The cells of a line beyond the end (0: the lesser) of an axis, at their side towards the lattice: there may be little paper. With the
    /// mean of the shades, those of cells with an odd sum with the other sign, and their number; `None` where none is in view.
    pub fn line(&self, [axis, end]: [usize; 2], at: i32, across: RangeInclusive<i32>) -> Option<(Line, f64, usize)> {
        let near = if end == 0 { 1.0 - NEAR } else { NEAR };
        let place = if axis == 0 { [near, 0.5] } else { [0.5, near] };
        let cells = across.map(|other| if axis == 0 { (at, other) } else { (other, at) });
        let seen: Vec<(f64, f64)> = cells.filter_map(|(u, v)| Some((self.at((u, v), place)?, parity(u, v)))).collect();
        let mean = |of: fn(&(f64, f64)) -> f64| seen.iter().map(of).sum::<f64>() / seen.len() as f64;
        let alternating = mean(|(shade, sign)| shade * sign);
        let line = match mean(|(shade, _)| *shade) {
            _ if alternating.abs() > NO_SQUARES => Line::Squares,
            shade if shade < PAPER => Line::Covered,
            _ => Line::Paper,
        };
        (!seen.is_empty()).then_some((line, alternating, seen.len()))
    }
}

/// 1 of cells with an even sum, -1 of those with an odd one.
pub fn parity(u: i32, v: i32) -> f64 {
    f64::from(1 - 2 * (u + v).rem_euclid(2))
}

/// Shade of every lattice cell in view.
struct Shades {
    origin: (i32, i32),
    width: i32,
    values: Vec<Option<f64>>,
}

impl Shades {
    /// Reads the cells up to `reach` beyond the lattice.
    fn read(shader: &Shader, reach: i32) -> Option<Self> {
        let (low, high) = bounds(shader.maps.lattice)?;
        let origin = (low.0 - reach, low.1 - reach);
        let (width, height) = (high.0 - low.0 + 2 * reach + 1, high.1 - low.1 + 2 * reach + 1);
        let cells = (0..height).flat_map(|j| (0..width).map(move |i| (origin.0 + i, origin.1 + j)));
        let values = cells.map(|cell| shader.at(cell, [0.5; 2])).collect();
        Some(Self { origin, width, values })
    }

    /// Leaves out the lines beyond the lattice that show neither squares nor paper: something lies there, and the board may go on below.
    fn forget_covered(&mut self, shader: &Shader) {
        let Some((low, high)) = bounds(shader.maps.lattice) else { return };
        for (side, first, step) in
            [([0, 0], low.0 - 2, -1), ([0, 1], high.0 + 1, 1), ([1, 0], low.1 - 2, -1), ([1, 1], high.1 + 1, 1)]
        {
            let across = if side[0] == 0 { low.1 - 1..=high.1 } else { low.0 - 1..=high.0 };
            let mut line = first;
            while self.has(side[0], line)
                && let Some((look, ..)) = shader.line(side, line, across.clone())
                && look != Line::Paper
            {
                if look == Line::Covered {
                    self.forget(side[0], line);
                }
                line += step;
            }
        }
    }

    fn has(&self, axis: usize, line: i32) -> bool {
        let height = self.values.len() as i32 / self.width;
        let [first, count] = if axis == 0 { [self.origin.0, self.width] } else { [self.origin.1, height] };
        (first..first + count).contains(&line)
    }

    fn forget(&mut self, axis: usize, line: i32) {
        let (width, [u0, v0]) = (self.width, [self.origin.0, self.origin.1]);
        for (k, value) in (0..).zip(&mut self.values) {
            let at = if axis == 0 { u0 + k % width } else { v0 + k / width };
            if at == line {
                *value = None;
            }
        }
    }

    /// `None` out of view, or covered.
    fn at(&self, (u, v): (i32, i32)) -> Option<f64> {
        let (i, j) = (u - self.origin.0, v - self.origin.1);
        if i < 0 || j < 0 || i >= self.width {
            return None;
        }
        self.values.get(usize::try_from(j * self.width + i).ok()?).copied().flatten()
    }
}

/// From the lattice to the picture: one map where it holds everywhere, else the map of the neighbourhood.
struct Maps<'a> {
    lattice: &'a Lattice,
    whole: PlaneMap,
    bent: bool,
}

impl<'a> Maps<'a> {
    fn of(lattice: &'a Lattice) -> Option<Self> {
        let pairs: Vec<_> = lattice.iter().map(|(&(u, v), &uv)| ([f64::from(u), f64::from(v)], uv)).collect();
        let whole = PlaneMap::fit(&pairs)?;
        let off = |(at, uv): &([f64; 2], [f64; 2])| {
            let (Some(p), Some([x, y])) = (whole.apply(*at), whole.jacobian(*at)) else { return f64::INFINITY };
            let side = x[0].hypot(y[0]).min(x[1].hypot(y[1]));
            (p[0] - uv[0]).hypot(p[1] - uv[1]) / side
        };
        let bent = pairs.iter().map(off).fold(0.0, f64::max) > BENT;
        Some(Self { lattice, whole, bent })
    }

    /// Where a place within a cell lies, px.
    fn place(&self, (u, v): (i32, i32), [x, y]: [f64; 2]) -> Option<[f64; 2]> {
        let at = [f64::from(u) + x, f64::from(v) + y];
        if self.bent
            && let Some(near) = self.around((u, v))
        {
            return near.apply(at);
        }
        self.whole.apply(at)
    }

    /// The map of the corners nearest to a cell, where there are enough of them.
    fn around(&self, (u, v): (i32, i32)) -> Option<PlaneMap> {
        (2..=4).find_map(|reach| {
            let near = (v + 1 - reach..=v + reach).flat_map(|j| (u + 1 - reach..=u + reach).map(move |i| (i, j)));
            let pairs: Vec<_> =
                near.filter_map(|key| Some(([f64::from(key.0), f64::from(key.1)], *self.lattice.get(&key)?))).collect();
            if pairs.len() < LEAST_LOCAL { None } else { PlaneMap::fit(&pairs) }
        })
    }
}

/// Brightness of the cells whose four corners were found.
fn inner_cells(picture: &Picture, lattice: &Lattice) -> BTreeMap<(i32, i32), f64> {
    let corner = |u, v| lattice.get(&(u, v));
    lattice
        .keys()
        .filter_map(|&(u, v)| {
            let corners = [corner(u, v)?, corner(u + 1, v)?, corner(u, v + 1)?, corner(u + 1, v + 1)?];
            let mean = |k: usize| corners.iter().map(|c| c[k]).sum::<f64>() / 4.0;
            Some(((u, v), brightness(picture, [mean(0), mean(1)])?))
        })
        .collect()
}

/// Compares a brightness with the two colours near the cell, so that uneven light does not matter.
fn relative_shade(value: f64, cell: (i32, i32), inner: &BTreeMap<(i32, i32), f64>) -> Option<f64> {
    let mut sums = [(0.0, 0.0); 2];
    let add = |(&(u, v), &brightness): (&(i32, i32), &f64)| {
        let distance2 = f64::from((u - cell.0).pow(2) + (v - cell.1).pow(2));
        let weight = (distance2 + 1.0).powi(-2);
        let sum = &mut sums[usize::from((u + v).rem_euclid(2) == 1)];
        sum.0 += weight;
        sum.1 += weight * brightness;
    };
    if inner.len() <= MOST_COMPARED {
        inner.iter().for_each(add);
    } else {
        let lines = cell.0 - COMPARED_LINES..=cell.0 + COMPARED_LINES;
        let near = |u: i32| inner.range((u, cell.1 - COMPARED_LINES)..=(u, cell.1 + COMPARED_LINES));
        lines.flat_map(near).for_each(add);
    }
    let [even, odd] = sums.map(|(weight, sum)| sum / weight);
    let half_contrast = 0.5 * (even - odd).abs();
    let shade = (value - 0.5 * (even + odd)) / half_contrast;
    shade.is_finite().then(|| shade.clamp(-1.0, 1.0))
}

/// Mean of the 3 x 3 pixels around a point; `None` outside the picture.
pub(super) fn brightness(picture: &Picture, [u, v]: [f64; 2]) -> Option<f64> {
    let inside = u >= 1.0 && v >= 1.0 && u <= picture.width as f64 - 2.0 && v <= picture.height as f64 - 2.0;
    if !inside {
        return None;
    }
    let (x, y) = (u.round() as usize, v.round() as usize);
    let sum: f32 = (y - 1..=y + 1).map(|j| (x - 1..=x + 1).map(|i| picture.at(i, j)).sum::<f32>()).sum();
    Some(f64::from(sum) / 9.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn corners_in_a_rectangle_are_counted_as_one_by_one() {
        let lattice: Lattice = (0..60).map(|k| ((k * 7 % 11 - 3, k * 5 % 13 - 9), [0.0; 2])).collect();
        let (low, high) = bounds(&lattice).unwrap();
        let counts = Counts::of(&lattice, low, high);
        for (u, v) in (-8..10).flat_map(|u| (-14..6).map(move |v| (u, v))) {
            for (width, height) in [(1, 1), (3, 2), (20, 20)] {
                let is_in = |key: &&(i32, i32)| (u..u + width).contains(&key.0) && (v..v + height).contains(&key.1);
                let expected = lattice.keys().filter(is_in).count();
                assert_eq!(counts.within((u, v), (u + width, v + height)), expected, "{u} {v} {width} {height}");
            }
        }
    }

    #[test]
    fn shades_of_a_large_lattice_are_those_of_the_nearer_cells() {
        let counts = |u: i32, v: i32| 100.0 + 0.3 * f64::from(u) + 40.0 * parity(u, v);
        let cells = |side: i32| (0..side).flat_map(move |u| (0..side).map(move |v| ((u, v), counts(u, v))));
        let (small, large): (BTreeMap<_, _>, BTreeMap<_, _>) = (cells(50).collect(), cells(200).collect());
        assert!(small.len() <= MOST_COMPARED && large.len() > MOST_COMPARED);
        for (cell, value) in [((25, 25), 110.0), ((20, 31), 90.0), ((25, 24), 140.0), ((3, 28), 70.0)] {
            let [near, all] = [&large, &small].map(|inner| relative_shade(value, cell, inner).unwrap());
            assert!((near - all).abs() < 0.02, "{cell:?} {near} {all}");
        }
        assert_eq!(relative_shade(100.0, (-40, 25), &large), None);
    }
}
