//! MCAP files as a stream of messages, in constant memory; a damaged file gives what stands before the damage.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

use mcap::records::Record;
use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions};
use sha2::{Digest, Sha256};

use crate::series::InputFile;
use crate::{Error, Notice, Result, plain_name};

/// No record of a camera is as long as this; a longer one is a damaged length, bytes.
const LONGEST_RECORD: usize = 1 << 30;

/// One message of a recording.
pub(super) struct Message<'a> {
    pub topic: &'a str,
    /// Name of the type.
    pub schema: &'a str,
    /// `cdr` for ROS 2.
    pub encoding: &'a str,
    pub log_time_ns: u64,
    pub data: &'a [u8],
}

struct Channel {
    topic: String,
    schema: u16,
    encoding: String,
}

/// The MCAP files of a recording, in the order in which they were written: one file, or a rosbag2 folder.
///
/// # Errors
/// Other kinds of recordings, with the command that converts them.
pub(super) fn files_of(recording: &Path) -> Result<Vec<PathBuf>> {
    if !recording.is_dir() {
        return Ok(vec![recording.to_path_buf()]);
    }
    let mut files = Vec::new();
    for entry in std::fs::read_dir(recording).map_err(|e| Error::io(recording, &e))? {
        files.push(entry.map_err(|e| Error::io(recording, &e))?.path());
    }
    let ends = |path: &PathBuf, end: &str| path.to_string_lossy().ends_with(end);
    if let Some(other) = files.iter().find(|p| [".db3", ".zstd", ".bag"].iter().any(|e| ends(p, e)))
        && !files.iter().any(|p| ends(p, ".mcap"))
    {
        return Err(not_mcap(other, &head(other)?));
    }
    files.retain(|p| ends(p, ".mcap"));
    files.sort_by_key(|p| split_number(p));
    if files.is_empty() {
        let remedy = "give an .mcap file, or a rosbag2 folder with .mcap files";
        return Err(Error::input(recording.display(), "holds no .mcap file", remedy));
    }
    Ok(files)
}

/// Refuses other kinds of recordings, with the command that converts them.
///
/// # Errors
/// As the name says; a recording that cannot be read.
pub(in crate::series) fn require_mcap(recording: &Path) -> Result<()> {
    for path in files_of(recording)? {
        let head = head(&path)?;
        if !head.starts_with(mcap::MAGIC) {
            return Err(not_mcap(&path, &head));
        }
    }
    Ok(())
}

/// rosbag2 numbers the files of a long recording: `name_0.mcap`, ..., `name_10.mcap`.
fn split_number(path: &Path) -> (Option<u64>, PathBuf) {
    let stem = path.file_stem().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default();
    let number = stem.rsplit_once('_').and_then(|(_, n)| n.parse().ok());
    (number, path.to_path_buf())
}

fn head(path: &Path) -> Result<Vec<u8>> {
    let mut bytes = Vec::new();
    let file = File::open(path).map_err(|e| Error::io(path, &e))?;
    file.take(16).read_to_end(&mut bytes).map_err(|e| Error::io(path, &e))?;
    Ok(bytes)
}

/// Names what a file is instead, with the command that converts it.
fn not_mcap(path: &Path, head: &[u8]) -> Error {
    let shown = path.display();
    let (what, remedy) = if head.starts_with(b"#ROSBAG V2") {
        let remedy =
            format!("convert it: pip install rosbags; rosbags-convert --src {shown} --dst run1 --dst-storage mcap");
        ("is a ROS 1 bag", remedy)
    } else if head.starts_with(b"SQLite format 3") {
        let folder = path.parent().unwrap_or(path).display();
        let remedy = format!(
            "convert its folder: pip install rosbags; rosbags-convert --src {folder} --dst run1 --dst-storage mcap"
        );
        ("is a rosbag2 recording in sqlite", remedy)
    } else if head.starts_with(&[0x28, 0xb5, 0x2f, 0xfd]) {
        ("is compressed as a whole", format!("expand it first: unzstd {shown}"))
    } else {
        ("is not an MCAP file", "check the file: it does not begin as MCAP does".to_string())
    };
    Error::input(shown, what, remedy)
}

/// Calls `visit` for every message of a file in the order of the file, and returns a notice where the file is damaged.
///
/// A chunk is given out only after its checksum held, so that no damaged message is seen.
pub(super) fn for_each(path: &Path, mut visit: impl FnMut(Message<'_>) -> Result<()>) -> Result<Option<Notice>> {
    let head = head(path)?;
    if !head.starts_with(mcap::MAGIC) {
        return Err(not_mcap(path, &head));
    }
    let mut file = File::open(path).map_err(|e| Error::io(path, &e))?;
    let options =
        LinearReaderOptions::default().with_prevalidate_chunk_crcs(true).with_record_length_limit(LONGEST_RECORD);
    let mut reader = LinearReader::new_with_options(options);
    let mut schemas: BTreeMap<u16, String> = BTreeMap::new();
    let mut channels: BTreeMap<u16, Channel> = BTreeMap::new();
    let mut messages = 0_u64;
    while let Some(event) = reader.next_event() {
        let record = match event {
            Ok(LinearReadEvent::ReadRequest(wanted)) => {
                let read = file.read(reader.insert(wanted)).map_err(|e| Error::io(path, &e))?;
                reader.notify_read(read);
                continue;
            }
            Ok(LinearReadEvent::Record { opcode, data }) => mcap::parse_record(opcode, data),
            Err(error) => Err(error),
        };
        match record {
            Ok(Record::Schema { header, .. }) => {
                schemas.insert(header.id, header.name);
            }
            Ok(Record::Channel(c)) => {
                plain_name("topic", &c.topic, path.display())?;
                let channel = Channel { topic: c.topic, schema: c.schema_id, encoding: c.message_encoding };
                channels.insert(c.id, channel);
            }
            Ok(Record::Message { header, data }) => {
                let Some(channel) = channels.get(&header.channel_id) else { continue };
                messages += 1;
                visit(Message {
                    topic: &channel.topic,
                    schema: schemas.get(&channel.schema).map_or("", String::as_str),
                    encoding: &channel.encoding,
                    log_time_ns: header.log_time,
                    data: &data,
                })?;
            }
            // What follows is the summary: nothing new in it.
            Ok(Record::DataEnd(_)) => return Ok(None),
            Ok(_) => {}
            Err(error) => {
                let what = format!("is damaged or cut off ({error}); the {messages} messages before that are used");
                return Ok(Some(Notice::new(path.display(), what, "repair it with: mcap recover")));
            }
        }
    }
    Ok(None)
}

/// SHA-256 of a file of any size.
pub(super) fn hash(path: &Path) -> Result<InputFile> {
    let mut file = File::open(path).map_err(|e| Error::io(path, &e))?;
    let mut hasher = Sha256::new();
    let mut buffer = vec![0; 1 << 20];
    loop {
        let read = file.read(&mut buffer).map_err(|e| Error::io(path, &e))?;
        if read == 0 {
            break;
        }
        hasher.update(&buffer[..read]);
    }
    Ok(InputFile::of_digest(path, &hasher.finalize()))
}
