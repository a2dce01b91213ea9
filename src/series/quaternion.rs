//! Quaternions in tables.

use nalgebra::Matrix3;

use super::table::{Row, Table};
use crate::error::{Code, Error, Result};
use crate::geom::Pose;

/// A quaternion whose length differs from 1 by more is none: rounded ones differ by less.
const MOST_OFF_UNIT: f64 = 1e-3;

/// True where nothing stands in these columns but zeros: what is no rotation, and no slip of digits.
pub(super) fn are_zeros(table: &Table, row: Row<'_>, columns: &[usize]) -> bool {
    columns.iter().all(|&c| table.number(row, c).is_ok_and(|value| value == 0.0))
}

/// The rotation of the quaternion in these columns; `stop` is for the message.
pub(super) fn quaternion(table: &Table, row: Row<'_>, columns: [usize; 4], stop: &str) -> Result<Matrix3<f64>> {
    let [x, y, z, w] = columns.map(|c| table.number(row, c));
    let xyzw = [x?, y?, z?, w?];
    let length = xyzw.iter().map(|v| v * v).sum::<f64>().sqrt();
    if (length - 1.0).abs() > MOST_OFF_UNIT {
        let what = format!("stop {stop}: the quaternion qx, qy, qz, qw has length {length:.4} and not 1");
        let remedy = "check the order of the columns and that no digits were lost; qw stands last";
        return Err(Error::new(Code::CsvRange, table.place(row), what, remedy));
    }
    Ok(Pose::from_xyz_quaternion([0.0; 3], xyzw).rotation)
}
