//! `poses.csv`: poses of a body on the tip, seen by a tracker.

use super::quaternion::quaternion;
use super::stop_index::{StopIndex, position, position_columns, refuse_twice, sigma, stop_column, target_name};
use super::table::{Row, Table};
use crate::error::Result;
use crate::geom::Pose;

/// A row of poses.csv: a body on the tip, in the frame of the tracker.
#[derive(Debug, Clone, PartialEq)]
pub struct PoseRow {
    /// Index of the stop.
    pub stop: usize,
    /// Name of the body.
    pub target: String,
    /// Where it was.
    pub tracker_from_target: Pose,
    /// Standard deviation of a coordinate, m, where the row states it.
    pub sigma_m: Option<f64>,
    /// Standard deviation of the rotation about an axis, rad, where the row states it.
    pub sigma_rad: Option<f64>,
    /// Line in the file.
    pub line: u64,
}

const KNOWN: [&str; 12] =
    ["stop", "image", "target", "x_m", "y_m", "z_m", "qx", "qy", "qz", "qw", "sigma_m", "sigma_rad"];

pub(super) fn rows(table: &Table, stops: &StopIndex<'_>) -> Result<Vec<PoseRow>> {
    table.refuse_unknown(&KNOWN)?;
    let (stop, target, xyz) = (stop_column(table)?, table.require("target")?, position_columns(table)?);
    let [qx, qy, qz, qw] = ["qx", "qy", "qz", "qw"].map(|name| table.require(name));
    let xyzw = [qx?, qy?, qz?, qw?];
    let (sigma_m, sigma_rad) = (table.column("sigma_m"), table.column("sigma_rad"));
    let one = |row: Row<'_>| {
        let place = position(table, row, xyz)?;
        Ok(PoseRow {
            stop: stops.find(table, row, stop)?,
            target: target_name(table, row, target)?,
            tracker_from_target: Pose::new(quaternion(table, row, xyzw, row.cell(stop))?, place),
            sigma_m: sigma(table, row, sigma_m)?,
            sigma_rad: sigma(table, row, sigma_rad)?,
            line: row.line,
        })
    };
    let rows: Vec<PoseRow> = table.rows().map(one).collect::<Result<_>>()?;
    refuse_twice(table, target, rows.iter().map(|r| (r.stop, r.target.as_str(), r.line)))?;
    Ok(rows)
}
