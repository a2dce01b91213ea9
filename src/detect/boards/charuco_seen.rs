//! Which ChArUco board is in a picture that does not show the one of the plate file.

use std::ops::Range;

use calib_targets_aruco::Dictionary;

use super::charuco_markers::{Print, needed};
use crate::detect::Picture;
use crate::detect::tags::code::Reader;
use crate::detect::tags::layout::Layout;
use crate::detect::tags::quads::Quad;
use crate::detect::tags::scan::{corners, scan, usual_dictionaries};
use crate::series::{Plate, dictionary_named};

/// Pairs of markers two squares apart that must agree on the numbers.
const LEAST_PAIRS: usize = 4;
/// Sides over squares that differ by less are the same.
const ALIKE: f64 = 0.06;

/// What the markers of the picture say.
#[derive(Debug, Clone, Copy)]
pub struct MarkersSeen {
    pub dictionary: &'static str,
    /// Inner corners in a row.
    pub columns: Option<u32>,
    /// Side of a marker over that of a square.
    pub side: Option<f64>,
    /// Markers in all places, as on an ArUco grid.
    pub side_by_side: bool,
    /// The number in the middle of those of the markers.
    pub middle_id: Option<u32>,
    /// The least and the greatest number of those that stand in a common layout.
    pub ids: [u32; 2],
    pairs: usize,
}

impl MarkersSeen {
    fn of(picture: &Picture, passes: &[Vec<Quad>], dictionary: Dictionary) -> Self {
        let layout = Layout::of(&corners(&scan(picture, &Reader::of_opencv(&dictionary), passes, false)));
        let (across, down) = (layout.agreed((2, 0)), layout.agreed((0, -2)));
        let pairs = [across, down].into_iter().flatten().map(|(_, count)| count).sum();
        let columns = down.and_then(|(squares, _)| u32::try_from(squares - 1).ok());
        let side_by_side = layout.change((1, 0)) == Some(1);
        Self {
            dictionary: dictionary.name(),
            columns,
            side: layout.length(2).map(|two| 2.0 / two),
            side_by_side,
            middle_id: layout.middle_id(),
            ids: layout.first_and_last_id(),
            pairs,
        }
    }

    /// Whether this is the board of the plate file, as far as it says.
    fn is(&self, plate: &Plate) -> bool {
        let columns = self.columns.is_none_or(|n| n == plate.columns);
        let is_print = !self.dictionary_differs(plate) && !self.side_differs(plate) && !self.side_by_side;
        is_print && columns && !self.ids_differ(plate)
    }

    /// Whether most numbers are none of the board.
    pub fn ids_differ(&self, plate: &Plate) -> bool {
        self.middle_id.is_some_and(|id| !ids(plate).contains(&id))
    }

    /// Whether the plate file states another dictionary, or none.
    pub fn dictionary_differs(&self, plate: &Plate) -> bool {
        stated(plate).is_none_or(|stated| stated.name() != self.dictionary)
    }

    /// Whether the plate file states another side.
    pub fn side_differs(&self, plate: &Plate) -> bool {
        let stated = plate.aruco.as_ref().map(|aruco| aruco.side_m / plate.pitch_m);
        self.side.zip(stated).is_some_and(|(seen, stated)| (seen - stated).abs() > ALIKE)
    }
}

/// Numbers of the markers of the plate file.
pub fn ids(plate: &Plate) -> Range<u32> {
    let first = plate.aruco.as_ref().map_or(0, |aruco| aruco.first_id);
    first..first.saturating_add(needed(plate))
}

/// The dictionary of the plate file.
fn stated(plate: &Plate) -> Option<Dictionary> {
    dictionary_named(&plate.aruco.as_ref()?.dictionary, "plate").ok()
}

/// The board that most markers agree with, where it is another one.
pub fn instead(picture: &Picture, plate: &Plate, passes: &[Vec<Quad>]) -> Option<MarkersSeen> {
    seen(picture, plate, passes).filter(|best| !best.is(plate))
}

/// The same, or the stated board with some numbers that it has not.
pub fn elsewhere(picture: &Picture, plate: &Plate, passes: &[Vec<Quad>]) -> Option<MarkersSeen> {
    let has_others = |seen: &MarkersSeen| seen.ids.iter().any(|id| !ids(plate).contains(id));
    seen(picture, plate, passes).filter(|best| !best.is(plate) || has_others(best))
}

fn seen(picture: &Picture, plate: &Plate, passes: &[Vec<Quad>]) -> Option<MarkersSeen> {
    agreed(picture, passes, stated(plate).into_iter().chain(usual_dictionaries()))
}

/// Side of the markers over that of a square, as their contours tell it, or else as they are read.
pub fn side_seen(picture: &Picture, print: &Print, passes: &[Vec<Quad>]) -> f64 {
    MarkersSeen::of(picture, passes, print.dictionary).side.unwrap_or(print.ratio)
}

/// The board that most markers agree with, of these dictionaries.
pub fn agreed(
    picture: &Picture,
    passes: &[Vec<Quad>],
    dictionaries: impl Iterator<Item = Dictionary>,
) -> Option<MarkersSeen> {
    let all = dictionaries.map(|dictionary| MarkersSeen::of(picture, passes, dictionary));
    // The first of equals.
    let best = all.reduce(|best, other| if other.pairs > best.pairs { other } else { best })?;
    (best.pairs >= LEAST_PAIRS).then_some(best)
}
