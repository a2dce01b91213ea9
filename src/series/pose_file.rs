//! `poses.csv`: poses of a body on the tip, seen by a tracker.

use super::quaternion::{are_zeros, quaternion};
use super::stop_index::{
    StopIndex, position, position_columns, refuse_twice, sigma_of_place, sigma_of_rotation, stop_column, target_name,
};
use super::table::Table;
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

/// A row without a measurement.
pub(super) struct LostRow {
    /// Name of the body.
    pub target: String,
    /// Line in the file.
    pub line: u64,
}

const KNOWN: [&str; 12] =
    ["stop", "image", "target", "x_m", "y_m", "z_m", "qx", "qy", "qz", "qw", "sigma_m", "sigma_rad"];

/// The rows, and those that are all zeros, quaternion included: there the tracker had lost the target.
pub(super) fn rows(table: &Table, stops: &StopIndex<'_>) -> Result<(Vec<PoseRow>, Vec<LostRow>)> {
    table.refuse_unknown(&KNOWN)?;
    let (stop, target, xyz) = (stop_column(table)?, table.require("target")?, position_columns(table)?);
    let [qx, qy, qz, qw] = ["qx", "qy", "qz", "qw"].map(|name| table.require(name));
    let xyzw = [qx?, qy?, qz?, qw?];
    let (sigma_m, sigma_rad) = (table.column("sigma_m"), table.column("sigma_rad"));
    let (mut rows, mut lost, mut named) = (Vec::new(), Vec::new(), Vec::new());
    for row in table.rows() {
        let (stop_index, name) = (stops.find(table, row, stop)?, target_name(table, row, target)?);
        named.push((stop_index, name.clone(), row.line));
        if are_zeros(table, row, &xyz) && are_zeros(table, row, &xyzw) {
            lost.push(LostRow { target: name, line: row.line });
            continue;
        }
        let place = position(table, row, xyz)?;
        rows.push(PoseRow {
            stop: stop_index,
            target: name,
            tracker_from_target: Pose::new(quaternion(table, row, xyzw, row.cell(stop))?, place),
            sigma_m: sigma_of_place(table, row, sigma_m)?,
            sigma_rad: sigma_of_rotation(table, row, sigma_rad)?,
            line: row.line,
        });
    }
    refuse_twice(table, target, named.iter().map(|(stop, name, line)| (*stop, name.as_str(), *line)))?;
    Ok((rows, lost))
}
