//! The sizes of the dots on a lattice: most are alike, some may be larger, smaller or open.

use std::collections::BTreeMap;

use crate::detect::circles::candidates::candidate::Candidate;
use crate::detect::circles::identity::lattice::{Cell, Lattice, Site};
use crate::linalg::median;

/// Least gap between the sizes of two kinds of dots, as a logarithm: printed sizes differ by a half or more, and a fifth is
/// what threshold and blur may do to a small dot beside a large one.
const GAP: f64 = 0.2;
/// The same for a dot of which only a part is seen, roughly.
const MISSING: f64 = 0.3;
/// Largest share of dots that are not as most are.
const FEW: f64 = 0.34;
/// Paper beside neighbouring dots differs by no more in even light, as a logarithm: a shadow that moves an edge by enough to pass for another
/// size is deeper, and vignetting from dot to dot is a tenth of it.
const EVEN_LIGHT: f64 = 0.15;

/// A dot as seen; lengths in steps of the lattice.
#[derive(Debug, Clone, Copy)]
pub struct Dot {
    pub radius: f64,
    /// Inner over outer radius; 0 for a disc.
    pub ratio: f64,
}

/// The dots of a lattice by kind.
#[derive(Debug, Clone)]
pub struct Dots {
    pub usual: Dot,
    /// Those that are not as most are.
    pub other: BTreeMap<Cell, Dot>,
}

impl Dots {
    /// Dots that are larger than most by as much as is printed, where the light does not make them so.
    pub fn larger(lattice: &Lattice, candidates: &[Candidate]) -> Option<Self> {
        let mut dots = Self::of(lattice, candidates)?;
        dots.leave_out_uneven_light(lattice, candidates);
        let usual = dots.usual.radius;
        dots.other.retain(|_, dot| (dot.radius / usual).ln() > MISSING);
        Some(dots)
    }

    /// Sorts the dots of a lattice; `None` where no kind makes up most of them.
    pub fn of(lattice: &Lattice, candidates: &[Candidate]) -> Option<Self> {
        let dot = |(cell, site): (&Cell, &Site)| {
            let c = &candidates[site.candidate];
            let ratio = if c.open { c.hole.unwrap_or(0.5) } else { 0.0 };
            (*cell, Dot { radius: site.relative_radius(c), ratio })
        };
        let all: BTreeMap<Cell, Dot> = lattice.cells.iter().map(dot).collect();
        let open = 2 * all.values().filter(|d| d.ratio > 0.0).count() > all.len();
        let alike: Vec<Dot> = all.values().filter(|d| (d.ratio > 0.0) == open).copied().collect();
        let [low, high] = around_the_median(alike.iter().map(|d| d.radius).collect())?;
        let is_usual = |d: &Dot| (d.ratio > 0.0) == open && (low..=high).contains(&d.radius);
        let middle = |pick: fn(&Dot) -> f64| median(alike.iter().filter(|d| is_usual(d)).map(pick));
        let usual = Dot { radius: middle(|d| d.radius)?, ratio: middle(|d| d.ratio)? };
        let other: BTreeMap<Cell, Dot> = all.into_iter().filter(|(_, d)| !is_usual(d)).collect();
        ((other.len() as f64) < FEW * lattice.cells.len() as f64).then_some(Self { usual, other })
    }

    /// All dots as alike, whatever their sizes look like.
    pub fn alike(lattice: &Lattice, candidates: &[Candidate]) -> Option<Self> {
        let all = || lattice.cells.values().map(|site| (site.relative_radius(&candidates[site.candidate]), site));
        let open = |(_, site): &(f64, &Site)| candidates[site.candidate].open;
        let is_open = 2 * all().filter(open).count() > lattice.cells.len();
        let ratios = || all().filter(open).map(|(_, site)| candidates[site.candidate].hole.unwrap_or(0.5));
        let ratio = if is_open { median(ratios())? } else { 0.0 };
        let radius = median(all().filter(|dot| open(dot) == is_open).map(|(radius, _)| radius))?;
        Some(Self { usual: Dot { radius, ratio }, other: BTreeMap::new() })
    }

    /// Dots that look larger or smaller beside a step of the light count as usual: the edge of a shadow moves edges, and makes no ring.
    /// Light that changes by the same from dot to dot moves none.
    pub fn leave_out_uneven_light(&mut self, lattice: &Lattice, candidates: &[Candidate]) {
        let paper =
            |cell: Cell| lattice.cells.get(&cell).map(|site| f64::from(candidates[site.candidate].paper).max(1.0).ln());
        let usual = self.usual.ratio > 0.0;
        self.other.retain(|cell, dot| (dot.ratio > 0.0) != usual || is_even(*cell, &paper));
    }

    /// Adds dots that are not on the lattice where they are not as most are.
    pub fn add(&mut self, dots: Vec<(Cell, Dot)>) {
        let usual = self.usual.radius;
        self.other.extend(dots.into_iter().filter(|(_, d)| (d.radius / usual).ln().abs() > MISSING));
    }
}

/// Whether the paper, as a logarithm, has no step around a dot: it differs little, or goes on with the same slope on both sides of the dot
/// or beyond it.
fn is_even((i, j): Cell, paper: &impl Fn(Cell) -> Option<f64>) -> bool {
    let at = |(di, dj): Cell, steps: i32| paper((i + steps * di, j + steps * dj));
    let around: Vec<Cell> = (-1..=1).flat_map(|di| (-1..=1).map(move |dj| (di, dj))).filter(|d| *d != (0, 0)).collect();
    let all = || around.iter().filter_map(|d| at(*d, 1)).chain(paper((i, j)));
    if all().fold(f64::NEG_INFINITY, f64::max) - all().fold(f64::INFINITY, f64::min) < EVEN_LIGHT {
        return true;
    }
    // Of a dot without a contour: what those around say.
    let pair = |d: &Cell| Some(0.5 * (at(*d, 1)? + at(*d, -1)?));
    let beyond = |d: &Cell| Some(2.0 * at(*d, 1)? - at(*d, 2)?);
    let of_others = || median(around.iter().filter_map(pair)).or_else(|| median(around.iter().filter_map(beyond)));
    let Some(own) = paper((i, j)).or_else(of_others) else { return false };
    let goes_on = |d: &Cell| {
        let Some(beside) = at(*d, 1) else { return true };
        let bends = [at(*d, -1).map(|other| other + beside - 2.0 * own), at(*d, 2).map(|far| far + own - 2.0 * beside)];
        // Across a corner of the lattice there may be no third dot: rows and columns tell.
        let is_across = d.0 != 0 && d.1 != 0;
        let is_told = is_across || bends.iter().any(Option::is_some) || (beside - own).abs() < EVEN_LIGHT;
        is_told && bends.iter().flatten().all(|bend| bend.abs() < EVEN_LIGHT)
    };
    around.iter().all(goes_on)
}

/// Least and largest of the values that no gap parts from their median.
fn around_the_median(mut values: Vec<f64>) -> Option<[f64; 2]> {
    values.sort_by(f64::total_cmp);
    let (below, above) = values.split_at(values.len() / 2);
    let first = above.first()?;
    let joins = |last: &mut f64, v: &f64| {
        let near = (v / *last).ln().abs() < GAP;
        *last = *v;
        near.then_some(*v)
    };
    let high = above.iter().scan(*first, joins).last().unwrap_or(*first);
    let low = below.iter().rev().scan(*first, joins).last().unwrap_or(*first);
    Some([low, high])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Light that halves over seven dots is even everywhere, at the border and where a dot is missing; the edge of a shadow is not,
    /// wherever it lies between the dots or across one.
    #[test]
    fn a_slope_of_the_light_is_even_and_a_step_is_not() {
        let inside = |(i, j): Cell, missing: Cell| (0..8).contains(&i) && (0..6).contains(&j) && (i, j) != missing;
        let slope = |(i, j): Cell| f64::from(2 * i + j) * 0.5 * 0.5_f64.ln() / 7.0;
        for cell in (0..8).flat_map(|i| (0..6).map(move |j| (i, j))) {
            for steep in [1.0, 2.0] {
                let paper = |missing: Cell| move |c: Cell| inside(c, missing).then(|| steep * slope(c));
                assert!(is_even(cell, &paper((-9, -9))) && is_even(cell, &paper(cell)), "{cell:?}");
            }
            for own in [0.0, -0.3, -0.52, -0.8, -1.05] {
                let shadow = |c: Cell| {
                    let depth = if c.0 > cell.0 {
                        -1.05
                    } else if c.0 == cell.0 {
                        own
                    } else {
                        0.0
                    };
                    inside(c, (-9, -9)).then_some(depth)
                };
                let has_step = if cell.0 == 7 {
                    own != 0.0
                } else if cell.0 == 0 {
                    own != -1.05
                } else {
                    true
                };
                assert_eq!(is_even(cell, &shadow), !has_step, "{cell:?} {own}");
            }
        }
    }

    #[test]
    fn a_gap_parts_the_large_and_a_slow_drift_does_not() {
        let mut sizes: Vec<f64> = (0..50).map(|k| 0.2 * (0.005 * f64::from(k)).exp()).collect();
        let whole = around_the_median(sizes.clone()).unwrap();
        assert_eq!(whole, [0.2, sizes[49]]);
        sizes.push(0.4);
        assert_eq!(around_the_median(sizes).unwrap(), whole);
    }
}
