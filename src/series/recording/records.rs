//! Records of an MCAP file, each held against the end of the file before memory is taken; damage costs its own chunk.
//!
//! Source of the format: mcap.dev/spec. A chunk is given out only after its checksum held (where it has one), so that no
//! damaged message is seen.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufReader, Read, Seek, SeekFrom};
use std::path::Path;

use super::message::{MCAP, Message, at_places};
use crate::error::{Code, Error, Notice, Result};
use crate::files::{self, FileKind};

const FOOTER: u8 = 2;
const SCHEMA: u8 = 3;
const CHANNEL: u8 = 4;
const MESSAGE: u8 = 5;
const CHUNK: u8 = 6;
const CHUNK_INDEX: u8 = 8;
const DATA_END: u8 = 15;

/// Bytes before the content of a record: what it is, and how long.
const HEAD: u64 = 9;
/// Content of the footer: where the summary begins, where its index does, a checksum.
const FOOTER_LENGTH: u64 = 20;
/// No record or chunk of a camera is as long as this; a longer one is a damaged length, bytes.
const LONGEST: u64 = 1 << 29;

/// Why a record or a chunk cannot be used.
type Damage = String;

/// Calls `visit` for every message of an MCAP file in the order of the file, and returns a notice where the file is damaged.
pub(super) fn for_each(path: &Path, visit: impl FnMut(Message<'_>) -> Result<()>) -> Result<Option<Notice>> {
    let (file, length) = files::open(path, FileKind::Recording)?;
    let file = BufReader::with_capacity(1 << 16, file);
    let mut walk = Walk { path, file, length, at: 0, contents: Contents::default(), starts: None, visit };
    walk.seek(MCAP.len() as u64)?;
    walk.run()
}

struct Walk<'p, V> {
    path: &'p Path,
    file: BufReader<File>,
    length: u64,
    at: u64,
    contents: Contents,
    /// Where the chunks begin by the summary, once that was needed.
    starts: Option<Vec<u64>>,
    visit: V,
}

/// What the file has said so far, and what could not be used of it.
#[derive(Default)]
struct Contents {
    schemas: BTreeMap<u16, String>,
    channels: BTreeMap<u16, Channel>,
    messages: u64,
    damaged: u64,
    reason: Option<Damage>,
}

struct Channel {
    topic: String,
    schema: u16,
    encoding: String,
}

/// How a look at the next record ended.
enum Step {
    Next,
    End,
}

impl<V: FnMut(Message<'_>) -> Result<()>> Walk<'_, V> {
    fn run(&mut self) -> Result<Option<Notice>> {
        loop {
            let at = self.at;
            match self.step()? {
                Ok(Step::Next) => {}
                Ok(Step::End) => return Ok(self.contents.notice(self.path, None)),
                Err(damage) => {
                    let starts = self.summary()?;
                    let Some(next) = starts.iter().copied().filter(|s| *s > at).min() else {
                        return Ok(self.contents.notice(self.path, Some(damage)));
                    };
                    self.contents.lost(damage);
                    self.seek(next)?;
                }
            }
        }
    }

    /// Reads one record; the inner error is damage to the file, the outer one ends the reading.
    fn step(&mut self) -> Result<std::result::Result<Step, Damage>> {
        let left = self.length.saturating_sub(self.at);
        if left < HEAD {
            return Ok(Err(format!("it ends at byte {} without its end mark", self.length)));
        }
        let (kind, length) = self.head()?;
        if length > left - HEAD {
            return Ok(Err(format!("a record at byte {} is longer than the rest of the file", self.at)));
        }
        let next = self.at + HEAD + length;
        match kind {
            DATA_END | FOOTER => return Ok(Ok(Step::End)),
            SCHEMA | CHANNEL | MESSAGE | CHUNK if length > LONGEST => {
                return Ok(Err(format!("a record at byte {} has the length {length}", self.at)));
            }
            SCHEMA | CHANNEL | MESSAGE | CHUNK => {
                let content = self.content(length)?;
                let used = match kind {
                    CHUNK => self.contents.chunk(&content, &mut self.visit)?,
                    _ => self.contents.record(kind, &content, &mut self.visit)?,
                };
                if let Err(damage) = used {
                    // What the lost chunk said of channels stands in the summary, too.
                    self.summary()?;
                    self.contents.lost(damage);
                }
            }
            // Indices, attachments, metadata.
            1..=14 => {}
            _ => return Ok(Err(format!("the unknown record {kind} at byte {}", self.at))),
        }
        self.seek(next)?;
        Ok(Ok(Step::Next))
    }

    /// Where the chunks begin, by the summary; read once.
    fn summary(&mut self) -> Result<&[u64]> {
        if self.starts.is_none() {
            self.starts = Some(self.learn_summary()?);
        }
        Ok(self.starts.as_deref().unwrap_or_default())
    }

    /// Learns the channels from the summary at the end of the file and returns where its chunks begin; none without a summary.
    fn learn_summary(&mut self) -> Result<Vec<u64>> {
        let mut starts = Vec::new();
        let tail = HEAD + FOOTER_LENGTH + MCAP.len() as u64;
        let Some(footer) = self.length.checked_sub(tail) else { return Ok(starts) };
        self.seek(footer)?;
        if self.head()? != (FOOTER, FOOTER_LENGTH) {
            return Ok(starts);
        }
        let mut at = Fields(&self.content(FOOTER_LENGTH)?).u64().filter(|a| *a > 0).unwrap_or(footer);
        while at.saturating_add(HEAD) < footer {
            self.seek(at)?;
            let (kind, length) = self.head()?;
            if length > (footer - at - HEAD).min(LONGEST) {
                break;
            }
            if matches!(kind, SCHEMA | CHANNEL | CHUNK_INDEX) {
                let content = self.content(length)?;
                let mut fields = Fields(&content);
                match kind {
                    SCHEMA => self.contents.schema(&mut fields).unwrap_or_default(),
                    CHANNEL => self.contents.channel(&mut fields).unwrap_or_default(),
                    _ => starts.extend(fields.take(16).and_then(|_| fields.u64()).filter(|s| *s < footer)),
                }
            }
            at += HEAD + length;
        }
        Ok(starts)
    }

    fn head(&mut self) -> Result<(u8, u64)> {
        let mut head = [0; HEAD as usize];
        self.file.read_exact(&mut head).map_err(|e| Error::io(self.path, &e))?;
        let [kind, length @ ..] = head;
        Ok((kind, u64::from_le_bytes(length)))
    }

    /// The content of a record whose length was held against the file.
    fn content(&mut self, length: u64) -> Result<Vec<u8>> {
        let mut content = vec![0; length as usize];
        self.file.read_exact(&mut content).map_err(|e| Error::io(self.path, &e))?;
        Ok(content)
    }

    fn seek(&mut self, to: u64) -> Result<()> {
        self.at = to;
        self.file.seek(SeekFrom::Start(to)).map(|_| ()).map_err(|e| Error::io(self.path, &e))
    }
}

impl Contents {
    fn lost(&mut self, damage: Damage) {
        self.damaged += 1;
        self.reason.get_or_insert(damage);
    }

    fn notice(&self, path: &Path, end: Option<Damage>) -> Option<Notice> {
        let used = format!("the {} other messages are used", self.messages);
        let what = match (end, &self.reason) {
            (None, None) => return None,
            (Some(end), _) => format!("is damaged or cut off ({end}); {used}"),
            (None, Some(reason)) => {
                format!("is damaged {}; {used}", at_places(self.damaged, reason))
            }
        };
        Some(Notice::new(
            Code::RecordingDamaged,
            path.display(),
            what,
            "copy it again; stops that were lost have to be recorded again",
        ))
    }

    /// All records of a chunk.
    fn chunk(
        &mut self,
        content: &[u8],
        visit: &mut impl FnMut(Message<'_>) -> Result<()>,
    ) -> Result<std::result::Result<(), Damage>> {
        let expanded = match expand(content) {
            Ok(expanded) => expanded,
            Err(damage) => return Ok(Err(damage)),
        };
        let mut rest = Fields(&expanded);
        while !rest.0.is_empty() {
            let record =
                rest.take(1).zip(rest.u64()).and_then(|(k, l)| Some((k[0], rest.take(usize::try_from(l).ok()?)?)));
            let Some((kind, content)) = record else { return Ok(Err("a chunk ends within a record".into())) };
            if let Err(damage) = self.record(kind, content, visit)? {
                return Ok(Err(damage));
            }
        }
        Ok(Ok(()))
    }

    fn record(
        &mut self,
        kind: u8,
        content: &[u8],
        visit: &mut impl FnMut(Message<'_>) -> Result<()>,
    ) -> Result<std::result::Result<(), Damage>> {
        let mut fields = Fields(content);
        let read = match kind {
            SCHEMA => self.schema(&mut fields),
            CHANNEL => self.channel(&mut fields),
            MESSAGE => {
                let id = fields.u16().zip(fields.u32()).map(|(id, _)| id);
                let Some((id, log_time_ns)) = id.zip(fields.u64()).filter(|_| fields.u64().is_some()) else {
                    return Ok(Err("a message is shorter than its header".into()));
                };
                if let Some(channel) = self.channels.get(&id) {
                    self.messages += 1;
                    let schema = self.schemas.get(&channel.schema).map_or("", String::as_str);
                    let (topic, encoding) = (&channel.topic, &channel.encoding);
                    visit(Message { topic, schema, encoding, log_time_ns, data: fields.0 })?;
                }
                Some(())
            }
            _ => Some(()),
        };
        Ok(read.ok_or_else(|| format!("a record {kind} is shorter than it says")))
    }

    fn schema(&mut self, fields: &mut Fields<'_>) -> Option<()> {
        let (id, name) = (fields.u16()?, fields.string()?);
        self.schemas.insert(id, name);
        Some(())
    }

    fn channel(&mut self, fields: &mut Fields<'_>) -> Option<()> {
        let (id, schema) = (fields.u16()?, fields.u16()?);
        let (topic, encoding) = (fields.string()?, fields.string()?);
        self.channels.insert(id, Channel { topic, schema, encoding });
        Some(())
    }
}

/// The records of a chunk, unpacked; no more memory is taken than there are bytes to unpack.
fn expand(content: &[u8]) -> std::result::Result<Cow<'_, [u8]>, Damage> {
    let mut fields = Fields(content);
    let times = [fields.u64(), fields.u64()];
    let (size, crc) = (fields.u64(), fields.u32());
    let (compression, packed) = (fields.string(), fields.u64());
    let ([Some(_), Some(_)], Some(size), Some(crc), Some(compression), Some(packed)) =
        (times, size, crc, compression, packed)
    else {
        return Err("a chunk is shorter than its header".into());
    };
    let packed = usize::try_from(packed).ok().and_then(|n| fields.take(n)).ok_or("a chunk is shorter than it says")?;
    if size > LONGEST {
        return Err(format!("a chunk promises {size} bytes"));
    }
    let failed = |e: std::io::Error| format!("a chunk cannot be unpacked: {e}");
    let expanded = match compression.as_str() {
        "" => Cow::Borrowed(packed),
        "zstd" => read_all(zstd::stream::read::Decoder::new(packed).map_err(failed)?, size).map_err(failed)?,
        "lz4" => read_all(lz4::Decoder::new(packed).map_err(failed)?, size).map_err(failed)?,
        other => return Err(format!("a chunk has the unknown compression \"{}\"", other.escape_debug())),
    };
    if expanded.len() as u64 != size {
        return Err(format!("a chunk of {size} bytes has {}", expanded.len()));
    }
    if crc != 0 && crc32fast::hash(&expanded) != crc {
        return Err("the checksum of a chunk does not hold".into());
    }
    Ok(expanded)
}

/// How a zstd frame begins; no CDR message begins so.
const ZSTD: &[u8] = &[0x28, 0xb5, 0x2f, 0xfd];

/// A message as rosbag2 packs it by itself (`compression_mode: MESSAGE`), unpacked; any other, and one that is damaged, as it is.
pub(super) fn unpacked(data: &[u8]) -> Cow<'_, [u8]> {
    let whole = |bytes: &Cow<'_, [u8]>| bytes.len() as u64 <= LONGEST;
    let unpack = || read_all(zstd::stream::read::Decoder::new(data).ok()?, LONGEST).ok().filter(whole);
    data.starts_with(ZSTD).then(unpack).flatten().unwrap_or(Cow::Borrowed(data))
}

fn read_all<'a>(source: impl Read, size: u64) -> std::io::Result<Cow<'a, [u8]>> {
    let mut bytes = Vec::new();
    source.take(size + 1).read_to_end(&mut bytes)?;
    Ok(Cow::Owned(bytes))
}

/// Little-endian fields from the front of some bytes.
struct Fields<'a>(&'a [u8]);

impl<'a> Fields<'a> {
    fn take(&mut self, count: usize) -> Option<&'a [u8]> {
        let (taken, rest) = self.0.split_at_checked(count)?;
        self.0 = rest;
        Some(taken)
    }

    fn array<const N: usize>(&mut self) -> Option<[u8; N]> {
        self.take(N)?.try_into().ok()
    }

    fn u16(&mut self) -> Option<u16> {
        self.array().map(u16::from_le_bytes)
    }

    fn u32(&mut self) -> Option<u32> {
        self.array().map(u32::from_le_bytes)
    }

    fn u64(&mut self) -> Option<u64> {
        self.array().map(u64::from_le_bytes)
    }

    fn string(&mut self) -> Option<String> {
        let length = self.u32()?;
        self.take(length as usize).map(|bytes| String::from_utf8_lossy(bytes).into_owned())
    }
}
