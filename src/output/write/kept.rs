//! What is kept of an earlier result, as nothing says whether somebody worked with it.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use super::strays::free_name;
use super::tree::{self, write_synced};
use crate::error::{Code, Error, Result};

/// Endings of files that are looked at, or read by programs, and not edited: records, matrices, reports, pictures.
const NOT_EDITED: [&str; 5] = ["html", "json", "npy", "png", "svg"];
/// The folder within a target that no folder can be made beside.
const WITHIN: &str = "earlier";

/// Keeps a file that is to be replaced under another name, as somebody may have worked with it.
pub(super) fn keep(file: &Path) -> Result<()> {
    let kept = free_name(file.to_path_buf()).map_err(|_| {
        let what = "would be kept under another name, and all of them are taken";
        Error::new(Code::OutputExists, file.display(), what, "move it and those of its name with .kept- away")
    })?;
    fs::read(file).and_then(|bytes| write_synced(&kept, &bytes)).map_err(|e| Error::io(&kept, &e))?;
    if let Some(folder) = kept.parent() {
        tree::sync(folder);
    }
    tracing::warn!(
        "{}: no record says whether it was changed since it was written; it is kept as {}",
        file.display(),
        kept.display()
    );
    Ok(())
}

/// Keeps those of these files in a target that people edit and that `new` does not have with the same bytes, in one folder beside it: a dozen
/// copies among the new files would hide them.
pub(super) fn keep_unrecorded(target: &Path, unrecorded: &[String], new: &Path) -> io::Result<()> {
    let is_edited = |name: &&String| {
        let path = Path::new(name);
        let is_other = |ending: &str| path.extension().is_some_and(|e| e == ending);
        !NOT_EDITED.into_iter().any(is_other) && target.join(path).is_file()
    };
    let read = |name| fs::read(target.join(name)).map(|bytes| (name, bytes));
    let mut lost = unrecorded.iter().filter(is_edited).map(read).collect::<io::Result<Vec<_>>>()?;
    lost.retain(|(name, bytes)| !fs::read(new.join(name)).is_ok_and(|new| new == *bytes));
    if lost.is_empty() {
        return Ok(());
    }
    let folder = made(target.to_path_buf()).or_else(|_| made(target.join(WITHIN)))?;
    for (name, bytes) in &lost {
        let path = folder.join(name);
        path.parent().map_or(Ok(()), fs::create_dir_all)?;
        write_synced(&path, bytes)?;
    }
    tree::sync_below(&folder);
    if let Some(parent) = folder.parent() {
        tree::sync(parent);
    }
    tracing::warn!(
        "{}: no record says whether {} of its files were changed since they were written; they are kept in {}",
        target.display(),
        lost.len(),
        folder.display()
    );
    Ok(())
}

/// A new folder of this name, or of another where it is taken.
fn made(path: PathBuf) -> io::Result<PathBuf> {
    let folder = free_name(path)?;
    fs::create_dir(&folder).map(|()| folder)
}
