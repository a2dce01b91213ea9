//! Which files of a folder are of the result in it, and which are the user's.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::io;
use std::path::{Component, Path, PathBuf};

use serde::Deserialize;

use super::own::{self, WRITTEN};
use crate::output::detection_files::OVERLAY_FOLDER;
use crate::output::{detection_files, plan_files, solution_json, stand_alone_files};
use crate::series::InputFile;

/// Files that list all others of their result; the last to come and the last to go.
pub(super) const RECORDS: [&str; 4] =
    [solution_json::FILE_NAME, plan_files::FILE_NAME, detection_files::FILE_NAME, stand_alone_files::FILE_NAME];

/// Records of results that can be completed to a series.
const SERIES: [&str; 2] = [plan_files::FILE_NAME, detection_files::FILE_NAME];

/// Where the images of a series lie.
const IMAGES: &str = "images";

/// The folder of a run at work within its target.
pub(super) const UNFINISHED: &str = ".robotcal-unfinished";

/// What is in a folder that gets a new result.
#[derive(Debug, Default)]
pub(super) struct There {
    /// Files of the earlier result that the new one does not have.
    pub stale: Vec<String>,
    /// Files of the earlier result of which no hash is known.
    pub unrecorded: Vec<String>,
    /// What the program did not write: files, and folders as a whole.
    pub foreign: Vec<PathBuf>,
}

impl There {
    /// Something of the user where a file of these names, or its folder, has to be.
    pub fn in_the_way(&self, names: &BTreeSet<String>) -> Option<&Path> {
        let is_taken = |f: &&PathBuf| names.iter().any(|n| Path::new(n).starts_with(f));
        self.foreign.iter().find(is_taken).map(PathBuf::as_path)
    }
}

/// Looks at the target of a result with these names.
pub(super) fn there(target: &Path, names: &BTreeSet<String>) -> io::Result<There> {
    let own = own_files(target);
    let known: BTreeSet<String> = hashes(target, &own).into_iter().map(|(file, _)| file).collect();
    let mut there = There::default();
    for entry in entries(target, &folders(own.iter().chain(names)))? {
        let Some(file) = entry.to_str().filter(|e| own.contains(*e)) else {
            there.foreign.push(entry);
            continue;
        };
        if !names.contains(file) {
            there.stale.push(file.to_owned());
        }
        if !known.contains(file) {
            there.unrecorded.push(file.to_owned());
        }
    }
    Ok(there)
}

/// A path that leads to a place within the folder that it starts from, without detours.
pub(super) fn is_inside(name: &Path) -> bool {
    name.components().all(|c| matches!(c, Component::Normal(_))) && name.file_name().is_some()
}

/// Files of the result in a folder, as its record lists them; `None` where there is none.
pub(super) fn earlier_files(target: &Path) -> Option<BTreeSet<String>> {
    #[derive(Deserialize)]
    struct Listed {
        files: BTreeSet<String>,
    }
    let listed = |name: &&str| {
        let path = target.join(name);
        let bytes = path.symlink_metadata().is_ok_and(|m| !m.is_dir()).then(|| fs::read(&path).ok())??;
        let mut files = serde_json::from_slice::<Listed>(&bytes).ok()?.files;
        files.insert(solution_json::TIMINGS.to_owned());
        if files.remove(OVERLAY_FOLDER) {
            files.extend(pictures(&bytes));
        }
        Some(files)
    };
    RECORDS.iter().find_map(listed)
}

/// The same with the record of the folder itself, which is there in any case.
pub(super) fn own_files(target: &Path) -> BTreeSet<String> {
    let mut own = earlier_files(target).unwrap_or_default();
    own.insert(WRITTEN.to_owned());
    own
}

/// Records in a folder of other commands than that whose own this is.
pub(super) fn other_record(target: &Path, own: &str) -> Option<&'static str> {
    RECORDS.into_iter().find(|record| *record != own && target.join(record).symlink_metadata().is_ok())
}

/// SHA-256 of an earlier result's `own` files, by name, as its record and that of the folder hold them.
fn hashes(target: &Path, own: &BTreeSet<String>) -> Vec<(String, String)> {
    #[derive(Deserialize)]
    struct Listed {
        #[serde(default)]
        as_written: BTreeMap<String, String>,
    }
    let read = |record: &str| serde_json::from_slice::<Listed>(&fs::read(target.join(record)).ok()?).ok();
    let listed = SERIES.into_iter().filter_map(read);
    let written = own::written(target).into_iter().filter(|(file, _)| own.contains(file));
    listed.flat_map(|l| l.as_written).chain(written).collect()
}

/// A file of an earlier result that is not what its record says was written, or what was put there to be used with it.
pub(super) fn used_since(target: &Path) -> Option<String> {
    let is_other = |(file, sha256): &(String, String)| {
        let path = target.join(file);
        path.exists() && InputFile::of_file(&path).is_ok_and(|now| now.sha256 != *sha256)
    };
    let changed = hashes(target, &own_files(target)).into_iter().find(is_other).map(|(file, _)| file);
    let is_series = || SERIES.iter().any(|record| target.join(record).exists()) && target.join(IMAGES).exists();
    changed.or_else(|| is_series().then(|| IMAGES.to_owned()))
}

/// Pictures of a detection whose record lists nothing but their folder, as the first version did.
fn pictures(record: &[u8]) -> Vec<String> {
    #[derive(Deserialize)]
    struct DetectedImages {
        images: Vec<Named>,
    }
    #[derive(Deserialize)]
    struct Named {
        name: String,
    }
    let stem = |i: &Named| i.name.strip_suffix(".png").unwrap_or(&i.name).to_owned();
    let seen = serde_json::from_slice::<DetectedImages>(record);
    seen.map_or_else(|_| Vec::new(), |s| s.images.iter().map(|i| format!("{OVERLAY_FOLDER}/{}.png", stem(i))).collect())
}

/// The folders that files of these names lie in.
pub(super) fn folders<'a>(names: impl Iterator<Item = &'a String>) -> BTreeSet<PathBuf> {
    names.flat_map(|n| Path::new(n).ancestors().skip(1).map(Path::to_path_buf)).collect()
}

/// Everything in a folder, by paths within it; of its folders only those named here are entered, others stand for all
/// that is in them.
pub(super) fn entries(top: &Path, entered: &BTreeSet<PathBuf>) -> io::Result<Vec<PathBuf>> {
    let mut all = Vec::new();
    let mut open = vec![PathBuf::new()];
    while let Some(folder) = open.pop() {
        for entry in fs::read_dir(top.join(&folder))? {
            let entry = entry?;
            let path = folder.join(entry.file_name());
            if entry.file_type()?.is_dir() && entered.contains(&path) {
                open.push(path);
            } else if !is_unfinished(&path) {
                all.push(path);
            }
        }
    }
    all.sort();
    Ok(all)
}

/// Folder and probes of a run at work.
pub(super) fn is_unfinished(name: &Path) -> bool {
    name.to_str().is_some_and(|n| n.starts_with(UNFINISHED))
}

/// Makes sure that the names of files are on the disk, too; their contents are. A disk that cannot do it is no failure.
pub(super) fn sync_below(folder: &Path) {
    if let Ok(entries) = fs::read_dir(folder) {
        let is_folder = |e: &fs::DirEntry| e.file_type().is_ok_and(|t| t.is_dir());
        entries.filter_map(io::Result::ok).filter(is_folder).for_each(|e| sync_below(&e.path()));
    }
    sync(folder);
}

/// Makes sure that the names in this folder are on the disk.
pub(super) fn sync(folder: &Path) {
    let _ = fs::File::open(folder).and_then(|f| f.sync_all());
}

/// Writes a file through to the disk, so that a full disk is noticed here.
pub(super) fn write_synced(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let mut file = fs::File::create_new(path)?;
    io::Write::write_all(&mut file, bytes)?;
    file.sync_all()
}
