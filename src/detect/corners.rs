//! From a labelled lattice of corners to observations.

use std::collections::BTreeMap;

use super::board_labels::{Lattice, Placement};
use super::saddle::{Saddle, Seed, Window, refine};
use super::{Detection, Dropped, Picture};
use crate::geom::PlaneMap;
use crate::series::{Edge, Observation};

/// Neighbours up to this many squares away say where a corner is and how the edges run ...
const REACH: i32 = 2;
/// ... and up to this many where a gap in the lattice has to be bridged.
const FAR_REACH: i32 = 5;
/// A corner with less than this share of the usual contrast is none.
const WEAK: f64 = 0.3;
/// A fit this many times worse than usual is disturbed by something else in the window ...
const DISTURBED: f64 = 3.0;
/// ... if its residuals exceed this share of the contrast.
const LEAST_DISTURBED: f64 = 0.06;

/// Sub-pixel positions of all corners of the board, also of those that the lattice finder left out.
pub(super) fn measure(picture: &Picture, lattice: &Lattice, placement: Placement, window: Window) -> Detection {
    let mut detection = Detection::default();
    let mut fitted = BTreeMap::new();
    for (&key, &uv) in lattice {
        let seed = seed(lattice, key, REACH).ok_or("no neighbours");
        match seed.and_then(|seed| refine(picture, &seed, window)) {
            _ if placement.id(key).is_none() => detection.dropped.push(Dropped::point(uv, "off the board")),
            Ok(saddle) => drop(fitted.insert(key, saddle)),
            Err(reason) => detection.dropped.push(Dropped::point(uv, reason)),
        }
    }
    let usual = Usual::of(&fitted);
    let mut kept = BTreeMap::new();
    for (key, saddle) in fitted {
        match usual.fault(key, &saddle, placement) {
            None => drop(kept.insert(key, saddle)),
            Some(reason) => detection.dropped.push(Dropped::point(saddle.uv, reason)),
        }
    }
    let missing = Missing { picture, lattice, placement, window, usual: &usual };
    missing.find(&mut kept);
    for (key, saddle) in kept {
        if let Some(marker) = placement.id(key) {
            let (uv, covariance) = (saddle.uv, Some(saddle.covariance));
            detection.observations.push(Observation { marker, edge: Edge::Outer, uv, covariance });
        }
    }
    detection.observations.sort_by_key(|o| o.marker);
    detection
}

/// The search for corners that the lattice lacks.
struct Missing<'a> {
    picture: &'a Picture,
    lattice: &'a Lattice,
    placement: Placement,
    window: Window,
    usual: &'a Usual,
}

impl Missing<'_> {
    /// Works outwards from the corners that are known.
    fn find(&self, kept: &mut BTreeMap<(i32, i32), Saddle>) {
        let mut known: Lattice = kept.iter().map(|(&key, saddle)| (key, saddle.uv)).collect();
        let mut reach = REACH;
        loop {
            let found: Vec<_> = self
                .placement
                .corners()
                .filter(|key| !known.contains_key(key) && !self.lattice.contains_key(key))
                .filter_map(|key| Some((key, self.fit(&known, key, reach)?)))
                .collect();
            if found.is_empty() && reach == FAR_REACH {
                return;
            }
            reach = if found.is_empty() { FAR_REACH } else { REACH };
            known.extend(found.iter().map(|(key, saddle)| (*key, saddle.uv)));
            kept.extend(found);
        }
    }

    fn fit(&self, known: &Lattice, key: (i32, i32), reach: i32) -> Option<Saddle> {
        let saddle = refine(self.picture, &seed(known, key, reach)?, self.window).ok()?;
        self.usual.fault(key, &saddle, self.placement).is_none().then_some(saddle)
    }
}

/// What most corners of the picture have in common.
struct Usual {
    /// Half the step between the squares, counts.
    contrast: f64,
    /// Residual of the fit over that.
    residual: f64,
}

impl Usual {
    fn of(fitted: &BTreeMap<(i32, i32), Saddle>) -> Self {
        Self {
            contrast: median(fitted.values().map(|s| s.contrast.abs())),
            residual: median(fitted.values().map(|s| s.noise / s.contrast.abs())),
        }
    }

    /// Why a fitted corner cannot be one of this board.
    fn fault(&self, (u, v): (i32, i32), saddle: &Saddle, placement: Placement) -> Option<&'static str> {
        let contrast = if placement.is_dark((u - 1, v)) { -saddle.contrast } else { saddle.contrast };
        if contrast < WEAK * self.contrast {
            Some("weak or wrong contrast")
        } else if saddle.noise > f64::max(DISTURBED * self.residual, LEAST_DISTURBED) * contrast {
            Some("disturbed surroundings")
        } else {
            None
        }
    }
}

fn median(values: impl Iterator<Item = f64>) -> f64 {
    let mut sorted: Vec<f64> = values.collect();
    sorted.sort_by(f64::total_cmp);
    sorted.get(sorted.len() / 2).copied().unwrap_or(0.0)
}

/// A corner with the directions and lengths of the edges there, from the map of its neighbourhood.
fn seed(lattice: &Lattice, (u, v): (i32, i32), reach: i32) -> Option<Seed> {
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
    Some(Seed { uv, sides: [[xu, yu], [xv, yv]] })
}
