//! The detector: the stages in their order.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::Vector2;

use super::beside::Printed;
use super::clipped;
use super::code::{Reader, SURE_BITS};
use super::edge_line::{ENDS_SPARE_PX, EdgeLine, Measured, Side};
use super::growth::{self, Growth, InPicture, Outlined};
use super::layout::{Layout, Tagged};
use super::misfit::Usual;
use super::quads::{Quad, distance, middle};
use super::scan::{certain, coded, corners, passes, read_pass, scan};
use super::seen::{MEASURED, contradiction, gap_contradiction, instead};
use crate::detect::circles::{smoothed, variance_factor};
use crate::detect::detection::smoothed_notice;
use crate::detect::shared::mirrored;
use crate::detect::{Detection, Dropped, Outline, Picture};
use crate::error::{Code, Error, Notice, Result};
use crate::geom::PlaneMap;
use crate::linalg::median;
use crate::series::{Edge, Observation, Plate, TagPrint, Tags};

/// Sigma with which a picture is smoothed in which tags are lost as it is, px: of a mosaic of colours and of moire nothing is left.
const SMOOTHING_PX: f64 = 1.2;
/// Fewer tags than this are not all, as a rule.
const FEW: usize = 4;
/// Tags that are seen twice: one may be misread.
const LEAST_TWICE: usize = 2;
/// Sides that must say by how much ink has grown before they are believed.
const LEAST_GROWN: usize = 8;
/// Sigma of a normal distribution over its median distance from the middle.
const NORMAL_MEDIAN: f64 = 1.4826;
/// Tags that say where another one stands.
const NEAREST: usize = 6;
/// How far a tag may be from where the others say, in sides of it: one neighbour extrapolates roughly.
const OFF: f64 = 0.5;

/// Times that sides are measured again between the corners that they have.
const MOST_AGAIN: usize = 4;

/// A corner with its covariance (uu, uv, vv), px^2.
type Corner = ([f64; 2], [f64; 3]);
/// A corner, or why there is none.
type Crossing = std::result::Result<Corner, &'static str>;
type Crossings = [Crossing; 4];
/// Corners of tags by their place on the plate, counter-clockwise from the bottom-left.
type Found = BTreeMap<usize, Quad>;
/// Sides of tags by their place on the plate: bottom, right, top, left as printed.
type Sides = BTreeMap<usize, [Measured; 4]>;

/// Finds the tags of a plate and measures their corners; tags may be out of view or covered.
///
/// Positions in px with (0, 0) at the centre of the top-left pixel. Where few tags are found, or few of their corners can be measured, as in noise, behind the
/// mosaic of a colour sensor or after sharpening, they are sought and measured in a smoothed copy of the picture.
///
/// # Errors
/// A dictionary that is not known; no tag of the plate in the picture; every tag in it twice; a mirrored picture.
pub fn detect(picture: &Picture, plate: &Plate) -> Result<Detection> {
    let tags = plate.tags.as_ref().ok_or_else(no_tags)?;
    let board = Board::of(picture, None, plate, tags)?;
    let mut best = board.look()?;
    if !best.as_ref().is_some_and(|found| board.is_enough(found)) {
        let smooth = smoothed(picture, SMOOTHING_PX);
        let better = match Board::of(&smooth, Some(picture), plate, tags)?.look() {
            Err(error) if best.is_none() => return Err(error),
            other => other.ok().flatten(),
        };
        let corners = |found: &Option<Detection>| found.as_ref().map(|d| d.observations.len());
        if corners(&better) > corners(&best) {
            best = better;
        }
    }
    match best {
        None => Err(board.why_nothing()),
        Some(found) if found.observations.is_empty() => Err(nothing(tags)),
        Some(found) => Ok(found),
    }
}

struct Board<'a> {
    picture: &'a Picture,
    plate: &'a Plate,
    tags: &'a Tags,
    reader: Reader,
    /// Places of the tags by their numbers.
    places: BTreeMap<u32, usize>,
    /// The picture before it was smoothed.
    raw: Option<&'a Picture>,
    /// Sigma with which the picture was smoothed, px.
    smoothing_px: f64,
}

impl<'a> Board<'a> {
    fn of(picture: &'a Picture, raw: Option<&'a Picture>, plate: &'a Plate, tags: &'a Tags) -> Result<Self> {
        let count = plate.columns * plate.rows;
        let reader = Reader::of(tags, &tags.dictionary("plate", count)?);
        let number = |place: u32| tags.tag_at(place, plate.columns, plate.rows).0;
        let places = (0..count).map(|place| (number(place), place as usize)).collect();
        let smoothing_px = if raw.is_some() { SMOOTHING_PX } else { 0.0 };
        Ok(Self { picture, plate, tags, reader, places, raw, smoothing_px })
    }

    /// What is found in the picture, measured or not; `None` where there is none of the tags.
    fn look(&self) -> Result<Option<Detection>> {
        let (seen, twice) = self.read();
        if let Some(error) = contradiction(self.plate, self.tags, &seen) {
            return Err(error);
        }
        let mut detection = Detection::default();
        let mut found: Found =
            seen.into_iter().filter_map(|(id, corners)| Some((*self.places.get(&id)?, corners))).collect();
        self.check(&mut found, &mut detection.dropped);
        let is_twice = twice.len() >= LEAST_TWICE.min(self.count());
        if found.is_empty() {
            return if is_twice { Err(all_twice(&twice)) } else { Ok(None) };
        }
        self.complete(&mut found);
        let off_px = self.measure(&found, &mut detection);
        detection.outline = self.outline(&found);
        detection.notices.extend(is_twice.then(|| some_twice(&twice)));
        if self.smoothing_px > 0.0 {
            detection.notices.push(smoothed_notice(found.len(), found.len()));
        }
        let measured = Layout::of(&whole(&detection.observations));
        match gap_contradiction(self.tags, &measured, &MEASURED.less(off_px)) {
            Some(error) => Err(error),
            None => Ok(Some(detection)),
        }
    }

    /// Whether a smoothed picture would hardly show more.
    fn is_enough(&self, found: &Detection) -> bool {
        let corners = found.observations.len();
        corners >= found.dropped.len() && corners >= 2 * FEW.min(self.count())
    }

    fn count(&self) -> usize {
        self.places.len()
    }

    /// Reads all quadrilaterals, until all tags of the plate are found; with those that are seen in two places.
    fn read(&self) -> (Tagged, BTreeSet<u32>) {
        let (mut found, mut twice) = (BTreeMap::new(), BTreeSet::new());
        for quads in passes(self.picture) {
            twice.extend(read_pass(&quads, |quad| self.reader.read(self.picture, quad, false), &mut found));
            if self.places.keys().all(|id| found.contains_key(id)) {
                break;
            }
        }
        twice.retain(|id| self.places.contains_key(id));
        (corners(&found), twice)
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
            // Smoothed, the picture has been looked at twice.
            let is_alone = self.count() == 1 && self.smoothing_px == 0.0;
            let sure = again.is_some_and(|r| r.wrong == 0 && (is_alone || self.reader.is_sure(0, self.count())));
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

    /// Measures the corners; how far the sides may be off in common, px.
    fn measure(&self, found: &Found, detection: &mut Detection) -> f64 {
        let sides: Sides = found.iter().map(|(place, corners)| (*place, self.sides(*place, corners))).collect();
        let usual = Usual::of(sides.values().flatten().flatten());
        let sides: Sides = sides.into_iter().map(|(place, four)| (place, usual.undisturbed(four))).collect();
        let own = self.grown(found, &sides);
        let known = InPicture::of(&own.values().copied().collect::<Vec<_>>());
        let blur_px = median(sides.values().flatten().flatten().map(EdgeLine::blur_px)).unwrap_or(0.0);
        let untold = Growth::untold(blur_px, self.smoothing_px);
        let of_place = |place: &usize| match known.map(|known| known.with(own.get(place).copied())) {
            None => untold,
            Some(growth) if self.tags.print == TagPrint::Kalibr => growth,
            Some(growth) => growth.of_outline(),
        };
        for (place, four) in &sides {
            let id = self.number(*place);
            let growth = of_place(place);
            let four = self.corrected(four, &found[place], growth);
            for ((k, corner), start) in (0..).zip(crossings(&four, &found[place])).zip(found[place]) {
                match corner {
                    Ok((uv, covariance)) => {
                        let (marker, covariance) = (4 * id + k, Some(covariance));
                        detection.observations.push(Observation { marker, edge: Edge::Outer, uv, covariance });
                    }
                    Err(reason) => detection.dropped.push(Dropped::point(start, reason)),
                }
            }
        }
        detection.observations.sort_by_key(|o| o.marker);
        // An encoding displaces an edge by less than its blur.
        if known.is_some() { 0.0 } else { blur_px }
    }

    /// The sides of a tag with these corners where its ink ends, and not where it seems to.
    fn corrected(&self, four: &[Measured; 4], corners: &Quad, growth: Growth) -> [Measured; 4] {
        [0, 1, 2, 3].map(|k: usize| {
            let side = four[k]?;
            let length = distance(corners[k], corners[(k + 1) % 4]);
            let unseen = |raw| clipped::variance(raw, self.smoothing_px, &side, length, growth);
            Ok(side.shrunk(growth.px, growth.variance).displaced(self.raw.map_or(0.0, unseen)))
        })
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

    /// The sides of a tag with these corners. Where its code shines through its border, or its corners lie elsewhere, as those of bent sides
    /// do, once more with the corners that they have.
    fn sides(&self, place: usize, corners: &Quad) -> [Measured; 4] {
        let (mut corners, mut sides) = (*corners, self.sides_from(place, corners));
        for again in 0..MOST_AGAIN {
            let measured = crossings(&sides, &corners);
            let found = [0, 1, 2, 3].map(|k: usize| measured[k].map_or(corners[k], |(uv, _)| uv));
            let is_elsewhere = (0..4).any(|k| distance(found[k], corners[k]) > ENDS_SPARE_PX);
            let is_lit = again == 0 && sides.iter().flatten().any(EdgeLine::is_lit);
            if !is_elsewhere && !is_lit {
                break;
            }
            (corners, sides) = (found, self.sides_from(place, &found));
        }
        sides
    }

    fn sides_from(&self, place: usize, corners: &Quad) -> [Measured; 4] {
        let printed = self.print_of(place);
        [0, 1, 2, 3].map(|k: usize| {
            let line = EdgeLine::fit(self.picture, &self.side(corners, k), || printed.beside(corners, k))?;
            Ok(line.widened(variance_factor(line.blur_px(), self.smoothing_px)))
        })
    }

    /// Side `k` of a tag with these corners.
    fn side(&self, corners: &Quad, k: usize) -> Side {
        let module = width(corners, k) / self.reader.side() as f64;
        let (ink_px, paper_px) = (module * self.reader.border() as f64, module * self.gap().min(2.0));
        let sharpness = [(k + 1) % 4, k].map(|corner| sharpness(corners, corner));
        Side { from: corners[(k + 1) % 4], to: corners[k], ink_px, paper_px, sharpness }
    }

    fn print_of(&self, place: usize) -> Printed<'_> {
        let [columns, rows] = [self.plate.columns, self.plate.rows].map(|n| n as usize);
        let (column, row) = (place % columns, place / columns);
        let next = [row + 1 < rows, column + 1 < columns, row > 0, column > 0];
        Printed { reader: &self.reader, id: self.number(place), gap: self.gap(), next }
    }

    /// Paper beside a tag, modules.
    fn gap(&self) -> f64 {
        if self.tags.gap_m > 0.0 { self.tags.gap_m / self.tags.side_m * self.reader.side() as f64 } else { 1.0 }
    }

    /// How far ink reaches beyond its place, of the tags that say it. Where none of them has all four corners, as where the border of the picture
    /// cuts a side, those that are missing are taken as they were seen.
    fn grown(&self, found: &Found, sides: &Sides) -> BTreeMap<usize, Growth> {
        if self.tags.print == TagPrint::Kalibr {
            return self.grown_beside_squares(found, sides);
        }
        let tags: Vec<(usize, Crossings)> =
            sides.iter().map(|(place, four)| (*place, crossings(four, &found[place]))).collect();
        let of_code = |is_whole: bool| -> BTreeMap<usize, Growth> {
            let alike = tags.iter().filter(|(_, corners)| corners.iter().all(|c| c.is_ok()) == is_whole);
            let grown = |(place, corners): &(usize, Crossings)| {
                let rough = |k: usize| (found[place][k], [ENDS_SPARE_PX.powi(2), 0.0, ENDS_SPARE_PX.powi(2)]);
                let corners = [0, 1, 2, 3].map(|k| corners[k].unwrap_or(rough(k)));
                Some((*place, self.grown_of_code(*place, &corners, &sides[place])?))
            };
            alike.filter_map(grown).collect()
        };
        let whole = of_code(true);
        if whole.is_empty() { of_code(false) } else { whole }
    }

    /// What the code of a tag says, whose corners have these covariances.
    fn grown_of_code(&self, place: usize, corners: &[Corner; 4], sides: &[Measured; 4]) -> Option<Growth> {
        let contrast = median(sides.iter().flatten().map(EdgeLine::contrast))?;
        let variance = corners.iter().map(|(_, c)| c[0] + c[2]).sum::<f64>() / 8.0;
        let printed = self.print_of(place);
        let tag = Outlined { printed: &printed, corners: corners.map(|(uv, _)| uv), variance, contrast, sides };
        tag.growth(self.picture, self.smoothing_px)
    }

    /// Where a side of a tag of an AprilGrid ends, the side of a dark square goes on with its ink on the other side, so that what moves both
    /// moves them apart by twice that.
    fn grown_beside_squares(&self, found: &Found, sides: &Sides) -> BTreeMap<usize, Growth> {
        let share = self.tags.gap_m / self.tags.side_m;
        let beside = |(place, four): (&usize, &[Measured; 4])| {
            let mut grown: Vec<f64> = Vec::new();
            let corners = found[place];
            for (k, side) in four.iter().enumerate().filter_map(|(k, side)| Some((k, side.as_ref().ok()?))) {
                let px = 0.5 * share * width(&corners, k);
                for (near, far) in [(corners[k], corners[(k + 1) % 4]), (corners[(k + 1) % 4], corners[k])] {
                    let end = [0, 1].map(|a| near[a] + share * (near[a] - far[a]));
                    // its light is where the ink of the tag is
                    let (from, to) = if near == corners[k] { (end, near) } else { (near, end) };
                    let square = EdgeLine::fit(
                        self.picture,
                        &Side { from, to, ink_px: px, paper_px: px, sharpness: [0.0; 2] },
                        Vec::new,
                    );
                    grown.extend(square.map(|square| -0.5 * side.step_to(&square)));
                }
            }
            (*place, grown)
        };
        let said: BTreeMap<usize, Vec<f64>> = sides.iter().map(beside).collect();
        if said.values().map(Vec::len).sum::<usize>() < LEAST_GROWN {
            return BTreeMap::new();
        }
        let variance = scatter(&said);
        let of_tag = |(place, values): (usize, Vec<f64>)| Some((place, growth::of_tag(&values, variance)?));
        said.into_iter().filter_map(of_tag).collect()
    }

    /// What is in the picture, where the plate is not.
    fn why_nothing(&self) -> Error {
        let quads = coded(self.picture);
        let reflected = scan(self.picture, &self.reader, &quads, true);
        if !certain(&self.reader, &reflected, SURE_BITS).is_empty() {
            return mirrored("the tags are mirrored");
        }
        instead(self.picture, self.plate, self.tags, &quads).unwrap_or_else(|| nothing(self.tags))
    }
}

/// Variance of a value about the median of its tag, from the median of their distances.
fn scatter(said: &BTreeMap<usize, Vec<f64>>) -> f64 {
    let apart = said.values().flat_map(|values| {
        let middle = median(values).unwrap_or(0.0);
        values.iter().map(move |v| (v - middle).abs())
    });
    (NORMAL_MEDIAN * median(apart.collect::<Vec<_>>()).unwrap_or(0.0)).powi(2)
}

/// The tags all of whose corners are measured.
fn whole(observations: &[Observation]) -> Tagged {
    let of_tag = observations.chunk_by(|a, b| a.marker / 4 == b.marker / 4);
    of_tag
        .filter_map(|tag| Some((tag[0].marker / 4, <&[Observation; 4]>::try_from(tag).ok()?.each_ref().map(|o| o.uv))))
        .collect()
}

/// Where two sides cross, with the covariance.
fn crossing(a: Measured, b: Measured, start: [f64; 2]) -> Crossing {
    a?.crossing(&b?, start).ok_or("no crossing of two sides")
}

/// The corners of a tag, from its bottom-left.
fn crossings(sides: &[Measured; 4], starts: &Quad) -> Crossings {
    [0, 1, 2, 3].map(|k: usize| crossing(sides[(k + 3) % 4], sides[k], starts[k]))
}

/// From the order as printed to clockwise on the screen.
fn clockwise([a, b, c, d]: &Quad) -> Quad {
    [*d, *c, *b, *a]
}

/// Width of a tag across its side from corner `k` to the next, px: a tilted one is not as wide as it is long.
fn width(corners: &Quad, k: usize) -> f64 {
    let [from, to, far, last] = [0, 1, 2, 3].map(|i| corners[(k + i) % 4]);
    let along = [to[0] - from[0], to[1] - from[1]];
    let across = |p: [f64; 2]| along[0] * (p[1] - from[1]) - along[1] * (p[0] - from[0]);
    (across(far) + across(last)).abs() / (2.0 * distance(from, to))
}

/// Cosine of the angle at a corner of a tag.
fn sharpness(corners: &Quad, k: usize) -> f64 {
    let [at, next, last] = [0, 1, 3].map(|i| Vector2::from(corners[(k + i) % 4]));
    (next - at).normalize().dot(&(last - at).normalize())
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

fn twice_named(twice: &BTreeSet<u32>) -> String {
    match (twice.first(), twice.last()) {
        (Some(first), Some(last)) if first != last => {
            format!("{} tags from {first} to {last} are seen twice", twice.len())
        }
        (first, _) => format!("tag {} is seen twice", first.copied().unwrap_or(0)),
    }
}

const ONE_PLATE: &str =
    "take the image so that one plate with these tags is in view, or print others with other numbers";

fn all_twice(twice: &BTreeSet<u32>) -> Error {
    let what = format!("{}: which of them are those of the plate cannot be told", twice_named(twice));
    Error::new(Code::PlateTwice, "image", what, ONE_PLATE)
}

fn some_twice(twice: &BTreeSet<u32>) -> Notice {
    let what = format!("{}: those are taken that stand where the others say", twice_named(twice));
    Notice::new(Code::PlateTwice, "image", what, ONE_PLATE)
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
            if plate.tags.is_some() { "tags" } else { "inner corners" }
        ),
        "if nothing covers it, the board is smaller: correct columns and rows of the plate file, in whose middle its frame is",
    )
}
