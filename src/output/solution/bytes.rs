//! solution.json as bytes, and back.

use std::io;

use serde::{Deserialize, Serialize};

use super::solution_json::{FILE_NAME, FORMAT, SolutionRecord, TermRecord};
use crate::error::{Code, Error, Result};
use crate::model::joint_terms::Term;

/// Bytes of solution.json: one line for each field of [`SolutionRecord`].
///
/// # Errors
/// None in practice: every field can be written as JSON.
pub fn to_bytes(record: &SolutionRecord) -> Result<Vec<u8>> {
    field_per_line(record, FILE_NAME)
}

/// A record as JSON with a line for each field; `file` is its name, for messages.
///
/// # Errors
/// None in practice: every field can be written as JSON.
pub fn field_per_line(record: &impl Serialize, file: &str) -> Result<Vec<u8>> {
    let mut bytes = Vec::new();
    let mut serializer = serde_json::Serializer::with_formatter(&mut bytes, FieldPerLine::default());
    record.serialize(&mut serializer).map_err(|e| Error::new(Code::RecordNotWritten, file, e, "report this"))?;
    bytes.push(b'\n');
    Ok(bytes)
}

/// Compact JSON with a new line before each field of the outermost object.
#[derive(Default)]
struct FieldPerLine {
    depth: usize,
}

impl FieldPerLine {
    fn open(&mut self, w: &mut (impl io::Write + ?Sized), bracket: &[u8]) -> io::Result<()> {
        self.depth += 1;
        w.write_all(bracket)
    }

    fn close(&mut self, w: &mut (impl io::Write + ?Sized), bracket: &[u8]) -> io::Result<()> {
        self.depth -= 1;
        if self.depth == 0 {
            w.write_all(b"\n")?;
        }
        w.write_all(bracket)
    }
}

impl serde_json::ser::Formatter for FieldPerLine {
    fn begin_object<W: io::Write + ?Sized>(&mut self, w: &mut W) -> io::Result<()> {
        self.open(w, b"{")
    }

    fn end_object<W: io::Write + ?Sized>(&mut self, w: &mut W) -> io::Result<()> {
        self.close(w, b"}")
    }

    fn begin_array<W: io::Write + ?Sized>(&mut self, w: &mut W) -> io::Result<()> {
        self.open(w, b"[")
    }

    fn end_array<W: io::Write + ?Sized>(&mut self, w: &mut W) -> io::Result<()> {
        self.close(w, b"]")
    }

    fn begin_object_key<W: io::Write + ?Sized>(&mut self, w: &mut W, first: bool) -> io::Result<()> {
        w.write_all(if first { b"" } else { b"," })?;
        w.write_all(if self.depth == 1 { b"\n" } else { b"" })
    }
}

/// Reads solution.json back.
///
/// # Errors
/// Text that is no such file, other versions of the format, parts that do not fit together (by field).
pub fn read(bytes: &[u8]) -> Result<SolutionRecord> {
    #[derive(Deserialize)]
    struct Version {
        format: u32,
    }
    let refuse = |e: serde_json::Error| {
        Error::new(Code::SolutionDamaged, FILE_NAME, e, "give the solution.json that `robotcal identify` wrote")
    };
    let version: Version = serde_json::from_slice(bytes).map_err(refuse)?;
    if version.format != FORMAT {
        let what = format!("format = {}", version.format);
        let remedy = match version.format < FORMAT {
            true => "an earlier version wrote it: identify again".to_owned(),
            false => format!("this program reads format = {FORMAT}; a newer one may be needed"),
        };
        return Err(Error::new(Code::SettingVersion, FILE_NAME, what, remedy));
    }
    let mut record: SolutionRecord = serde_json::from_slice(bytes).map_err(refuse)?;
    record.plain_names()?;
    let of_older = |t: &mut TermRecord| matches!(Term::from_name(&t.term), Some(Term::Local(_)));
    let older: Vec<TermRecord> = record.robot.terms.extract_if(.., of_older).collect();
    record.robot.local_errors.extend(older);
    super::check::check(&record)?;
    Ok(record)
}
