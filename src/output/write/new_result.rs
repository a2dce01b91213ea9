//! Results and folders that take their place when they are complete.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::io;
use std::path::Path;
use std::sync::{Mutex, PoisonError};

use super::own::{self, WRITTEN};
use super::place::ResultFolder;
use super::staging::Staging;
use super::tree::write_synced;
use super::{journal, kept, swap, tree};
use crate::error::{Code, Error, Result};
use crate::series::sha256;

impl ResultFolder {
    /// Writes a whole result.
    ///
    /// # Errors
    /// As [`write_all`](super::write_all).
    pub fn write_all(self, files: &BTreeMap<String, Vec<u8>>) -> Result<()> {
        let result = self.begin()?;
        files.iter().try_for_each(|(name, bytes)| result.put(name, bytes))?;
        result.finish()
    }

    /// Begins a result.
    ///
    /// # Errors
    /// A folder that went away and cannot be made again.
    pub fn begin(self) -> Result<NewResult> {
        Ok(NewResult { staging: self.stage()?, hashes: Mutex::default(), place: self })
    }
}

/// A result that is written file by file and takes the place of the earlier one in the end; dropped before, it leaves
/// everything as it was.
#[derive(Debug)]
pub struct NewResult {
    staging: Staging,
    hashes: Mutex<BTreeMap<String, String>>,
    place: ResultFolder,
}

impl NewResult {
    /// Writes a file, from any thread; `name` may begin with a folder.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn put(&self, name: &str, bytes: &[u8]) -> Result<()> {
        if !tree::is_inside(Path::new(name)) {
            return Err(Error::new(Code::OutputName, name, "is no name of a file in a result", "report this"));
        }
        let path = self.staging.path().join(name);
        if let Some(folder) = path.parent() {
            fs::create_dir_all(folder).map_err(|e| Error::io(folder, &e))?;
        }
        write_synced(&path, bytes).map_err(|e| Error::io(&path, &e))?;
        self.hashes.lock().unwrap_or_else(PoisonError::into_inner).insert(name.to_owned(), sha256(bytes));
        Ok(())
    }

    /// Puts the result in the place of the earlier one.
    ///
    /// # Errors
    /// When it cannot be moved there: the earlier one is kept. Where a file of the user is in the way, or one of the earlier result was
    /// changed meanwhile, the new one is put beside, and the error says where.
    pub fn finish(self) -> Result<()> {
        let Self { place, hashes, staging } = self;
        let hashes = hashes.into_inner().unwrap_or_else(PoisonError::into_inner);
        let target = &place.target;
        let io = |e: io::Error| Error::io(target, &e);
        fs::create_dir_all(target).map_err(io)?;
        write_synced(&staging.path().join(WRITTEN), &own::record(target, &hashes)?).map_err(io)?;
        let names: BTreeSet<String> = hashes.into_keys().chain([WRITTEN.to_owned()]).collect();
        let there = tree::there(target, &names).map_err(io)?;
        if let Some(file) = there.in_the_way(&names) {
            return Err(set_aside(&staging, target, file, IN_THE_WAY));
        }
        // As it was claimed, long ago perhaps.
        if let Some(used) = tree::used_since(target) {
            let what = "was changed or put there since the earlier result, and would be lost";
            return Err(set_aside(&staging, target, Path::new(&used), what));
        }
        kept::keep_unrecorded(target, &there.unrecorded, staging.path()).map_err(io)?;
        tree::sync_below(staging.path());
        if let Staging::Beside(new) = &staging {
            match swap::swap(target, new, &there.foreign) {
                Ok(()) => return Ok(()),
                Err(error) => tracing::debug!("{}: {error}; replaced file by file", target.display()),
            }
        }
        let _inside = staging.inside(target, &names)?;
        journal::commit(target, &names, &there.stale)
    }
}

/// A folder that is filled by others and appears at its place when it is complete.
#[derive(Debug)]
pub struct NewFolder {
    staging: Staging,
    place: ResultFolder,
}

impl NewFolder {
    /// Begins a folder; `dir` must be new or empty.
    ///
    /// # Errors
    /// A folder with something in it, one that cannot be written, one that another run writes.
    pub fn begin(dir: &Path) -> Result<Self> {
        let place = ResultFolder::empty(dir)?;
        Ok(Self { staging: place.stage()?, place })
    }

    /// Where it is to be filled.
    pub fn path(&self) -> &Path {
        self.staging.path()
    }

    /// Moves the folder to its place.
    ///
    /// # Errors
    /// When something came there meanwhile, or it cannot be moved.
    pub fn finish(self) -> Result<()> {
        let Self { place, staging } = self;
        let target = &place.target;
        if let Staging::Beside(new) = &staging
            && fs::rename(new, target).is_ok()
        {
            return Ok(());
        }
        let fail = |e: io::Error| Error::io(target, &e);
        let listed = fs::read_dir(staging.path()).map_err(fail)?;
        let names: BTreeSet<String> = listed.filter_map(|e| e.ok()?.file_name().into_string().ok()).collect();
        let there = tree::there(target, &BTreeSet::new()).map_err(fail)?;
        if let Some(file) = there.in_the_way(&names) {
            return Err(set_aside(&staging, target, file, IN_THE_WAY));
        }
        let _inside = staging.inside(target, &names)?;
        journal::commit(target, &names, &[])
    }
}

/// What is said of a file that stands where a new one goes.
const IN_THE_WAY: &str = "would be overwritten, but is not of the earlier result in this folder";

/// Moves a result that has no place, because `file` is what is said of it, to where it can be found.
fn set_aside(staging: &Staging, target: &Path, file: &Path, what: &str) -> Error {
    let name = target.file_name().map_or_else(|| "result".into(), |n| n.to_string_lossy());
    let candidate = |k: u32| match staging {
        Staging::Beside(_) => target.with_file_name(format!("{name}-{k}")),
        Staging::Inside(_) => target.join(format!("result-{k}")),
    };
    let place = target.join(file);
    let aside = (2..1000).map(candidate).find(|p| !p.exists());
    match aside.filter(|aside| fs::rename(staging.path(), aside).is_ok()) {
        Some(aside) => Error::new(
            Code::OutputForeign,
            place.display(),
            format!("{what}; the new result is in {}", aside.display()),
            "move the file away before the next run",
        ),
        None => Error::new(Code::OutputForeign, place.display(), what, "move it away, or choose another folder"),
    }
}
