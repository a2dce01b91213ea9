//! plan.json of planned touches: what their joint values were before anybody jogged.

use std::collections::BTreeMap;
use std::path::Path;

use serde::{Deserialize, Serialize};

use super::plan_files::{FILE_NAME, FORMAT, written};
use crate::error::{Code, Error, Result};
use crate::files::{self, FileKind};
use crate::output::text::{as_written, json};
use crate::urdf::Chain;

/// One touch of a plan.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TouchStop {
    /// Its stop.
    pub stop: String,
    /// Readings, rad or m, in the order of the joints.
    pub readings: Vec<f64>,
}

#[derive(Serialize)]
struct TouchRecord<'a> {
    format: u32,
    files: Vec<String>,
    as_written: BTreeMap<String, String>,
    command: &'a str,
    joints: &'a [String],
    stops: &'a [TouchStop],
}

/// The files of planned touches with their record.
///
/// # Errors
/// None in practice: everything can be written as text.
pub fn touch_files(
    mut files: BTreeMap<String, Vec<u8>>,
    (joints, stops): (&[String], &[TouchStop]),
    command: &str,
) -> Result<BTreeMap<String, Vec<u8>>> {
    let listed = files.keys().cloned().chain([FILE_NAME.to_owned()]).collect();
    let record = TouchRecord { format: FORMAT, files: listed, as_written: as_written(&files), command, joints, stops };
    files.insert(FILE_NAME.to_owned(), json(&record, FILE_NAME)?);
    Ok(files)
}

/// What of plan.json tells whether somebody jogged.
#[derive(Debug, Clone, Deserialize)]
struct Planned {
    joints: Vec<String>,
    stops: Vec<PlannedReadings>,
}

#[derive(Debug, Clone, Deserialize)]
struct PlannedReadings {
    readings: Vec<f64>,
}

/// Of stops with their readings (rad or m, in the order of the chain) those whose readings are, to the last digit that a plan writes, those
/// of this plan.json; none where it is of other joints.
///
/// # Errors
/// A plan.json that cannot be read.
pub fn as_planned<'a>(
    path: &Path,
    chain: &Chain,
    stops: impl Iterator<Item = (&'a str, &'a [f64])>,
) -> Result<Vec<String>> {
    let bytes = files::read(path, FileKind::Settings)?;
    // Plans of before have no readings of touches.
    let syntax = |e| Error::new(Code::SettingSyntax, path.display(), e, "plan again, or remove the file");
    let record: serde_json::Value = serde_json::from_slice(&bytes).map_err(syntax)?;
    let Ok(Planned { joints, stops: planned }) = serde_json::from_value(record) else { return Ok(Vec::new()) };
    if joints != chain.readings {
        return Ok(Vec::new());
    }
    let shown = |readings: &[f64]| written(readings, &chain.reading_kinds);
    let planned: Vec<Vec<f64>> = planned.iter().map(|p| shown(&p.readings)).collect();
    Ok(stops.filter(|(_, readings)| planned.contains(&shown(readings))).map(|(stop, _)| stop.to_owned()).collect())
}
