//! Plates of square tags with a code: which tags, how large, and what of them is dark.
//!
//! The corners of tag `k` (its number in the dictionary) are the markers `4k` to `4k + 3`, counter-clockwise from the bottom-left as
//! printed. Three ways to print a tag are in use:
//!
//! | print | border | first tag of a board | the bits of OpenCV's dictionary stand |
//! |---|---|---|---|
//! | OpenCV | 1 module | top-left, then row by row downwards | upright |
//! | AprilTag | 1 module | | upside down |
//! | Kalibr | 2 modules | bottom-left, then row by row upwards | upside down |
//!
//! Kalibr's AprilGrid also has a dark square at every corner between tags, as wide as the gap.

use calib_targets_aruco::Dictionary;
use calib_targets_aruco::builtins::{BUILTIN_DICTIONARY_NAMES, builtin_dictionary};
use serde::{Deserialize, Serialize};

use crate::error::{Code, Error, Result, closest_name};

/// How a tag is printed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum TagPrint {
    /// As `cv::aruco` draws it.
    Opencv,
    /// As the AprilTag library has it.
    Apriltag,
    /// As on the AprilGrid of Kalibr.
    Kalibr,
}

impl TagPrint {
    /// Width of the dark border, modules.
    pub fn border(self) -> usize {
        match self {
            Self::Opencv | Self::Apriltag => 1,
            Self::Kalibr => 2,
        }
    }
}

/// The tags of a plate.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Tags {
    /// Name of the dictionary as OpenCV spells it.
    pub dictionary: String,
    /// How they are printed.
    pub print: TagPrint,
    /// Side of a tag with its dark border, m.
    pub side_m: f64,
    /// Paper between neighbours, m; 0 for a single tag.
    pub gap_m: f64,
    /// Number of the first tag in the dictionary.
    pub first_id: u32,
}

/// Closed outlines, the first dark, the others light within it; m, in the plate frame.
pub type Region = Vec<Vec<[f64; 2]>>;

impl Tags {
    /// The dictionary.
    ///
    /// # Errors
    /// A name that is not known; fewer tags in it than `count` from the first on.
    pub fn dictionary(&self, place: &str, count: u32) -> Result<Dictionary> {
        let found = dictionary_named(&self.dictionary, place)?;
        let last = u64::from(self.first_id) + u64::from(count);
        if last > found.codes().len() as u64 {
            let what = format!("{} has {} tags, but {last} are needed", found.name(), found.codes().len());
            return Err(Error::new(Code::SettingRange, place, what, "take a larger dictionary, or fewer tags"));
        }
        Ok(found)
    }

    /// The number of a tag and its middle, m, by its place (counted row by row from the top-left) on a board of `columns` x `rows`.
    pub fn tag_at(&self, place: u32, columns: u32, rows: u32) -> (u32, [f64; 2]) {
        let (column, row) = (place % columns, place / columns);
        let counted = if self.print == TagPrint::Kalibr { (rows - 1 - row) * columns + column } else { place };
        let pitch_m = self.side_m + self.gap_m;
        let middle = |n: u32| (f64::from(n) - 1.0) / 2.0;
        let (x, y) = (f64::from(column) - middle(columns), middle(rows) - f64::from(row));
        (self.first_id + counted, [x * pitch_m, y * pitch_m])
    }

    /// Which modules of a tag are dark, row by row from the top-left as printed, with its border.
    pub fn modules(&self, dictionary: &Dictionary, id: u32) -> Vec<Vec<bool>> {
        let (bits, border) = (dictionary.marker_size(), self.print.border());
        let code = dictionary.codes().get(id as usize).copied().unwrap_or(u64::MAX);
        let last = bits - 1;
        let bit = |row: usize, column: usize| {
            let place =
                if self.print == TagPrint::Opencv { row * bits + column } else { (last - row) * bits + last - column };
            code >> place & 1 == 1
        };
        let within = border..border + bits;
        let dark =
            |row, column| !within.contains(&row) || !within.contains(&column) || bit(row - border, column - border);
        let side = bits + 2 * border;
        (0..side).map(|row| (0..side).map(|column| dark(row, column)).collect()).collect()
    }

    /// What is dark on a plate of these tags.
    ///
    /// # Errors
    /// As [`Tags::dictionary`].
    pub(super) fn regions(&self, columns: u32, rows: u32) -> Result<Vec<Region>> {
        let dictionary = self.dictionary("plate.toml", columns * rows)?;
        let tag = |place: u32| {
            let (id, middle) = self.tag_at(place, columns, rows);
            self.tag_region(&self.modules(&dictionary, id), middle)
        };
        let mut all: Vec<Region> = (0..columns * rows).map(tag).collect();
        if self.print == TagPrint::Kalibr {
            let pitch_m = self.side_m + self.gap_m;
            for (i, j) in (0..=columns).flat_map(|i| (0..=rows).map(move |j| (i, j))) {
                let at = |k: u32, n: u32| (f64::from(k) - f64::from(n) / 2.0) * pitch_m;
                all.push(vec![square([at(i, columns), at(j, rows)], self.gap_m / 2.0)]);
            }
        }
        Ok(all)
    }

    pub(super) fn tag_region(&self, modules: &[Vec<bool>], [x, y]: [f64; 2]) -> Region {
        let module_m = self.side_m / modules.len() as f64;
        let middle = (modules.len() as f64 - 1.0) / 2.0;
        let mut region = vec![square([x, y], self.side_m / 2.0)];
        for (row, line) in modules.iter().enumerate() {
            for (column, _) in line.iter().enumerate().filter(|(_, dark)| !**dark) {
                let centre = [x + (column as f64 - middle) * module_m, y + (middle - row as f64) * module_m];
                let mut light = square(centre, module_m / 2.0);
                light.reverse();
                region.push(light);
            }
        }
        region
    }
}

/// A dictionary by its name in OpenCV, in letters of either case, with or without `DICT_`.
///
/// # Errors
/// A name that is not known.
pub fn dictionary_named(name: &str, place: &str) -> Result<Dictionary> {
    let bare = |name: &str| name.to_ascii_uppercase().trim_start_matches("DICT_").to_owned();
    let meant = BUILTIN_DICTIONARY_NAMES.iter().find(|known| bare(known) == bare(name));
    meant.and_then(|known| builtin_dictionary(known)).ok_or_else(|| {
        let remedy = match closest_name(name, BUILTIN_DICTIONARY_NAMES.iter().copied()) {
            Some(close) => format!("is \"{close}\" meant?"),
            None => {
                "use a name of OpenCV, such as DICT_4X4_50 or DICT_APRILTAG_36h11, or a family such as 36h11".to_owned()
            }
        };
        Error::new(Code::DictionaryUnknown, place, format!("the dictionary {name:?} is not known"), remedy)
    })
}

pub(super) fn square([x, y]: [f64; 2], half: f64) -> Vec<[f64; 2]> {
    vec![[x - half, y - half], [x + half, y - half], [x + half, y + half], [x - half, y + half]]
}

/// Tags as Kalibr prints them.
#[cfg(test)]
pub(super) fn kalibr() -> Tags {
    Tags {
        dictionary: "DICT_APRILTAG_36h11".to_owned(),
        print: TagPrint::Kalibr,
        side_m: 0.05,
        gap_m: 0.015,
        first_id: 0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The first code of the family as its makers state it: 0xd5d628584, light bits set, the highest bit at the top-left.
    #[test]
    fn a_tag_of_kalibr_has_the_bits_of_its_family() {
        let tags = kalibr();
        let modules = tags.modules(&tags.dictionary("", 36).unwrap(), 0);
        assert_eq!(modules.len(), 10);
        assert!(modules[1].iter().all(|dark| *dark) && (0..10).all(|row| modules[row][8]));
        let code = (0..36).fold(0u64, |code, k| code << 1 | u64::from(!modules[2 + k / 6][2 + k % 6]));
        assert_eq!(code, 0xd_5d62_8584);
    }
}
