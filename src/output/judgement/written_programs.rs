//! Programs that were corrected: by the record beside them they are known again.

use std::collections::BTreeMap;
use std::path::{Component, Path, PathBuf};

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use super::corrections::{FINDINGS, FileFinding, TABLE, left_finding};
use crate::diagnose::Weight;
use crate::error::{Code, Error, Result};
use crate::files::{self, FileKind};
use crate::series::{csv_line, sha256};

/// A file that was written: a finding with the hash of its bytes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct WrittenProgram {
    #[serde(flatten)]
    finding: FileFinding,
    /// SHA-256, lower-case hexadecimal.
    sha256: String,
    /// The program from which it was made, as seen from its folder; absent in files of earlier versions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    made_of: Option<String>,
}

impl WrittenProgram {
    /// A file of this name, made of a program that was read with `before`.
    pub fn new((name, bytes): (&str, &[u8]), before: &[u8], made_of: String) -> Self {
        let (code, text) = match bytes == before {
            true => (Code::ProgramCopied, "none of its targets was changed"),
            false => (
                Code::ProgramWritten,
                "its targets were changed; to correct it for another robot or another calibration, take the program from which it was made",
            ),
        };
        let finding = FileFinding {
            code,
            weight: Weight::Note,
            subject: name.to_owned(),
            quantities: BTreeMap::new(),
            text: text.to_owned(),
        };
        Self { finding, sha256: sha256(bytes), made_of: Some(made_of) }
    }

    fn is_of(&self, name: &str) -> bool {
        [Code::ProgramWritten, Code::ProgramCopied].contains(&self.finding.code) && self.finding.subject == name
    }
}

/// A finding of a run, with the names of the files that were corrected in it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RunFinding {
    #[serde(flatten)]
    finding: FileFinding,
    /// Absent in files of earlier versions.
    programs: Vec<String>,
}

impl RunFinding {
    /// Findings of the run that wrote these files.
    pub fn all(findings: &[FileFinding], programs: &[&str]) -> Vec<Self> {
        let programs: Vec<String> = programs.iter().map(|&name| name.to_owned()).collect();
        findings.iter().map(|f| Self { finding: f.clone(), programs: programs.clone() }).collect()
    }
}

/// What the record of a folder has of one kind.
fn recorded_as<T: DeserializeOwned>(folder: &Path) -> Vec<T> {
    let text = files::read_text(&folder.join(FINDINGS), FileKind::Table).unwrap_or_default();
    let all: Vec<serde_json::Value> = serde_json::from_str(&text).unwrap_or_default();
    all.into_iter().filter_map(|value| serde_json::from_value(value).ok()).collect()
}

/// The files that the record of a folder says were written.
fn listed(folder: &Path) -> Vec<WrittenProgram> {
    recorded_as(folder)
}

/// Hash of the bytes with which a file of a folder was written, by the record there.
pub fn recorded(folder: &Path, name: &str) -> Option<String> {
    listed(folder).into_iter().find(|w| w.is_of(name)).map(|w| w.sha256)
}

/// How a folder leads to a file, so that both may be moved together.
pub fn seen_from(folder: &Path, file: &Path) -> String {
    let real = |path: &Path| path.canonicalize().unwrap_or_else(|_| path.to_path_buf());
    let (folder, file) = (real(folder), real(file));
    let common = folder.components().zip(file.components()).take_while(|(a, b)| a == b).count();
    if common == 0 {
        return file.display().to_string();
    }
    let up = folder.components().skip(common).map(|_| Component::ParentDir);
    let path: PathBuf = up.chain(file.components().skip(common)).collect();
    path.to_string_lossy().replace('\\', "/")
}

/// Refuses to put a program in the place of one that was made of another of its name.
///
/// # Errors
/// Such a program in the folder.
pub fn require_same_source(folder: &Path, name: &str, made_of: &str) -> Result<()> {
    let path = folder.join(name);
    let earlier = listed(folder).into_iter().find(|w| w.is_of(name)).and_then(|w| w.made_of);
    earlier.filter(|earlier| earlier != made_of && path.is_file()).map_or(Ok(()), |earlier| {
        let what = format!("was made of another program of this name ({})", folder.join(earlier).display());
        let remedy = "give each of them a folder of its own with --out, or remove this file";
        Err(Error::new(Code::OutputExists, path.display(), what, remedy))
    })
}

/// What the records of a folder say of programs that other runs wrote and that are still there.
#[derive(Debug)]
pub struct OfOthers {
    /// Rows of findings.json that name the files.
    pub programs: Vec<WrittenProgram>,
    /// What was found in those runs; how many targets stay as they are is counted for each file.
    pub findings: Vec<RunFinding>,
    /// Rows of corrections.csv, with the columns of the new one.
    pub corrections: String,
}

impl OfOthers {
    /// Of all but the files of these names; `table` is the new corrections.csv.
    pub fn read(folder: &Path, own: &[&str], table: &str) -> Self {
        let is_other = |name: &str| !own.contains(&name) && folder.join(name).is_file();
        let programs = listed(folder).into_iter().filter(|w| w.is_of(&w.finding.subject)).collect::<Vec<_>>();
        let programs = programs.into_iter().filter(|w| is_other(&w.finding.subject)).collect();
        let there = files::read_text(&folder.join(TABLE), FileKind::Table).unwrap_or_default();
        let header = table.lines().next().unwrap_or_default();
        let corrections = rows(&there, header, is_other).unwrap_or_default();
        let mut findings: Vec<RunFinding> = recorded_as(folder);
        findings.retain(|f| f.finding.code != Code::TargetsLeft);
        findings.iter_mut().for_each(|f| f.programs.retain(|name| is_other(name)));
        findings.retain(|f| !f.programs.is_empty());
        findings.extend(left(&format!("{header}\n{corrections}")));
        Self { programs, findings, corrections }
    }
}

/// Targets of a table of corrections that stay as they are, by file.
fn left(table: &str) -> Vec<RunFinding> {
    let mut reader = csv::Reader::from_reader(table.as_bytes());
    let reason = reader.headers().ok().and_then(|names| names.iter().position(|name| name == "reason"));
    let mut files: BTreeMap<String, Vec<String>> = BTreeMap::new();
    for row in reader.records().filter_map(std::result::Result::ok) {
        let reason = reason.and_then(|at| row.get(at)).filter(|reason| !reason.is_empty());
        if let (Some(file), Some(reason)) = (row.get(0).map(Path::new).and_then(Path::file_name), reason) {
            files.entry(file.to_string_lossy().into_owned()).or_default().push(reason.to_owned());
        }
    }
    let finding = |(name, reasons): (String, Vec<String>)| {
        let finding = left_finding(reasons.iter().map(String::as_str), &name)?;
        Some(RunFinding { finding, programs: vec![name] })
    };
    files.into_iter().filter_map(finding).collect()
}

/// Rows of a table of corrections whose program is one of these, with the columns of `header`.
fn rows(table: &str, header: &str, is_wanted: impl Fn(&str) -> bool) -> Option<String> {
    let mut reader = csv::Reader::from_reader(table.as_bytes());
    let there = reader.headers().ok().filter(|there| there.get(0) == Some("file"))?.clone();
    let columns: Vec<Option<usize>> =
        header.split(',').map(|name| there.iter().position(|other| other == name)).collect();
    let is_wanted = |row: &csv::StringRecord| {
        let name = row.get(0).map(Path::new).and_then(Path::file_name).and_then(|name| name.to_str());
        name.is_some_and(&is_wanted)
    };
    let cells = |row: csv::StringRecord| {
        let cell = |column: &Option<usize>| column.and_then(|k| row.get(k)).unwrap_or_default().to_owned();
        columns.iter().map(cell).collect::<Vec<_>>()
    };
    let kept = reader.records().filter_map(std::result::Result::ok).filter(is_wanted);
    Some(kept.map(|row| csv_line(&cells(row))).collect())
}

/// What the record beside a program says of it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum WrittenAs {
    /// It was written with just these bytes.
    Itself,
    /// A file of its name was written, or targets of it are listed there that were changed.
    Other,
}

/// What the files beside a program say of it; `None` where they say nothing.
pub fn written_as(program: &Path, bytes: &[u8]) -> Option<WrittenAs> {
    let name = program.file_name()?.to_string_lossy();
    let beside = |file: &str| files::read_text(&program.with_file_name(file), FileKind::Table).ok();
    serde_json::from_str::<Vec<serde_json::Value>>(&beside(FINDINGS)?).ok()?;
    let written = listed(program.parent().unwrap_or(Path::new("")));
    let mut own = written.into_iter().filter(|w| w.finding.code == Code::ProgramWritten && w.finding.subject == name);
    if let Some(written) = own.next() {
        return Some(if written.sha256 == sha256(bytes) { WrittenAs::Itself } else { WrittenAs::Other });
    }
    let table = beside(TABLE)?;
    let mut rows = csv::Reader::from_reader(table.as_bytes());
    let headers = rows.headers().ok().filter(|headers| headers.get(0) == Some("file"))?;
    let reason = headers.iter().position(|name| name == "reason");
    let is_own = |row: &csv::StringRecord| row.get(0).map(Path::new).and_then(Path::file_name) == program.file_name();
    // A target that was left has a reason.
    let is_changed = |row: &csv::StringRecord| reason.and_then(|at| row.get(at)).is_none_or(str::is_empty);
    rows.records()
        .filter_map(std::result::Result::ok)
        .any(|row| is_own(&row) && is_changed(&row))
        .then_some(WrittenAs::Other)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_program_is_known_again_by_its_bytes_and_by_its_name() {
        let folder = tempfile::tempdir().unwrap();
        let program = folder.path().join("p.src");
        assert_eq!(written_as(&program, b"a"), None);
        let record = serde_json::to_string(&[WrittenProgram::new(("p.src", b"a"), b"", "../p.src".into())]).unwrap();
        std::fs::write(folder.path().join(FINDINGS), record).unwrap();
        assert_eq!(written_as(&program, b"a"), Some(WrittenAs::Itself));
        assert_eq!(written_as(&program, b"b"), Some(WrittenAs::Other));
        assert_eq!(written_as(&folder.path().join("q.src"), b"a"), None);
        // A record without hashes.
        std::fs::write(folder.path().join(FINDINGS), "[]").unwrap();
        assert_eq!(written_as(&program, b"a"), None);
        std::fs::write(folder.path().join(TABLE), "file,line\n\"cell/p.src\",2\n").unwrap();
        assert_eq!(written_as(&program, b"a"), Some(WrittenAs::Other));
        assert_eq!(written_as(&folder.path().join("q.src"), b"a"), None);
        // All its targets were left.
        let rows = "file,line,reason\np.src,2,computed\nq.src,3,\nq.src,4,computed\n";
        std::fs::write(folder.path().join(TABLE), rows).unwrap();
        assert_eq!(written_as(&program, b"a"), None);
        assert_eq!(written_as(&folder.path().join("q.src"), b"a"), Some(WrittenAs::Other));
    }
}
