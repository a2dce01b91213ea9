//! Corners of the square tags of an AprilGrid, of a grid of ArUco markers, or of a single tag.
//!
//! ```text
//! picture -> quadrilaterals -> codes -> do the neighbours agree -> tags that are missing -> sides -> corners
//! ```
//!
//! A code of few bits is read by chance now and then: such a tag counts only where the tags around it say that it stands there.

use std::collections::BTreeMap;

use super::edge_line::{EdgeLine, Side};
use super::misfit::Usual;
use super::quads::{Quad, quads};
use super::tag_code::{Reader, Reading};
use super::{Detection, Dropped, Picture};
use crate::error::{Code, Error, Result};
use crate::geom::PlaneMap;
use crate::series::{Edge, Observation, Plate, TagPrint, Tags};

/// Largest tags, as shares of the picture's longer side, that are looked for one after the other (the threshold follows the light
/// over this length), and thresholds between paper and ink: above the middle, where the crossing of two dark squares is light, and
/// further up for squares that blur joins.
const PASSES: [(f64, f32); 5] = [(0.1, 0.6), (0.3, 0.6), (0.9, 0.6), (0.1, 0.75), (0.3, 0.75)];
/// Sides that must say by how much ink has grown before they are believed.
const LEAST_GROWN: usize = 8;
/// Tags that say where another one stands.
const NEAREST: usize = 6;
/// How far a tag may be from where the others say, in sides of it: one neighbour extrapolates roughly.
const OFF: f64 = 0.5;

/// Corners of tags by their place on the plate, counter-clockwise from the bottom-left.
type Found = BTreeMap<usize, Quad>;
/// A side, or why there is none.
type Measured = std::result::Result<EdgeLine, &'static str>;
/// Sides of tags by their place on the plate: bottom, right, top, left as printed.
type Sides = BTreeMap<usize, [Measured; 4]>;

/// Finds the tags of a plate and measures their corners; tags may be out of view or covered.
///
/// Positions in px with (0, 0) at the centre of the top-left pixel.
///
/// # Errors
/// A dictionary that is not known; no tag of the plate in the picture; a mirrored picture.
pub fn detect(picture: &Picture, plate: &Plate) -> Result<Detection> {
    let tags = plate.tags.as_ref().ok_or_else(no_tags)?;
    let board = Board { picture, plate, tags, reader: Reader::of(plate, tags)? };
    let (mut found, mut detection) = (Found::new(), Detection::default());
    for pass in PASSES {
        board.read(pass, &mut found);
        if found.len() == board.count() {
            break;
        }
    }
    board.check(&mut found, &mut detection.dropped);
    if found.is_empty() {
        return Err(if board.is_mirrored() { mirrored() } else { nothing(tags) });
    }
    board.complete(&mut found);
    board.measure(&found, &mut detection);
    if detection.observations.is_empty() {
        return Err(nothing(tags));
    }
    Ok(detection)
}

struct Board<'a> {
    picture: &'a Picture,
    plate: &'a Plate,
    tags: &'a Tags,
    reader: Reader,
}

impl Board<'_> {
    fn count(&self) -> usize {
        (self.plate.columns * self.plate.rows) as usize
    }

    fn quads(&self, (share, threshold): (f64, f32)) -> Vec<Quad> {
        quads(self.picture, share * self.picture.width.max(self.picture.height) as f64, threshold)
    }

    /// Reads all quadrilaterals; of two that say the same none is known to be right.
    fn read(&self, pass: (f64, f32), found: &mut Found) {
        let mut seen: BTreeMap<usize, Vec<Reading>> = BTreeMap::new();
        for reading in self.quads(pass).iter().filter_map(|quad| self.reader.read(self.picture, quad, false)) {
            let alone = self.count() == 1 || self.reader.is_sure(reading.wrong);
            if alone || self.count() > 1 {
                seen.entry(reading.place).or_default().push(reading);
            }
        }
        for (place, readings) in seen {
            if let ([reading], false) = (&readings[..], found.contains_key(&place)) {
                found.insert(place, reading.corners);
            }
        }
    }

    /// Leaves out tags that do not stand where the others say; a single one must be sure of its code.
    fn check(&self, found: &mut Found, dropped: &mut Vec<Dropped>) {
        loop {
            let off = |place: &usize| self.off(found, *place);
            let judged: Vec<(usize, Option<f64>)> = found.keys().map(|place| (*place, off(place))).collect();
            let worst = judged.iter().filter_map(|(p, off)| off.map(|o| (*p, o))).max_by(|a, b| a.1.total_cmp(&b.1));
            match worst.filter(|(_, off)| *off > OFF) {
                Some((place, _)) => drop_tag(found, place, dropped),
                None => break,
            }
        }
        if let (1, Some(place)) = (found.len(), found.keys().next().copied()) {
            let again = self.reader.read(self.picture, &clockwise(&found[&place]), false);
            let sure = again.is_some_and(|r| r.wrong == 0 && (self.count() == 1 || self.reader.is_sure(0)));
            if !sure {
                drop_tag(found, place, dropped);
            }
        }
    }

    /// How far a tag is from where the others say, in sides of it; `None` where there are no others.
    fn off(&self, found: &Found, place: usize) -> Option<f64> {
        let predicted = self.predict(found, place)?;
        let seen = found.get(&place)?;
        let off = (0..4).map(|k| distance(seen[k], predicted[k]));
        let side = (0..4).map(|k| distance(seen[k], seen[(k + 1) % 4]));
        Some(off.fold(0.0, f64::max) / (side.sum::<f64>() / 4.0))
    }

    /// Corners of a tag by the map through the tags around it, without itself.
    fn predict(&self, found: &Found, place: usize) -> Option<Quad> {
        let columns = self.plate.columns as usize;
        let far = |other: usize| {
            let (dc, dr) = ((other % columns).abs_diff(place % columns), (other / columns).abs_diff(place / columns));
            dc * dc + dr * dr
        };
        let mut others: Vec<usize> = found.keys().copied().filter(|other| *other != place).collect();
        others.sort_by_key(|other| (far(*other), *other));
        others.truncate(NEAREST);
        let pairs: Vec<_> = others.iter().flat_map(|o| self.printed(*o).into_iter().zip(found[o])).collect();
        let map = PlaneMap::fit(&pairs)?;
        let [a, b, c, d] = self.printed(place).map(|p| map.apply(p));
        Some([a?, b?, c?, d?])
    }

    /// Corners of a tag on the plate in sides, rows upwards, from the middle.
    fn printed(&self, place: usize) -> Quad {
        let (_, [x, y]) = self.tags.tag_at(place as u32, self.plate.columns, self.plate.rows);
        let half = self.tags.side_m / 2.0;
        [[-half, -half], [half, -half], [half, half], [-half, half]].map(|[dx, dy]| [x + dx, y + dy])
    }

    fn number(&self, place: usize) -> u32 {
        self.tags.tag_at(place as u32, self.plate.columns, self.plate.rows).0
    }

    /// Looks for the missing tags where the others say that they are.
    fn complete(&self, found: &mut Found) {
        loop {
            let missing = (0..self.count()).filter(|place| !found.contains_key(place));
            let seen: Vec<(usize, Quad)> = missing
                .filter_map(|place| Some((place, self.predict(found, place).filter(|_| found.len() > 1)?)))
                .filter(|(place, corners)| self.reader.confirms(self.picture, *place, corners))
                .collect();
            if seen.is_empty() {
                return;
            }
            found.extend(seen);
        }
    }

    fn measure(&self, found: &Found, detection: &mut Detection) {
        let sides: Sides = found.iter().map(|(place, corners)| (*place, self.sides(corners))).collect();
        let (grown_px, usual) = (self.grown(found, &sides), Usual::of(sides.values().flatten().flatten()));
        for (place, four) in sides {
            let id = self.number(place);
            let [bottom, right, top, left] = four.map(|side| Ok(usual.undisturbed(side?)?.shrunk(grown_px)));
            let crossings = [(left, bottom), (bottom, right), (right, top), (top, left)];
            for ((k, (a, b)), start) in (0..).zip(crossings).zip(found[&place]) {
                match crossing(a, b, start) {
                    Ok((uv, covariance)) => {
                        let (marker, covariance) = (4 * id + k, Some(covariance));
                        detection.observations.push(Observation { marker, edge: Edge::Outer, uv, covariance });
                    }
                    Err(reason) => detection.dropped.push(Dropped::point(start, reason)),
                }
            }
        }
        detection.observations.sort_by_key(|o| o.marker);
    }

    fn sides(&self, corners: &Quad) -> [Measured; 4] {
        [0, 1, 2, 3].map(|k: usize| {
            let (from, to) = (corners[k], corners[(k + 1) % 4]);
            let module = distance(from, to) / self.reader.side() as f64;
            let (ink_px, paper_px) = (module * self.reader.border() as f64, module * self.gap().min(2.0));
            EdgeLine::fit(self.picture, &Side { from: to, to: from, ink_px, paper_px })
        })
    }

    /// Paper beside a tag, modules.
    fn gap(&self) -> f64 {
        if self.tags.gap_m > 0.0 { self.tags.gap_m / self.tags.side_m * self.reader.side() as f64 } else { 1.0 }
    }

    /// How far ink reaches beyond its place, px: where a side of a tag of an AprilGrid ends, the side of a dark square goes on with its
    /// ink on the other side, so that printing and clipping move the two apart by twice that.
    fn grown(&self, found: &Found, sides: &Sides) -> f64 {
        if self.tags.print != TagPrint::Kalibr {
            return 0.0;
        }
        let share = self.tags.gap_m / self.tags.side_m;
        let mut grown: Vec<f64> = Vec::new();
        for (place, four) in sides {
            let corners = found[place];
            for (k, side) in four.iter().enumerate().filter_map(|(k, side)| Some((k, side.as_ref().ok()?))) {
                for (near, far) in [(corners[k], corners[(k + 1) % 4]), (corners[(k + 1) % 4], corners[k])] {
                    let end = [0, 1].map(|a| near[a] + share * (near[a] - far[a]));
                    let px = 0.5 * share * distance(near, far);
                    // its light is where the ink of the tag is
                    let (from, to) = if near == corners[k] { (end, near) } else { (near, end) };
                    let square = EdgeLine::fit(self.picture, &Side { from, to, ink_px: px, paper_px: px });
                    grown.extend(square.map(|square| -0.5 * side.step_to(&square)));
                }
            }
        }
        grown.sort_by(f64::total_cmp);
        if grown.len() < LEAST_GROWN { 0.0 } else { grown[grown.len() / 2] }
    }

    fn is_mirrored(&self) -> bool {
        let reads =
            |quad: &Quad| self.reader.read(self.picture, quad, true).is_some_and(|r| self.reader.is_sure(r.wrong));
        PASSES.iter().any(|pass| self.quads(*pass).iter().any(reads))
    }
}

/// Where two sides cross, with the covariance.
fn crossing(a: Measured, b: Measured, start: [f64; 2]) -> std::result::Result<([f64; 2], [f64; 3]), &'static str> {
    a?.crossing(&b?, start).ok_or("no crossing of two sides")
}

/// From the order as printed to clockwise on the screen.
fn clockwise([a, b, c, d]: &Quad) -> Quad {
    [*d, *c, *b, *a]
}

fn distance(a: [f64; 2], b: [f64; 2]) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

fn middle(q: &Quad) -> [f64; 2] {
    [0, 1].map(|a| q.iter().map(|p| p[a]).sum::<f64>() / 4.0)
}

fn drop_tag(found: &mut Found, place: usize, dropped: &mut Vec<Dropped>) {
    if let Some(corners) = found.remove(&place) {
        dropped.push(Dropped::point(middle(&corners), "out of place"));
    }
}

fn no_tags() -> Error {
    Error::new(
        Code::PlateNotDetectable,
        "plate",
        "the plate does not say which tags it has",
        "give tag_m or marker_m and the other keys of the kind in plate.toml",
    )
}

fn nothing(tags: &Tags) -> Error {
    let what = format!("no tag of {} found that stands where it should", tags.dictionary);
    let remedy = "check that the plate is in view and sharp, and that plate.toml describes it: dictionary or family, first_id, \
                  columns and rows";
    Error::new(Code::PlateNotFound, "image", what, remedy)
}

fn mirrored() -> Error {
    Error::new(
        Code::PlateMirrored,
        "image",
        "the tags are mirrored",
        "turn off mirroring in the camera or in the image export",
    )
}
