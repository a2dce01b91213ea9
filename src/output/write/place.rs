//! The folder that results go to, tried before the work that they cost.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use super::held::{Held, Taken};
use super::own::{self, Standing, WRITTEN};
use super::staging::Staging;
use super::strays::{bring_back, part_name, sweep_beside};
use super::tree::write_synced;
use super::{journal, kept, tree};
use crate::error::{Code, Error, Result};
use crate::series::sha256;

/// What to do where work would be lost.
const OTHER: &str = "choose another folder for the results";

/// A folder that can be written, for as long as this lives; folders that were made for it go again when nothing was written.
#[derive(Debug)]
pub struct ResultFolder {
    given: PathBuf,
    /// The option that names it.
    option: &'static str,
    pub(super) target: PathBuf,
    made: Vec<PathBuf>,
    /// Held against other runs.
    held: Option<Held>,
}

impl ResultFolder {
    /// Claims a folder for a result that has this record: it is made, or is empty, or holds an earlier result of the same kind that nobody
    /// has worked with, and no other run writes to it. What a run that was cut short left there is brought in order.
    ///
    /// # Errors
    /// A `dir` that is a file, holds something else than an earlier result, cannot be written, or belongs to another run.
    pub fn claim(dir: &Path, record: &str) -> Result<Self> {
        let place = Self::locked(dir)?;
        let foreign =
            |what: String, remedy: &str| Err(Error::new(Code::OutputForeign, place.target.display(), what, remedy));
        if !place.holds_something()? {
            return Ok(place);
        }
        if let Some(other) = tree::other_record(&place.target, record) {
            return foreign(format!("holds {other}, the result of another command, which would be lost"), OTHER);
        }
        if tree::earlier_files(&place.target).is_none() {
            let remedy = "choose another folder for the results, or empty this one";
            return foreign("is not empty and holds no earlier result of this program".into(), remedy);
        }
        if let Some(used) = tree::used_since(&place.target) {
            let what =
                format!("is in use: {used} was changed or put there since the earlier result, and would be lost");
            return foreign(what, OTHER);
        }
        Ok(place)
    }

    /// Claims a folder that is new or empty.
    ///
    /// # Errors
    /// As [`ResultFolder::claim`]; a folder with something in it.
    pub(super) fn empty(dir: &Path) -> Result<Self> {
        let place = Self::locked(dir)?;
        match place.holds_something()? {
            true => Err(Error::new(
                Code::OutputExists,
                dir.display(),
                "is not empty",
                "give a new folder, or remove this one",
            )),
            false => Ok(place),
        }
    }

    /// Tries a folder for files that go there among others.
    ///
    /// # Errors
    /// A `dir` that is a file or cannot be written.
    pub fn among(dir: &Path) -> Result<Self> {
        let place = Self::made(dir)?;
        // Otherwise whoever is at work there does it.
        if let Ok(_held) = Held::at_once(&place.target) {
            journal::complete(&place.target)?;
        }
        place.try_writing()?;
        Ok(place)
    }

    /// This place, named by another option than `--out`.
    #[must_use]
    pub fn named_by(mut self, option: &'static str) -> Self {
        self.option = option;
        self
    }

    /// This place for files of these names, of which none is there that somebody else made.
    ///
    /// # Errors
    /// Such a file.
    pub fn for_files(self, names: &[&str]) -> Result<Self> {
        names.iter().try_for_each(|name| self.require_replaceable(name, &[]).map(drop))?;
        Ok(self)
    }

    /// The folder as it was given.
    pub fn path(&self) -> &Path {
        &self.given
    }

    fn made(dir: &Path) -> Result<Self> {
        let missing = missing(dir)?;
        let mut place =
            Self { given: dir.to_path_buf(), option: "--out", target: PathBuf::new(), made: Vec::new(), held: None };
        for folder in missing {
            fs::create_dir(&folder).map_err(|e| Error::io(&folder, &e))?;
            place.made.push(folder);
        }
        place.target = dir.canonicalize().map_err(|e| Error::io(dir, &e))?;
        Ok(place)
    }

    fn locked(dir: &Path) -> Result<Self> {
        bring_back(dir);
        let mut place = Self::made(dir)?;
        place.held = Held::at_once(&place.target).map_err(|Taken| {
            let remedy = "wait until it is done, or choose another folder";
            Error::new(Code::OutputBusy, place.target.display(), "another run is writing its results here", remedy)
        })?;
        if place.held.is_some() {
            journal::complete(&place.target)?;
            journal::sweep(&place.target);
            sweep_beside(&place.target);
        }
        place.try_writing()?;
        Ok(place)
    }

    fn holds_something(&self) -> Result<bool> {
        let entries = fs::read_dir(&self.target).map_err(|e| Error::io(&self.target, &e))?;
        Ok(entries.filter_map(io::Result::ok).any(|entry| entry.file_name() != WRITTEN))
    }

    fn try_writing(&self) -> Result<()> {
        let probe = self.target.join(format!("{}-{}", tree::UNFINISHED, std::process::id()));
        let tried = write_synced(&probe, b"tried").and_then(|()| fs::remove_file(&probe));
        tried.map_err(|e| {
            let _ = fs::remove_file(&probe);
            Error::io(&self.target, &e)
        })
    }

    /// A folder for new files, beside the target where it can change places with it.
    pub(super) fn stage(&self) -> Result<Staging> {
        let target = &self.target;
        fs::create_dir_all(target).map_err(|e| Error::io(target, &e))?;
        let here = std::env::current_dir().and_then(|d| d.canonicalize()).unwrap_or_default();
        let part = part_name(target).filter(|_| !here.starts_with(target));
        match part.filter(|part| fs::create_dir(part).is_ok()) {
            Some(part) => Ok(Staging::Beside(part)),
            None => journal::stage(target).map(Staging::Inside).map_err(|e| Error::io(target, &e)),
        }
    }

    /// Writes files among what is there; see [`write_beside`](super::write_beside).
    ///
    /// # Errors
    /// As [`write_beside`](super::write_beside).
    pub fn write_beside(&self, files: &[(String, &[u8])], inputs: &[PathBuf]) -> Result<()> {
        let target = &self.target;
        let fail = |e: io::Error| Error::io(target, &e);
        fs::create_dir_all(target).map_err(fail)?;
        // Other runs may put other files here.
        let held = Held::when_free(target);
        journal::complete(target)?;
        journal::sweep(target);
        let mut unrecorded = Vec::new();
        for (k, (name, _)) in files.iter().enumerate() {
            self.require_its_own(name, inputs)?;
            if self.require_replaceable(name, files)? == Some(Standing::Unrecorded) {
                unrecorded.push(target.join(name));
            }
            if files[..k].iter().any(|(other, _)| other == name) {
                let path = target.join(name);
                return Err(Error::new(
                    Code::OutputName,
                    path.display(),
                    "is the name of two files",
                    "correct them one after the other",
                ));
            }
        }
        let staging = Staging::Inside(journal::stage(target).map_err(fail)?);
        let hashes = files.iter().map(|(name, bytes)| (name.clone(), sha256(bytes))).collect();
        let record = own::record(target, &hashes)?;
        for (name, bytes) in files.iter().map(|(n, b)| (n.as_str(), *b)).chain([(WRITTEN, record.as_slice())]) {
            write_synced(&staging.path().join(name), bytes).map_err(|e| Error::io(&target.join(name), &e))?;
        }
        unrecorded.iter().try_for_each(|file| kept::keep(file))?;
        journal::commit(target, &hashes.into_keys().chain([WRITTEN.to_owned()]).collect(), &[])?;
        drop(held);
        Ok(())
    }

    /// Refuses to replace one of these files by other ones: somebody may have measured what stands in them. `files` are those that are to be
    /// written, with their bytes.
    ///
    /// # Errors
    /// A file that is there, and would be another, or would not be written.
    pub fn require_the_same(&self, names: &[&str], files: &[(String, &[u8])]) -> Result<()> {
        let would_be = |name: &str| files.iter().find(|(file, _)| file == name).map(|(_, bytes)| *bytes);
        let is_other =
            |name: &&&str| fs::read(self.target.join(name)).is_ok_and(|there| would_be(name) != Some(&there[..]));
        names.iter().find(is_other).map_or(Ok(()), |name| {
            let place = self.given.join(name);
            let remedy = "give a new folder with --out, or remove this file";
            Err(Error::new(Code::OutputExists, place.display(), "is there already, and would be another", remedy))
        })
    }

    /// What is there; `None` where nothing is.
    fn require_replaceable(&self, name: &str, files: &[(String, &[u8])]) -> Result<Option<Standing>> {
        if self.target.join(name).symlink_metadata().is_err() {
            return Ok(None);
        }
        match own::standing(&self.target, name, files) {
            Standing::Others => Err(Error::new(
                Code::OutputExists,
                self.given.join(name).display(),
                "is there already, and no hash on record says that it is as this program wrote it",
                format!("name another place for the result ({}), or move this file away", self.option),
            )),
            standing => Ok(Some(standing)),
        }
    }

    fn require_its_own(&self, name: &str, inputs: &[PathBuf]) -> Result<()> {
        let path = self.target.join(name);
        let real = path.canonicalize().unwrap_or_else(|_| path.clone());
        if !tree::is_inside(Path::new(name)) || path.is_dir() {
            return Err(Error::new(Code::OutputName, path.display(), "cannot be a file", "rename it"));
        }
        if inputs.iter().any(|i| i.canonicalize().is_ok_and(|i| i == real)) {
            return Err(Error::new(
                Code::OutputIsInput,
                path.display(),
                "is the input itself",
                format!("name another place for the result ({})", self.option),
            ));
        }
        Ok(())
    }
}

impl Drop for ResultFolder {
    fn drop(&mut self) {
        // Only folders in which nothing is go.
        self.made.iter().rev().all(|folder| fs::remove_dir(folder).is_ok());
    }
}

/// Folders that have to be made, the outermost first.
fn missing(dir: &Path) -> Result<Vec<PathBuf>> {
    let bad = |what: &str| Error::new(Code::OutputName, dir.display(), what, "name a folder for the results");
    if dir.as_os_str().is_empty() {
        return Err(Error::new(Code::OutputName, "results folder", "has no name", "name a folder for the results"));
    }
    if dir.is_dir() {
        return Ok(Vec::new());
    }
    match dir.symlink_metadata() {
        Ok(m) if m.is_symlink() => return Err(bad("is a link that leads nowhere")),
        Ok(_) => return Err(bad("is a file, not a folder")),
        Err(e) if e.kind() == io::ErrorKind::NotFound => {}
        Err(e) => return Err(Error::io(dir, &e)),
    }
    if dir.file_name().is_none() {
        return Err(bad("does not name a folder"));
    }
    let is_missing = |p: &&Path| !p.as_os_str().is_empty() && p.symlink_metadata().is_err();
    let mut missing: Vec<PathBuf> = dir.ancestors().take_while(is_missing).map(Path::to_path_buf).collect();
    missing.reverse();
    Ok(missing)
}
