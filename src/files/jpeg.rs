//! Does a JPEG file end where its image does?

use std::io::{BufRead, Result, Seek, SeekFrom};

pub(super) const START: [u8; 2] = [0xff, 0xd8];
const SCAN: u8 = 0xda;
pub(super) const END: [u8; 2] = [0xff, 0xd9];

/// Frame whose scans each tell a part of all values.
const PROGRESSIVE: u8 = 0xc2;

/// What a JPEG file without a mark of the end lacks.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Lacking {
    /// Rows, or nothing but the mark.
    Rows,
    /// Some of its scans: all rows are there, blurred.
    Scans,
}

/// `None` for another file, or one with a mark of the end behind its first scan; what stands behind the mark does not count, nor do pictures in
/// the segments before the scan.
///
/// # Errors
/// A source that cannot be read.
pub fn lacking(source: &mut (impl BufRead + Seek)) -> Result<Option<Lacking>> {
    source.rewind()?;
    if !source.fill_buf()?.starts_with(&START[..1]) {
        return Ok(None);
    }
    let mut bytes = Vec::new();
    // Most files end with the mark; one further before may be that of a picture in the segments before the scan.
    let length = source.seek(SeekFrom::End(0))?;
    source.seek(SeekFrom::Start(length.saturating_sub(END.len() as u64)))?;
    source.read_to_end(&mut bytes)?;
    if bytes == END {
        return Ok(None);
    }
    bytes.clear();
    source.rewind()?;
    source.read_to_end(&mut bytes)?;
    let first = bytes.strip_prefix(&START).and_then(first_scan);
    Ok(first.filter(|first| !has_end(first.scan)).map(|first| first.lacking))
}

fn has_end(bytes: &[u8]) -> bool {
    bytes.windows(END.len()).any(|two| two == END)
}

/// The first scan and what follows, and what is lacking if that has no end.
struct FirstScan<'a> {
    scan: &'a [u8],
    lacking: Lacking,
}

fn first_scan(mut rest: &[u8]) -> Option<FirstScan<'_>> {
    let mut lacking = Lacking::Rows;
    loop {
        match rest {
            [0xff, 0xff, ..] => rest = &rest[1..],
            [0xff, SCAN, ..] => return Some(FirstScan { scan: rest, lacking }),
            [0xff, kind, high, low, ..] => {
                if *kind == PROGRESSIVE {
                    lacking = Lacking::Scans;
                }
                rest = rest.get(2 + usize::from(u16::from_be_bytes([*high, *low]))..)?;
            }
            _ => return None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Cursor;

    const SEQUENTIAL: u8 = 0xc0;

    /// A segment before the frame with a picture of its own, a frame of this kind, and two scans.
    fn file(frame: u8) -> Vec<u8> {
        let exif = [&[0xff, 0xe1, 0, 8], &START[..], &[0xff, SCAN], &END[..]].concat();
        let scan = [0xff, SCAN, 0, 2, 1, 0xff, 0, 2];
        [&START[..], &exif, &[0xff, frame, 0, 3, 8], &scan, &scan, &END].concat()
    }

    #[test]
    fn the_end_of_a_picture_tells_what_it_lacks() {
        let lacks = |bytes: &[u8]| lacking(&mut Cursor::new(bytes)).unwrap();
        for (frame, cut) in [(SEQUENTIAL, Lacking::Rows), (PROGRESSIVE, Lacking::Scans)] {
            let whole = file(frame);
            assert_eq!(lacks(&whole), None);
            assert_eq!(lacks(&[&whole[..], b"more"].concat()), None);
            for less in 1..17 {
                assert_eq!(lacks(&whole[..whole.len() - less]), Some(cut), "{less}");
            }
        }
        assert_eq!(lacks(b"P5 1 1"), None);
        assert_eq!(lacks(b""), None);
    }
}
