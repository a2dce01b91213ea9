//! CSV files of joint vectors, columns named as in the URDF.

use std::path::Path;

use clap::ValueEnum;

use crate::error::{Code, Error, Result};
use crate::files::{self, FileKind};
use crate::series::{AngleUnit, check_unit};
use crate::urdf::{Chain, JointKind};

/// Unit of revolute joints in a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(super) enum Unit {
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
pub(super) fn read(
    path: &Path,
    first: &[&str],
    chain: &Chain,
    (unit, flag): (Unit, &str),
) -> Result<Vec<(Vec<f64>, Vec<f64>)>> {
    let bad = |code, line: u64, what: String, remedy: &str| {
        Error::new(code, format!("{}:{line}", path.display()), what, remedy)
    };
    let mut reader = csv::ReaderBuilder::new().trim(csv::Trim::All).from_reader(files::open(path, FileKind::Table)?.0);
    let header = reader
        .headers()
        .map_err(|e| bad(Code::CsvSyntax, 1, e.to_string(), "the first line names the columns"))?
        .clone();
    let column = |name: &str| {
        header.iter().position(|h| h == name).ok_or_else(|| {
            let present: Vec<&str> = header.iter().collect();
            let what = format!("no column '{name}' (present: {})", present.join(", "));
            let named: Vec<&str> = first.iter().copied().chain(chain.readings.iter().map(String::as_str)).collect();
            bad(Code::CsvColumnMissing, 1, what, &format!("name the columns {}", named.join(", ")))
        })
    };
    let plain: Vec<usize> = first.iter().map(|name| column(name)).collect::<Result<_>>()?;
    let joints: Vec<usize> = chain.readings.iter().map(|j| column(j)).collect::<Result<_>>()?;
    let mut rows = Vec::new();
    for record in reader.records() {
        let record = record.map_err(|e| {
            Error::new(Code::CsvSyntax, path.display(), e, "every row has the columns of the first line")
        })?;
        let line = record.position().map_or(0, csv::Position::line);
        let number = |c: usize| {
            let cell = record.get(c).unwrap_or("");
            cell.parse::<f64>().ok().filter(|v| v.is_finite()).ok_or_else(|| {
                bad(
                    Code::CsvNumber,
                    line,
                    format!("'{cell}' in column {} is no number", &header[c]),
                    "correct the cell",
                )
            })
        };
        let plain = plain.iter().map(|c| number(*c)).collect::<Result<_>>()?;
        let readings: Vec<f64> = joints.iter().map(|c| number(*c)).collect::<Result<_>>()?;
        rows.push((plain, readings));
    }
    if rows.is_empty() {
        return Err(bad(Code::FileEmpty, 1, "no row of numbers".into(), "write one joint vector per row"));
    }
    let as_written: Vec<&[f64]> = rows.iter().map(|(_, readings): &(Vec<f64>, Vec<f64>)| readings.as_slice()).collect();
    check_unit(path, unit.into(), chain, &as_written, |unit| format!("give {flag} {unit}"))?;
    if unit == Unit::Deg {
        let turning = |kind: &JointKind| *kind != JointKind::Prismatic;
        for (_, readings) in &mut rows {
            let turning = readings.iter_mut().zip(&chain.reading_kinds).filter(|(_, kind)| turning(kind));
            turning.for_each(|(q, _)| *q = q.to_radians());
        }
    }
    Ok(rows)
}
