//! The only place of this room that touches the disk.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use serde::Deserialize;

use super::{detection_files, plan_files, solution_json};
use crate::error::{Error, Result};

/// Writes all files into `dir`, replacing an earlier result as a whole: a failure leaves `dir` as it was.
///
/// Files are written to a folder beside `dir`, which then takes its place. Files in `dir` that do not belong to the earlier
/// result (notes, say) are kept. Missing parents are made.
///
/// # Errors
/// A `dir` that is a file, or holds something else than an earlier result; anything that cannot be written or renamed.
pub fn write_all(dir: &Path, files: &BTreeMap<String, Vec<u8>>) -> Result<()> {
    let result = NewResult::begin(dir, files.keys().map(String::as_str))?;
    files.iter().try_for_each(|(name, bytes)| result.put(name, bytes))?;
    result.finish()
}

/// A result that is written file by file and takes the place of the earlier one in the end; dropped before, it leaves
/// everything as it was.
#[derive(Debug)]
pub struct NewResult {
    target: PathBuf,
    new: PathBuf,
    foreign: Vec<String>,
}

impl NewResult {
    /// Begins a result in `dir` with files and folders of these names; see [`write_all`].
    ///
    /// # Errors
    /// A `dir` that is a file, or holds something else than an earlier result.
    pub fn begin<'a>(dir: &Path, names: impl Iterator<Item = &'a str>) -> Result<Self> {
        let target = resolve(dir)?;
        let foreign = foreign_files(&target, &names.collect())?;
        let new = beside(&target, "new")?;
        fs::create_dir(&new).map_err(|e| Error::io(&new, &e))?;
        Ok(Self { target, new, foreign })
    }

    /// Writes a file, from any thread; `name` may begin with a folder.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn put(&self, name: &str, bytes: &[u8]) -> Result<()> {
        let path = self.new.join(name);
        if let Some(folder) = path.parent() {
            fs::create_dir_all(folder).map_err(|e| Error::io(folder, &e))?;
        }
        write_synced(&path, bytes).map_err(|e| Error::io(&path, &e))
    }

    /// Puts the result in the place of the earlier one.
    ///
    /// # Errors
    /// When it cannot be moved there; the earlier one is kept then.
    pub fn finish(self) -> Result<()> {
        replace(&self.target, &self.new, &self.foreign)
    }
}

impl Drop for NewResult {
    fn drop(&mut self) {
        if self.new.exists() {
            // The first error is the one to report.
            let _ = fs::remove_dir_all(&self.new);
        }
    }
}

/// Writes files into a folder among whatever is there, each one whole or not at all; none of them may be one of `inputs`.
///
/// # Errors
/// A file that is one of the inputs; anything that cannot be written or renamed.
pub fn write_beside(dir: &Path, files: &[(String, &[u8])], inputs: &[PathBuf]) -> Result<()> {
    let target = resolve(dir)?;
    fs::create_dir_all(&target).map_err(|e| Error::io(&target, &e))?;
    for (k, (name, _)) in files.iter().enumerate() {
        let path = target.join(name);
        let real = path.canonicalize().unwrap_or_else(|_| path.clone());
        if inputs.iter().any(|i| i.canonicalize().is_ok_and(|i| i == real)) {
            return Err(Error::input(path.display(), "is the input itself", "choose another folder with --out"));
        }
        if files[..k].iter().any(|(other, _)| other == name) {
            return Err(Error::input(path.display(), "is the name of two files", "correct them one after the other"));
        }
    }
    for (name, bytes) in files {
        let path = target.join(name);
        let new = beside(&path, "new")?;
        let written = write_synced(&new, bytes).and_then(|()| fs::rename(&new, &path));
        if let Err(error) = written {
            let _ = fs::remove_file(&new);
            return Err(Error::io(&path, &error));
        }
    }
    Ok(())
}

/// The real path of the target, whose parent exists.
fn resolve(dir: &Path) -> Result<PathBuf> {
    if dir.as_os_str().is_empty() {
        return Err(Error::input("results folder", "has no name", "name a folder for the results"));
    }
    if dir.exists() {
        let target = dir.canonicalize().map_err(|e| Error::io(dir, &e))?;
        if !target.is_dir() {
            return Err(Error::input(dir.display(), "is a file, not a folder", "name a folder for the results"));
        }
        return Ok(target);
    }
    let name = dir
        .file_name()
        .ok_or_else(|| Error::input(dir.display(), "does not name a folder", "name a folder for the results"))?;
    let parent = match dir.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    };
    fs::create_dir_all(parent).map_err(|e| Error::io(parent, &e))?;
    Ok(parent.canonicalize().map_err(|e| Error::io(parent, &e))?.join(name))
}

/// Names in the target that are not of the result that it holds.
fn foreign_files(target: &Path, files: &BTreeSet<&str>) -> Result<Vec<String>> {
    if !target.exists() {
        return Ok(Vec::new());
    }
    let mut there = BTreeSet::new();
    for entry in fs::read_dir(target).map_err(|e| Error::io(target, &e))? {
        let entry = entry.map_err(|e| Error::io(target, &e))?;
        there.insert(entry.file_name().into_string().map_err(|name| {
            Error::input(target.display(), format!("holds {}", name.display()), "choose another folder for the results")
        })?);
    }
    if there.is_empty() {
        return Ok(Vec::new());
    }
    let own = earlier_files(target).ok_or_else(|| {
        let what = "is not empty and holds no earlier result of this program";
        Error::input(target.display(), what, "choose another folder for the results, or empty this one")
    })?;
    let foreign: Vec<String> = there.into_iter().filter(|name| !own.contains(name)).collect();
    match foreign.iter().find(|name| files.contains(name.as_str())) {
        Some(name) => {
            let what = "would be overwritten, but is not of the earlier result in this folder";
            Err(Error::input(target.join(name).display(), what, "move it away, or choose another folder"))
        }
        None => Ok(foreign),
    }
}

/// Files of the result in a folder, as its solution.json, plan.json or detection.json lists them.
fn earlier_files(target: &Path) -> Option<BTreeSet<String>> {
    #[derive(Deserialize)]
    struct Listed {
        files: BTreeSet<String>,
    }
    let listed = |name: &str| {
        let bytes = fs::read(target.join(name)).ok()?;
        serde_json::from_slice::<Listed>(&bytes).ok().map(|l| l.files)
    };
    [solution_json::FILE_NAME, plan_files::FILE_NAME, detection_files::FILE_NAME].into_iter().find_map(listed)
}

/// A name beside the target that nothing has yet.
fn beside(target: &Path, purpose: &str) -> Result<PathBuf> {
    let name = target.file_name().map(|n| n.to_string_lossy().into_owned()).ok_or_else(|| {
        Error::input(target.display(), "cannot be replaced", "name a folder below it for the results")
    })?;
    let candidate = |k: u32| target.with_file_name(format!(".{name}.{purpose}-{}-{k}", std::process::id()));
    (0..1000).map(candidate).find(|p| !p.exists()).ok_or_else(|| {
        Error::input(
            target.display(),
            "many unfinished results lie beside it",
            "remove them (names that begin with a point)",
        )
    })
}

/// Writes a file through to the disk, so that a full disk is noticed here.
fn write_synced(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let mut file = fs::File::create_new(path)?;
    io::Write::write_all(&mut file, bytes)?;
    file.sync_all()
}

/// Puts `new` in the place of `target`; what was there comes back when that fails.
fn replace(target: &Path, new: &Path, foreign: &[String]) -> Result<()> {
    let fail = |e: io::Error| Error::io(target, &e);
    if !target.exists() {
        return fs::rename(new, target).map_err(fail);
    }
    let old = beside(target, "old")?;
    fs::rename(target, &old).map_err(fail)?;
    if let Err(error) = fs::rename(new, target) {
        return match fs::rename(&old, target) {
            Ok(()) => Err(fail(error)),
            Err(_) => Err(Error::input(target.display(), error, format!("the earlier result is in {}", old.display()))),
        };
    }
    for name in foreign {
        fs::rename(old.join(name), target.join(name)).map_err(|e| Error::io(&old.join(name), &e))?;
    }
    fs::remove_dir_all(&old).map_err(|e| Error::io(&old, &e))
}
