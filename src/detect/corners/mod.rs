//! From a labelled lattice of corners (`lattice`) to observations.

mod fit;
pub(super) mod lattice;
mod look;
mod model;
mod neighbours;
mod noise;
mod outline;
mod refusal;
mod rim;
mod smooth;
mod sums;

use std::collections::{BTreeMap, BTreeSet};

use fit::Saddle;
pub(super) use fit::Window;
use lattice::{Lattice, Placement};
use look::Sight;
pub(super) use look::quantile;
use neighbours::{FAR_REACH, REACH};
use noise::{correlation, covariance};
use outline::outline;
use refusal::Refusal;
use rim::out_of_line;

use super::correlated::Correlation;
use super::pictures::few_levels::few_levels;
use super::{Detection, Dropped, Picture};
use crate::linalg::median;
use crate::series::{Edge, Observation};

/// Share of full scale from which a pixel is clipped.
const CLIPPED: f32 = 0.99;
/// A dark square with a greater share of clipped pixels is washed out.
const WASHED_OUT: f64 = 0.2;
/// A corner with less than this share of the usual contrast is none.
const WEAK: f64 = 0.3;
/// A fit this many times worse than usual is disturbed by something else in the window ...
const DISTURBED: f64 = 3.0;
/// ... if its residuals exceed this share of the contrast.
const LEAST_DISTURBED: f64 = 0.06;

/// Corners whose residuals tell how the noise of neighbouring pixels is correlated: so many, or more where they have fewer pixels.
const NOISE_CORNERS: usize = 16;
const NOISE_PIXELS: usize = 6000;

/// Sub-pixel positions of all corners of the board, also of those that the lattice finder left out.
pub(super) fn measure(picture: &Picture, lattice: &Lattice, placement: Placement, window: Window) -> Detection {
    let mut view = Sight::of(picture, lattice, window);
    let mut first = First::of(&view, lattice, placement);
    if first.is_unfinished && view.may_be_smoothed() {
        view = view.smoothed(lattice);
        first = First::of(&view, lattice, placement);
    }
    if view.bend(&first.places()) {
        first = First::of(&view, &first.on(lattice), placement);
    }
    let First { fitted, retry, mut detection, .. } = first;
    let usual = Usual::of(picture, &fitted);
    let mut kept = BTreeMap::new();
    let mut closed: BTreeSet<(i32, i32)> = lattice.keys().copied().filter(|key| !retry.contains_key(key)).collect();
    for (key, saddle) in fitted {
        match usual.fault(key, &saddle, placement) {
            None => drop(kept.insert(key, saddle)),
            Some(reason) => detection.dropped.push(Dropped::point(saddle.uv, reason)),
        }
    }
    closed.extend(kept.keys());
    Missing { view: &view, closed, placement, usual: &usual }.find(&mut kept);
    detection.dropped.extend(retry.into_iter().filter(|(key, _)| !kept.contains_key(key)).map(|(_, dropped)| dropped));
    while let Some(saddle) = out_of_line(&kept).and_then(|key| kept.remove(&key)) {
        detection.dropped.push(Dropped::point(saddle.uv, "out of line"));
    }
    detection.outline = outline(picture, &kept, placement);
    let correlation = match view.has_correlated_noise() {
        true => correlation(&some(&kept), view.smoothing_px()),
        false => Correlation::WHITE,
    };
    for (key, saddle) in kept {
        if let Some(marker) = placement.id(key) {
            let covariance = Some(covariance(&correlation, &saddle));
            detection.observations.push(Observation { marker, edge: Edge::Outer, uv: saddle.uv, covariance });
        }
    }
    detection.observations.sort_by_key(|o| o.marker);
    detection
}

/// Corners that tell of the noise, all over the board.
fn some(kept: &BTreeMap<(i32, i32), Saddle>) -> Vec<&Saddle> {
    let pixels = kept.values().map(Saddle::pixels).sum::<usize>();
    let number = NOISE_CORNERS.max(kept.len() * NOISE_PIXELS / pixels.max(1));
    kept.values().step_by(kept.len().div_ceil(number).max(1)).collect()
}

/// Fits from where the lattice finder says that corners are.
#[derive(Default)]
struct First {
    fitted: BTreeMap<(i32, i32), Saddle>,
    /// What another start may find.
    retry: BTreeMap<(i32, i32), Dropped>,
    /// Whether a fit did not converge.
    is_unfinished: bool,
    /// What is none.
    detection: Detection,
}

impl First {
    fn places(&self) -> Lattice {
        self.fitted.iter().map(|(&key, saddle)| (key, saddle.uv)).collect()
    }

    /// The lattice with the corners where they were measured.
    fn on(&self, lattice: &Lattice) -> Lattice {
        let mut measured = lattice.clone();
        measured.extend(self.places());
        measured
    }

    fn of(view: &Sight, lattice: &Lattice, placement: Placement) -> Self {
        let mut first = Self::default();
        for (&key, &uv) in lattice {
            if placement.id(key).is_none() {
                first.detection.dropped.push(Dropped::point(uv, "off the board"));
                continue;
            }
            match view.corner(lattice, key, REACH) {
                Ok(saddle) => drop(first.fitted.insert(key, saddle)),
                Err(refusal) if refusal.may_pass() => {
                    first.is_unfinished |= refusal == Refusal::NotConverged;
                    first.retry.insert(key, Dropped::point(uv, refusal.reason()));
                }
                Err(refusal) => first.detection.dropped.push(Dropped::point(uv, refusal.reason())),
            }
        }
        first
    }
}

/// The search for corners that the lattice lacks, or whose first start led nowhere.
struct Missing<'a> {
    view: &'a Sight<'a>,
    /// Corners that are found, or are none.
    closed: BTreeSet<(i32, i32)>,
    placement: Placement,
    usual: &'a Usual<'a>,
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
                .filter(|key| !known.contains_key(key) && !self.closed.contains(key))
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
        let saddle = self.view.corner(known, key, reach).ok()?;
        self.usual.fault(key, &saddle, self.placement).is_none().then_some(saddle)
    }
}

/// What most corners of the picture have in common.
struct Usual<'a> {
    /// Where over-exposure shows; `None` for one of few grey levels, of which white is one.
    picture: Option<&'a Picture>,
    /// Half the step between the squares, counts.
    contrast: f64,
    /// Residual of the fit over that.
    residual: f64,
}

impl<'a> Usual<'a> {
    fn of(picture: &'a Picture, fitted: &BTreeMap<(i32, i32), Saddle>) -> Self {
        Self {
            picture: few_levels(picture).is_none().then_some(picture),
            contrast: median(fitted.values().map(|s| s.contrast.abs())).unwrap_or(0.0),
            residual: median(fitted.values().map(|s| s.noise / s.contrast.abs())).unwrap_or(0.0),
        }
    }

    /// Why a fitted corner cannot be one of this board.
    fn fault(&self, (u, v): (i32, i32), saddle: &Saddle, placement: Placement) -> Option<&'static str> {
        let contrast = if placement.is_dark((u - 1, v)) { -saddle.contrast } else { saddle.contrast };
        if contrast < WEAK * self.contrast {
            Some("weak or wrong contrast")
        } else if saddle.noise > f64::max(DISTURBED * self.residual, LEAST_DISTURBED) * contrast {
            Some("disturbed surroundings")
        } else if self.picture.is_some_and(|picture| is_washed_out(picture, saddle)) {
            Some("over-exposed")
        } else {
            None
        }
    }
}

/// Whether a crossing is over-exposed: an edge is where the picture is half-way between dark and light, and both dark squares must be dark.
fn is_washed_out(picture: &Picture, saddle: &Saddle) -> bool {
    let level = CLIPPED * picture.full_scale;
    let [x, y] = saddle.uv.map(|c| c.floor() as usize);
    let around = [(x, y), (x + 1, y), (x, y + 1), (x + 1, y + 1)];
    let clipped = |&(x, y): &(usize, usize)| x >= picture.width || y >= picture.height || picture.at(x, y) >= level;
    around.iter().all(clipped) || saddle.dark_share_from(f64::from(level)) > WASHED_OUT
}
