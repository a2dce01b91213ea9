//! CSV files of joint vectors, columns named as in the URDF.

use std::path::Path;

use clap::ValueEnum;

use crate::error::{Code, Error, Result};
use crate::series::{AngleUnit, Row, StatedUnit, Table, check_unit};
use crate::urdf::{Chain, JointKind};

/// Unit of revolute joints in a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Unit {
    Rad,
    Deg,
}

impl From<Unit> for AngleUnit {
    fn from(unit: Unit) -> Self {
        match unit {
            Unit::Rad => Self::Rad,
            Unit::Deg => Self::Deg,
        }
    }
}

/// Rows of a table: the columns `first` as they are, then the joints in rad or m. `flag` states the unit of the revolute ones.
///
/// # Errors
/// Names file and line: a missing column, a cell that is no number, a unit that cannot be true.
pub fn read(path: &Path, first: &[&str], chain: &Chain, unit: (Unit, &str)) -> Result<Vec<(Vec<f64>, Vec<f64>)>> {
    read_rows(path, first, chain, unit, |_, _| true)
}

/// Joint vectors of a table in rad or m; rows without any, as of images taken off the robot, are none.
///
/// # Errors
/// As of [`read`].
pub fn read_vectors(path: &Path, chain: &Chain, unit: (Unit, &str)) -> Result<Vec<Vec<f64>>> {
    let is_on_robot = |row: Row<'_>, joints: &[usize]| joints.iter().any(|joint| !row.cell(*joint).is_empty());
    let rows = read_rows(path, &[], chain, unit, is_on_robot)?;
    Ok(rows.into_iter().map(|(_, readings)| readings).collect())
}

fn read_rows(
    path: &Path,
    first: &[&str],
    chain: &Chain,
    (unit, flag): (Unit, &str),
    counts: impl Fn(Row<'_>, &[usize]) -> bool,
) -> Result<Vec<(Vec<f64>, Vec<f64>)>> {
    let table = Table::read(path, &mut Vec::new())?;
    let columns = |names: &[&str]| names.iter().map(|name| table.require(name)).collect::<Result<Vec<usize>>>();
    let stating = |unit: &str| format!("give {flag} {unit}");
    let stated = StatedUnit { unit: unit.into(), stating: &stating };
    let (plain, joints) = (columns(first)?, table.require_joints(&chain.readings, stated)?);
    let numbers = |row, columns: &[usize]| columns.iter().map(|c| table.number(row, *c)).collect::<Result<Vec<f64>>>();
    let read = |row| -> Result<(Vec<f64>, Vec<f64>)> { Ok((numbers(row, &plain)?, numbers(row, &joints)?)) };
    let mut rows: Vec<(Vec<f64>, Vec<f64>)> =
        table.rows().filter(|row| counts(*row, &joints)).map(read).collect::<Result<_>>()?;
    if rows.is_empty() {
        let place = table.place_of_header();
        return Err(Error::new(Code::FileEmpty, place, "no row of numbers", "write one joint vector per row"));
    }
    let as_written: Vec<&[f64]> = rows.iter().map(|(_, readings)| readings.as_slice()).collect();
    check_unit(path, unit.into(), chain, &as_written, stating)?;
    if unit == Unit::Deg {
        let turning = |kind: &JointKind| *kind != JointKind::Prismatic;
        for (_, readings) in &mut rows {
            let turning = readings.iter_mut().zip(&chain.reading_kinds).filter(|(_, kind)| turning(kind));
            turning.for_each(|(q, _)| *q = q.to_radians());
        }
    }
    Ok(rows)
}
