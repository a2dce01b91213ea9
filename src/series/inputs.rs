//! Input files: read once, hashed for the record, with messages for the usual ways in which text files go wrong.

use std::path::{Path, PathBuf};

use sha2::{Digest, Sha256};

use crate::{Error, Result};

/// A file that went into the result.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, serde::Serialize, serde::Deserialize)]
pub struct InputFile {
    /// The path as it was opened.
    pub path: PathBuf,
    /// SHA-256 of its bytes, lower-case hexadecimal.
    pub sha256: String,
}

impl InputFile {
    /// A file whose bytes are at hand.
    pub fn of_bytes(path: &Path, bytes: &[u8]) -> Self {
        Self::of_digest(path, &Sha256::digest(bytes))
    }

    /// A file whose SHA-256 is at hand.
    pub(super) fn of_digest(path: &Path, digest: &[u8]) -> Self {
        Self { path: path.to_path_buf(), sha256: digest.iter().map(|b| format!("{b:02x}")).collect() }
    }

    /// Reads and hashes a file.
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn of_file(path: &Path) -> Result<Self> {
        let bytes = std::fs::read(path).map_err(|e| Error::io(path, &e))?;
        Ok(Self::of_bytes(path, &bytes))
    }
}

/// Reads a text file without its byte order mark and notes its hash.
pub(super) fn read_text(path: &Path, inputs: &mut Vec<InputFile>) -> Result<String> {
    let bytes = std::fs::read(path).map_err(|e| Error::io(path, &e))?;
    inputs.push(InputFile::of_bytes(path, &bytes));
    let remedy = "save it as UTF-8 (in a spreadsheet: CSV UTF-8)";
    if bytes.starts_with(&[0xff, 0xfe]) || bytes.starts_with(&[0xfe, 0xff]) {
        return Err(Error::input(path.display(), "is UTF-16 text", remedy));
    }
    let text = String::from_utf8(bytes).map_err(|e| {
        let valid = e.utf8_error().valid_up_to();
        let line = 1 + e.as_bytes()[..valid].iter().filter(|b| **b == b'\n').count();
        Error::input(format!("{}:{line}", path.display()), "is not UTF-8 text", remedy)
    })?;
    Ok(text.strip_prefix('\u{feff}').map(str::to_string).unwrap_or(text))
}
