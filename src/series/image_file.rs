//! `images.csv`: which camera took which image at which stop.

use std::collections::BTreeMap;

use super::camera_section::Cameras;
use super::stop_index::{StopIndex, stop_column};
use super::table::{Row, Table};
use crate::error::{Code, Result, closest_name};

/// Name of the file.
pub(super) const NAME: &str = "images.csv";

/// One image.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct ImageRow {
    /// Index of the stop.
    pub stop: usize,
    /// Index of the camera.
    pub camera: usize,
    /// Its file in the folder of the camera.
    pub image: String,
    /// Line in the file.
    pub line: u64,
}

pub(super) fn rows(table: &Table, stops: &StopIndex<'_>, cameras: &Cameras) -> Result<Vec<ImageRow>> {
    table.refuse_unknown(&["stop", "camera", "image"])?;
    let (stop, image) = (stop_column(table)?, table.require("image")?);
    let camera = if cameras.len() > 1 { Some(table.require("camera")?) } else { table.column("camera") };
    let mut seen: BTreeMap<(usize, String), u64> = BTreeMap::new();
    let mut rows = Vec::new();
    for row in table.rows() {
        let found = ImageRow {
            stop: stops.find(table, row, stop)?,
            camera: camera.map_or(Ok(0), |c| camera_of(table, row, c, cameras))?,
            image: image_of(table, row, image)?,
            line: row.line,
        };
        if let Some(first) = seen.insert((found.camera, found.image.clone()), row.line) {
            let what = format!("is an image of this camera in line {first} already");
            return Err(table.refuse(Code::CsvRowTwice, row, image, &what, "give every image one row"));
        }
        rows.push(found);
    }
    rows.sort_by_key(|r| r.stop);
    Ok(rows)
}

fn camera_of(table: &Table, row: Row<'_>, column: usize, cameras: &Cameras) -> Result<usize> {
    let name = row.cell(column);
    let names = || cameras.iter().filter_map(|c| c.name.as_deref());
    cameras.iter().position(|c| c.name.as_deref() == Some(name)).ok_or_else(|| {
        let remedy = match closest_name(name, names()) {
            Some(meant) => format!("is \"{meant}\" meant?"),
            None => format!("its cameras are: {}", names().collect::<Vec<_>>().join(", ")),
        };
        table.refuse(Code::CameraUnknown, row, column, "is no [[camera]] of series.toml", &remedy)
    })
}

fn image_of(table: &Table, row: Row<'_>, column: usize) -> Result<String> {
    match row.cell(column) {
        "" => Err(table.refuse(Code::CsvCellEmpty, row, column, "names no image", "name the file of the image")),
        name => Ok(name.to_owned()),
    }
}
