//! Which files that stand where new ones go are this program's own, as it wrote them.
//!
//! A folder keeps the hash of every file that was written to it. What other programs and earlier versions left there has none: it is known by its mark.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use serde::Deserialize;

use crate::error::Result;
use crate::output::corrections::{FINDINGS, FileFinding, TABLE};
use crate::output::frames_record;
use crate::output::text::json;
use crate::output::written_programs::{self, WrittenAs};
use crate::series::sha256;

/// The record of what was written to a folder: SHA-256 (lower-case hexadecimal) by name.
pub(super) const WRITTEN: &str = ".robotcal-written.json";

/// How reports begin.
const PAGE: &str = "<!DOCTYPE html><html lang=\"en\"><head><meta charset=\"utf-8\"><meta name=\"viewport\" content=\"width=device-width, initial-scale=1\"><meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'";
/// How drawings begin, and what follows.
const DRAWING: &str = "<svg xmlns=\"http://www.w3.org/2000/svg\" ";
const DRAWN: [&str; 2] = ["role=\"img\" aria-label=", "class=\"scene\""];
/// How reports of studies begin; the command follows.
const STUDIES: [&str; 3] = [
    "# Stated uncertainties against known truth",
    "# Two-step calibration against the joint fit",
    "# The image stage on rendered pictures",
];
/// In the first line of that of plans.
const PLANNED: &str = " planned images against ";
/// Columns of tables.
const COLUMNS: [&str; 2] = ["file,line,target,correction_mm,", ",x_m,y_m,z_m,qx,qy,qz,qw,sigma_mm,sigma_mrad,"];
/// How programs with frames begin.
const FRAME_PROGRAMS: [&str; 3] =
    ["&ACCESS RVP\nDEF robotcal_frames()", "MODULE RobotcalFrames\n", "def robotcal_frames():\n"];
/// Bytes in which a mark is looked for.
const HEAD: usize = 4096;

/// What a file is that stands where a new one goes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Standing {
    /// It is as this program wrote it, or as it would write it again.
    Own,
    /// This program wrote it, and no record says whether somebody changed it since.
    Unrecorded,
    /// Somebody else made it, or changed it.
    Others,
}

/// What `name` in the folder is, where `files` are to be written.
pub(super) fn standing(folder: &Path, name: &str, files: &[(String, &[u8])]) -> Standing {
    let path = folder.join(name);
    let Ok(there) = fs::read(&path) else { return Standing::Others };
    if is_same(name, &there, files) {
        return Standing::Own;
    }
    let written = written(folder);
    let recorded = written.get(name).cloned().or_else(|| written_programs::recorded(folder, name));
    let is_marked = || {
        let goes_with_own = || written.is_empty() && goes_with_own(folder, name, files);
        has_mark(name, &there)
            || written_programs::written_as(&path, &there) == Some(WrittenAs::Other)
            || goes_with_own()
    };
    match recorded {
        Some(hash) if sha256(&there) == hash => Standing::Own,
        None if is_marked() => Standing::Unrecorded,
        _ => Standing::Others,
    }
}

/// True of a file that is not as it was written to its folder; false where no record says.
pub fn is_changed(path: &Path, bytes: &[u8]) -> bool {
    let name = path.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
    let recorded = path.parent().and_then(|folder| written(folder).remove(&name));
    recorded.is_some_and(|hash| hash != sha256(bytes))
}

/// Hashes of what was written to a folder, by name; none where it has no record.
pub(super) fn written(folder: &Path) -> BTreeMap<String, String> {
    fs::read(folder.join(WRITTEN)).ok().and_then(|bytes| serde_json::from_slice(&bytes).ok()).unwrap_or_default()
}

/// The record of a folder that gets files with these hashes: with what else is still there.
///
/// # Errors
/// None in practice: every name can be written as JSON.
pub(super) fn record(folder: &Path, new: &BTreeMap<String, String>) -> Result<Vec<u8>> {
    let mut all = written(folder);
    all.retain(|name, _| folder.join(name).is_file());
    all.extend(new.clone());
    json(&all, WRITTEN)
}

fn is_same(name: &str, there: &[u8], files: &[(String, &[u8])]) -> bool {
    files.iter().any(|(file, bytes)| file == name && *bytes == there)
}

/// Whether another of `files` is there that is the same or has a mark, as those of earlier versions are that were written together.
fn goes_with_own(folder: &Path, name: &str, files: &[(String, &[u8])]) -> bool {
    let is_own = |other: &str| {
        fs::read(folder.join(other)).is_ok_and(|there| is_same(other, &there, files) || has_mark(other, &there))
    };
    files.iter().any(|(other, _)| other != name && is_own(other))
}

fn ending(name: &str) -> &str {
    name.rsplit_once('.').map_or("", |(_, ending)| ending)
}

/// What is written at the head of such files.
fn has_mark(name: &str, there: &[u8]) -> bool {
    let head = String::from_utf8_lossy(&there[..there.len().min(HEAD)]).into_owned();
    let first = head.lines().next().unwrap_or_default();
    match ending(name) {
        _ if head.starts_with(PAGE) => true,
        "json" => is_record(name, there),
        "svg" => head.strip_prefix(DRAWING).is_some_and(|rest| DRAWN.iter().any(|next| rest.starts_with(next))),
        "md" => {
            let is_study = STUDIES.iter().any(|start| first.starts_with(start)) || first.contains(PLANNED);
            is_study && head.contains("robotcal ")
        }
        "csv" if name == TABLE => first.starts_with(COLUMNS[0]),
        "csv" => first.contains(COLUMNS[1]),
        _ => FRAME_PROGRAMS.iter().any(|start| head.starts_with(start)),
    }
}

fn is_record(name: &str, there: &[u8]) -> bool {
    #[derive(Deserialize)]
    #[expect(dead_code, reason = "read for its fields alone")]
    struct Frames {
        format: u32,
        command: String,
        touches: Vec<serde_json::Value>,
        findings: Vec<FileFinding>,
    }
    match name {
        FINDINGS => serde_json::from_slice::<Vec<FileFinding>>(there).is_ok(),
        frames_record::FILE_NAME => serde_json::from_slice::<Frames>(there).is_ok(),
        _ => false,
    }
}
