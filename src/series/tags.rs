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

use std::path::Path;

use calib_targets_aruco::{Dictionary, resolve_dictionary};
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use super::plate::{Marker, Plate};
use super::plate_kind::PlateKind;
use crate::error::{Code, Error, Result};

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
        let found = resolve_dictionary(&self.dictionary).ok_or_else(|| {
            Error::new(
                Code::DictionaryUnknown,
                place,
                format!("the dictionary {:?} is not known", self.dictionary),
                "use a name of OpenCV, such as DICT_4X4_50 or DICT_APRILTAG_36h11, or a family such as 36h11",
            )
        })?;
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
    fn regions(&self, columns: u32, rows: u32) -> Result<Vec<Region>> {
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

    fn tag_region(&self, modules: &[Vec<bool>], [x, y]: [f64; 2]) -> Region {
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

    /// The plate of these tags.
    pub(super) fn plate(self, kind: PlateKind, columns: u32, rows: u32, tolerance_m: f64) -> Plate {
        let half = self.side_m / 2.0;
        let corners = |place: u32| {
            let (id, [x, y]) = self.tag_at(place, columns, rows);
            [[-half, -half], [half, -half], [half, half], [-half, half]].into_iter().zip(0..).map(
                move |([dx, dy], k)| Marker {
                    id: 4 * id + k,
                    position_m: Vector3::new(x + dx, y + dy, 0.0),
                    outer_radius_m: 0.0,
                    inner_radius_m: 0.0,
                    sigma_m: tolerance_m,
                },
            )
        };
        let mut markers: Vec<Marker> = (0..columns * rows).flat_map(corners).collect();
        markers.sort_by_key(|m| m.id);
        let pitch_m = self.side_m + self.gap_m;
        Plate { markers, tags: Some(self), ..Plate::lattice(kind, columns, rows, pitch_m, tolerance_m) }
    }
}

/// What is dark on a plate of tags, or on a ChArUco board whose markers are stated; nothing on a plate of another kind.
///
/// # Errors
/// As [`Tags::dictionary`].
pub fn regions(plate: &Plate) -> Result<Vec<Region>> {
    match (&plate.tags, &plate.aruco) {
        (Some(tags), _) => tags.regions(plate.columns, plate.rows),
        (None, Some(aruco)) => {
            let tags = Tags {
                dictionary: aruco.dictionary.clone(),
                print: TagPrint::Opencv,
                side_m: aruco.side_m,
                gap_m: 0.0,
                first_id: 0,
            };
            charuco(plate, &tags)
        }
        (None, None) => Ok(Vec::new()),
    }
}

/// Squares around the inner corners, the one at the top-left dark, with tags in the light ones that count up row by row.
fn charuco(plate: &Plate, tags: &Tags) -> Result<Vec<Region>> {
    let (columns, rows) = (plate.columns + 1, plate.rows + 1);
    let dictionary = tags.dictionary("plate.toml", columns * rows / 2)?;
    let mut next = 0;
    let mut all = Vec::new();
    for (row, column) in (0..rows).flat_map(|row| (0..columns).map(move |column| (row, column))) {
        let at = |k: u32, n: u32| (f64::from(k) - (f64::from(n) - 1.0) / 2.0) * plate.pitch_m;
        let middle = [at(column, columns), -at(row, rows)];
        if (row + column) % 2 == 0 {
            all.push(vec![square(middle, plate.pitch_m / 2.0)]);
        } else {
            all.push(tags.tag_region(&tags.modules(&dictionary, next), middle));
            next += 1;
        }
    }
    Ok(all)
}

fn square([x, y]: [f64; 2], half: f64) -> Vec<[f64; 2]> {
    vec![[x - half, y - half], [x + half, y - half], [x + half, y + half], [x - half, y + half]]
}

/// What plate.toml says of tags; the names of the keys are those of the kinds.
#[derive(Debug, Default)]
pub(super) struct TagKeys {
    pub tag_m: Option<f64>,
    pub marker_m: Option<f64>,
    pub spacing: Option<f64>,
    pub gap_m: Option<f64>,
    pub family: Option<String>,
    pub dictionary: Option<String>,
    pub first_id: Option<u32>,
    pub id: Option<u32>,
}

impl TagKeys {
    /// The tags of a plate of this kind, and its columns and rows.
    ///
    /// # Errors
    /// Missing keys, or such as the kind does not have.
    pub(super) fn tags(&self, path: &Path, kind: PlateKind, size: [Option<u32>; 2]) -> Result<(Tags, [u32; 2])> {
        let missing = |keys: &str| {
            let what = format!("{keys} are needed for a plate of this kind");
            Error::new(Code::SettingMissing, path.display(), what, "add what is missing (lengths in metres)")
        };
        let board = size[0].zip(size[1]).map(|(columns, rows)| [columns, rows]);
        let number = |value: Option<f64>, keys: &str| value.ok_or_else(|| missing(keys));
        let (tags, size) = match kind {
            PlateKind::Aprilgrid => {
                let keys = "columns, rows, tag_m and spacing";
                let side_m = number(self.tag_m, keys)?;
                let gap_m = side_m * number(self.spacing, keys)?;
                let dictionary = dictionary_of(self.family.as_deref().unwrap_or("36h11"));
                let first_id = self.first_id.unwrap_or(0);
                let tags = Tags { dictionary, print: TagPrint::Kalibr, side_m, gap_m, first_id };
                (tags, board.ok_or_else(|| missing(keys))?)
            }
            PlateKind::ArucoGrid => {
                let keys = "columns, rows, marker_m, gap_m and dictionary";
                let (side_m, gap_m) = (number(self.marker_m, keys)?, number(self.gap_m, keys)?);
                let dictionary = self.dictionary.clone().ok_or_else(|| missing(keys))?;
                let first_id = self.first_id.unwrap_or(0);
                let tags = Tags { dictionary, print: TagPrint::Opencv, side_m, gap_m, first_id };
                (tags, board.ok_or_else(|| missing(keys))?)
            }
            _ => {
                let keys = "tag_m, id and family or dictionary";
                let side_m = number(self.tag_m, keys)?;
                let (dictionary, print) = match (&self.family, &self.dictionary) {
                    (Some(family), None) => (dictionary_of(family), TagPrint::Apriltag),
                    (None, Some(dictionary)) => (dictionary.clone(), TagPrint::Opencv),
                    _ => return Err(missing(keys)),
                };
                let first_id = self.id.ok_or_else(|| missing(keys))?;
                (Tags { dictionary, print, side_m, gap_m: 0.0, first_id }, [1, 1])
            }
        };
        if size.iter().any(|n| !(1..=1000).contains(n)) || size[0] * size[1] > 100_000 {
            let what = format!("columns = {}, rows = {}", size[0], size[1]);
            return Err(Error::new(
                Code::SettingRange,
                path.display(),
                what,
                "give the numbers of tags, 1 to 1000 of each",
            ));
        }
        if tags.side_m >= 1.0 {
            let what = format!("a tag has a side of {} m", tags.side_m);
            return Err(Error::new(
                Code::PlateUnitUnlikely,
                path.display(),
                what,
                "sizes are in metres: 40 mm are 0.04",
            ));
        }
        tags.dictionary(&path.display().to_string(), size[0] * size[1])?;
        Ok((tags, size))
    }

    /// The keys that say what these tags are.
    pub(super) fn of(kind: PlateKind, tags: &Tags) -> Self {
        let (side_m, dictionary) = (Some(tags.side_m), Some(tags.dictionary.clone()));
        let first_id = Some(tags.first_id);
        match kind {
            PlateKind::Aprilgrid => {
                let spacing = Some(tags.gap_m / tags.side_m);
                Self { tag_m: side_m, spacing, family: dictionary, first_id, ..Self::default() }
            }
            PlateKind::ArucoGrid => {
                Self { marker_m: side_m, gap_m: Some(tags.gap_m), dictionary, first_id, ..Self::default() }
            }
            _ if tags.print == TagPrint::Apriltag => {
                Self { tag_m: side_m, family: dictionary, id: first_id, ..Self::default() }
            }
            _ => Self { tag_m: side_m, dictionary, id: first_id, ..Self::default() },
        }
    }
}

/// OpenCV's name of a family: `36h11`, `t36h11` and `tag36h11` are all used.
fn dictionary_of(family: &str) -> String {
    let bare = family.trim_start_matches("DICT_APRILTAG_").trim_start_matches("tag").trim_start_matches('t');
    format!("DICT_APRILTAG_{}", bare.replace('H', "h"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn kalibr() -> Tags {
        Tags {
            dictionary: "DICT_APRILTAG_36h11".to_owned(),
            print: TagPrint::Kalibr,
            side_m: 0.05,
            gap_m: 0.015,
            first_id: 0,
        }
    }

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

    #[test]
    fn corners_count_from_the_bottom_left() {
        let plate = kalibr().plate(PlateKind::Aprilgrid, 6, 5, 1e-4);
        let at = |id: u32| plate.markers[plate.index_of(id).unwrap()].position_m;
        assert_eq!(plate.markers.len(), 120);
        // tag 0 is the one at the bottom-left
        assert!((at(0) - Vector3::new(-0.1875, -0.155, 0.0)).norm() < 1e-12, "{}", at(0));
        assert!((at(1) - at(0) - Vector3::new(0.05, 0.0, 0.0)).norm() < 1e-12);
        assert!((at(3) - at(0) - Vector3::new(0.0, 0.05, 0.0)).norm() < 1e-12);
        assert!((at(4 * 6) - at(0) - Vector3::new(0.0, 0.065, 0.0)).norm() < 1e-12);
        let opencv = Tags { print: TagPrint::Opencv, ..kalibr() }.plate(PlateKind::ArucoGrid, 6, 5, 1e-4);
        assert!(opencv.markers[0].position_m.y > 0.0);
    }
}
