//! Where a corner should be, by the corners around it.

use super::fit::Seed;
use super::lattice::Lattice;
use crate::geom::PlaneMap;

/// Neighbours up to this many squares away say where a corner is and how the edges run ...
pub(super) const REACH: i32 = 2;
/// ... and up to this many where a gap in the lattice has to be bridged.
pub(super) const FAR_REACH: i32 = 5;
/// A corner with the directions and lengths of the edges there, from the map of its neighbourhood.
pub(super) fn seed(lattice: &Lattice, (u, v): (i32, i32), reach: i32) -> Option<Seed> {
    let pairs: Vec<_> = (v - reach..=v + reach)
        .flat_map(|j| (u - reach..=u + reach).map(move |i| (i, j)))
        .filter(|&key| key != (u, v))
        .filter_map(|key| Some(([f64::from(key.0 - u), f64::from(key.1 - v)], *lattice.get(&key)?)))
        .collect();
    let map = PlaneMap::fit(&pairs)?;
    let [[xu, xv], [yu, yv]] = map.jacobian([0.0, 0.0])?;
    let predicted = map.apply([0.0, 0.0])?;
    let near =
        |uv: &&[f64; 2]| (uv[0] - predicted[0]).hypot(uv[1] - predicted[1]) < 0.2 * xu.hypot(yu).min(xv.hypot(yv));
    let uv = lattice.get(&(u, v)).filter(near).copied().unwrap_or(predicted);
    let curvature = [0, 1].map(|axis| bend(lattice, (u, v), axis).map_or(0.0, |b| b.curvature));
    Some(Seed { uv, sides: [[xu, yu], [xv, yv]], curvature })
}

/// How an edge runs through a corner.
pub(super) struct Bend {
    /// 1 / px, positive where the edge bends from the one axis towards the other. Perspective bends no edge.
    pub curvature: f64,
    /// Length of a square's side, px.
    pub side_px: f64,
}

/// The bend of the edge along an axis, from three corners in a row: the middle one is that of the key, where there are such.
pub(super) fn bend(lattice: &Lattice, (u, v): (i32, i32), axis: usize) -> Option<Bend> {
    let at = |along: i32| lattice.get(&if axis == 0 { (u + along, v) } else { (u, v + along) });
    [0, -1, 1].into_iter().find_map(|middle| {
        let [before, here, after] = [at(middle - 1)?, at(middle)?, at(middle + 1)?];
        let [x, y] = [0, 1].map(|k| 0.5 * (after[k] - before[k]));
        let [sx, sy] = [0, 1].map(|k| before[k] - 2.0 * here[k] + after[k]);
        let side_px = x.hypot(y);
        Some(Bend { curvature: (x * sy - y * sx) / side_px.powi(3), side_px })
    })
}
