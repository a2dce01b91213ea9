//! A second look at markers that are small against the blur, with what their neighbours tell.
//!
//! Two things make a small marker harder than a large one. Blur carries the ink of its neighbours into its pixels: once
//! they are measured it is taken off ([`crate::detect::circles::edge::nearby_ink`]). And the two edges of a thin ring are not told apart: the centre of
//! the one against that of the other costs three times the precision, although geometry knows it from the map between
//! plate and image around the marker ([`tie`]). Such an annulus is one observation, not two.

use std::collections::BTreeMap;

use super::agreement::centroid;
use super::measure::{Camera, Target};
use crate::detect::Picture;
use crate::detect::circles::edge::model::Pixels;
use crate::detect::circles::edge::nearby_ink::NearbyInk;
use crate::detect::circles::edge::refine::{Fit, WHOLE, refine};
use crate::detect::circles::edge::start::Start;
use crate::detect::circles::ellipse::Ellipse;
use crate::detect::circles::identity::lattice::Cell;
use crate::detect::circles::identity::local_map::LocalMap;
use crate::detect::circles::types::Measured;
use crate::linalg::median;

/// A circle or annulus of the plate: outer radius in units of the pitch, inner over outer radius.
#[derive(Debug, Clone, Copy)]
pub struct Figure {
    pub radius: f64,
    pub ratio: Option<f64>,
}

/// A marker after the first look.
#[derive(Debug, Clone, Copy)]
pub struct Place {
    pub figure: Figure,
    /// The first measurement, or where one failed.
    pub first: Result<Fit, Target>,
    /// Relative radius that stays clear of other markers.
    pub clear: f64,
}

/// Gap to a neighbour, in units of the blur, below which its ink reaches the edge of a marker; and below which it
/// reaches any of the pixels that are then used.
pub(super) const CROWDED: f64 = 6.0;
pub(super) const WITHIN_REACH: f64 = 8.0;
/// Width of a ring, in units of the blur, below which its edges are not told apart.
const THIN: f64 = 4.0;
/// What two circles of one marker are printed apart, as a part of the outer radius.
const ECCENTRIC: f64 = 5e-4;
/// What the map around a marker says about the distance of its two centres is good to this part.
const TIE_PART: f64 = 0.1;
/// A second fit whose residuals are worse by this factor speaks against what it assumed.
const WORSE: f64 = 1.15;

/// Measures again what gains from it: small markers close to each other, thin rings, and those that were refused. New
/// fits by cell; `figure` tells what the plate has in a cell.
pub fn rescue(
    picture: &Picture,
    camera: &Camera,
    places: &BTreeMap<Cell, Place>,
    figure: &impl Fn(Cell) -> Option<Figure>,
) -> BTreeMap<Cell, Fit> {
    let mut pixels = Pixels::default();
    let mut known: BTreeMap<Cell, Fit> = places.iter().filter_map(|(c, p)| p.first.ok().map(|f| (*c, f))).collect();
    let mut renewed = BTreeMap::new();
    // the second round takes off neighbours that are themselves free of theirs
    for _ in 0..2 {
        let around = Around { known: &known, figure };
        let mut look = |(cell, place): (&Cell, &Place)| {
            Some((*cell, around.measure_at(*cell, place, picture, camera, &mut pixels)?))
        };
        let fits: Vec<(Cell, (Fit, bool))> = places.iter().filter_map(&mut look).collect();
        let crowded = fits.iter().any(|(_, (_, crowded))| *crowded);
        for (cell, (fit, _)) in fits {
            renewed.insert(cell, fit);
            known.insert(cell, fit);
        }
        if !crowded {
            break;
        }
    }
    // judged at the end: neighbours that are not free of theirs yet leave something of them
    let is_worse = |cell: &Cell, fit: &Fit| places[cell].first.is_ok_and(|f| fit.misfit > WORSE * f.misfit.max(1.0));
    renewed.retain(|cell, fit| !is_worse(cell, fit));
    renewed
}

/// What is known around a cell.
struct Around<'a, F> {
    known: &'a BTreeMap<Cell, Fit>,
    figure: &'a F,
}

impl<F: Fn(Cell) -> Option<Figure>> Around<'_, F> {
    /// The new fit, and whether neighbours were taken off; `None` where nothing is to be gained.
    fn measure_at(
        &self,
        cell: Cell,
        place: &Place,
        picture: &Picture,
        camera: &Camera,
        pixels: &mut Pixels,
    ) -> Option<(Fit, bool)> {
        let old = self.known.get(&cell);
        let own = match (&place.first, old) {
            (_, Some(fit)) => fit.measured.outer.ellipse,
            (Err(target), None) => target.ellipse,
            (Ok(_), None) => return None,
        };
        let blur_px = old.map_or(camera.blur_px, |f| f.measured.blur_px);
        let gaps = self.gaps(cell, &own, place.figure.radius);
        let crowded = gaps.iter().any(|(_, gap)| *gap < CROWDED * blur_px);
        let [major, minor] = own.semi_axes();
        let thin = place.figure.ratio.is_some_and(|k| is_thin(k, minor, blur_px));
        if !(crowded || thin || place.first.is_err()) {
            return None;
        }
        let map = self.map(cell)?;
        let apart = if thin { tie(&map, &place.figure, major) } else { None };
        // what the picture tells better than geometry is left to the picture
        let tie =
            apart.filter(|(_, sigma)| place.first.is_err() || place.first.is_ok_and(|f| f.apart_sigma() > *sigma));
        if tie.is_none() && !crowded && place.first.is_ok() {
            return None;
        }
        let nearby: Vec<NearbyInk> = if crowded {
            let near = gaps.iter().filter(|(_, gap)| *gap < WITHIN_REACH * blur_px);
            near.flat_map(|(c, _)| self.nearby(*c, cell, &map)).collect()
        } else {
            Vec::new()
        };
        let mut start = self.start(cell, place, camera)?;
        if old.is_none_or(|f| f.measured.visible < WHOLE) {
            let predicted = map.ellipse(place.figure.radius)?;
            start.ellipse = Ellipse { centre: own.centre, ..predicted };
            start.shape_sigma = Some(0.05);
        }
        if let Some((apart, sigma)) = tie {
            (start.apart, start.tie_sigma) = (apart, Some(sigma));
        }
        let fit = refine(picture, &Start { nearby: &nearby, ..start }, pixels).ok()?;
        Some((fit, crowded))
    }

    fn start(&self, cell: Cell, place: &Place, camera: &Camera) -> Option<Start<'static>> {
        let base = match (self.known.get(&cell), &place.first) {
            (Some(fit), _) => Target {
                ellipse: fit.measured.outer.ellipse,
                ratio: place.figure.ratio,
                paper: fit.measured.paper,
                ink: fit.measured.ink,
                clear: place.clear,
                shape_sigma: None,
            },
            (None, Err(target)) => {
                let like = self.typical(cell)?;
                Target { ratio: place.figure.ratio, paper: like.paper, ink: like.ink, ..*target }
            }
            (None, Ok(_)) => return None,
        };
        let blur_px = median(self.near(cell, 2).map(|(_, f)| f.measured.blur_px)).filter(|blur| blur.is_finite());
        let camera = blur_px.map_or(*camera, |blur_px| Camera { blur_px, ..*camera });
        Some(base.start(&camera, 0.1))
    }

    fn near(&self, (i, j): Cell, reach: i32) -> impl Iterator<Item = (Cell, &Fit)> {
        let cells = (-reach..=reach).flat_map(move |b| (-reach..=reach).map(move |a| (i + a, j + b)));
        cells.filter_map(|c| self.known.get(&c).map(|f| (c, f)))
    }

    fn map(&self, cell: Cell) -> Option<LocalMap> {
        let offset = |c: Cell| [f64::from(c.0 - cell.0), f64::from(c.1 - cell.1)];
        let pairs: Vec<_> = self.near(cell, 2).map(|(c, f)| (offset(c), f.measured.outer.ellipse.centre)).collect();
        LocalMap::fit(&pairs)
    }

    /// The light at the nearest measured marker.
    fn typical(&self, cell: Cell) -> Option<&Measured> {
        let far = |c: &Cell| (c.0 - cell.0).pow(2) + (c.1 - cell.1).pow(2);
        self.near(cell, 2).min_by_key(|(c, _)| far(c)).map(|(_, f)| &f.measured)
    }

    /// Paper between a marker and the eight around it, px.
    fn gaps(&self, cell: Cell, own: &Ellipse, radius: f64) -> Vec<(Cell, f64)> {
        let Some(map) = self.map(cell) else { return Vec::new() };
        let steps = (-1..=1).flat_map(|b| (-1..=1).map(move |a| (a, b))).filter(|s| *s != (0, 0));
        let gap = |(a, b): (i32, i32)| {
            let c = (cell.0 + a, cell.1 + b);
            let other = (self.figure)(c)?;
            let centre = self
                .known
                .get(&c)
                .map_or_else(|| map.at([f64::from(a), f64::from(b)]), |f| f.measured.outer.ellipse.centre);
            Some((c, own.gap(centre, other.radius / radius)))
        };
        steps.filter_map(gap).collect()
    }

    /// Contours of a neighbour: as measured, or as the map around `cell` has them.
    fn nearby(&self, neighbour: Cell, cell: Cell, map: &LocalMap) -> Vec<NearbyInk> {
        if let Some(fit) = self.known.get(&neighbour) {
            return NearbyInk::of(&fit.measured).collect();
        }
        let Some((like, figure)) = self.typical(neighbour).zip((self.figure)(neighbour)) else { return Vec::new() };
        let centre = map.at([f64::from(neighbour.0 - cell.0), f64::from(neighbour.1 - cell.1)]);
        let one = |(ratio, sign): (f64, f64)| {
            let ellipse = map.ellipse(figure.radius * ratio).filter(|_| ratio > 0.0)?;
            Some(NearbyInk::at(&Ellipse { centre, ..ellipse }, like, sign))
        };
        let circles = [(1.0, 1.0), (figure.ratio.unwrap_or(0.0), -1.0)];
        circles.into_iter().filter_map(one).collect()
    }
}

/// A ring whose edges the blur does not tell apart, or whose middle it fills; `ratio` is inner over outer radius.
pub fn is_thin(ratio: f64, minor_px: f64, blur_px: f64) -> bool {
    (1.0 - ratio) * minor_px < THIN * blur_px || 2.0 * ratio * minor_px < THIN * blur_px
}

/// The distance of inner and outer centre by the map around the marker, and its standard deviation per axis, px.
fn tie(map: &LocalMap, figure: &Figure, major_px: f64) -> Option<([f64; 2], f64)> {
    let to = |p: [f64; 2]| Some(map.at(p));
    let (outer, inner) = (centroid(&to, figure.radius)?, centroid(&to, figure.radius * figure.ratio?)?);
    let offset = [0, 1].map(|a| inner[a] - outer[a]);
    Some((offset, tie_sigma(offset, major_px)))
}

/// Standard deviation per axis of what geometry says about the distance of inner and outer centre, px.
pub fn tie_sigma(apart: [f64; 2], major_px: f64) -> f64 {
    ECCENTRIC * major_px + TIE_PART * apart[0].hypot(apart[1])
}
