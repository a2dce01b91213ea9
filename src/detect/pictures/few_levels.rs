//! How many grey levels a picture has.

use std::collections::{BTreeMap, BTreeSet};

use crate::detect::Picture;

/// A picture with as many levels has blurred edges.
const ENOUGH: usize = 8;
/// Share of the places where a row changes its level that is left out of account: stray pixels.
const STRAY: f64 = 3e-3;
/// A picture with more levels, however rare, has enough.
const MOST_SEEN: usize = 64;
/// One of so many pixels is looked at first: most pictures have enough levels there.
const STRIDE: usize = 61;

/// Number of grey levels of a picture, as its file has them, where it has too few: the most frequent ones, to which all but a few changes along
/// its rows lead. Where rows do not change there is no edge: plain or over-exposed paper does not count.
pub fn few_levels(picture: &Picture) -> Option<usize> {
    let mut some = BTreeSet::new();
    if picture.pixels.iter().step_by(STRIDE).any(|v| some.insert(v.to_bits()) && some.len() > MOST_SEEN) {
        return None;
    }
    let mut seen: BTreeMap<u32, usize> = BTreeMap::new();
    let mut last = None;
    for value in picture.pixels.iter().map(|v| v.to_bits()) {
        if last != Some(value) {
            *seen.entry(value).or_default() += 1;
            if seen.len() > MOST_SEEN {
                return None;
            }
        }
        last = Some(value);
    }
    let mut counts: Vec<usize> = seen.into_values().collect();
    counts.sort_unstable();
    let stray = STRAY * counts.iter().sum::<usize>() as f64;
    let mut rarer = 0;
    let is_stray = |count: &&usize| {
        rarer += **count;
        rarer as f64 <= stray
    };
    let levels = counts.len() - counts.iter().take_while(is_stray).count();
    (2..ENOUGH).contains(&levels).then_some(levels)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(value: impl Fn(usize) -> usize) -> Picture {
        let (width, height) = (400, 20);
        Picture { width, height, pixels: (0..width * height).map(|k| value(k) as f32).collect(), full_scale: 255.0 }
    }

    #[test]
    fn levels_are_counted_up_to_enough() {
        let cycle = |levels: usize| few_levels(&of(|k| k % levels * 30));
        assert_eq!([1, 2, 7, 8].map(cycle), [None, Some(2), Some(7), None]);
    }

    #[test]
    fn stray_pixels_are_no_levels_and_rare_edges_are() {
        // 0.3 % of 8000 changes is 24, of 160 it is none.
        let coarse = |k: usize| (k / 50 % 2) * 255;
        let fine = |k: usize| k % 2 * 255;
        let with = |value: &dyn Fn(usize) -> usize, strays: usize| {
            of(|k| if k % 331 == 7 && k / 331 < strays { 60 + k / 331 } else { value(k) })
        };
        assert_eq!(few_levels(&with(&fine, 20)), Some(2));
        assert_eq!(few_levels(&with(&coarse, 0)), Some(2));
        // One edge of ten levels in a picture that is black and white beside.
        let blurred = |k: usize| match k % 400 {
            0..200 => 0,
            x @ 200..210 => 25 * (x - 199),
            _ => 255,
        };
        assert_eq!(few_levels(&of(blurred)), None);
    }
}
