//! Which plate of another kind is in a picture that does not show that of the plate file.

use super::Picture;
use super::boards::charuco_seen::agreed;
use super::boards::labels::{Shader, parity};
use super::boards::lattices::find_lattice;
use super::boards::seen::{BoardSeen, SQUARES, trimmed};
use super::corners::lattice::BoardSize;
use super::tags::code::Reader;
use super::tags::scan::{all_dictionaries, certain, coded, scan, usual_dictionaries};
use crate::error::{Code, Error};
use crate::series::{Plate, PlateKind, TagPrint, Tags};

/// Fewest lines of corners either way that are a board.
const LEAST_LINES: i32 = 3;
/// Places within a square, along a side: it has one colour up to its corners, which the ground around a dot has not.
const WITHIN: [f64; 3] = [0.12, 0.5, 0.88];
/// Bits beyond chance of a tag that stands in no layout.
const TAG_BITS: f64 = 12.0;
/// Failures of a picture in which the stated plate may not be.
const IN_DOUBT: [Code; 4] =
    [Code::PlateNotFound, Code::PlateContradicted, Code::PlateIncomplete, Code::PlateLineHidden];
/// Tags that are more than a mark in the scene.
const SEVERAL: usize = 4;

/// A plate that is seen.
struct Instead {
    what: String,
    kind: &'static str,
    keys: &'static str,
}

/// The failure of a picture with the kind of plate that is seen in it; `None` where none is.
pub(super) fn named(picture: &Picture, plate: &Plate, failure: &Error) -> Option<Error> {
    if !IN_DOUBT.contains(&failure.code) {
        return None;
    }
    // Detectors of tags say themselves which other tags they see.
    let Instead { what, kind, keys } = match plate.kind {
        PlateKind::Chessboard => tags(picture, failure.code),
        PlateKind::CodedCircles | PlateKind::CircleGrid | PlateKind::Puzzleboard => {
            tags(picture, failure.code).or_else(|| chessboard(picture))
        }
        PlateKind::Charuco | PlateKind::Aprilgrid | PlateKind::ArucoGrid | PlateKind::Tag
            if failure.code == Code::PlateNotFound =>
        {
            chessboard(picture)
        }
        _ => None,
    }?;
    let what = format!("{what}, and no plate as stated: {}", failure.what);
    let remedy = format!("if that is the plate, write kind = \"{kind}\" in the plate file, with {keys}");
    Some(Error::new(failure.code, &failure.place, what, remedy))
}

fn tags(picture: &Picture, code: Code) -> Option<Instead> {
    let passes = coded(picture);
    if let Some(seen) = agreed(picture, &passes, usual_dictionaries()).filter(|seen| !seen.side_by_side) {
        return Some(Instead {
            what: format!("markers of {} are seen in every second square, as on a ChArUco board", seen.dictionary),
            kind: "charuco",
            keys: "columns, rows (inner corners), pitch_m, marker_m and dictionary",
        });
    }
    let prints = [TagPrint::Opencv, TagPrint::Kalibr];
    let all = all_dictionaries().flat_map(|dictionary| prints.map(|print| (dictionary, print)));
    let counted = all.map(|(dictionary, print)| {
        let name = dictionary.name();
        let tags = Tags { dictionary: name.to_owned(), print, side_m: 1.0, gap_m: 0.0, first_id: 0 };
        let reader = Reader::of(&tags, &dictionary);
        (certain(&reader, &scan(picture, &reader, &passes, false), TAG_BITS).len(), name, print)
    });
    // The first of equals.
    let (count, dictionary, print) = counted.reduce(|best, other| if other.0 > best.0 { other } else { best })?;
    let (kind, keys) = match (count, print) {
        (0, _) => return None,
        (1, _) => ("tag", "tag_m, id, and family or dictionary"),
        (_, TagPrint::Kalibr) => ("aprilgrid", "columns, rows (tags), tag_m, spacing and family"),
        _ => ("aruco-grid", "columns, rows (markers), marker_m, gap_m, dictionary and first_id"),
    };
    let is_enough = count >= SEVERAL || code == Code::PlateNotFound;
    let counted = if count == 1 { "a tag".to_owned() } else { format!("{count} tags") };
    let are = if count == 1 { "is" } else { "are" };
    is_enough.then(|| Instead { what: format!("{counted} of {dictionary} {are} seen"), kind, keys })
}

fn chessboard(picture: &Picture) -> Option<Instead> {
    let least = BoardSize { columns: LEAST_LINES, rows: LEAST_LINES };
    let lattice = find_lattice(picture, least)?;
    let range = trimmed(&lattice)?;
    let is_board = range.iter().all(|[low, high]| high - low + 1 >= LEAST_LINES);
    if !is_board {
        return None;
    }
    let shader = Shader::of(picture, &lattice)?;
    if evenness(&shader, range)? < SQUARES {
        return None;
    }
    let size = BoardSeen::of(&shader)?.size();
    let size = size.map_or_else(String::new, |[a, b]| format!(" of {} x {} inner corners", a.max(b), a.min(b)));
    let keys = "columns, rows (inner corners) and pitch_m";
    Some(Instead { what: format!("a chessboard{size} is seen"), kind: "chessboard", keys })
}

/// How well squares of either colour have it all over: the mean shade at the worst place within them, 1 for those of a board.
fn evenness(shader: &Shader, [[u0, u1], [v0, v1]]: [[i32; 2]; 2]) -> Option<f64> {
    let mean = |sign: f64, place: [f64; 2]| {
        let cells = (v0..v1).flat_map(|v| (u0..u1).map(move |u| (u, v))).filter(|(u, v)| parity(*u, *v) == sign);
        let shades: Vec<f64> = cells.filter_map(|cell| shader.at(cell, place)).collect();
        (!shades.is_empty()).then(|| sign * shades.iter().sum::<f64>() / shades.len() as f64)
    };
    let places = WITHIN.into_iter().flat_map(|v| WITHIN.map(|u| [u, v]));
    let means: Option<Vec<[f64; 2]>> = places.map(|place| Some([mean(1.0, place)?, mean(-1.0, place)?])).collect();
    let least = |sign: f64| means.iter().flatten().flatten().map(|mean| sign * mean).fold(f64::INFINITY, f64::min);
    means.is_some().then(|| f64::max(least(1.0), least(-1.0)))
}
