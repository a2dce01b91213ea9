//! Which tags are in a picture that does not show those of the plate file.

use std::collections::BTreeMap;

use super::code::Reader;
use super::layout::{Layout, Steps, Tagged};
use super::quads::Quad;
use super::scan::{all_dictionaries, certain, scan};
use crate::detect::Picture;
use crate::error::{Code, Error};
use crate::series::{Plate, PlateKind, TagPrint, Tags};

/// A layout counts against that of the plate file when so many more tags agree with it: one that is misread may fit by chance.
const MORE: usize = 2;
/// How well the gap between neighbours is known.
pub struct Known {
    /// By how much of a side from middle to middle, in print, and px, on the picture, it may differ from what is stated.
    share: f64,
    px: f64,
    decimals: usize,
}

impl Known {
    /// Where the ends of a gap may be off by so many px each.
    pub(super) fn less(self, by_px: f64) -> Self {
        Self { px: self.px + 2.0 * by_px, ..self }
    }
}

/// From contours, which lie nearer to the ink where edges are blurred.
const BY_CONTOURS: Known = Known { share: 0.1, px: 2.0, decimals: 1 };
/// From measured sides, what ink has grown being taken off.
pub(super) const MEASURED: Known = Known { share: 0.02, px: 1.0, decimals: 2 };
/// Bits beyond chance of a tag that is named: of the stated dictionary, and of one of many.
const STATED_BITS: f64 = 8.0;
const OTHER_BITS: f64 = 12.0;

/// Why the tags that are seen are not those of the plate, though of its dictionary; `None` where they may be.
pub(super) fn contradiction(plate: &Plate, tags: &Tags, seen: &Tagged) -> Option<Error> {
    if plate.kind == PlateKind::Tag {
        return None;
    }
    let layout = Layout::of(seen);
    if layout.change((1, 0)).is_none() && layout.change((2, 0)) == Some(1) {
        return Some(chessboard_between(tags));
    }
    let places = places(plate, tags);
    let stated = |id: u32, (i, j): Steps| places.get(&id).map(|(column, row)| (column - i, row - j));
    let as_stated = layout.agreeing(stated).len();
    let as_seen = layout.counted_as_seen();
    if as_seen.len() >= as_stated + MORE {
        return Some(other_layout(plate, tags, &layout, &as_seen));
    }
    gap_contradiction(tags, &layout, &BY_CONTOURS)
}

/// Why neighbours are further apart than stated, or nearer.
pub(super) fn gap_contradiction(tags: &Tags, layout: &Layout, known: &Known) -> Option<Error> {
    let (gap, stated) = (layout.length(1)? - 1.0, tags.gap_m / tags.side_m);
    let off = (gap - stated).abs() / (1.0 + stated);
    (off > known.share && off * layout.side_px() > known.px).then(|| other_gap(tags, gap, known.decimals))
}

/// Columns to the right and rows up of the plate's tags, by their numbers.
fn places(plate: &Plate, tags: &Tags) -> BTreeMap<u32, Steps> {
    let columns = plate.columns.max(1);
    let steps = |place: u32| (i64::from(place % columns), -i64::from(place / columns));
    (0..columns * plate.rows).map(|place| (tags.tag_at(place, plate.columns, plate.rows).0, steps(place))).collect()
}

/// What tags are there instead: others of the dictionary, of another one, or with another border.
pub(super) fn instead(picture: &Picture, plate: &Plate, tags: &Tags, passes: &[Vec<Quad>]) -> Option<Error> {
    let stated = tags.dictionary("plate", 1).ok()?;
    let borders = [tags.print, if tags.print == TagPrint::Kalibr { TagPrint::Opencv } else { TagPrint::Kalibr }];
    let all = [stated].into_iter().chain(all_dictionaries());
    let candidates = all.flat_map(|dictionary| borders.map(|print| (dictionary, print)));
    let certain = candidates.map(|(dictionary, print)| {
        let reader = Reader::of(&Tags { print, ..tags.clone() }, &dictionary);
        let bits = if dictionary.name() == stated.name() { STATED_BITS } else { OTHER_BITS };
        (certain(&reader, &scan(picture, &reader, passes, false), bits), dictionary.name(), print)
    });
    // The first of equals.
    let best = certain.reduce(|best, other| if other.0.len() > best.0.len() { other } else { best })?;
    let (seen, dictionary, print) = best;
    let wanted = match plate.kind {
        PlateKind::Tag => format!("tag {}", tags.first_id),
        _ => format!("tags {} to {}", tags.first_id, tags.first_id + plate.columns * plate.rows - 1),
    };
    let there = match (seen.keys().next()?, seen.keys().next_back()?) {
        (first, last) if first == last => format!("tag {first}"),
        (first, last) => format!("{} tags from {first} to {last}", seen.len()),
    };
    let what = format!("{wanted} of {} not found, but {there} of {dictionary}", tags.dictionary);
    let (what, remedy) = if print.border() != tags.print.border() {
        let border = print.border();
        let what = format!("{what} with a border of {border} {}", if border == 1 { "module" } else { "modules" });
        (
            what,
            "correct kind in the plate file: an aprilgrid has tags with a border of 2 modules, an aruco-grid and a tag of 1",
        )
    } else if plate.kind == PlateKind::Tag {
        (what, "correct id, and family or dictionary, of the plate file")
    } else {
        (what, "correct first_id, and family or dictionary (this one, or a shorter one of its kind), of the plate file")
    };
    Some(Error::new(Code::PlateNotFound, "image", what, remedy))
}

fn other_layout(plate: &Plate, tags: &Tags, layout: &Layout, seen: &BTreeMap<u32, Steps>) -> Error {
    let extent = |of: fn(&Steps) -> i64| {
        let all = || seen.values().map(of);
        all().max().unwrap_or(0) - all().min().unwrap_or(0) + 1
    };
    let [right, up] = layout.changes();
    let columns = if right.abs() == 1 { up.abs().max(extent(|s| s.0)) } else { extent(|s| s.0) };
    let numbers = |first: Option<&u32>, last: Option<&u32>| [first, last].map(|n| n.copied().unwrap_or(0));
    let [first, last] = numbers(seen.keys().next(), seen.keys().next_back());
    let stated = tags.first_id + plate.columns * plate.rows - 1;
    let what = format!(
        "tags {first} to {last} are seen in {} rows of {columns}, not {} to {stated} in {} rows of {}",
        extent(|s| s.1),
        tags.first_id,
        plate.rows,
        plate.columns
    );
    let counted_up = tags.print == TagPrint::Kalibr;
    if right == 1 && (up > 0) == counted_up {
        let remedy =
            "correct columns, rows and first_id of the plate file: they count tags, columns from left to right";
        return Error::new(Code::PlateContradicted, "image", what, remedy);
    }
    let (kind, from) = if counted_up { ("aprilgrid", "bottom-left") } else { ("aruco-grid", "top-left") };
    let what = format!("{what}, and their numbers do not count from the {from}");
    let remedy = format!(
        "take a board that counts its tags as an {kind} does, or correct kind, dictionary or family of the plate file"
    );
    Error::new(Code::PlateContradicted, "image", what, remedy)
}

fn other_gap(tags: &Tags, gap: f64, decimals: usize) -> Error {
    let stated = tags.gap_m / tags.side_m;
    let what = format!("the tags are {gap:.decimals$} of their side apart, not {stated:.2}");
    let remedy = match tags.print {
        TagPrint::Kalibr => {
            "correct spacing of the plate file: the gap between two tags over tag_m, a ratio (not metres)"
        }
        _ => {
            "correct marker_m (with the black border) and gap_m (between two markers, not from middle to middle) of the plate file"
        }
    };
    Error::new(Code::PlateContradicted, "image", what, remedy)
}

fn chessboard_between(tags: &Tags) -> Error {
    let what = format!("tags of {} stand in every second square, as on a ChArUco board", tags.dictionary);
    let remedy = "write kind = \"charuco\" in the plate file, with columns, rows (inner corners), pitch_m and [aruco]";
    Error::new(Code::PlateContradicted, "image", what, remedy)
}
