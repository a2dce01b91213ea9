//! The sizes of the dots on a lattice: most are alike, some may be larger, smaller or open.

use std::collections::BTreeMap;

use super::candidate::Candidate;
use super::lattice::{Cell, Lattice};
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
pub(super) struct Dot {
    pub radius: f64,
    /// Inner over outer radius; 0 for a disc.
    pub ratio: f64,
}

/// The dots of a lattice by kind.
#[derive(Debug, Clone)]
pub(super) struct Dots {
    pub usual: Dot,
    /// Those that are not as most are.
    pub other: BTreeMap<Cell, Dot>,
}

impl Dots {
    /// Sorts the dots of a lattice; `None` where no kind makes up most of them.
    pub fn of(lattice: &Lattice, candidates: &[Candidate]) -> Option<Self> {
        let dot = |(cell, site): (&Cell, &super::lattice::Site)| {
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
        let open = |(_, site): &(f64, &super::lattice::Site)| candidates[site.candidate].open;
        let is_open = 2 * all().filter(open).count() > lattice.cells.len();
        let ratios = || all().filter(open).map(|(_, site)| candidates[site.candidate].hole.unwrap_or(0.5));
        let ratio = if is_open { median(ratios())? } else { 0.0 };
        let radius = median(all().filter(|dot| open(dot) == is_open).map(|(radius, _)| radius))?;
        Some(Self { usual: Dot { radius, ratio }, other: BTreeMap::new() })
    }

    /// Dots that look larger or smaller beside a change of the light count as usual: the edge of a shadow moves edges, and makes no ring.
    pub fn leave_out_uneven_light(&mut self, lattice: &Lattice, candidates: &[Candidate]) {
        let paper = |cell: &Cell| lattice.cells.get(cell).map(|site| f64::from(candidates[site.candidate].paper));
        let around = |(i, j): Cell| (i - 1..=i + 1).flat_map(move |i| (j - 1..=j + 1).map(move |j| (i, j)));
        let is_even = |cell: &Cell| {
            let papers = || around(*cell).filter_map(|other| paper(&other));
            (papers().fold(0.0, f64::max) / papers().fold(f64::INFINITY, f64::min)).ln() < EVEN_LIGHT
        };
        let usual = self.usual.ratio > 0.0;
        self.other.retain(|cell, dot| (dot.ratio > 0.0) != usual || is_even(cell));
    }

    /// Adds dots that are not on the lattice where they are not as most are.
    pub fn add(&mut self, dots: Vec<(Cell, Dot)>) {
        let usual = self.usual.radius;
        self.other.extend(dots.into_iter().filter(|(_, d)| (d.radius / usual).ln().abs() > MISSING));
    }
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

    #[test]
    fn a_gap_parts_the_large_and_a_slow_drift_does_not() {
        let mut sizes: Vec<f64> = (0..50).map(|k| 0.2 * (0.005 * f64::from(k)).exp()).collect();
        let whole = around_the_median(sizes.clone()).unwrap();
        assert_eq!(whole, [0.2, sizes[49]]);
        sizes.push(0.4);
        assert_eq!(around_the_median(sizes).unwrap(), whole);
    }
}
