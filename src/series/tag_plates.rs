//! Plates of tags and of squares with a code: from the keys of plate.toml to markers, and what is dark on the print.

use std::path::Path;

use nalgebra::Vector3;

use super::plate::{Aruco, Marker, Plate};
use super::plate_kind::PlateKind;
use super::tags::{Region, TagPrint, Tags, square};
use crate::error::{Code, Error, Result};

/// The plate of these tags.
pub(super) fn plate_of(tags: Tags, kind: PlateKind, [columns, rows]: [u32; 2], tolerance_m: f64) -> Plate {
    let half = tags.side_m / 2.0;
    let corners = |place: u32| {
        let (id, [x, y]) = tags.tag_at(place, columns, rows);
        [[-half, -half], [half, -half], [half, half], [-half, half]].into_iter().zip(0..).map(move |([dx, dy], k)| {
            Marker {
                id: 4 * id + k,
                position_m: Vector3::new(x + dx, y + dy, 0.0),
                outer_radius_m: 0.0,
                inner_radius_m: 0.0,
                sigma_m: tolerance_m,
            }
        })
    };
    let mut markers: Vec<Marker> = (0..columns * rows).flat_map(corners).collect();
    markers.sort_by_key(|m| m.id);
    let pitch_m = tags.side_m + tags.gap_m;
    Plate { markers, tags: Some(tags), ..Plate::lattice(kind, columns, rows, pitch_m, tolerance_m) }
}

/// What is dark on a plate of tags, on a PuzzleBoard, or on a ChArUco board whose markers are stated; nothing on a plate of another kind.
///
/// # Errors
/// As [`Tags::dictionary`].
pub fn regions(plate: &Plate) -> Result<Vec<Region>> {
    if let Some(puzzle) = plate.puzzle {
        return Ok(puzzle.regions([plate.columns, plate.rows], plate.pitch_m));
    }
    match (&plate.tags, &plate.aruco) {
        (Some(tags), _) => tags.regions(plate.columns, plate.rows),
        (None, Some(aruco)) => charuco(plate, aruco),
        (None, None) => Ok(Vec::new()),
    }
}

/// Squares around the inner corners, the one at the top-left dark (light in a legacy board with an even number of rows), with tags in
/// the light ones that count up row by row.
fn charuco(plate: &Plate, aruco: &Aruco) -> Result<Vec<Region>> {
    let Aruco { dictionary, side_m, first_id, legacy } = aruco.clone();
    let tags = Tags { dictionary, print: TagPrint::Opencv, side_m, gap_m: 0.0, first_id };
    let (columns, rows) = (plate.columns + 1, plate.rows + 1);
    let dictionary = tags.dictionary("plate.toml", columns * rows / 2)?;
    let first_dark = u32::from(legacy && rows.is_multiple_of(2));
    let mut next = tags.first_id;
    let mut all = Vec::new();
    for (row, column) in (0..rows).flat_map(|row| (0..columns).map(move |column| (row, column))) {
        let at = |k: u32, n: u32| (f64::from(k) - (f64::from(n) - 1.0) / 2.0) * plate.pitch_m;
        let middle = [at(column, columns), -at(row, rows)];
        if (row + column) % 2 == first_dark {
            all.push(vec![square(middle, plate.pitch_m / 2.0)]);
        } else {
            all.push(tags.tag_region(&tags.modules(&dictionary, next), middle));
            next += 1;
        }
    }
    Ok(all)
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

/// Refuses a plate of more tags than any has, and tags of a size that is not in metres.
fn require_tag_board(path: &Path, tags: &Tags, [columns, rows]: [u32; 2]) -> Result<()> {
    if [columns, rows].iter().any(|n| !(1..=1000).contains(n)) || columns * rows > 100_000 {
        let what = format!("columns = {columns}, rows = {rows}");
        let remedy = "give the numbers of tags, 1 to 1000 of each";
        return Err(Error::new(Code::SettingRange, path.display(), what, remedy));
    }
    if tags.side_m >= 1.0 {
        let what = format!("a tag has a side of {} m", tags.side_m);
        let remedy = "sizes are in metres: 40 mm are 0.04";
        return Err(Error::new(Code::PlateUnitUnlikely, path.display(), what, remedy));
    }
    Ok(())
}

impl TagKeys {
    /// The tags of a plate of this kind, and its columns and rows.
    ///
    /// # Errors
    /// Missing keys, or such as the kind does not have.
    pub(super) fn tags(&self, path: &Path, kind: PlateKind, size: [Option<u32>; 2]) -> Result<(Tags, [u32; 2])> {
        let board = size[0].zip(size[1]).map(|(columns, rows)| [columns, rows]);
        let (keys, stated) = match kind {
            PlateKind::Aprilgrid => ("columns, rows, tag_m and spacing", self.aprilgrid().zip(board)),
            PlateKind::ArucoGrid => ("columns, rows, marker_m, gap_m and dictionary", self.aruco_grid().zip(board)),
            _ => ("tag_m, id and family or dictionary", self.single().map(|tag| (tag, [1, 1]))),
        };
        let (tags, size) = stated.ok_or_else(|| {
            let what = format!("{keys} are needed for a plate of this kind");
            Error::new(Code::SettingMissing, path.display(), what, "add what is missing (lengths in metres)")
        })?;
        require_tag_board(path, &tags, size)?;
        tags.dictionary(&path.display().to_string(), size[0] * size[1])?;
        Ok((tags, size))
    }

    fn aprilgrid(&self) -> Option<Tags> {
        let side_m = self.tag_m?;
        Some(Tags {
            dictionary: dictionary_of(self.family.as_deref().unwrap_or("36h11")),
            print: TagPrint::Kalibr,
            side_m,
            gap_m: side_m * self.spacing?,
            first_id: self.first_id.unwrap_or(0),
        })
    }

    fn aruco_grid(&self) -> Option<Tags> {
        Some(Tags {
            dictionary: self.dictionary.clone()?,
            print: TagPrint::Opencv,
            side_m: self.marker_m?,
            gap_m: self.gap_m?,
            first_id: self.first_id.unwrap_or(0),
        })
    }

    fn single(&self) -> Option<Tags> {
        let (dictionary, print) = match (&self.family, &self.dictionary) {
            (Some(family), None) => (dictionary_of(family), TagPrint::Apriltag),
            (None, Some(dictionary)) => (dictionary.clone(), TagPrint::Opencv),
            _ => return None,
        };
        Some(Tags { dictionary, print, side_m: self.tag_m?, gap_m: 0.0, first_id: self.id? })
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
pub(super) fn dictionary_of(family: &str) -> String {
    let lower = family.to_ascii_lowercase();
    let bare = lower.trim_start_matches("dict_apriltag_").trim_start_matches("tag").trim_start_matches('t');
    format!("DICT_APRILTAG_{bare}")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::series::tags::kalibr;

    #[test]
    fn corners_count_from_the_bottom_left() {
        let plate = plate_of(kalibr(), PlateKind::Aprilgrid, [6, 5], 1e-4);
        let at = |id: u32| plate.markers[plate.index_of(id).unwrap()].position_m;
        assert_eq!(plate.markers.len(), 120);
        // tag 0 is the one at the bottom-left
        assert!((at(0) - Vector3::new(-0.1875, -0.155, 0.0)).norm() < 1e-12, "{}", at(0));
        assert!((at(1) - at(0) - Vector3::new(0.05, 0.0, 0.0)).norm() < 1e-12);
        assert!((at(3) - at(0) - Vector3::new(0.0, 0.05, 0.0)).norm() < 1e-12);
        assert!((at(4 * 6) - at(0) - Vector3::new(0.0, 0.065, 0.0)).norm() < 1e-12);
        let opencv = plate_of(Tags { print: TagPrint::Opencv, ..kalibr() }, PlateKind::ArucoGrid, [6, 5], 1e-4);
        assert!(opencv.markers[0].position_m.y > 0.0);
    }
}
