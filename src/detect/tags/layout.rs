//! How the tags that are seen stand to one another, whatever the plate file says.
//!
//! A tag is a frame: its side to the right and its side up, px. In the mean of the frames of two tags the middle of one is at an offset
//! from the other; what a neighbour's is, in sides, most tags agree on, and that is one step. The numbers of tags change by the same with
//! every step along a row, and with every step up. Where two tags of a row are `p` sides apart, the ends `A B C D` of their sides on one
//! line have the cross-ratio
//!
//! ```text
//! AC BD / (BC AD) = p^2 / (p^2 - 1)
//! ```
//!
//! which no camera without a lens' distortion changes.

use std::collections::BTreeMap;

use nalgebra::{Matrix2, Vector2};

use super::quads::Quad;
use crate::detect::corners::quantile;

/// Furthest neighbours that are linked, in steps, and how far they may be from whole steps.
const REACH: i64 = 2;
const OFF: f64 = 0.25;
/// Pairs that must agree.
const LEAST_PAIRS: usize = 2;

/// Corners of tags by their numbers, counter-clockwise from the bottom-left as printed.
pub type Tagged = BTreeMap<u32, Quad>;

/// Steps to the right and up.
pub type Steps = (i64, i64);

/// Tags of one plate by their numbers, with the steps from one of them.
pub struct Layout {
    places: BTreeMap<u32, Steps>,
    corners: Tagged,
}

impl Layout {
    /// The largest set of tags that stand in whole steps from one another.
    pub fn of(tags: &Tagged) -> Self {
        let frames: Vec<(u32, Frame)> = tags.iter().map(|(id, corners)| (*id, Frame::of(corners))).collect();
        let links = links(&frames);
        let mut best = BTreeMap::new();
        for (first, _) in &frames {
            if !best.contains_key(first) {
                let reached = reached(*first, &links);
                best = if reached.len() > best.len() { reached } else { best };
            }
        }
        let corners = tags.iter().filter(|(id, _)| best.contains_key(id)).map(|(id, c)| (*id, *c)).collect();
        Self { places: best, corners }
    }

    /// The number in the middle of those of the tags.
    pub fn middle_id(&self) -> Option<u32> {
        self.places.keys().nth(self.places.len() / 2).copied()
    }

    /// The least and the greatest number; 0 where there is no tag.
    pub fn first_and_last_id(&self) -> [u32; 2] {
        [self.places.keys().next(), self.places.keys().next_back()].map(|id| id.copied().unwrap_or(0))
    }

    /// By how much the number of a tag changes with so many steps, as most pairs say.
    pub fn change(&self, steps: Steps) -> Option<i64> {
        self.agreed(steps).map(|(change, _)| change)
    }

    /// The change with how many pairs say so.
    pub fn agreed(&self, steps: Steps) -> Option<(i64, usize)> {
        let changes = self.pairs(steps).map(|(from, to)| i64::from(to) - i64::from(from));
        most_frequent(changes).filter(|(_, count)| *count >= LEAST_PAIRS)
    }

    /// By how much it changes with a step to the right and up; 1 and nothing where too few tags say.
    pub fn changes(&self) -> [i64; 2] {
        [self.change((1, 0)).unwrap_or(1), self.change((0, 1)).unwrap_or(0)]
    }

    /// The tags that agree with these changes.
    pub fn counted_as_seen(&self) -> BTreeMap<u32, Steps> {
        let [right, up] = self.changes();
        let one_row = up == 0;
        self.agreeing(|id, (i, j)| Some((i64::from(id) - right * i - up * j, if one_row { j } else { 0 })))
    }

    /// The tags on which most agree how far they are from their places, in steps; none of those that have no place.
    pub fn agreeing<T: Ord + Copy>(&self, say: impl Fn(u32, Steps) -> Option<T>) -> BTreeMap<u32, Steps> {
        let said = self.places.iter().filter_map(|(id, steps)| Some((*id, *steps, say(*id, *steps)?)));
        let said: Vec<(u32, Steps, T)> = said.collect();
        let most = most_frequent(said.iter().map(|(_, _, what)| *what)).map(|(what, _)| what);
        said.into_iter().filter(|(_, _, what)| Some(*what) == most).map(|(id, steps, _)| (id, steps)).collect()
    }

    /// Length of so many steps, in sides of a tag: the median over pairs of tags whose numbers change as those of most.
    pub fn length(&self, steps: i64) -> Option<f64> {
        let along = |steps: Steps, lines: [[usize; 2]; 2]| {
            self.as_numbered(steps).flat_map(move |(a, b)| lines.map(|line| self.apart(a, b, line)))
        };
        let rows = along((steps, 0), [[0, 1], [3, 2]]);
        let lengths: Vec<f64> = rows.chain(along((0, steps), [[0, 3], [1, 2]])).filter(|p| p.is_finite()).collect();
        if lengths.len() < 2 * LEAST_PAIRS { None } else { quantile(lengths.into_iter(), 0.5) }
    }

    /// Median side of a tag, px.
    pub fn side_px(&self) -> f64 {
        quantile(self.corners.values().map(|c| Frame::of(c).sides.determinant().abs().sqrt()), 0.5).unwrap_or(0.0)
    }

    /// How far two tags are apart, in sides, from the ends of one of their sides on a common line.
    fn apart(&self, first: u32, second: u32, [from, to]: [usize; 2]) -> f64 {
        let (one, other) = (&self.corners[&first], &self.corners[&second]);
        let [a, b, c, d] = [one[from], one[to], other[from], other[to]].map(Vector2::from);
        let ratio = (c - a).norm() * (d - b).norm() / ((c - b).norm() * (d - a).norm());
        (ratio / (ratio - 1.0)).sqrt()
    }

    /// The pairs whose numbers say that they are so many steps apart; all of them where too few agree.
    fn as_numbered(&self, steps: Steps) -> impl Iterator<Item = (u32, u32)> {
        let change = self.change(steps);
        self.pairs(steps).filter(move |(from, to)| change.is_none_or(|by| i64::from(*to) - i64::from(*from) == by))
    }

    fn pairs(&self, (i, j): Steps) -> impl Iterator<Item = (u32, u32)> {
        let by_place: BTreeMap<Steps, u32> = self.places.iter().map(|(id, steps)| (*steps, *id)).collect();
        let next = move |(from, (x, y)): (&u32, &Steps)| Some((*from, *by_place.get(&(x + i, y + j))?));
        self.places.iter().filter_map(next)
    }
}

struct Frame {
    middle: Vector2<f64>,
    /// Sides to the right and up.
    sides: Matrix2<f64>,
}

impl Frame {
    fn of(corners: &Quad) -> Self {
        let [a, b, c, d] = corners.map(Vector2::from);
        Self {
            middle: (a + b + c + d) / 4.0,
            sides: Matrix2::from_columns(&[(b - a + c - d) / 2.0, (d - a + c - b) / 2.0]),
        }
    }

    /// How far another tag is away to the right and up, in sides.
    fn to(&self, other: &Self) -> Option<Vector2<f64>> {
        Some(((self.sides + other.sides) / 2.0).try_inverse()? * (other.middle - self.middle))
    }
}

/// Other tags, each at an offset in sides.
type Offsets = Vec<(u32, Vector2<f64>)>;

/// Neighbours of tags that are whole steps away.
fn links(frames: &[(u32, Frame)]) -> BTreeMap<u32, Vec<(u32, Steps)>> {
    let offsets = |(id, frame): &(u32, Frame)| -> Offsets {
        let others = frames.iter().filter(|(other, _)| other != id);
        others.filter_map(|(other, f)| Some((*other, frame.to(f)?))).collect()
    };
    let all: BTreeMap<u32, Offsets> = frames.iter().map(|frame| (frame.0, offsets(frame))).collect();
    let nearest = |near: &Offsets| near.iter().map(|(_, o)| o.amax()).reduce(f64::min);
    let Some(step) = quantile(all.values().filter_map(nearest), 0.5) else { return BTreeMap::new() };
    let link = |(id, offset): (u32, Vector2<f64>)| {
        let (steps, whole) = (offset / step, (offset / step).map(f64::round));
        let near = (steps - whole).amax() < OFF && whole.amax() <= REACH as f64;
        near.then(|| (id, (whole.x as i64, whole.y as i64)))
    };
    all.into_iter().map(|(id, near)| (id, near.into_iter().filter_map(link).collect())).collect()
}

/// Every tag that links lead to, with the steps to it.
fn reached(first: u32, links: &BTreeMap<u32, Vec<(u32, Steps)>>) -> BTreeMap<u32, Steps> {
    let mut places = BTreeMap::from([(first, (0, 0))]);
    let mut next = vec![first];
    while let Some(id) = next.pop() {
        let (x, y) = places[&id];
        for (other, (i, j)) in links.get(&id).into_iter().flatten() {
            places.entry(*other).or_insert_with(|| {
                next.push(*other);
                (x + i, y + j)
            });
        }
    }
    places
}

/// What occurs most often, the least of equals, and how often.
fn most_frequent<T: Ord + Copy>(all: impl Iterator<Item = T>) -> Option<(T, usize)> {
    let mut counts: BTreeMap<T, usize> = BTreeMap::new();
    all.for_each(|one| *counts.entry(one).or_default() += 1);
    counts.into_iter().rev().max_by_key(|(_, count)| *count)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::PlaneMap;

    /// Seen so slantwise that tags of other rows are nearest.
    #[test]
    fn tags_that_stand_as_numbered_tell_how_far_they_are_apart() {
        let (columns, rows, pitch) = (6, 4, 1.25);
        let [right, below] = [columns, rows].map(|n| f64::from(n) * pitch + 0.25);
        let paper = [[-0.5, -0.5], [right, -0.5], [right, below], [-0.5, below]];
        let seen = [[543.0, 473.0], [1014.0, 185.0], [783.0, 573.0], [330.0, 1000.0]];
        let map = PlaneMap::fit(&paper.into_iter().zip(seen).collect::<Vec<_>>()).unwrap();
        let tag = |id: u32| {
            let [x, y] = [id % columns, id / columns].map(|n| f64::from(n) * pitch);
            let corners = [[x, y + 1.0], [x + 1.0, y + 1.0], [x + 1.0, y], [x, y]];
            (id, corners.map(|corner| map.apply(corner).unwrap()))
        };
        let layout = Layout::of(&(0..columns * rows).map(tag).collect());
        assert!((layout.length(1).unwrap() - pitch).abs() < 1e-6, "{:?}", layout.length(1));
    }
}
