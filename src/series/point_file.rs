//! `points.csv`: points of the tip, seen by a tracker.

use nalgebra::Vector3;

use super::stop_index::{
    StopIndex, position, position_columns, refuse_twice, sigma_of_place, stop_column, target_name,
};
use super::table::Table;
use crate::error::Result;

/// A row of points.csv: a reflector on the tip, in the frame of the tracker.
#[derive(Debug, Clone, PartialEq)]
pub struct PointRow {
    /// Index of the stop.
    pub stop: usize,
    /// Name of the reflector.
    pub target: String,
    /// Where it was, m.
    pub tracker_from_point_m: Vector3<f64>,
    /// Standard deviation of a coordinate, m, where the row states it.
    pub sigma_m: Option<f64>,
    /// Line in the file.
    pub line: u64,
}

const KNOWN: [&str; 7] = ["stop", "image", "target", "x_m", "y_m", "z_m", "sigma_m"];

pub(super) fn rows(table: &Table, stops: &StopIndex<'_>) -> Result<Vec<PointRow>> {
    table.refuse_unknown(&KNOWN)?;
    let (stop, target, xyz) = (stop_column(table)?, table.require("target")?, position_columns(table)?);
    let sigma_m = table.column("sigma_m");
    let one = |row| {
        Ok(PointRow {
            stop: stops.find(table, row, stop)?,
            target: target_name(table, row, target)?,
            tracker_from_point_m: position(table, row, xyz)?,
            sigma_m: sigma_of_place(table, row, sigma_m)?,
            line: row.line,
        })
    };
    let rows: Vec<PointRow> = table.rows().map(one).collect::<Result<_>>()?;
    refuse_twice(table, target, rows.iter().map(|r| (r.stop, r.target.as_str(), r.line)))?;
    Ok(rows)
}
