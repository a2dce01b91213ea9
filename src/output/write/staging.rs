//! Where new files wait until all of them are there.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use super::journal;
use crate::error::Result;

/// Where the new files wait.
#[derive(Debug)]
pub(super) enum Staging {
    /// In a folder beside the target, which can change places with it.
    Beside(PathBuf),
    /// In a folder within the target.
    Inside(PathBuf),
}

impl Staging {
    /// The folder.
    pub(super) fn path(&self) -> &Path {
        match self {
            Self::Beside(path) | Self::Inside(path) => path,
        }
    }

    /// The files moved to a folder within the target.
    pub(super) fn inside(&self, target: &Path, names: &BTreeSet<String>) -> Result<Option<Self>> {
        match self {
            Self::Beside(new) => journal::moved_inside(target, new, names).map(|path| Some(Self::Inside(path))),
            Self::Inside(_) => Ok(None),
        }
    }
}

impl Drop for Staging {
    fn drop(&mut self) {
        // What could not be removed is swept up by the next run; the first error is the one to report.
        let _ = match self {
            Self::Beside(path) => fs::remove_dir_all(path),
            Self::Inside(path) => journal::discard(path.parent().unwrap_or(path)),
        };
    }
}
