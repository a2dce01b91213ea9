//! Whether the outer lines of a board are where they should be.

use std::collections::BTreeMap;

use super::fit::{LEAST_MARGIN_PX, Saddle};
use super::lattice::{Lattice, Placement};
use super::neighbours::{FAR_REACH, seed};
use crate::detect::shared::{LEAST_IN_VIEW, MISSING};
use crate::detect::{Outline, Picture};

/// A line of which this share of all corners is found is there.
const THERE: f64 = 0.5;

/// What the corners that were kept say about the outline.
pub(super) fn outline(picture: &Picture, kept: &BTreeMap<(i32, i32), Saddle>, placement: Placement) -> Outline {
    let known: Lattice = kept.iter().map(|(&key, saddle)| (key, saddle.uv)).collect();
    let (right, bottom) = (picture.width as f64 - 1.0, picture.height as f64 - 1.0);
    let in_view = |key: &(i32, i32)| {
        seed(&known, *key, FAR_REACH).is_some_and(|seed| {
            let [x, y] = seed.uv;
            x.min(y).min(right - x).min(bottom - y) > LEAST_MARGIN_PX + seed.side_px()
        })
    };
    let found = |line: &[(i32, i32)]| line.iter().filter(|key| kept.contains_key(key)).count() as f64;
    let visible = |line: &[(i32, i32)]| line.iter().filter(|key| kept.contains_key(key) || in_view(key)).count();
    // From each side to the first line of which enough is found.
    let missing = |side: &Vec<Vec<(i32, i32)>>| {
        let unseen = side.iter().map(|line| (found(line), visible(line)));
        unseen
            .take_while(|(found, visible)| *found == 0.0 || *found < MISSING * *visible as f64)
            .any(|(_, visible)| visible >= LEAST_IN_VIEW)
    };
    let sides = placement.lines_inwards();
    if sides.iter().any(missing) {
        Outline::LineMissing
    } else if sides.iter().all(|side| found(&side[0]) >= THERE * side[0].len() as f64) {
        Outline::Whole
    } else {
        Outline::Open
    }
}
