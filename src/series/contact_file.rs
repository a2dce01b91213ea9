//! `contacts.csv`: a point of the tip at a place of the base.

use nalgebra::Vector3;

use super::stop_index::{StopIndex, position, position_columns, refuse_twice, stop_column, target_name};
use super::table::{Row, Table};
use crate::error::{Code, Result};

/// A row of contacts.csv: a point of the tip at a place of the base.
#[derive(Debug, Clone, PartialEq)]
pub struct ContactRow {
    /// Index of the stop.
    pub stop: usize,
    /// Name of the contact; stops of one contact have the same point of the tip at the same place.
    pub contact: String,
    /// The place, m, where it is known; in the frame that `[contact]` names.
    pub position_m: Option<Vector3<f64>>,
    /// Line in the file.
    pub line: u64,
}

const KNOWN: [&str; 6] = ["stop", "image", "contact", "x_m", "y_m", "z_m"];

pub(super) fn rows(table: &Table, stops: &StopIndex<'_>) -> Result<Vec<ContactRow>> {
    table.refuse_unknown(&KNOWN)?;
    let (stop, contact) = (stop_column(table)?, table.require("contact")?);
    let is_placed = ["x_m", "y_m", "z_m"].iter().any(|name| table.column(name).is_some());
    let xyz = is_placed.then(|| position_columns(table)).transpose()?;
    let one = |row: Row<'_>| {
        let written = xyz.filter(|columns| columns.iter().any(|&c| !row.cell(c).is_empty()));
        if let Some(&c) = written.iter().flatten().find(|&&c| row.cell(c).is_empty()) {
            let remedy = "give all three coordinates of the place, or none where it is not known";
            return Err(table.refuse(Code::CsvCellEmpty, row, c, "among coordinates", remedy));
        }
        Ok(ContactRow {
            stop: stops.find(table, row, stop)?,
            contact: target_name(table, row, contact)?,
            position_m: written.map(|columns| position(table, row, columns)).transpose()?,
            line: row.line,
        })
    };
    let rows: Vec<ContactRow> = table.rows().map(one).collect::<Result<_>>()?;
    refuse_twice(table, contact, rows.iter().map(|r| (r.stop, r.contact.as_str(), r.line)))?;
    Ok(rows)
}
