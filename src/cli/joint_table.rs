//! CSV files of joint vectors, columns named as in the URDF.

use std::path::Path;

use clap::ValueEnum;

use crate::error::{Code, Error, Result};
use crate::files::{self, FileKind};
use crate::urdf::JointKind;

/// Unit of revolute joints in a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(super) enum Unit {
    Rad,
    Deg,
}

/// Rows of a table: the columns `first` as they are, then the joints in rad or m.
///
/// # Errors
/// Names file and line: a missing column, a cell that is no number.
pub(super) fn read(
    path: &Path,
    first: &[&str],
    joints: &[String],
    kinds: &[JointKind],
    unit: Unit,
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
            let named: Vec<&str> = first.iter().copied().chain(joints.iter().map(String::as_str)).collect();
            bad(Code::CsvColumnMissing, 1, what, &format!("name the columns {}", named.join(", ")))
        })
    };
    let plain: Vec<usize> = first.iter().map(|name| column(name)).collect::<Result<_>>()?;
    let joints: Vec<usize> = joints.iter().map(|j| column(j)).collect::<Result<_>>()?;
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
        let mut readings = Vec::with_capacity(joints.len());
        for (c, kind) in joints.iter().zip(kinds) {
            let degrees = unit == Unit::Deg && *kind != JointKind::Prismatic;
            readings.push(if degrees { number(*c)?.to_radians() } else { number(*c)? });
        }
        rows.push((plain, readings));
    }
    if rows.is_empty() {
        return Err(bad(Code::FileEmpty, 1, "no row of numbers".into(), "write one joint vector per row"));
    }
    Ok(rows)
}
