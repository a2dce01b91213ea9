//! Where a corner should be, by the corners around it.

use super::fit::{Bend, Seed};
use super::lattice::Lattice;
use crate::geom::PlaneMap;

/// Neighbours up to this many squares away say where a corner is and how the edges run ...
pub(super) const REACH: i32 = 2;
/// ... and up to this many where a gap in the lattice has to be bridged.
pub(super) const FAR_REACH: i32 = 5;
/// Behind a lens that bends much, the next corners alone.
const NEXT: i32 = 1;
/// There a corner lies less than so many squares off the continuation of two neighbours, and less than half as many off the middle of two.
const OFF_LINE: f64 = 0.7;
/// A map is as good as far away where it explains so many corners to this share of a square.
const EXPLAINED: usize = 8;
const EXPLAINED_TO: f64 = 0.1;

/// A corner with the directions and lengths of the edges there, from the map of its neighbourhood.
pub(super) fn seed(lattice: &Lattice, key: (i32, i32), reach: i32) -> Option<Seed> {
    Around::of(lattice, key, reach)?.seed(lattice, key)
}

/// The same behind a lens that bends the lines of corners, where no map may hold far. A corner of the lattice may be where it was found.
pub(super) fn bent_seed(lattice: &Lattice, key: (i32, i32), reach: i32) -> Option<Seed> {
    let found = lattice.get(&key).copied().filter(|uv| is_in_line(lattice, key, *uv) == Some(true));
    [NEXT, reach].into_iter().find_map(|reach| {
        let around = Around::of(lattice, key, reach)?;
        let mut seed = around.seed(lattice, key)?;
        if let Some(uv) = found {
            seed = seed.at(lattice, key, uv);
        }
        is_in_line(lattice, key, seed.uv).unwrap_or_else(|| around.is_explained()).then_some(seed)
    })
}

/// The corners around one, by the squares from it, with the map that fits them best.
struct Around {
    pairs: Vec<([f64; 2], [f64; 2])>,
    map: PlaneMap,
}

impl Around {
    fn of(lattice: &Lattice, (u, v): (i32, i32), reach: i32) -> Option<Self> {
        let pairs: Vec<_> = (v - reach..=v + reach)
            .flat_map(|j| (u - reach..=u + reach).map(move |i| (i, j)))
            .filter(|&key| key != (u, v))
            .filter_map(|key| Some(([f64::from(key.0 - u), f64::from(key.1 - v)], *lattice.get(&key)?)))
            .collect();
        let map = PlaneMap::fit(&pairs)?;
        Some(Self { pairs, map })
    }

    fn seed(&self, lattice: &Lattice, key: (i32, i32)) -> Option<Seed> {
        let [[xu, xv], [yu, yv]] = self.map.jacobian([0.0, 0.0])?;
        let predicted = self.map.apply([0.0, 0.0])?;
        let near =
            |uv: &&[f64; 2]| (uv[0] - predicted[0]).hypot(uv[1] - predicted[1]) < 0.2 * xu.hypot(yu).min(xv.hypot(yv));
        let uv = lattice.get(&key).filter(near).copied().unwrap_or(predicted);
        Some(Seed { uv, sides: [[xu, yu], [xv, yv]], bends: bends(lattice, key, uv) })
    }

    fn is_explained(&self) -> bool {
        let explains = |(at, uv): &([f64; 2], [f64; 2])| {
            let (Some([x, y]), Some([[xu, xv], [yu, yv]])) = (self.map.apply(*at), self.map.jacobian(*at)) else {
                return false;
            };
            (uv[0] - x).hypot(uv[1] - y) < EXPLAINED_TO * xu.hypot(yu).min(xv.hypot(yv))
        };
        self.pairs.len() >= EXPLAINED && self.pairs.iter().all(explains)
    }
}

impl Seed {
    /// At another place.
    pub fn at(self, lattice: &Lattice, key: (i32, i32), uv: [f64; 2]) -> Self {
        Self { uv, bends: bends(lattice, key, uv), ..self }
    }
}

/// Whether a corner at this place is in line with its neighbours on both sides, or else with two on one side; `None` where there are none.
pub(super) fn is_in_line(lattice: &Lattice, (u, v): (i32, i32), uv: [f64; 2]) -> Option<bool> {
    let off = |axis: usize| {
        let at = |along: i32| lattice.get(&if axis == 0 { (u + along, v) } else { (u, v + along) });
        let off = |[a, b, c]: [[f64; 2]; 3], side_px: f64| {
            let [x, y] = [0, 1].map(|k| a[k] - 2.0 * b[k] + c[k]);
            x.hypot(y) / side_px
        };
        let length = |a: &[f64; 2], b: &[f64; 2]| (a[0] - b[0]).hypot(a[1] - b[1]);
        if let (Some(a), Some(b)) = (at(-1), at(1)) {
            return Some(off([*a, uv, *b], 0.5 * length(a, b)));
        }
        [-1, 1].into_iter().find_map(|way| {
            let (b, c) = (at(way)?, at(2 * way)?);
            Some(off([uv, *b, *c], length(b, c)))
        })
    };
    let most = [0, 1].into_iter().filter_map(off).reduce(f64::max)?;
    Some(most < OFF_LINE)
}

fn bends(lattice: &Lattice, key: (i32, i32), uv: [f64; 2]) -> [Option<Bend>; 2] {
    [0, 1].map(|axis| bend(lattice, key, uv, axis))
}

/// The bend of the edge along an axis through a corner at this place, from three corners in a row: the middle one is that corner, where there are such.
pub(super) fn bend(lattice: &Lattice, (u, v): (i32, i32), uv: [f64; 2], axis: usize) -> Option<Bend> {
    let at = |along: i32| match along {
        0 => Some(uv),
        _ => lattice.get(&if axis == 0 { (u + along, v) } else { (u, v + along) }).copied(),
    };
    [0, -1, 1].into_iter().find_map(|middle| {
        let [before, here, after] = [at(middle - 1)?, at(middle)?, at(middle + 1)?];
        let [x, y] = [0, 1].map(|k| 0.5 * (after[k] - before[k]));
        let [sx, sy] = [0, 1].map(|k| before[k] - 2.0 * here[k] + after[k]);
        let from_middle = f64::from(-middle);
        let side = [x + from_middle * sx, y + from_middle * sy];
        Some(Bend { curvature: (x * sy - y * sx) / x.hypot(y).powi(3), side })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Equidistant, with squares of 24 degrees in the middle.
    fn behind_a_fisheye() -> Lattice {
        let at = |(u, v): (i32, i32)| {
            let [x, y] = [u, v].map(|k| 0.44 * f64::from(k));
            let radius = x.hypot(y).max(1e-9);
            [x, y].map(|c| 420.0 * c * radius.atan() / radius)
        };
        (-3..=3).flat_map(|v| (-4..=4).map(move |u| (u, v))).map(|key| (key, at(key))).collect()
    }

    #[test]
    fn corners_behind_a_fisheye_are_in_line_and_their_neighbours_are_not() {
        let whole = behind_a_fisheye();
        for (&(u, v), &uv) in &whole {
            assert_eq!(is_in_line(&whole, (u, v), uv), Some(true), "{u} {v}");
            for next in [(u + 1, v), (u - 1, v), (u, v + 1), (u, v - 1)] {
                let Some(other) = whole.get(&next) else { continue };
                assert_eq!(is_in_line(&whole, (u, v), *other), Some(false), "{u} {v} at {next:?}");
            }
        }
        assert_eq!(is_in_line(&Lattice::new(), (0, 0), [0.0; 2]), None);
    }

    #[test]
    fn a_corner_that_is_lacking_is_sought_near_its_place() {
        let whole = behind_a_fisheye();
        for (&key, &[x, y]) in whole.iter().filter(|((u, v), _)| u.abs() < 4 && v.abs() < 3) {
            let mut rest = whole.clone();
            rest.remove(&key);
            let seed = bent_seed(&rest, key, REACH).unwrap();
            let off = (seed.uv[0] - x).hypot(seed.uv[1] - y);
            assert!(off < 0.2 * seed.side_px(), "{key:?}: {off} px of {}", seed.side_px());
        }
    }
}
