//! Replacing file by file, so that a run that is cut short can be completed by the next one.
//!
//! The new files wait in a folder within the target. A list of what is to be moved and removed is put there in one step:
//! from then on the new result counts, and whoever comes next completes what is left of the list.

use std::collections::BTreeSet;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::tree::{self, RECORDS, UNFINISHED, write_synced};
use crate::error::{Code, Error, Result};

/// Its new files.
const FILES: &str = "files";
/// Its list.
const LIST: &str = "commit.json";

/// What is to be done.
#[derive(Debug, Serialize, Deserialize)]
struct List {
    move_in: BTreeSet<String>,
    remove: Vec<String>,
}

/// Makes the folder for the new files of a target.
pub(super) fn stage(target: &Path) -> io::Result<PathBuf> {
    let unfinished = target.join(UNFINISHED);
    fs::create_dir(&unfinished)?;
    let files = unfinished.join(FILES);
    fs::create_dir(&files)?;
    Ok(files)
}

/// Moves new files from elsewhere, on another disk perhaps, into that folder.
pub(super) fn moved_inside(target: &Path, new: &Path, names: &BTreeSet<String>) -> Result<PathBuf> {
    let fail = |e: io::Error| Error::io(target, &e);
    let files = stage(target).map_err(fail)?;
    let moved = names.iter().try_for_each(|name| {
        let (from, to) = (new.join(name), files.join(name));
        to.parent().map_or(Ok(()), fs::create_dir_all)?;
        fs::rename(&from, &to).or_else(|_| copy(&from, &to))
    });
    if moved.is_err() {
        let _ = discard(&target.join(UNFINISHED));
    }
    moved.map(|()| files).map_err(fail)
}

fn copy(from: &Path, to: &Path) -> io::Result<()> {
    if !from.is_dir() {
        return write_synced(to, &fs::read(from)?);
    }
    fs::create_dir(to)?;
    fs::read_dir(from)?.try_for_each(|entry| {
        let name = entry?.file_name();
        copy(&from.join(&name), &to.join(&name))
    })
}

/// Replaces the files of a target by those that wait in its folder.
pub(super) fn commit(target: &Path, names: &BTreeSet<String>, stale: &[String]) -> Result<()> {
    let unfinished = target.join(UNFINISHED);
    let list = List { move_in: names.clone(), remove: stale.to_vec() };
    let fail = |e: io::Error| Error::io(target, &e);
    let json = serde_json::to_vec(&list).map_err(|e| fail(e.into()))?;
    tree::sync_below(&unfinished);
    let draft = unfinished.join("draft.json");
    write_synced(&draft, &json).map_err(fail)?;
    fs::rename(&draft, unfinished.join(LIST)).map_err(fail)?;
    tree::sync(&unfinished);
    complete(target)
}

/// Completes the list of a target, where there is one.
///
/// # Errors
/// When a file cannot be moved or removed: the rest of the list is kept for another try.
pub(super) fn complete(target: &Path) -> Result<()> {
    let unfinished = target.join(UNFINISHED);
    let list = unfinished.join(LIST);
    let bytes = match fs::read(&list) {
        Ok(bytes) => bytes,
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(()),
        Err(error) => return Err(Error::io(&list, &error)),
    };
    let todo: List = serde_json::from_slice(&bytes)
        .ok()
        .filter(|l: &List| l.move_in.iter().chain(&l.remove).all(|n| tree::is_inside(Path::new(n))))
        .ok_or_else(|| {
            Error::new(Code::OutputForeign, list.display(), "is not of this program", "remove the folder that it is in")
        })?;
    run(target, &unfinished.join(FILES), &todo).map_err(|e| {
        let what = format!("a new result is only partly in its place: {e}");
        Error::new(
            Code::OutputFailed,
            target.display(),
            what,
            "make the folder writable and run again: it is completed then",
        )
    })?;
    tree::sync(target);
    let _ = fs::remove_file(&list).and_then(|()| fs::remove_dir_all(&unfinished));
    Ok(())
}

/// A record goes first and comes last, so that it never stands beside files of another result.
fn run(target: &Path, files: &Path, todo: &List) -> io::Result<()> {
    let is_record = |name: &&String| RECORDS.contains(&name.as_str());
    for name in todo.move_in.iter().filter(is_record).filter(|n| files.join(n).exists()) {
        gone(fs::remove_file(target.join(name)))?;
    }
    for name in &todo.remove {
        gone(fs::remove_file(target.join(name)))?;
        // Left where something of the user is in it.
        let folder = Path::new(name).parent().filter(|f| f.file_name().is_some());
        let _ = folder.map(|f| fs::remove_dir(target.join(f)));
    }
    let (last, first): (Vec<&String>, Vec<&String>) = todo.move_in.iter().partition(is_record);
    for name in first.into_iter().chain(last) {
        let to = target.join(name);
        to.parent().map_or(Ok(()), fs::create_dir_all)?;
        gone(fs::rename(files.join(name), to))?;
    }
    Ok(())
}

/// What is done already need not be done again.
pub(super) fn gone(done: io::Result<()>) -> io::Result<()> {
    done.or_else(|e| if e.kind() == io::ErrorKind::NotFound { Ok(()) } else { Err(e) })
}

/// Removes the folder, unless its list is to be completed.
pub(super) fn discard(unfinished: &Path) -> io::Result<()> {
    if unfinished.join(LIST).exists() { Ok(()) } else { fs::remove_dir_all(unfinished) }
}

/// Removes what a run that was cut short before its list was complete left in a target.
pub(super) fn sweep(target: &Path) {
    let _ = discard(&target.join(UNFINISHED));
    let listed = fs::read_dir(target).into_iter().flatten().filter_map(io::Result::ok);
    let is_probe = |p: &PathBuf| p.file_name().is_some_and(|n| tree::is_unfinished(Path::new(n))) && p.is_file();
    for probe in listed.map(|e| e.path()).filter(is_probe) {
        let _ = fs::remove_file(probe);
    }
}
