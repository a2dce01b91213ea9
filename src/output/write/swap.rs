//! Two folders that change places in a single step of the file system.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use super::held::Held;
use super::strays::{self, sweep};
use super::tree;

/// Puts `part` in the place of `target`, with what is the user's; what was there is removed.
pub(super) fn swap(target: &Path, part: &Path, foreign: &[PathBuf]) -> io::Result<()> {
    let new = strays::finished_name(part);
    fs::set_permissions(part, fs::metadata(target)?.permissions())?;
    for file in foreign {
        let link = part.join(file);
        link.parent().map_or(Ok(()), fs::create_dir_all)?;
        fs::hard_link(target.join(file), link)?;
    }
    // The folder that is the target in a moment, and its earlier files as long as they are here.
    let own = tree::own_files(target);
    let held = Held::at_once(part);
    fs::rename(part, &new)?;
    if let Err(error) = exchange(&new, target) {
        let _ = fs::rename(&new, part);
        return Err(error);
    }
    if let Some(parent) = target.parent() {
        tree::sync(parent);
    }
    if let Err(error) = sweep(&new, target, &own) {
        tracing::debug!("{}: {error}; left for the next run", new.display());
    }
    drop(held);
    Ok(())
}

#[cfg(target_os = "linux")]
fn exchange(a: &Path, b: &Path) -> io::Result<()> {
    use std::os::unix::ffi::OsStrExt;

    use rustix::fs::{CWD, RenameFlags, renameat_with};
    let bytes = |p: &'_ Path| p.as_os_str().as_bytes().to_vec();
    renameat_with(CWD, bytes(a).as_slice(), CWD, bytes(b).as_slice(), RenameFlags::EXCHANGE)
        .map_err(|e| io::Error::from_raw_os_error(e.raw_os_error()))
}

#[cfg(not(target_os = "linux"))]
fn exchange(_: &Path, _: &Path) -> io::Result<()> {
    Err(io::ErrorKind::Unsupported.into())
}
