//! Tables whose rows refer to stops: what their readers have in common.

use std::collections::BTreeMap;

use nalgebra::Vector3;

use super::joints::{StopKey, Stops};
use super::table::{Row, Table};
use super::toml_file::{LARGEST_SIGMA_M, LARGEST_SIGMA_RAD, SIGMA_IN_METRES, SIGMA_IN_RAD};
use crate::error::{Code, Error, Result, closest_name};

/// The stops of a series by name.
pub(super) struct StopIndex<'a> {
    by_name: BTreeMap<&'a str, usize>,
    key: StopKey,
    /// The file that names them.
    table: &'static str,
}

impl<'a> StopIndex<'a> {
    /// Of the stops that this file names.
    pub fn of(stops: &'a Stops, table: &'static str) -> Self {
        let by_name = stops.stops.iter().enumerate().map(|(k, s)| (s.name(), k)).collect();
        Self { by_name, key: stops.key, table }
    }

    /// The stop that a row names.
    pub fn find(&self, table: &Table, row: Row<'_>, column: usize) -> Result<usize> {
        let (name, own) = (row.cell(column), self.table);
        if name.is_empty() {
            let remedy = format!("name it as in {own}");
            return Err(table.refuse(Code::CsvCellEmpty, row, column, "names no stop", &remedy));
        }
        self.by_name.get(name).copied().ok_or_else(|| {
            let what = format!("is no {} of {own}", self.key.column());
            let remedy = match closest_name(name, self.by_name.keys().copied()) {
                Some(meant) => format!("is \"{meant}\" meant? else add the stop to {own}, or remove the row"),
                None => format!("add the stop to {own}, or remove the row"),
            };
            table.refuse(Code::StopUnknown, row, column, &what, &remedy)
        })
    }
}

/// The column that names the stop; `image` serves as well.
pub(super) fn stop_column(table: &Table) -> Result<usize> {
    match table.column("image") {
        Some(column) if table.column("stop").is_none() => Ok(column),
        _ => table.require("stop"),
    }
}

/// What a row measures of: a name that is not empty.
pub(super) fn target_name(table: &Table, row: Row<'_>, column: usize) -> Result<String> {
    match row.cell(column) {
        "" => {
            let what = format!("names no {}", table.headers[column]);
            Err(table.refuse(Code::CsvCellEmpty, row, column, &what, "give it a name; rows of one thing share it"))
        }
        name => Ok(name.to_owned()),
    }
}

/// x_m, y_m and z_m of a row.
pub(super) fn position(table: &Table, row: Row<'_>, columns: [usize; 3]) -> Result<Vector3<f64>> {
    let [x, y, z] = columns.map(|c| table.number(row, c));
    Ok(Vector3::new(x?, y?, z?))
}

/// Columns x_m, y_m, z_m.
pub(super) fn position_columns(table: &Table) -> Result<[usize; 3]> {
    let [x, y, z] = ["x_m", "y_m", "z_m"].map(|name| table.require(name));
    Ok([x?, y?, z?])
}

/// A standard deviation where the row states one.
pub(super) fn sigma(table: &Table, row: Row<'_>, column: Option<usize>) -> Result<Option<f64>> {
    let value = table.optional_number(row, column)?;
    match (column, value) {
        (Some(c), Some(v)) if v <= 0.0 => {
            Err(table.refuse(Code::CsvRange, row, c, "is not positive", "give the standard deviation, or nothing"))
        }
        _ => Ok(value),
    }
}

/// The same of a coordinate, m.
pub(super) fn sigma_of_place(table: &Table, row: Row<'_>, column: Option<usize>) -> Result<Option<f64>> {
    sigma_below(table, row, column, (LARGEST_SIGMA_M, SIGMA_IN_METRES))
}

/// The same of a rotation, rad.
pub(super) fn sigma_of_rotation(table: &Table, row: Row<'_>, column: Option<usize>) -> Result<Option<f64>> {
    sigma_below(table, row, column, (LARGEST_SIGMA_RAD, SIGMA_IN_RAD))
}

fn sigma_below(
    table: &Table,
    row: Row<'_>,
    column: Option<usize>,
    (largest, remedy): (f64, &str),
) -> Result<Option<f64>> {
    let value = sigma(table, row, column)?;
    match (column, value) {
        (Some(c), Some(v)) if v >= largest => {
            Err(table.refuse(Code::CsvRange, row, c, "is larger than of any measurement", remedy))
        }
        _ => Ok(value),
    }
}

/// Refuses a second row that measures the same thing at the same stop.
pub(super) fn refuse_twice<'a>(
    table: &Table,
    column: usize,
    rows: impl Iterator<Item = (usize, &'a str, u64)>,
) -> Result<()> {
    let mut seen = BTreeMap::new();
    for (stop, name, line) in rows {
        if let Some(first) = seen.insert((stop, name), line) {
            let at = table.rows().find(|r| r.line == line);
            let what = format!("was measured at this stop by line {first} already");
            let remedy = "remove one of the two rows, or give the repetition a stop of its own";
            return Err(match at {
                Some(row) => table.refuse(Code::CsvRowTwice, row, column, &what, remedy),
                None => Error::new(Code::CsvRowTwice, table.place_of_line(line), what, remedy),
            });
        }
    }
    Ok(())
}
