//! What is kept of an earlier result, as nothing says whether somebody worked with it.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use super::strays::free_name;
use super::tree::{self, write_synced};

/// Endings of files that are looked at, or read by programs, and not edited: records, matrices, reports, pictures.
const NOT_EDITED: [&str; 5] = ["html", "json", "npy", "png", "svg"];
/// The folder within a target that no folder can be made beside.
const WITHIN: &str = "earlier";

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
