//! Input files: read once, hashed for the record.

use std::io::Read;
use std::path::{Path, PathBuf};

use sha2::{Digest, Sha256};

use crate::error::{Error, Result};
use crate::files::{self, FileKind};

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
        Self { path: path.to_path_buf(), sha256: sha256(bytes) }
    }

    /// Hashes a file of any length, as long as it was when it was opened.
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn of_file(path: &Path) -> Result<Self> {
        let (file, length) = files::open(path, FileKind::Recording)?;
        let mut file = file.take(length);
        let mut hasher = Sha256::new();
        let mut buffer = vec![0; 1 << 20];
        loop {
            match file.read(&mut buffer).map_err(|e| Error::io(path, &e))? {
                0 => return Ok(Self { path: path.to_path_buf(), sha256: hexadecimal(&hasher.finalize()) }),
                read => hasher.update(&buffer[..read]),
            }
        }
    }
}

/// SHA-256, lower-case hexadecimal.
pub fn sha256(bytes: &[u8]) -> String {
    hexadecimal(&Sha256::digest(bytes))
}

fn hexadecimal(digest: &[u8]) -> String {
    digest.iter().map(|b| format!("{b:02x}")).collect()
}

/// Reads a text file without its byte order mark and notes its hash.
pub(super) fn read_text(path: &Path, kind: FileKind, inputs: &mut Vec<InputFile>) -> Result<String> {
    let bytes = files::read(path, kind)?;
    inputs.push(InputFile::of_bytes(path, &bytes));
    files::text(path, bytes)
}
