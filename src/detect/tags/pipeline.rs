//! The detector: the stages in their order.

use std::collections::BTreeMap;

use super::code::{Reader, SURE_BITS};
use super::edge_line::{EdgeLine, Measured, Side};
use super::layout::{Layout, Tagged};
use super::misfit::Usual;
use super::quads::Quad;
use super::scan::{certain, corners, passes, read_pass, scan};
use super::seen::{MEASURED, contradiction, gap_contradiction, instead};
use crate::detect::{Detection, Dropped, Outline, Picture};
use crate::error::{Code, Error, Notice, Result};
use crate::geom::PlaneMap;
use crate::linalg::median;
use crate::series::{Edge, Observation, Plate, PlateKind, TagPrint, Tags};

/// Sides that must say by how much ink has grown before they are believed.
const LEAST_GROWN: usize = 8;
/// Tags that say where another one stands.
const NEAREST: usize = 6;
/// How far a tag may be from where the others say, in sides of it: one neighbour extrapolates roughly.
const OFF: f64 = 0.5;

/// Corners of tags by their place on the plate, counter-clockwise from the bottom-left.
type Found = BTreeMap<usize, Quad>;
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
    let board = Board::of(picture, plate, tags)?;
    let seen = board.read();
    if let Some(error) = contradiction(plate, tags, &seen) {
        return Err(error);
    }
    let mut detection = Detection::default();
    let mut found: Found =
        seen.into_iter().filter_map(|(id, corners)| Some((*board.places.get(&id)?, corners))).collect();
    board.check(&mut found, &mut detection.dropped);
    if found.is_empty() {
        return Err(board.why_nothing());
    }
    board.complete(&mut found);
    board.measure(&found, &mut detection);
    detection.outline = board.outline(&found);
    let measured = Layout::of(&whole(&detection.observations));
    match gap_contradiction(tags, &measured, &MEASURED) {
        Some(error) => Err(error),
        None if detection.observations.is_empty() => Err(nothing(tags)),
        None => Ok(detection),
    }
}

struct Board<'a> {
    picture: &'a Picture,
    plate: &'a Plate,
    tags: &'a Tags,
    reader: Reader,
    /// Places of the tags by their numbers.
    places: BTreeMap<u32, usize>,
}

impl<'a> Board<'a> {
    fn of(picture: &'a Picture, plate: &'a Plate, tags: &'a Tags) -> Result<Self> {
        let count = plate.columns * plate.rows;
        let reader = Reader::of(tags, &tags.dictionary("plate", count)?);
        let number = |place: u32| tags.tag_at(place, plate.columns, plate.rows).0;
        let places = (0..count).map(|place| (number(place), place as usize)).collect();
        Ok(Self { picture, plate, tags, reader, places })
    }

    fn count(&self) -> usize {
        self.places.len()
    }

    /// Reads all quadrilaterals, until all tags of the plate are found.
    fn read(&self) -> Tagged {
        let mut found = BTreeMap::new();
        for quads in passes(self.picture) {
            read_pass(&quads, |quad| self.reader.read(self.picture, quad, false), &mut found);
            if self.places.keys().all(|id| found.contains_key(id)) {
                break;
            }
        }
        corners(&found)
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
            let sure =
                again.is_some_and(|r| r.wrong == 0 && (self.count() == 1 || self.reader.is_sure(0, self.count())));
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
                .filter(|(place, corners)| self.reader.confirms(self.picture, self.number(*place), corners))
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
            let [bottom, right, top, left] = usual.undisturbed(four).map(|side| Ok(side?.shrunk(grown_px)));
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

    /// Whether each outer line of tags shows one, or should be in view.
    fn outline(&self, found: &Found) -> Outline {
        let [columns, rows] = [self.plate.columns, self.plate.rows].map(|n| n as usize);
        let row = |r: usize| (0..columns).map(|c| r * columns + c).collect::<Vec<_>>();
        let column = |c: usize| (0..rows).map(|r| r * columns + c).collect::<Vec<_>>();
        let unseen = [row(0), row(rows - 1), column(0), column(columns - 1)]
            .into_iter()
            .filter(|line| !line.iter().any(|place| found.contains_key(place)));
        let size = [self.picture.width, self.picture.height].map(|n| n as f64 - 1.0);
        let inside = |p: &[f64; 2]| (0..2).all(|a| (0.0..size[a]).contains(&p[a]));
        let in_view = |place: &usize| self.predict(found, *place).is_some_and(|tag| tag.iter().all(inside));
        unseen.fold(Outline::Whole, |so_far, line| match so_far {
            Outline::TagsMissing => so_far,
            _ if line.iter().all(in_view) => Outline::TagsMissing,
            _ => Outline::Open,
        })
    }

    fn sides(&self, corners: &Quad) -> [Measured; 4] {
        [0, 1, 2, 3].map(|k: usize| {
            let (from, to) = (corners[k], corners[(k + 1) % 4]);
            let module = width(corners, k) / self.reader.side() as f64;
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
                let px = 0.5 * share * width(&corners, k);
                for (near, far) in [(corners[k], corners[(k + 1) % 4]), (corners[(k + 1) % 4], corners[k])] {
                    let end = [0, 1].map(|a| near[a] + share * (near[a] - far[a]));
                    // its light is where the ink of the tag is
                    let (from, to) = if near == corners[k] { (end, near) } else { (near, end) };
                    let square = EdgeLine::fit(self.picture, &Side { from, to, ink_px: px, paper_px: px });
                    grown.extend(square.map(|square| -0.5 * side.step_to(&square)));
                }
            }
        }
        median(&grown).filter(|_| grown.len() >= LEAST_GROWN).unwrap_or(0.0)
    }

    /// What is in the picture, where the plate is not.
    fn why_nothing(&self) -> Error {
        let quads: Vec<Vec<Quad>> = passes(self.picture).collect();
        let reflected = scan(self.picture, &self.reader, &quads, true);
        if !certain(&self.reader, &reflected, SURE_BITS).is_empty() {
            return mirrored();
        }
        instead(self.picture, self.plate, self.tags, &quads).unwrap_or_else(|| nothing(self.tags))
    }
}

/// The tags all of whose corners are measured.
fn whole(observations: &[Observation]) -> Tagged {
    let of_tag = observations.chunk_by(|a, b| a.marker / 4 == b.marker / 4);
    of_tag
        .filter_map(|tag| Some((tag[0].marker / 4, <&[Observation; 4]>::try_from(tag).ok()?.each_ref().map(|o| o.uv))))
        .collect()
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

/// Width of a tag across its side from corner `k` to the next, px: a tilted one is not as wide as it is long.
fn width(corners: &Quad, k: usize) -> f64 {
    let [from, to, far, last] = [0, 1, 2, 3].map(|i| corners[(k + i) % 4]);
    let along = [to[0] - from[0], to[1] - from[1]];
    let across = |p: [f64; 2]| along[0] * (p[1] - from[1]) - along[1] * (p[0] - from[0]);
    (across(far) + across(last)).abs() / (2.0 * distance(from, to))
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

/// What to say where no image shows an outer line of the tags, or of the corners between them.
pub fn unseen_line(plate: &Plate) -> Notice {
    Notice::new(
        Code::PlateLineHidden,
        "image",
        format!(
            "an outer row or column of the {} x {} {} is not seen where it should be, in no image",
            plate.columns,
            plate.rows,
            if plate.kind == PlateKind::Charuco { "inner corners" } else { "tags" }
        ),
        "if nothing covers it, the board is smaller: correct columns and rows of the plate file, in whose middle its frame is",
    )
}

fn mirrored() -> Error {
    Error::new(
        Code::PlateMirrored,
        "image",
        "the tags are mirrored",
        "turn off mirroring in the camera or in the image export",
    )
}
