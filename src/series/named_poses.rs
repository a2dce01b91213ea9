//! Poses by name in a table of another device or program: `image` or `stop`, x_m, y_m, z_m, qx, qy, qz, qw; other columns are not looked at.

use std::path::Path;

use super::quaternion::quaternion;
use super::stop_index::{position, position_columns, refuse_twice, stop_column};
use super::table::{Row, Table};
use crate::error::{Code, Error, Result};
use crate::geom::Pose;

/// Poses by name.
#[derive(Debug, Clone, PartialEq)]
pub struct NamedPoses {
    /// Name of image or stop, and `frame_from_body` there.
    pub poses: Vec<(String, Pose)>,
    /// True where they are of a body that moves with the camera (`target`), false where they are of the camera itself.
    pub of_target: bool,
}

/// Reads such a table.
///
/// # Errors
/// Names file, line and column: missing columns, numbers that are none, names that stand there twice, several targets.
pub fn read_named_poses(path: &Path) -> Result<NamedPoses> {
    let table = Table::read(path, &mut Vec::new())?;
    let (name, xyz) = (stop_column(&table)?, position_columns(&table)?);
    let [qx, qy, qz, qw] = ["qx", "qy", "qz", "qw"].map(|name| table.require(name));
    let xyzw = [qx?, qy?, qz?, qw?];
    let target = table.column("target");
    let one = |row: Row<'_>| {
        let place = position(&table, row, xyz)?;
        Ok((row.cell(name).to_owned(), Pose::new(quaternion(&table, row, xyzw, row.cell(name))?, place)))
    };
    let poses: Vec<(String, Pose)> = table.rows().map(one).collect::<Result<_>>()?;
    let targets: std::collections::BTreeSet<&str> =
        target.iter().flat_map(|&t| table.rows().map(move |r| r.cell(t))).collect();
    if targets.len() > 1 {
        let what = format!("has the targets {}", targets.into_iter().collect::<Vec<_>>().join(", "));
        return Err(Error::new(
            Code::CsvRowTwice,
            path.display(),
            what,
            "keep one of them: one body is compared with the camera",
        ));
    }
    refuse_twice(&table, name, poses.iter().zip(table.rows()).map(|((n, _), r)| (0, n.as_str(), r.line)))?;
    Ok(NamedPoses { poses, of_target: target.is_some() })
}
