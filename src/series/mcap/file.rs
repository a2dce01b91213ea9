//! The files of a recording as streams of messages, in constant memory, whatever holds them: MCAP or sqlite.

use std::io::Read;
use std::path::{Path, PathBuf};

use super::message::{MCAP, Message};
#[cfg(feature = "mcap")]
use super::records;
use super::sqlite;
use crate::error::{Code, Error, Notice, Result, plain_name};
use crate::files::{self, FileKind};

/// The files of a recording, in the order in which they were written: one file, or a rosbag2 folder.
///
/// # Errors
/// Other kinds of recordings, with the command that converts them.
pub(super) fn files_of(recording: &Path) -> Result<Vec<PathBuf>> {
    if !recording.is_dir() {
        return Ok(vec![recording.to_path_buf()]);
    }
    let mut all = Vec::new();
    for entry in std::fs::read_dir(recording).map_err(|e| Error::io(recording, &e))? {
        all.push(entry.map_err(|e| Error::io(recording, &e))?.path());
    }
    let ends = |end: &'static str| move |path: &&PathBuf| path.to_string_lossy().ends_with(end);
    for known in [".mcap", ".db3"] {
        let mut files: Vec<PathBuf> = all.iter().filter(ends(known)).cloned().collect();
        if !files.is_empty() {
            files.sort_by_key(|p| split_number(p));
            return Ok(files);
        }
    }
    if let Some(other) = [".zstd", ".bag"].iter().find_map(|end| all.iter().find(ends(end))) {
        return Err(not_recording(other, &head(other)?));
    }
    let remedy = match recording.join("series.toml").is_file() {
        true => "a series folder becomes a recording: let the second name end in .mcap",
        false => "give an .mcap file, or a rosbag2 folder with .mcap or .db3 files",
    };
    Err(Error::new(Code::RecordingFormat, recording.display(), "holds no .mcap or .db3 file", remedy))
}

/// Refuses other kinds of recordings, with the command that converts them.
///
/// # Errors
/// As the name says; a recording that cannot be read.
pub(in crate::series) fn require_recording(recording: &Path) -> Result<()> {
    for path in files_of(recording)? {
        let head = head(&path)?;
        if !head.starts_with(MCAP) && !head.starts_with(sqlite::MAGIC) {
            return Err(not_recording(&path, &head));
        }
    }
    Ok(())
}

/// rosbag2 numbers the files of a long recording: `name_0.mcap`, ..., `name_10.mcap`.
fn split_number(path: &Path) -> (Option<u64>, PathBuf) {
    let stem = path.file_stem().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default();
    let number = stem.rsplit_once('_').and_then(|(_, n)| n.parse().ok());
    (number, path.to_path_buf())
}

fn head(path: &Path) -> Result<Vec<u8>> {
    let mut bytes = Vec::new();
    let (file, _) = files::open(path, FileKind::Recording)?;
    file.take(16).read_to_end(&mut bytes).map_err(|e| Error::io(path, &e))?;
    Ok(bytes)
}

/// Names what a file is instead, with the command that converts it.
fn not_recording(path: &Path, head: &[u8]) -> Error {
    let shown = path.display();
    let (what, remedy) = if head.starts_with(b"#ROSBAG V2") {
        let remedy =
            format!("convert it: pip install rosbags; rosbags-convert --src {shown} --dst run1 --dst-storage mcap");
        ("is a ROS 1 bag", remedy)
    } else if head.starts_with(&[0x28, 0xb5, 0x2f, 0xfd]) {
        ("is compressed as a whole", format!("expand it first: unzstd {shown}"))
    } else {
        ("is not a recording", "check the file: it begins neither as MCAP nor as sqlite does".to_string())
    };
    Error::new(Code::RecordingFormat, shown, what, remedy)
}

/// Calls `visit` for every message of a file in the order of the file, and returns a notice where the file is damaged.
pub(super) fn for_each(path: &Path, mut visit: impl FnMut(Message<'_>) -> Result<()>) -> Result<Option<Notice>> {
    let visit = |message: Message<'_>| {
        plain_name("topic", message.topic, path.display())?;
        let data = unpacked(message.data);
        visit(Message { data: &data, ..message })
    };
    let head = head(path)?;
    match () {
        () if head.starts_with(MCAP) => mcap_messages(path, visit),
        () if head.starts_with(sqlite::MAGIC) => sqlite::for_each(path, visit),
        () => Err(not_recording(path, &head)),
    }
}

#[cfg(feature = "mcap")]
use records::{for_each as mcap_messages, unpacked};

/// A build without the feature unpacks nothing.
#[cfg(not(feature = "mcap"))]
fn unpacked(data: &[u8]) -> std::borrow::Cow<'_, [u8]> {
    data.into()
}

/// What a build without the feature says of MCAP.
#[cfg(not(feature = "mcap"))]
fn mcap_messages(path: &Path, _: impl FnMut(Message<'_>) -> Result<()>) -> Result<Option<Notice>> {
    let remedy = "build robotcal with the feature mcap";
    Err(Error::new(Code::RecordingFormat, path.display(), "is MCAP, which this build does not read", remedy))
}
