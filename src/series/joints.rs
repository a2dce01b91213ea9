//! `joints.csv`: the stops of the robot in the order in which they were visited.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use super::inputs::InputFile;
use super::table::{Row, Table};
use crate::error::{Code, Error, Result};

/// The placement of a series that names none.
pub const DEFAULT_PLACEMENT: &str = "placement_0";

/// Columns that are no joints.
const RESERVED: [&str; 3] = ["image", "placement", "time_s"];

/// One stop: one image, and the joint readings while it was taken.
#[derive(Debug, Clone, PartialEq)]
pub struct Stop {
    /// File name of the image, the key of the stop.
    pub image: String,
    /// The image file; `None` when it is not there, or when observations are given instead.
    pub path: Option<PathBuf>,
    /// Readings as written, in the order and unit of the file; `None` for an image taken off the robot.
    pub raw_readings: Option<Vec<f64>>,
    /// Where the plate stood.
    pub placement: String,
    /// Time of the image, s, on any clock.
    pub time_s: Option<f64>,
    /// Line in joints.csv; 0 when it does not come from one.
    pub line: u64,
}

/// All stops, with the names of the joint columns.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Stops {
    /// Joint names in the order of `Stop::raw_readings`.
    pub joints: Vec<String>,
    /// The stops in visiting order.
    pub stops: Vec<Stop>,
}

impl Stops {
    /// Reads joints.csv.
    ///
    /// # Errors
    /// Unreadable files, rows without an image, cells that are no numbers, some joints of a row empty.
    pub fn read(path: &Path, inputs: &mut Vec<InputFile>) -> Result<Self> {
        Self::from_table(&Table::read(path, inputs)?)
    }

    /// Reads the text of a joints.csv; `path` is for messages only.
    ///
    /// # Errors
    /// As [`Stops::read`].
    pub fn parse(path: &Path, text: &str) -> Result<Self> {
        Self::from_table(&Table::parse(path, text)?)
    }

    fn from_table(table: &Table) -> Result<Self> {
        let image = table.require("image")?;
        let (placement, time) = (table.column("placement"), table.column("time_s"));
        let columns: Vec<usize> =
            (0..table.headers.len()).filter(|&c| !RESERVED.contains(&table.headers[c].as_str())).collect();
        let joints: Vec<String> = columns.iter().map(|&c| table.headers[c].clone()).collect();
        let placements_named = placement.is_some_and(|c| table.rows().any(|r| !r.cell(c).is_empty()));
        let mut seen: BTreeMap<String, u64> = BTreeMap::new();
        let mut stops = Vec::new();
        for row in table.rows() {
            let name = image_name(table, row, image)?;
            if let Some(first) = seen.insert(name.clone(), row.line) {
                let what = format!("is the image of line {first} already");
                return Err(table.refuse(Code::CsvRowTwice, row, image, &what, "give every image one row"));
            }
            let placement = match placement.filter(|_| placements_named) {
                None => DEFAULT_PLACEMENT.to_string(),
                Some(c) if row.cell(c).is_empty() => {
                    return Err(table.refuse(
                        Code::CsvCellEmpty,
                        row,
                        c,
                        "names no placement",
                        "name it as in the other rows",
                    ));
                }
                Some(c) => row.cell(c).to_string(),
            };
            stops.push(Stop {
                image: name,
                path: None,
                raw_readings: readings(table, row, &columns)?,
                placement,
                time_s: table.optional_number(row, time)?,
                line: row.line,
            });
        }
        if stops.is_empty() {
            return Err(Error::new(
                Code::FileEmpty,
                table.place_of_header(),
                "has no rows",
                "give one row for every image",
            ));
        }
        Ok(Self { joints, stops })
    }

    /// Text of joints.csv; columns `placement` and `time_s` only where they say something.
    pub fn to_csv(&self) -> String {
        let placed = self.stops.iter().any(|s| s.placement != DEFAULT_PLACEMENT);
        let timed = self.stops.iter().any(|s| s.time_s.is_some());
        let mut names = vec!["image".to_string()];
        names.extend(self.joints.iter().cloned());
        names.extend(placed.then(|| "placement".into()));
        names.extend(timed.then(|| "time_s".into()));
        let mut rows = vec![names];
        for stop in &self.stops {
            let mut cells = vec![stop.image.clone()];
            match &stop.raw_readings {
                Some(values) => cells.extend(values.iter().map(|v| format!("{v:?}"))),
                None => cells.extend(self.joints.iter().map(|_| String::new())),
            }
            cells.extend(placed.then(|| stop.placement.clone()));
            cells.extend(timed.then(|| stop.time_s.map_or_else(String::new, |t| format!("{t:?}"))));
            rows.push(cells);
        }
        super::table::to_csv(&rows)
    }
}

fn image_name(table: &Table, row: Row<'_>, column: usize) -> Result<String> {
    let name = row.cell(column);
    if name.is_empty() {
        return Err(table.refuse(Code::CsvCellEmpty, row, column, "names no image", "name the image of the stop"));
    }
    if name.contains(['/', '\\']) {
        return Err(table.refuse(
            Code::CsvName,
            row,
            column,
            "is a path",
            "write the file name alone; images lie in images/",
        ));
    }
    Ok(name.to_string())
}

/// All cells or none.
fn readings(table: &Table, row: Row<'_>, columns: &[usize]) -> Result<Option<Vec<f64>>> {
    if columns.iter().all(|&c| row.cell(c).is_empty()) {
        return Ok(None);
    }
    if let Some(&column) = columns.iter().find(|&&c| row.cell(c).is_empty()) {
        let remedy = "give all joints, or none for an image that was taken off the robot";
        return Err(table.refuse(Code::CsvCellEmpty, row, column, "among joint readings", remedy));
    }
    columns.iter().map(|&c| table.number(row, c)).collect::<Result<_>>().map(Some)
}
