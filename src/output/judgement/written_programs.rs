//! Programs that were corrected: by the record beside them they are known again.

use std::collections::BTreeMap;
use std::path::Path;

use serde::{Deserialize, Serialize};

use super::corrections::{FINDINGS, FileFinding, TABLE};
use crate::diagnose::Weight;
use crate::error::Code;
use crate::files::{self, FileKind};
use crate::series::InputFile;

/// A file whose targets were changed: a finding with the hash of its bytes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct WrittenProgram {
    #[serde(flatten)]
    finding: FileFinding,
    /// SHA-256, lower-case hexadecimal.
    sha256: String,
}

fn sha256(bytes: &[u8]) -> String {
    InputFile::of_bytes(Path::new(""), bytes).sha256
}

impl WrittenProgram {
    /// A file of this name, written with other bytes than it was read with.
    pub fn new(name: &str, bytes: &[u8]) -> Self {
        let text = "its targets were changed; to correct it for another robot or another calibration, take the program from which it was made";
        let finding = FileFinding {
            code: Code::ProgramWritten,
            weight: Weight::Note,
            subject: name.to_owned(),
            quantities: BTreeMap::new(),
            text: text.to_owned(),
        };
        Self { finding, sha256: sha256(bytes) }
    }
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
    let all: Vec<serde_json::Value> = serde_json::from_str(&beside(FINDINGS)?).ok()?;
    let written = all.into_iter().filter_map(|value| serde_json::from_value::<WrittenProgram>(value).ok());
    let mut own = written.filter(|w| w.finding.code == Code::ProgramWritten && w.finding.subject == name);
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
    rows.records().filter_map(Result::ok).any(|row| is_own(&row) && is_changed(&row)).then_some(WrittenAs::Other)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_program_is_known_again_by_its_bytes_and_by_its_name() {
        let folder = tempfile::tempdir().unwrap();
        let program = folder.path().join("p.src");
        assert_eq!(written_as(&program, b"a"), None);
        let record = serde_json::to_string(&[WrittenProgram::new("p.src", b"a")]).unwrap();
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
