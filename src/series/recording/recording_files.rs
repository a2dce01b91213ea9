//! The files of a recording: one, or those of a rosbag2 folder in the order of its metadata.yaml.

use std::path::{Component, Path, PathBuf};

use serde::Deserialize;

use super::kind::{head, not_recording};
use crate::error::{Code, Error, Notice, Result};
use crate::files::{self, FileKind};

/// How files end that rosbag2 writes.
const KNOWN: [&str; 2] = [".mcap", ".db3"];
/// How a file ends that rosbag2 has compressed as a whole.
const PACKED: &str = ".zstd";
/// How single files end that are recordings, some of which are refused with advice.
const SINGLE: [&str; 4] = ["mcap", "bag", "db3", "zstd"];
/// What a series folder holds: a recording that lies there, too, does not make it one.
const OF_SERIES: [&str; 5] = ["series.toml", "joints.csv", "controller.csv", "observations.csv", "images"];

/// Whether a path is a recording: an `.mcap` file, another bag that will be refused with advice, or a rosbag2 folder. One without metadata.yaml,
/// as a recorder leaves it that crashed, holds the files of one recording, numbered from 0, without
/// a manifest that is theirs alone.
pub fn is_recording(path: &Path) -> bool {
    if !path.is_dir() {
        return path.extension().is_some_and(|e| SINGLE.iter().any(|known| e == *known));
    }
    let has = |name: &&str| path.join(name).exists();
    if path.join("metadata.yaml").exists() {
        return !path.join("series.toml").exists();
    }
    let parts = written_in(path);
    // A recording with a manifest of its own is given by itself.
    are_of_one(&parts)
        && !parts.iter().any(|part| unpacked(part).with_extension("toml").is_file())
        && !OF_SERIES.iter().any(has)
}

/// Whether there is one file, or several of one name that are numbered from 0, as rosbag2 does: other numbers may be dates.
fn are_of_one(parts: &[PathBuf]) -> bool {
    let mut numbered: Vec<(String, Option<u64>)> = parts.iter().map(|part| name_and_number(part)).collect();
    numbered.sort();
    numbered.dedup();
    let is_next =
        |((name, number), wanted): (&(String, Option<u64>), u64)| *name == numbered[0].0 && *number == Some(wanted);
    numbered.len() == 1 || !numbered.is_empty() && numbered.iter().zip(0..).all(is_next)
}

/// Files of recordings in a folder, packed ones as well, in the order of their names.
pub(in crate::series) fn written_in(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let is_part = |path: &PathBuf| {
        let name = path.to_string_lossy();
        let name = name.strip_suffix(PACKED).unwrap_or(&name);
        path.is_file() && KNOWN.iter().any(|end| name.ends_with(end))
    };
    let mut parts: Vec<PathBuf> = entries.map(|entry| entry.path()).filter(is_part).collect();
    parts.sort();
    parts
}

/// The files of a recording, in the order in which they were written.
pub(super) struct Parts {
    pub files: Vec<PathBuf>,
    /// Files that are missing, and files that are not read.
    pub notices: Vec<Notice>,
}

/// The part of metadata.yaml that is read.
#[derive(Deserialize)]
struct Metadata {
    #[serde(default)]
    rosbag2_bagfile_information: Information,
}

#[derive(Default, Deserialize)]
struct Information {
    #[serde(default)]
    relative_file_paths: Vec<String>,
}

/// The files of a recording, in the order in which they were written: one file, or a rosbag2 folder.
///
/// # Errors
/// Other kinds of recordings, with the command that converts them.
pub(super) fn parts_of(recording: &Path) -> Result<Parts> {
    if !recording.is_dir() {
        return Ok(Parts { files: vec![recording.to_path_buf()], notices: Vec::new() });
    }
    let mut all = Vec::new();
    for entry in std::fs::read_dir(recording).map_err(|e| Error::io(recording, &e))? {
        all.push(entry.map_err(|e| Error::io(recording, &e))?.path());
    }
    all.sort();
    let (listed, mut notices) = listed(recording);
    let by_name = by_name(&all);
    let (there, missing): (Vec<&String>, Vec<&String>) =
        listed.iter().partition(|name| part(recording, name).is_some());
    let files = match there.is_empty() {
        true => {
            let renamed = listed.len() == by_name.len();
            notices.extend(lacking(recording, &missing).filter(|_| !renamed));
            refuse_packed(all.iter())?;
            by_name
        }
        false => {
            let files: Vec<PathBuf> = there.iter().filter_map(|name| part(recording, name)).collect();
            refuse_packed(files.iter())?;
            notices.extend(lacking(recording, &missing));
            notices.extend(not_listed(recording, by_name.iter().filter(|path| !files.contains(path))));
            files
        }
    };
    match files.is_empty() {
        true => Err(holds_none(recording, &all, &missing)?),
        false => Ok(Parts { files, notices }),
    }
}

/// What metadata.yaml lists; nothing where there is none, or none that can be read.
fn listed(recording: &Path) -> (Vec<String>, Vec<Notice>) {
    let path = recording.join("metadata.yaml");
    if !path.is_file() {
        return (Vec::new(), Vec::new());
    }
    let read = files::read_text(&path, FileKind::Settings).map_err(|e| e.to_string());
    let read = read.and_then(|text| serde_saphyr::from_str::<Metadata>(&text).map_err(|e| e.to_string()));
    match read {
        Ok(metadata) => (metadata.rosbag2_bagfile_information.relative_file_paths, Vec::new()),
        Err(why) => {
            let what = format!("lists no files that can be read ({why}): they are read in the order of their names");
            let notice = Notice::new(Code::RecordingDamaged, path.display(), what, "write it anew: ros2 bag reindex");
            (Vec::new(), vec![notice])
        }
    }
}

/// The file that metadata.yaml means: early versions write the name of the folder before it, and a packed one may have been expanded.
fn part(recording: &Path, name: &str) -> Option<PathBuf> {
    let expanded = name.strip_suffix(PACKED);
    let within = |name: &str| {
        let name = Path::new(name);
        let is_below = name.components().all(|c| matches!(c, Component::Normal(_) | Component::CurDir));
        let below = is_below.then(|| recording.join(name)).filter(|path| path.is_file());
        below.or_else(|| name.file_name().map(|name| recording.join(name)).filter(|path| path.is_file()))
    };
    expanded.and_then(within).or_else(|| within(name))
}

fn ends(path: &Path, end: &str) -> bool {
    path.to_string_lossy().ends_with(end)
}

/// The files of the first kind that is there, by their numbers.
fn by_name(all: &[PathBuf]) -> Vec<PathBuf> {
    let of = |end: &&str| all.iter().filter(|path| ends(path, end)).cloned().collect::<Vec<_>>();
    let mut files = KNOWN.iter().map(of).find(|files| !files.is_empty()).unwrap_or_default();
    files.sort_by_key(|path| split_number(path));
    files
}

/// rosbag2 numbers the files of a long recording: `name_0.mcap`, ..., `name_10.mcap`.
fn split_number(path: &Path) -> (Option<u64>, PathBuf) {
    let stem = stem(path);
    let number = stem.rsplit_once('_').and_then(|(_, n)| n.parse().ok());
    (number, path.to_path_buf())
}

/// The name of the recording that a file is a part of, and which.
fn name_and_number(path: &Path) -> (String, Option<u64>) {
    let stem = stem(&unpacked(path));
    match stem.rsplit_once('_').and_then(|(name, number)| Some((name.to_owned(), number.parse().ok()?))) {
        Some((name, number)) => (name, Some(number)),
        None => (stem, None),
    }
}

/// The file without the ending of a packed one.
fn unpacked(path: &Path) -> PathBuf {
    if ends(path, PACKED) { path.with_extension("") } else { path.to_path_buf() }
}

fn stem(path: &Path) -> String {
    path.file_stem().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default()
}

/// A part that is packed holds stops, which must not be lost in silence.
fn refuse_packed<'a>(files: impl Iterator<Item = &'a PathBuf>) -> Result<()> {
    let is_packed = |path: &&PathBuf| {
        let known = KNOWN.iter().any(|end| ends(path, &format!("{end}{PACKED}")));
        known && !path.with_extension("").is_file()
    };
    match files.into_iter().find(is_packed) {
        Some(packed) => Err(not_recording(packed, &head(packed)?)),
        None => Ok(()),
    }
}

fn holds_none(recording: &Path, all: &[PathBuf], missing: &[&String]) -> Result<Error> {
    if let Some(other) = [PACKED, ".bag"].iter().find_map(|end| all.iter().find(|path| ends(path, end))) {
        return Ok(not_recording(other, &head(other)?));
    }
    let remedy = match recording.join("series.toml").is_file() {
        true => "a series folder becomes a recording: let the second name end in .mcap",
        false => "give an .mcap file, or a rosbag2 folder with .mcap or .db3 files",
    };
    let mut what = "holds no .mcap or .db3 file".to_owned();
    if !missing.is_empty() {
        what = format!("{what}; its metadata.yaml lists {}", joined(missing));
    }
    Ok(Error::new(Code::RecordingFormat, recording.display(), what, remedy))
}

fn joined(names: &[&String]) -> String {
    names.iter().map(|name| name.as_str()).collect::<Vec<_>>().join(", ")
}

fn lacking(recording: &Path, missing: &[&String]) -> Option<Notice> {
    let what = format!("lacks what its metadata.yaml lists: {}", joined(missing));
    let remedy = "copy it again, or record its stops again";
    (!missing.is_empty()).then(|| Notice::new(Code::RecordingDamaged, recording.display(), what, remedy))
}

fn not_listed<'a>(recording: &Path, others: impl Iterator<Item = &'a PathBuf>) -> Option<Notice> {
    let names: Vec<String> =
        others.filter_map(|path| path.file_name()).map(|name| name.to_string_lossy().into_owned()).collect();
    let what = format!("holds what its metadata.yaml does not list and is not read: {}", names.join(", "));
    let remedy = "where it belongs to the recording: ros2 bag reindex";
    (!names.is_empty()).then(|| Notice::new(Code::RecordingDamaged, recording.display(), what, remedy))
}
