//! Which files that stand where new ones go are this program's own, as it wrote them.

use std::fs;
use std::path::Path;

use serde::Deserialize;

use crate::output::corrections::{FINDINGS, FileFinding, TABLE};
use crate::output::frames_record;
use crate::output::written_programs::{self, WrittenAs};
use crate::series::InputFile;

/// How reports begin.
const PAGE: &str = "<!DOCTYPE html><html lang=\"en\"><head><meta charset=\"utf-8\"><meta name=\"viewport\" content=\"width=device-width, initial-scale=1\"><meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'";
/// How drawings begin, and what follows.
const DRAWING: &str = "<svg xmlns=\"http://www.w3.org/2000/svg\" ";
const DRAWN: [&str; 3] = ["role=\"img\" aria-label=", "class=\"scene\"", "width=\""];
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
/// Endings of files without a mark: they are known by a file with one that is written with them.
const UNMARKED: [&str; 3] = ["png", "pdf", "urdf"];
/// Bytes in which a mark is looked for.
const HEAD: usize = 4096;

/// True where nothing of the user is lost when `name` in the folder is replaced by that of `files`: its bytes are the same, or those that a record
/// of the folder says were written, or it has the mark of files that no record lists.
pub(super) fn is_own(folder: &Path, name: &str, files: &[(String, &[u8])]) -> bool {
    let path = folder.join(name);
    let Ok(there) = fs::read(&path) else { return false };
    if is_same(name, &there, files) {
        return true;
    }
    let of_frames = || {
        let bytes = fs::read(folder.join(frames_record::FILE_NAME)).ok()?;
        frames_record::recorded(&bytes).remove(name)
    };
    let recorded = written_programs::recorded(folder, name).or_else(of_frames);
    match recorded {
        Some(sha256) => InputFile::of_bytes(Path::new(name), &there).sha256 == sha256,
        // Records of earlier versions have no hash.
        None => {
            has_mark(name, &there)
                || written_programs::written_as(&path, &there) == Some(WrittenAs::Other)
                || (UNMARKED.contains(&ending(name)) && goes_with_own(folder, files))
        }
    }
}

fn is_same(name: &str, there: &[u8], files: &[(String, &[u8])]) -> bool {
    files.iter().any(|(file, bytes)| file == name && *bytes == there)
}

fn goes_with_own(folder: &Path, files: &[(String, &[u8])]) -> bool {
    let marked = files.iter().filter(|(name, _)| ["csv", "md", "json"].contains(&ending(name)));
    let is_own = |name: &str| {
        fs::read(folder.join(name)).is_ok_and(|there| is_same(name, &there, files) || has_mark(name, &there))
    };
    marked.into_iter().any(|(name, _)| is_own(name))
}

fn ending(name: &str) -> &str {
    name.rsplit_once('.').map_or("", |(_, ending)| ending)
}

/// What is written at the head of such files.
fn has_mark(name: &str, there: &[u8]) -> bool {
    let head = String::from_utf8_lossy(&there[..there.len().min(HEAD)]).into_owned();
    let first = head.lines().next().unwrap_or_default();
    match ending(name) {
        "json" => is_record(name, there),
        "html" => head.starts_with(PAGE),
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
