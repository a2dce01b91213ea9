//! The messages of a rosbag2 recording in sqlite: the tables `topics` and `messages`, nothing else of the format.
//!
//! Source of the format: sqlite.org/fileformat2.html, sections 1.3, 1.5, 1.6 and 2. Every page, cell and length is held
//! against the file; a damaged page costs the messages on it.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::Path;

use super::message::{Message, at_places};
use crate::error::{Code, Error, Notice, Result};
use crate::files::{self, FileKind};

/// First bytes of such a file.
pub(super) const MAGIC: &[u8] = b"SQLite format 3\0";

const INTERIOR: u8 = 5;
const LEAF: u8 = 13;
/// The file header stands on the first page, before its own content.
const FILE_HEADER: usize = 100;
/// No message is as long as this, bytes.
const LONGEST: usize = 1 << 29;

/// Why a part of the file cannot be used.
type Damage = String;

type Checked<T> = std::result::Result<T, Damage>;

/// Calls `visit` for every message of a file in the order of the file, and returns a notice where the file is damaged.
pub(super) fn for_each(path: &Path, mut visit: impl FnMut(Message<'_>) -> Result<()>) -> Result<Option<Notice>> {
    let mut base = Base::open(path)?;
    let mut lost = Lost::default();
    let mut roots: BTreeMap<String, u32> = BTreeMap::new();
    base.rows(1, &mut lost, |row| {
        if let [Value::Text("table"), Value::Text(name), _, Value::Integer(root), ..] = row.values()?[..] {
            roots.insert(name.to_string(), u32::try_from(root).map_err(|_| "a table begins nowhere")?);
        }
        Ok(())
    })?;
    let (Some(&topics), Some(&messages)) = (roots.get("topics"), roots.get("messages")) else {
        let what = "is a sqlite database without the tables topics and messages";
        return Err(Error::new(Code::RecordingFormat, path.display(), what, "give a recording of rosbag2"));
    };
    let mut known: BTreeMap<i64, [String; 3]> = BTreeMap::new();
    base.rows(topics, &mut lost, |row| {
        if let [_, Value::Text(name), Value::Text(schema), Value::Text(encoding), ..] = row.values()?[..] {
            known.insert(row.id, [name, schema, encoding].map(str::to_string));
        }
        Ok(())
    })?;
    let mut given = 0_u64;
    let mut refused = None;
    base.rows(messages, &mut lost, |row| {
        let [_, Value::Integer(topic), Value::Integer(time), Value::Blob(data), ..] = row.values()?[..] else {
            return Err("a row of messages is none".into());
        };
        let Some([topic, schema, encoding]) = known.get(&topic).filter(|_| refused.is_none()) else { return Ok(()) };
        given += 1;
        refused = visit(Message { topic, schema, encoding, log_time_ns: time.max(0) as u64, data }).err();
        Ok(())
    })?;
    match refused {
        Some(error) => Err(error),
        None => Ok(lost.notice(path, given, base.unmerged)),
    }
}

/// What could not be used.
#[derive(Default)]
struct Lost {
    parts: u64,
    reason: Option<Damage>,
}

impl Lost {
    fn note(&mut self, part: Checked<()>) {
        if let Err(damage) = part {
            self.parts += 1;
            self.reason.get_or_insert(damage);
        }
    }

    fn notice(&self, path: &Path, given: u64, unmerged: bool) -> Option<Notice> {
        if let Some(reason) = &self.reason {
            let what = format!("is damaged {}; the {given} other messages are used", at_places(self.parts, reason));
            return Some(Notice::new(
                Code::RecordingDamaged,
                path.display(),
                what,
                "copy it again; stops that were lost have to be recorded again",
            ));
        }
        let what = "the recorder did not close it: messages in its -wal file are missing";
        unmerged.then(|| {
            Notice::new(
                Code::RecordingDamaged,
                path.display(),
                what,
                "merge them: sqlite3 FILE.db3 'PRAGMA wal_checkpoint'",
            )
        })
    }
}

/// A value in a row.
#[derive(Debug, Clone, Copy)]
enum Value<'a> {
    Integer(i64),
    Text(&'a str),
    Blob(&'a [u8]),
    /// Null and floating-point numbers.
    Other,
}

/// A row of a table.
struct Row {
    id: i64,
    record: Vec<u8>,
}

impl Row {
    /// The columns; one that is an alias of the row's number is [`Value::Other`].
    fn values(&self) -> Checked<Vec<Value<'_>>> {
        let short = || Damage::from("a row is shorter than it says");
        let mut at = 0;
        let header = usize::try_from(varint(&self.record, &mut at)?).map_err(|_| short())?;
        let mut body = self.record.get(header..).ok_or_else(short)?;
        let mut values = Vec::new();
        while at < header {
            let kind = varint(&self.record, &mut at)?;
            let length = match kind {
                0 | 8 | 9 => 0,
                1..=4 => kind,
                5 => 6,
                6 | 7 => 8,
                10 | 11 => return Err("a row has a value of unknown kind".into()),
                _ => (kind - 12) / 2,
            };
            let (bytes, rest) =
                usize::try_from(length).ok().and_then(|n| body.split_at_checked(n)).ok_or_else(short)?;
            body = rest;
            values.push(match kind {
                1..=6 => Value::Integer(integer(bytes)),
                8 => Value::Integer(0),
                9 => Value::Integer(1),
                0 | 7 => Value::Other,
                _ if kind % 2 == 0 => Value::Blob(bytes),
                _ => Value::Text(std::str::from_utf8(bytes).map_err(|_| "a text is not UTF-8")?),
            });
        }
        Ok(values)
    }
}

/// A big-endian signed number of up to eight bytes.
fn integer(bytes: &[u8]) -> i64 {
    let sign = if bytes.first().is_some_and(|b| *b >= 0x80) { -1 } else { 0 };
    bytes.iter().fold(sign, |value, byte| (value << 8) | i64::from(*byte))
}

/// A number of one to nine bytes, seven bits each but for the ninth.
fn varint(bytes: &[u8], at: &mut usize) -> Checked<u64> {
    let mut value = 0_u64;
    for k in 0..9 {
        let byte = *bytes.get(*at).ok_or("a number ends beyond its page")?;
        *at += 1;
        if k == 8 {
            return Ok((value << 8) | u64::from(byte));
        }
        value = (value << 7) | u64::from(byte & 0x7f);
        if byte < 0x80 {
            break;
        }
    }
    Ok(value)
}

/// The file as pages.
struct Base {
    file: File,
    page_bytes: usize,
    /// Bytes of a page that are used.
    usable: usize,
    pages: u32,
    /// Pages that may still be read of the table at hand: none belongs to it twice.
    left: u32,
    /// There is a write-ahead log that was not merged.
    unmerged: bool,
}

impl Base {
    fn open(path: &Path) -> Result<Self> {
        let refuse = |what: &str| {
            Error::new(Code::RecordingDamaged, path.display(), what, "copy it again, or convert it: ros2 bag convert")
        };
        let (mut file, length) = files::open(path, FileKind::Recording)?;
        let mut header = [0; FILE_HEADER];
        file.read_exact(&mut header).map_err(|_| refuse("is cut off within its header"))?;
        let page_bytes = match u16::from_be_bytes([header[16], header[17]]) {
            1 => 1 << 16,
            bytes if bytes >= 512 && bytes.is_power_of_two() => usize::from(bytes),
            _ => return Err(refuse("has no page size")),
        };
        if u32::from_be_bytes([header[56], header[57], header[58], header[59]]) > 1 {
            return Err(refuse("has text in UTF-16, which rosbag2 does not write"));
        }
        let usable = page_bytes - usize::from(header[20]);
        if usable < 480 {
            return Err(refuse("has pages without room"));
        }
        let pages = u32::try_from(length / page_bytes as u64).unwrap_or(u32::MAX);
        let mut log = path.as_os_str().to_owned();
        log.push("-wal");
        let unmerged = std::fs::metadata(log).is_ok_and(|m| m.len() > 0);
        Ok(Self { file, page_bytes, usable, pages, left: 0, unmerged })
    }

    fn page(&mut self, number: u32) -> Checked<Vec<u8>> {
        if number == 0 || number > self.pages {
            return Err(format!("page {number} of {} does not exist", self.pages));
        }
        self.left = self.left.checked_sub(1).ok_or("its pages form a ring")?;
        let mut page = vec![0; self.page_bytes];
        let start = u64::from(number - 1) * self.page_bytes as u64;
        let read = self.file.seek(SeekFrom::Start(start)).and_then(|_| self.file.read_exact(&mut page));
        read.map_err(|e| format!("page {number} cannot be read: {e}"))?;
        page.truncate(self.usable);
        Ok(page)
    }

    /// Calls `each` for every row of the table that begins at page `root`, in the order of their numbers.
    fn rows(&mut self, root: u32, lost: &mut Lost, mut each: impl FnMut(&Row) -> Checked<()>) -> Result<()> {
        let mut waiting = vec![root];
        self.left = self.pages;
        while let Some(number) = waiting.pop() {
            let children = match self.page(number) {
                Ok(page) => self.leaf_or_children(number, &page, lost, &mut each),
                Err(damage) => Err(damage),
            };
            match children {
                Ok(children) => waiting.extend(children.into_iter().rev()),
                Err(damage) => lost.note(Err(damage)),
            }
        }
        Ok(())
    }

    /// Gives out the rows of a leaf, or returns the pages below an interior page.
    fn leaf_or_children(
        &mut self,
        number: u32,
        page: &[u8],
        lost: &mut Lost,
        each: &mut impl FnMut(&Row) -> Checked<()>,
    ) -> Checked<Vec<u32>> {
        let start = if number == 1 { FILE_HEADER } else { 0 };
        let kind = page[start];
        let head = match kind {
            LEAF => 8,
            INTERIOR => 12,
            _ => return Err(format!("page {number} is of kind {kind}")),
        };
        let cells = usize::from(u16::from_be_bytes([page[start + 3], page[start + 4]]));
        let pointers = page.get(start + head..start + head + 2 * cells).ok_or("a page has more cells than room")?;
        let mut children = Vec::new();
        for pointer in pointers.chunks_exact(2) {
            let at = usize::from(u16::from_be_bytes([pointer[0], pointer[1]]));
            if kind == LEAF {
                lost.note(self.row(page, at).and_then(|row| each(&row)));
            } else {
                children.push(be_u32(page, at)?);
            }
        }
        if kind == INTERIOR {
            children.push(be_u32(page, start + 8)?);
        }
        Ok(children)
    }

    /// The row whose cell begins at a place of a leaf, with what overflows to pages of its own.
    fn row(&mut self, page: &[u8], mut at: usize) -> Checked<Row> {
        let length = usize::try_from(varint(page, &mut at)?).unwrap_or(usize::MAX);
        let id = varint(page, &mut at)? as i64;
        let in_file = usize::try_from(self.pages).unwrap_or(usize::MAX).saturating_mul(self.page_bytes);
        if length > LONGEST.min(in_file) {
            return Err(format!("a row promises {length} bytes"));
        }
        let local = self.local(length);
        let mut record = page.get(at..at + local).ok_or("a row ends beyond its page")?.to_vec();
        if local < length {
            let mut next = be_u32(page, at + local)?;
            while record.len() < length {
                let page = self.page(next)?;
                next = be_u32(&page, 0)?;
                let wanted = (length - record.len()).min(page.len() - 4);
                record.extend_from_slice(&page[4..4 + wanted]);
            }
        }
        Ok(Row { id, record })
    }

    /// How many bytes of a record of a length stand on the leaf itself.
    fn local(&self, length: usize) -> usize {
        let usable = self.usable;
        if length <= usable - 35 {
            return length;
        }
        let least = (usable - 12) * 32 / 255 - 23;
        let fitting = least + (length - least) % (usable - 4);
        if fitting <= usable - 35 { fitting } else { least }
    }
}

fn be_u32(page: &[u8], at: usize) -> Checked<u32> {
    let bytes = page.get(at..at.saturating_add(4)).and_then(|b| <[u8; 4]>::try_from(b).ok());
    bytes.map(u32::from_be_bytes).ok_or_else(|| "a page ends within a number".into())
}
