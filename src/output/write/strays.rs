//! What a run that was cut short left behind.

use std::collections::BTreeSet;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use super::held::{Held, Taken};
use super::journal;
use super::tree::{self, RECORDS};
use crate::error::Result;

/// Brings the result that `file` belongs to into a whole state after a run that was cut short: the new one is completed,
/// or the earlier one brought back. Does nothing where nothing is to be done.
///
/// # Errors
/// A result that cannot be completed, because its folder may not be written.
pub fn recover(file: &Path) -> Result<()> {
    let Some(folder) = file.parent() else { return Ok(()) };
    let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    bring_back(folder);
    if folder.is_file() {
        return Ok(());
    }
    match Held::at_once(folder) {
        Ok(_held) => journal::complete(folder),
        Err(Taken) => Ok(()),
    }
}

/// Kinds of folders beside a target: not finished yet, and finished.
const PART: &str = "part";
const WHOLE: &str = "whole";
/// The same of versions that moved the earlier result away before the new one came: not finished, and moved away.
const NEW: &str = "new";
const OLD: &str = "old";

/// A name for a folder that is not finished.
pub(super) fn part_name(target: &Path) -> Option<PathBuf> {
    let name = target.file_name()?.to_str()?;
    let candidate = |k: u32| target.with_file_name(format!(".{name}.{PART}-{}-{k}", std::process::id()));
    (0..1000).map(candidate).find(|p| p.symlink_metadata().is_err())
}

/// Its name when it is finished.
pub(super) fn finished_name(part: &Path) -> PathBuf {
    let name = part.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
    let (head, tail) = name.rsplit_once(&format!(".{PART}-")).unwrap_or((&name, ""));
    part.with_file_name(format!("{head}.{WHOLE}-{tail}"))
}

/// Folders of one of these kinds beside a target, in the order of their ages, the newest last.
fn beside(target: &Path, kind: &str) -> Vec<PathBuf> {
    let (Some(name), Some(parent)) = (target.file_name().and_then(|n| n.to_str()), target.parent()) else {
        return Vec::new();
    };
    let parent = if parent.as_os_str().is_empty() { Path::new(".") } else { parent };
    let head = format!(".{name}.{kind}-");
    let is_number = |text: &str| !text.is_empty() && text.bytes().all(|b| b.is_ascii_digit());
    let is_stray = |e: &fs::DirEntry| {
        let name = e.file_name();
        let numbers = name.to_str().and_then(|n| n.strip_prefix(&head)).and_then(|n| n.split_once('-'));
        numbers.is_some_and(|(pid, k)| is_number(pid) && is_number(k)) && e.file_type().is_ok_and(|t| t.is_dir())
    };
    let listed = fs::read_dir(parent).into_iter().flatten().filter_map(io::Result::ok).filter(is_stray);
    let mut found: Vec<_> = listed.map(|e| (e.metadata().and_then(|m| m.modified()).ok(), e.path())).collect();
    found.sort();
    found.into_iter().map(|(_, path)| path).collect()
}

/// Brings back an earlier result that was moved away and never replaced.
pub(super) fn bring_back(target: &Path) {
    if target.symlink_metadata().is_ok() {
        return;
    }
    let holds_result = |p: &PathBuf| tree::earlier_files(p).is_some();
    if let Some(old) = beside(target, OLD).into_iter().rfind(holds_result)
        && fs::rename(&old, target).is_ok()
    {
        tracing::warn!("{}: the earlier result was brought back after a run that was cut short", target.display());
    }
}

/// Removes what runs that were cut short left beside a target; nobody else may be at work there.
pub(super) fn sweep_beside(target: &Path) {
    for part in [PART, NEW].into_iter().flat_map(|kind| beside(target, kind)) {
        let _ = fs::remove_dir_all(part);
    }
    for stray in [WHOLE, OLD].into_iter().flat_map(|kind| beside(target, kind)) {
        let own = tree::own_files(&stray);
        if let Err(error) = sweep(&stray, target, &own) {
            tracing::debug!("{}: {error}", stray.display());
        }
    }
}

/// Removes a folder that was replaced, with the files of its result; what is the user's is moved to the target.
pub(super) fn sweep(stray: &Path, target: &Path, own: &BTreeSet<String>) -> io::Result<()> {
    let folders = tree::folders(own.iter());
    let is_record = |p: &PathBuf| RECORDS.iter().any(|r| p == Path::new(r));
    let (records, others): (Vec<PathBuf>, Vec<PathBuf>) =
        tree::entries(stray, &folders)?.into_iter().partition(is_record);
    let clear = |entry: &PathBuf| {
        let (from, to) = (stray.join(entry), target.join(entry));
        let is_own = entry.to_str().is_some_and(|e| own.contains(e));
        if is_own || is_same_file(&from, &to) {
            fs::remove_file(&from)
        } else {
            to.parent().map_or(Ok(()), fs::create_dir_all)?;
            fs::rename(&from, free_name(to)?)
        }
    };
    others.iter().try_for_each(clear)?;
    let below = folders.iter().rev().filter(|f| f.file_name().is_some());
    below.map(|f| fs::remove_dir(stray.join(f))).try_for_each(journal::gone)?;
    // The record goes last: without it the next run would take what is left, folders too, for the user's.
    records.iter().try_for_each(clear)?;
    fs::remove_dir(stray)
}

/// The path itself, or another name where it is taken.
///
/// # Errors
/// Where all others are taken, too.
pub(super) fn free_name(path: PathBuf) -> io::Result<PathBuf> {
    let is_free = |p: &PathBuf| p.symlink_metadata().is_err();
    let name = path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
    let others = (1..1000).map(|k| path.with_file_name(format!("{name}.kept-{k}")));
    std::iter::once(path.clone()).chain(others).find(is_free).ok_or_else(|| io::ErrorKind::AlreadyExists.into())
}

#[cfg(unix)]
fn is_same_file(a: &Path, b: &Path) -> bool {
    use std::os::unix::fs::MetadataExt;
    let id = |p: &Path| p.symlink_metadata().ok().map(|m| (m.dev(), m.ino()));
    id(a).is_some_and(|a| id(b) == Some(a))
}

#[cfg(not(unix))]
fn is_same_file(_: &Path, _: &Path) -> bool {
    false
}
