//! The tags of a dictionary in a picture, whatever the plate file says of them.

use std::collections::{BTreeMap, BTreeSet};

use calib_targets_aruco::{Dictionary, builtins};

use super::code::{Reader, Reading, is_dark_square};
use super::layout::{Layout, Tagged};
use super::quads::{Quad, distance, inverted, middle, quads};
use crate::detect::Picture;

/// Largest tags, as shares of the picture's longer side, that are looked for one after the other (the threshold follows the light
/// over this length), and thresholds between paper and ink: above the middle, where the crossing of two dark squares is light, and
/// further up for squares that blur joins.
const PASSES: [(f64, f32); 5] = [(0.1, 0.6), (0.3, 0.6), (0.9, 0.6), (0.1, 0.75), (0.3, 0.75)];
/// Middles of two tags are further apart than this part of a side.
const APART: f64 = 0.5;
/// Tags whose numbers fit to their places: not by chance.
const LEAST_IN_LAYOUT: usize = 4;

/// Dictionaries of OpenCV's boards, the longest of each kind, which begins with the others.
pub fn usual_dictionaries() -> impl Iterator<Item = Dictionary> {
    let longest = [builtins::DICT_4X4_1000, builtins::DICT_5X5_1000, builtins::DICT_6X6_1000, builtins::DICT_7X7_1000];
    longest.into_iter().chain([builtins::DICT_ARUCO_ORIGINAL, builtins::DICT_APRILTAG_36h11])
}

/// Those that OpenCV has besides.
pub fn other_dictionaries() -> impl Iterator<Item = Dictionary> {
    let tags = [builtins::DICT_APRILTAG_16h5, builtins::DICT_APRILTAG_25h9, builtins::DICT_APRILTAG_36h10];
    tags.into_iter().chain([builtins::DICT_ARUCO_MIP_36h12])
}

/// All that OpenCV has.
pub fn all_dictionaries() -> impl Iterator<Item = Dictionary> {
    usual_dictionaries().chain(other_dictionaries())
}

/// Dark quadrilaterals, pass by pass.
pub fn passes(picture: &Picture) -> impl Iterator<Item = Vec<Quad>> {
    let longer = picture.width.max(picture.height) as f64;
    let inverted = inverted(picture);
    PASSES.into_iter().map(move |(share, threshold)| quads(&inverted, share * longer, threshold))
}

/// Those that may be tags, whatever their dictionary.
pub fn coded(picture: &Picture) -> Vec<Vec<Quad>> {
    let is_coded = |quad: &Quad| !is_dark_square(picture, quad);
    passes(picture).map(|quads| quads.into_iter().filter(is_coded).collect()).collect()
}

/// Adds what the quadrilaterals of a pass say; of two that say the same none is known to be right. Numbers that are seen in two places.
pub(super) fn read_pass(
    quads: &[Quad],
    read: impl Fn(&Quad) -> Option<Reading>,
    found: &mut BTreeMap<u32, Reading>,
) -> BTreeSet<u32> {
    let mut seen: BTreeMap<u32, Vec<Reading>> = BTreeMap::new();
    for reading in quads.iter().filter_map(read) {
        seen.entry(reading.id).or_default().push(reading);
    }
    let mut twice = BTreeSet::new();
    for (id, readings) in seen {
        let known = found.get(&id).or(readings.first()).copied();
        if known.is_some_and(|known| readings.iter().any(|other| are_apart(&known.corners, &other.corners))) {
            twice.insert(id);
        }
        if let [reading] = &readings[..] {
            found.entry(id).or_insert(*reading);
        }
    }
    twice
}

/// Whether two tags of a number lie beside each other.
fn are_apart(one: &Quad, other: &Quad) -> bool {
    let shortest = (0..4).map(|k| distance(one[k], one[(k + 1) % 4])).fold(f64::MAX, f64::min);
    distance(middle(one), middle(other)) > APART * shortest
}

/// What all quadrilaterals say, in print or in a mirror.
pub fn scan(picture: &Picture, reader: &Reader, passes: &[Vec<Quad>], mirrored: bool) -> BTreeMap<u32, Reading> {
    let mut found = BTreeMap::new();
    for quads in passes {
        read_pass(quads, |quad| reader.read(picture, quad, mirrored), &mut found);
    }
    found
}

/// The tags that can hardly be there by chance: they stand where their numbers say, or each has so many bits more than that.
pub fn certain(reader: &Reader, found: &BTreeMap<u32, Reading>, bits: f64) -> Tagged {
    let tags = corners(found);
    let in_layout = Layout::of(&tags).counted_as_seen();
    let sure = |id: &u32| reader.bits_beyond_chance(found[id].wrong, reader.count()) >= bits;
    let enough = in_layout.len() >= LEAST_IN_LAYOUT;
    tags.into_iter().filter(|(id, _)| if enough { in_layout.contains_key(id) } else { sure(id) }).collect()
}

pub fn corners(readings: &BTreeMap<u32, Reading>) -> Tagged {
    readings.iter().map(|(id, reading)| (*id, reading.corners)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIDE_PX: usize = 24;

    /// A square of ink on paper but for the light modules, smoothed over `blur` px, with its corners.
    fn picture(modules: usize, is_light: impl Fn(usize, usize) -> bool, blur: i32) -> (Picture, Quad) {
        let size = 2 * SIDE_PX;
        let first = SIDE_PX / 2;
        let ink = |x: i32, y: i32| {
            let [column, row] = [x, y].map(|p| (p - first as i32) * modules as i32);
            let inside = [column, row].iter().all(|p| (0..(SIDE_PX * modules) as i32).contains(p));
            inside && !is_light(row as usize / SIDE_PX, column as usize / SIDE_PX)
        };
        let value = |k: usize| {
            let (x, y) = ((k % size) as i32, (k / size) as i32);
            let around = (-blur..=blur).flat_map(|j| (-blur..=blur).map(move |i| (x + i, y + j)));
            let dark = around.filter(|(x, y)| ink(*x, *y)).count() as f32 / ((2 * blur + 1) * (2 * blur + 1)) as f32;
            200.0 - 160.0 * dark
        };
        let pixels = (0..size * size).map(value).collect();
        let [low, high] = [first as f64 - 0.5, (first + SIDE_PX) as f64 - 0.5];
        let quad = [[low, low], [high, low], [high, high], [low, high]];
        (Picture { width: size, height: size, pixels, full_scale: 255.0 }, quad)
    }

    #[test]
    fn a_dark_square_is_no_tag_and_no_tag_is_one() {
        for blur in [0, 1] {
            let (square, quad) = picture(1, |_, _| false, blur);
            assert!(is_dark_square(&square, &quad), "{blur}");
            for dictionary in all_dictionaries() {
                let reader = Reader::of_opencv(&dictionary);
                let bits = dictionary.marker_size();
                let light = |id: u32| (0..bits * bits).filter(|k| reader.is_light(id, k / bits, k % bits)).count();
                let darkest = (0..reader.count() as u32).min_by_key(|id| light(*id)).unwrap();
                let is_light = |row: usize, column: usize| {
                    let is_code = [row, column].iter().all(|k| (1..=bits).contains(k));
                    is_code && reader.is_light(darkest, row - 1, column - 1)
                };
                let (tag, quad) = picture(reader.side(), is_light, blur);
                assert!(!is_dark_square(&tag, &quad), "{} {darkest} {blur}", dictionary.name());
            }
        }
    }
}
