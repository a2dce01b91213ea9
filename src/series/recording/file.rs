//! The files of a recording as streams of messages, in constant memory, whatever holds them: MCAP or sqlite.

use std::path::Path;

use super::kind::{head, not_recording};
use super::message::{MCAP, Message};
use super::recording_files::parts_of;
#[cfg(feature = "mcap")]
use super::records;
use super::sqlite;
#[cfg(not(feature = "mcap"))]
use crate::error::{Code, Error};
use crate::error::{Notice, Result, plain_name};

/// Refuses other kinds of recordings, with the command that converts them.
///
/// # Errors
/// As the name says; a recording that cannot be read.
pub(in crate::series) fn require_recording(recording: &Path) -> Result<()> {
    for path in parts_of(recording)?.files {
        let head = head(&path)?;
        if !head.starts_with(MCAP) && !head.starts_with(sqlite::MAGIC) {
            return Err(not_recording(&path, &head));
        }
    }
    Ok(())
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
