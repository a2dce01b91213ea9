//! A user's files: regular files alone, none longer than its kind can be, pictures in bounded memory.

pub mod jpeg;
mod picture;
mod tiff;
mod word;

use std::fs::File;
use std::io::Read;
use std::path::Path;

pub use picture::{
    MOST_SIDE_PX, batches, decode_picture, decoded_bytes, is_turned_by_viewers, is_whole, page_of, picture_size,
};
pub use word::{folder_of, word};

use crate::error::{Code, Error, Result};

/// What a file is; says how long it may be.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FileKind {
    /// TOML or YAML.
    Settings,
    /// CSV: ten thousand images of the standard plate have 250 MB of observations.
    Table,
    /// URDF.
    Robot,
    /// A program of a robot.
    Program,
    /// solution.json, whose covariance grows with the square of the parameters: of ten thousand images of the standard plate it has 460 MB.
    Solution,
    /// One image, compressed or not.
    Image,
    /// A recording: read piece by piece, of any length.
    Recording,
}

impl FileKind {
    /// Bytes that a file of this kind has at most.
    pub fn most_bytes(self) -> u64 {
        const MIB: u64 = 1 << 20;
        match self {
            Self::Settings => 4 * MIB,
            Self::Robot => 16 * MIB,
            Self::Program => 64 * MIB,
            Self::Table => 1024 * MIB,
            Self::Solution => 2048 * MIB,
            Self::Image => 1024 * MIB,
            Self::Recording => u64::MAX,
        }
    }
}

/// Opens a regular file and tells its length.
///
/// # Errors
/// A file that is not there, empty names, folders, pipes, sockets and devices; files too long for their kind.
pub fn open(path: &Path, kind: FileKind) -> Result<(File, u64)> {
    let io = |e: std::io::Error| Error::io(path, &e);
    // Looked at before it is opened: a pipe without a writer would be waited for without end.
    refuse_special(path, &std::fs::metadata(path).map_err(io)?)?;
    let file = File::open(path).map_err(io)?;
    let metadata = file.metadata().map_err(io)?;
    refuse_special(path, &metadata)?;
    refuse_long(path, metadata.len(), kind)?;
    Ok((file, metadata.len()))
}

fn refuse_special(path: &Path, metadata: &std::fs::Metadata) -> Result<()> {
    if metadata.is_dir() {
        return Err(Error::new(
            Code::FileNotRegular,
            path.display(),
            "is a folder, not a file",
            "name the file itself",
        ));
    }
    if !metadata.is_file() {
        let what = "is a pipe, a socket or a device, not a file";
        return Err(Error::new(Code::FileNotRegular, path.display(), what, "write its content to a file first"));
    }
    Ok(())
}

fn refuse_long(path: &Path, bytes: u64, kind: FileKind) -> Result<()> {
    let most = kind.most_bytes();
    if bytes <= most {
        return Ok(());
    }
    let what = format!("has {bytes} bytes; a file of this kind ({kind:?}) has at most {most}").to_lowercase();
    Err(Error::new(Code::FileTooLarge, path.display(), what, "check that it is the right file"))
}

/// The bytes of a regular file.
///
/// # Errors
/// Those of [`open`]; a file that grows beyond its kind while it is read.
pub fn read(path: &Path, kind: FileKind) -> Result<Vec<u8>> {
    let (file, length) = open(path, kind)?;
    let mut bytes = Vec::with_capacity(usize::try_from(length).unwrap_or(0));
    file.take(kind.most_bytes().saturating_add(1)).read_to_end(&mut bytes).map_err(|e| Error::io(path, &e))?;
    refuse_long(path, bytes.len() as u64, kind)?;
    Ok(bytes)
}

/// The text of a regular file without its byte order mark.
///
/// # Errors
/// Those of [`read`] and [`text`].
pub fn read_text(path: &Path, kind: FileKind) -> Result<String> {
    text(path, read(path, kind)?)
}

/// The encoding of bytes that are UTF-16 text, with a byte order mark or with every other byte zero.
pub fn utf16(bytes: &[u8]) -> Option<&'static str> {
    match bytes {
        [0xff, 0xfe, ..] | [1..=255, 0, 1..=255, 0, ..] => Some("UTF-16LE"),
        [0xfe, 0xff, ..] | [0, 1..=255, 0, 1..=255, ..] => Some("UTF-16BE"),
        _ => None,
    }
}

/// Bytes as text without its byte order mark; `origin` is for messages only.
///
/// # Errors
/// UTF-16, and bytes that are not UTF-8 by their line.
pub fn text(origin: &Path, bytes: Vec<u8>) -> Result<String> {
    let is_table = origin.extension().is_some_and(|end| end.eq_ignore_ascii_case("csv"));
    let remedy = match is_table {
        true => "save it as UTF-8 (in a spreadsheet: CSV UTF-8)",
        false => "save it as UTF-8 (in an editor: encoding UTF-8)",
    };
    if utf16(&bytes).is_some() {
        return Err(Error::new(Code::TextEncoding, origin.display(), "is UTF-16 text", remedy));
    }
    let mut text = String::from_utf8(bytes).map_err(|e| {
        let valid = e.utf8_error().valid_up_to();
        let line = 1 + e.as_bytes()[..valid].iter().filter(|b| **b == b'\n').count();
        Error::new(Code::TextEncoding, format!("{}:{line}", origin.display()), "is not UTF-8 text", remedy)
    })?;
    if text.starts_with('\u{feff}') {
        text.drain(..'\u{feff}'.len_utf8());
    }
    Ok(text)
}
