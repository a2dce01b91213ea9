//! A folder held against other runs.

use std::fs;
use std::path::Path;

/// The lock on a folder; it goes when this is dropped, or with the process, however that ends.
#[derive(Debug)]
pub(super) struct Held(fs::File);

impl Held {
    /// Holds `folder`; `Err` where another run holds it, `None` where the file system knows no such thing.
    pub(super) fn at_once(folder: &Path) -> Result<Option<Self>, Taken> {
        let Ok(file) = fs::File::open(folder) else { return Ok(None) };
        match file.try_lock() {
            Ok(()) => Ok(Some(Self(file))),
            Err(fs::TryLockError::Error(_)) => Ok(None),
            Err(fs::TryLockError::WouldBlock) => Err(Taken),
        }
    }

    /// Holds `folder` as soon as nobody else does.
    pub(super) fn when_free(folder: &Path) -> Option<Self> {
        fs::File::open(folder).ok().filter(|file| file.lock().is_ok()).map(Self)
    }
}

impl Drop for Held {
    fn drop(&mut self) {
        // Closing is not enough: a process that is being started has the file open, too, until it runs its program.
        let _ = self.0.unlock();
    }
}

/// Another run is at work in a folder.
#[derive(Debug)]
pub(super) struct Taken;
