//! Inner corners of a ChArUco board: a chessboard with ArUco markers in its light squares.
//!
//! The `calib-targets` library decodes the markers and so tells which corner is which; the positions are measured as on
//! a plain chessboard, from the pixels along the edges that the markers leave free.

use std::borrow::Cow;
use std::cell::LazyCell;

use calib_targets_chessboard::ChessCorner;

use super::charuco_markers::{Marker, Print, decode, prints, rare_prints};
use super::charuco_numbers::{Contradiction, Counting, Numbers};
use super::charuco_placed::placed;
use super::charuco_seen::{MarkersSeen, elsewhere, ids, instead, side_seen};
use super::charuco_tagged::tagged;
use super::chessboard::{WINDOW, board_size};
use super::corner_finder::find_corners;
use super::lattices::{Sorted, on_no_larger};
use super::sizes::{best_of_sizes, on_picture, scales, shows_most};
use crate::detect::corners::lattice::{BoardSize, Lattice, Placement};
use crate::detect::corners::{Window, measure};
use crate::detect::pictures::bytes::Bytes;
use crate::detect::shared::{KEEP_OFF_PX, mirrored};
use crate::detect::size_seen::twin;
use crate::detect::tags::quads::Quad;
use crate::detect::tags::scan::{all_dictionaries, coded};
use crate::detect::{Detection, Outline, Picture};
use crate::error::{Code, Error, Notice, Result};
use crate::geom::PlaneMap;
use crate::series::Plate;

/// Markers that must be read where the dictionary is not stated, or where an outer line is not seen.
const LEAST_MARKERS: usize = 4;
/// Markers of the last row that prove a row below it.
const FURTHER_MARKERS: usize = 2;
/// Corners that are on no board of the other layout and prove this one.
const FURTHER_CORNERS: usize = 2;
/// Squares around the inner corners in which other corners still are those of the board.
const MARGIN: f64 = 1.5;
/// Wrong bits of a marker that proves where the board lies.
const SURE_BITS: u8 = 1;

/// Finds the inner corners of a ChArUco board (markers in the light squares counting up row by row; first square dark, or light in
/// OpenCV's layout before 4.6); parts of the board may be out of view or covered.
///
/// Ids are row-major from the top-left, positions in px with (0, 0) at the centre of the top-left pixel. Where the plate
/// does not state dictionary and marker size, OpenCV's dictionaries and the usual sizes are tried; a notice says which.
///
/// # Errors
/// An unknown dictionary or one with too few markers; no board in the picture; a mirrored picture; a board of the other layout.
pub fn detect(picture: &Picture, plate: &Plate) -> Result<Detection> {
    let board = board_size(plate)?;
    let bytes = &Bytes::of(picture);
    let prints = prints(plate)?;
    let least = if plate.aruco.is_some() { 1 } else { LEAST_MARKERS };
    let cells_of = plate.aruco.is_some().then_some(picture);
    let sizes = scales(bytes).map(|scale| LazyCell::new(move || Scaled::of(bytes, scale)));
    let best = |prints: &[Print]| {
        let sought = Sought { prints, board, least, cells_of };
        best_of_sizes(&sizes, board, |found: &Found| &found.lattice, |scaled| at_scale(scaled, sought))
    };
    let rare = rare_prints(plate);
    let found = match best(&prints)? {
        None if !rare.is_empty() => best(&rare)?,
        found => found,
    };
    let quads = LazyCell::new(|| coded(picture));
    let found = match found {
        Some(found) => found,
        None => {
            let mut other = bytes.clone();
            other.mirror();
            if at_scale(&Scaled::of(&other, 1.0), Sought { prints: &prints, board, least, cells_of: None })?.is_some() {
                return Err(mirrored("the board is mirrored"));
            }
            on_markers(picture, plate, (&prints, board), &quads)?
        }
    };
    let numbers = Numbers::read(picture, &found.lattice, &found.print, board);
    if let Some(contradiction) = numbers.contradiction(found.markers)
        && let Some(refusal) = numbers_contradict(plate, contradiction, || instead(picture, plate, &quads))
    {
        return refusal;
    }
    let is_sure = found.is_sure(board) || found.has_place && numbers.tell_layout();
    if plate.aruco.is_some() && prints.first().is_some_and(|stated| stated.legacy != found.print.legacy) {
        let error = other_layout(found.print.legacy);
        return if found.tells_layout() { Ok(Detection::other_size(error)) } else { Err(error) };
    }
    if plate.aruco.is_none() && found.rival.is_some_and(|rival| rival >= found.explains()) {
        return Err(either_layout());
    }
    if found.has_further_row && is_sure {
        return Ok(Detection::beyond(more_rows(plate)));
    }
    let Found { print, lattice, has_twin, .. } = found;
    let window = Window { arm: 0.5 * (1.0 - print.ratio), keep_off_px: KEEP_OFF_PX, ..WINDOW };
    let mut detection = measure(picture, &lattice, Placement::on_board(board, print.legacy), window);
    if detection.outline == Outline::LineMissing && is_sure {
        detection.outline = Outline::TagsMissing;
    }
    if detection.observations.is_empty()
        && let Some(seen) = instead(picture, plate, &quads)
    {
        return Err(other_board(plate, &seen));
    }
    if plate.aruco.is_none() {
        detection.notices.push(found_print(&print, side_seen(picture, &print, &quads)));
    }
    detection.notices.extend(has_twin.then(twin));
    Ok(detection)
}

/// The refusal of a board whose markers, all that are in view, are not those that the plate file has at their places.
fn numbers_contradict(
    plate: &Plate,
    contradiction: Contradiction,
    instead: impl Fn() -> Option<MarkersSeen>,
) -> Option<Result<Detection>> {
    let stated = plate.aruco.as_ref().map_or(0, |aruco| aruco.first_id);
    match contradiction {
        Contradiction::Counts(Counting { first_id, legacy }) if first_id == stated => {
            let is_other = plate.aruco.as_ref().is_some_and(|aruco| aruco.legacy != legacy);
            is_other.then(|| Ok(Detection::other_size(other_layout(legacy))))
        }
        Contradiction::Counts(counting) => Some(Ok(Detection::other_size(other_first(plate, counting)))),
        Contradiction::Outnumbers { wrong, right } => {
            let named = |seen| other_board(plate, &seen);
            Some(Err(instead().map_or_else(|| other_numbers(plate, [wrong, right]), named)))
        }
    }
}

/// What was found at one of the sizes.
struct Found {
    print: Print,
    markers: usize,
    /// Corners of the board in px of the picture.
    lattice: Lattice,
    /// Whether the markers alone say which corner is which on a board of this layout, wherever it seems to end.
    has_place: bool,
    /// Whether the board goes on below its last row.
    has_further_row: bool,
    /// What the other layout explains, where markers fit into it.
    rival: Option<(usize, usize)>,
    /// Whether another board with the same markers lies beside it.
    has_twin: bool,
}

impl Found {
    fn of(print: &Print, markers: &[Marker], lattice: Lattice, board: BoardSize) -> Self {
        Self {
            print: *print,
            markers: markers.len(),
            lattice,
            has_place: have_place(markers),
            has_further_row: has_further_row(markers, board),
            rival: None,
            has_twin: false,
        }
    }

    /// Markers that were read, then corners that are on the board: in the other layout most markers agree, moved by a column.
    fn explains(&self) -> (usize, usize) {
        (self.markers, self.lattice.len())
    }

    /// Where both have the same corners, those of both; else what explains more, of equals the other.
    fn beside(self, other: Self) -> Self {
        let common = |(at, uv): (_, &[f64; 2])| self.lattice.get(at).map(|own| own == uv);
        let mut common = other.lattice.iter().filter_map(common).peekable();
        let is_same = self.print.legacy == other.print.legacy && common.peek().is_some() && common.all(|same| same);
        let (mut best, rest) = if other.explains() >= self.explains() { (other, self) } else { (self, other) };
        let before = best.lattice.len();
        for (at, uv) in rest.lattice.into_iter().filter(|_| is_same) {
            best.lattice.entry(at).or_insert(uv);
        }
        // They may be on a board of the other layout as well.
        let added = best.lattice.len() - before;
        best.rival = best.rival.map(|(markers, corners)| (markers, corners + added));
        best
    }

    /// Whether the markers alone say which corner is which. On a board with an odd number of squares in a row they fit into both layouts,
    /// moved by a column: where one of these is not seen at all, the other may be the moved one.
    fn is_sure(&self, board: BoardSize) -> bool {
        let told = match self.rival {
            Some((markers, _)) => markers < self.markers,
            None => board.rows % 2 == 0 || board.columns % 2 == 1,
        };
        self.has_place && told
    }

    /// Whether markers or corners are seen that are on no board of the other layout.
    fn tells_layout(&self) -> bool {
        let (markers, corners) = self.rival.unwrap_or_default();
        self.has_place && (self.markers > markers || self.lattice.len() >= corners + FURTHER_CORNERS)
    }
}

/// What is sought.
#[derive(Clone, Copy)]
struct Sought<'a> {
    prints: &'a [Print],
    board: BoardSize,
    /// Markers that must be read.
    least: usize,
    /// The picture, where cells of a lattice are read, too.
    cells_of: Option<&'a Picture>,
}

/// The picture at another size.
struct Scaled<'a> {
    scale: f64,
    bytes: Cow<'a, Bytes>,
    /// Corners that may be those of a board.
    corners: Vec<ChessCorner>,
}

impl<'a> Scaled<'a> {
    fn of(bytes: &'a Bytes, scale: f64) -> Self {
        let bytes = bytes.scaled(scale);
        let corners = on_no_larger(find_corners(&bytes), most_squares());
        Self { scale, bytes, corners }
    }
}

/// Squares of the largest board: no dictionary has markers for more, and what has is a cloth or a floor.
fn most_squares() -> usize {
    2 * all_dictionaries().map(|dictionary| dictionary.codes().len()).max().unwrap_or(0)
}

/// The print that explains most markers in the picture at a size, with what was found.
fn at_scale(scaled: &Scaled, sought: Sought) -> Result<Option<Found>> {
    let Scaled { scale, bytes, corners } = scaled;
    let mut corners = Cow::from(corners);
    loop {
        let found = among(&corners, (bytes, *scale), sought)?;
        let is_most = |found: &Found| found.has_place && shows_most(&found.lattice, sought.board);
        if found.as_ref().is_some_and(|found| sought.cells_of.is_none() || is_most(found)) {
            return Ok(found);
        }
        let Sorted { lattices, left } = Sorted::of(&corners, *scale);
        let on_lattice = sought.on_lattices(&lattices);
        if let Some(found) = [on_lattice, found].into_iter().flatten().reduce(Found::beside) {
            return Ok(Some(found));
        }
        if lattices.is_empty() {
            return Ok(None);
        }
        corners = Cow::from(left);
    }
}

impl Sought<'_> {
    /// The board of the largest lattice on which enough markers tell where it lies.
    fn on_lattices(self, lattices: &[Lattice]) -> Option<Found> {
        let picture = self.cells_of?;
        // Of a larger lattice no board is half.
        let able = |lattice: &&Lattice| lattice.len() <= 2 * (self.board.columns * self.board.rows) as usize;
        let mut boards = lattices.iter().filter(able).filter_map(|lattice| {
            let on_lattice = |print| self.on_lattice(picture, lattice, print);
            with_rival(self.prints.iter().filter_map(on_lattice).collect())
        });
        let mut best = boards.next()?;
        best.has_twin = boards.any(|other| other.lattice.keys().any(|corner| best.lattice.contains_key(corner)));
        Some(best)
    }

    fn on_lattice(self, picture: &Picture, lattice: &Lattice, print: &Print) -> Option<Found> {
        let (placement, markers) = placed(picture, lattice, print, self.board)?;
        let at = |(key, uv): (&(i32, i32), &[f64; 2])| (placement.board_from_lattice(*key), *uv);
        let on_board = lattice.iter().map(at).filter(|(at, _)| self.board.contains(*at)).collect();
        have_place(&markers).then(|| Found::of(print, &markers, on_board, self.board))
    }
}

/// The same, of some of the corners.
fn among(corners: &[ChessCorner], (scaled, scale): (&Bytes, f64), sought: Sought) -> Result<Option<Found>> {
    let Sought { prints, board, least, .. } = sought;
    let mut all: Vec<Found> = Vec::new();
    for print in prints {
        let Some(found) = decode(&scaled.view(), corners, print, board)? else { continue };
        if found.markers.len() < least {
            continue;
        }
        let place = |[x, y]: [f32; 2]| [x, y].map(|c| on_picture(c, scale));
        let lattice = found.corners.iter().map(|(at, px)| (*at, place(*px))).collect();
        all.push(Found::of(print, &found.markers, lattice, board));
    }
    let mut best = with_rival(all);
    if let Some(best) = &mut best {
        let others = beside(corners, &best.lattice, scale, board);
        if 2 * others.len() >= best.lattice.len() {
            let twin = decode(&scaled.view(), &others, &best.print, board)?;
            best.has_twin = twin.is_some_and(|twin| have_place(&twin.markers));
        }
    }
    Ok(best)
}

/// The first of those that explain most.
fn with_rival(mut all: Vec<Found>) -> Option<Found> {
    let explains: Vec<_> = all.iter().map(|found| (found.print.legacy, found.explains())).collect();
    let most = explains.iter().map(|(_, explains)| *explains).max()?;
    let mut best = all.swap_remove(explains.iter().position(|(_, explains)| *explains == most)?);
    let rivals = explains.iter().filter(|(legacy, _)| *legacy != best.print.legacy);
    best.rival = rivals.map(|(_, explains)| *explains).max();
    Some(best)
}

/// The corners that do not lie on the board, with its margin.
fn beside(corners: &[ChessCorner], lattice: &Lattice, scale: f64, board: BoardSize) -> Vec<ChessCorner> {
    let pairs: Vec<_> = lattice.iter().map(|(&(u, v), &uv)| (uv, [f64::from(u), f64::from(v)])).collect();
    let Some(map) = PlaneMap::fit(&pairs) else { return Vec::new() };
    let size = [board.columns, board.rows].map(f64::from);
    let is_beside = |corner: &&ChessCorner| {
        let place = [corner.position.x, corner.position.y].map(|c| on_picture(c, scale));
        map.apply(place).is_none_or(|at| (0..2).any(|a| at[a] < -MARGIN || at[a] > size[a] - 1.0 + MARGIN))
    };
    corners.iter().filter(is_beside).copied().collect()
}

/// The stated board, where no marker says otherwise, by the contours of those that are in its squares.
fn on_markers(
    picture: &Picture,
    plate: &Plate,
    (prints, board): (&[Print], BoardSize),
    quads: &[Vec<Quad>],
) -> Result<Found> {
    if let Some(seen) = elsewhere(picture, plate, quads) {
        return Err(other_board(plate, &seen));
    }
    let stated = prints.iter().filter(|_| plate.aruco.is_some());
    let on_board = |print: &Print| {
        let (markers, lattice) = tagged(picture, quads, print, board)?;
        // Markers of the last row are read whether or not there is one below it.
        let found = Found { has_further_row: false, ..Found::of(print, &markers, lattice, board) };
        found.has_place.then_some(found)
    };
    let all: Vec<Found> = stated.filter_map(on_board).collect();
    // Corners are where markers have them, and tell nothing of the layout.
    let (own, others): (Vec<Found>, Vec<Found>) =
        all.into_iter().partition(|found| prints.first().is_some_and(|stated| stated.legacy == found.print.legacy));
    let rival = others.iter().map(|found| found.markers).max();
    let own = own.into_iter().max_by_key(|found| found.markers).filter(|own| Some(own.markers) >= rival);
    own.map(|own| Found { rival: rival.map(|markers| (markers, own.lattice.len())), ..own })
        .ok_or_else(|| no_board(plate))
}

/// Whether markers of the last row of squares are read: that takes the corners below them, and at the end of a board there are none.
fn has_further_row(markers: &[Marker], board: BoardSize) -> bool {
    markers.iter().filter(|m| m.wrong_bits <= SURE_BITS && m.row == board.rows).count() >= FURTHER_MARKERS
}

/// Whether enough markers, in more than one row, say where a board of their layout lies: with twenty cells of 4 x 4 bits, one such place in 50 million boards
/// is there by chance.
fn have_place(markers: &[Marker]) -> bool {
    let rows: Vec<i32> = markers.iter().filter(|m| m.wrong_bits <= SURE_BITS).map(|m| m.row).collect();
    rows.len() >= LEAST_MARKERS && rows.iter().any(|r| *r != rows[0])
}

fn found_print(print: &Print, side: f64) -> Notice {
    Notice::new(
        Code::DictionaryGuessed,
        "plate",
        format!(
            "markers of {} with a side of about {side:.2} squares were found{}",
            print.dictionary.name(),
            if print.legacy { ", in OpenCV's layout before 4.6" } else { "" }
        ),
        match print.legacy {
            false => "write dictionary and side_m under [aruco] in the plate file, which is faster and safer",
            true => {
                "write dictionary, side_m and legacy = true under [aruco] in the plate file, which is faster and safer"
            }
        },
    )
}

fn not_found(plate: &Plate) -> String {
    match &plate.aruco {
        Some(aruco) => format!("no ChArUco board with markers of {} found", aruco.dictionary),
        None => "no ChArUco board with markers of a usual kind found".to_owned(),
    }
}

fn no_board(plate: &Plate) -> Error {
    let remedy =
        "check that the board is in view and sharp, and columns, rows (inner corners) and [aruco] of the plate file";
    Error::new(Code::PlateNotFound, "image", not_found(plate), remedy)
}

fn other_board(plate: &Plate, seen: &MarkersSeen) -> Error {
    let mut differs = Vec::new();
    if seen.dictionary_differs(plate) {
        differs.push(format!("the markers are those of {}", seen.dictionary));
    }
    if seen.side_by_side {
        differs.push("they stand side by side, as on an aruco-grid".to_owned());
    } else {
        if let Some(columns) = seen.columns.filter(|n| *n != plate.columns) {
            differs
                .push(format!("they stand as on a board with {columns} inner corners in a row, not {}", plate.columns));
        }
        if let Some(id) = seen.middle_id.filter(|_| seen.ids_differ(plate)) {
            let stated = ids(plate);
            let last = stated.end.saturating_sub(1);
            differs.push(format!("their numbers are about {id}, and those of the board {} to {last}", stated.start));
        }
        if let Some(side) = seen.side.filter(|_| seen.side_differs(plate)) {
            differs.push(format!("their side is {side:.2} squares"));
        }
    }
    if differs.is_empty() {
        let [first, last] = seen.ids;
        let stated = ids(plate);
        let last_stated = stated.end.saturating_sub(1);
        differs
            .push(format!("markers {first} to {last} are read, and the board has {} to {last_stated}", stated.start));
    }
    let remedy = match seen.side_by_side {
        true => {
            "write kind = \"aruco-grid\" in the plate file, with columns, rows (markers), marker_m, gap_m and dictionary"
        }
        false => {
            "correct the plate file: columns and rows count inner corners (one less than squares), columns from left to right; dictionary \
             (this one, or a shorter one of its kind), side_m and first_id (the number of the first marker) stand under [aruco]"
        }
    };
    Error::new(Code::PlateNotFound, "image", format!("{}: {}", not_found(plate), differs.join(", ")), remedy)
}

/// Markers that count from another number than the plate file states.
fn other_first(plate: &Plate, Counting { first_id, legacy }: Counting) -> Error {
    let stated = plate.aruco.as_ref();
    let what =
        format!("the markers of the board count from {first_id}, not {}", stated.map_or(0, |aruco| aruco.first_id));
    let other_layout = legacy != stated.is_some_and(|aruco| aruco.legacy) && plate.rows % 2 == 1;
    let layout = if other_layout { format!(", and legacy = {legacy}") } else { String::new() };
    let remedy = format!(
        "write first_id = {first_id}{layout} in the plate file; if that is not the board, correct columns and rows"
    );
    Error::new(Code::PlateContradicted, "image", what, remedy)
}

/// Markers that no board of these columns and rows has at their places.
fn other_numbers(plate: &Plate, [wrong, right]: [usize; 2]) -> Error {
    let stated = ids(plate);
    let what = format!(
        "{wrong} markers are read where a board with {} to {} has others or none, and {right} that agree",
        stated.start,
        stated.end.saturating_sub(1)
    );
    let remedy = "correct first_id, dictionary and legacy of the plate file, or columns and rows";
    Error::new(Code::PlateContradicted, "image", what, remedy)
}

fn more_rows(plate: &Plate) -> Error {
    let what = format!("the board goes on below the {} rows of inner corners of the plate file", plate.rows);
    let remedy = "correct rows of the plate file: columns and rows count inner corners (one less than squares)";
    Error::new(Code::PlateContradicted, "image", what, remedy)
}

fn other_layout(legacy: bool) -> Error {
    let (what, remedy) = match legacy {
        true => (
            "the board has OpenCV's layout before 4.6: its first square is light",
            "write legacy = true under [aruco] in the plate file",
        ),
        false => (
            "the first square of the board is dark, which is not OpenCV's layout before 4.6",
            "remove legacy from [aruco] in the plate file",
        ),
    };
    Error::new(Code::PlateNotDetectable, "image", what, remedy)
}

fn either_layout() -> Error {
    let what =
        "the markers in view fit into both of OpenCV's layouts, a column apart: which corner is which cannot be told";
    let remedy = "write dictionary, side_m and legacy (true for the layout before 4.6) under [aruco] in the plate file";
    Error::new(Code::PlateIncomplete, "image", what, remedy)
}

#[cfg(test)]
mod tests {
    use calib_targets_aruco::builtins::DICT_4X4_50;

    use super::*;

    /// The library may read one marker less and find more corners.
    #[test]
    fn of_two_finds_with_the_same_corners_both_count() {
        let board = BoardSize { columns: 8, rows: 5 };
        let print = Print { dictionary: DICT_4X4_50, ratio: 0.7, legacy: false, first_id: 0 };
        let found = |markers: i32, columns: i32, step: f64| {
            let markers: Vec<Marker> = (0..markers).map(|k| Marker { row: k % 4, wrong_bits: 0 }).collect();
            let corners = (0..columns).flat_map(|u| (0..5).map(move |v| (u, v)));
            let lattice = corners.map(|at| (at, [at.0, at.1].map(|n| step * f64::from(n)))).collect();
            Found::of(&print, &markers, lattice, board)
        };
        let both = found(13, 6, 20.0).beside(found(12, 8, 20.0));
        assert_eq!(both.explains(), (13, 40));
        let elsewhere = found(13, 6, 20.0).beside(found(12, 8, 21.0));
        assert_eq!(elsewhere.explains(), (13, 30));
        assert_eq!(found(12, 8, 20.0).beside(found(12, 8, 21.0)).lattice[&(1, 1)], [21.0; 2]);
    }
}
