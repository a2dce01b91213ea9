//! Does a JPEG file end where its image does?

use std::io::{BufRead, Result, Seek};

pub(super) const START: [u8; 2] = [0xff, 0xd8];
const SCAN: u8 = 0xda;
pub(super) const END: [u8; 2] = [0xff, 0xd9];

/// False for a JPEG file without a mark of the end behind its first scan; what stands behind the mark does not count, nor do pictures in
/// the segments before the scan.
pub fn is_complete(source: &mut (impl BufRead + Seek)) -> Result<bool> {
    source.rewind()?;
    let mut bytes = Vec::new();
    source.read_to_end(&mut bytes)?;
    Ok(!bytes.starts_with(&START) || scan(&bytes).is_none_or(|scan| scan.windows(2).any(|two| two == END)))
}

/// What begins with the first scan.
fn scan(bytes: &[u8]) -> Option<&[u8]> {
    let mut rest = &bytes[START.len()..];
    loop {
        match rest {
            [0xff, 0xff, ..] => rest = &rest[1..],
            [0xff, SCAN, ..] => return Some(rest),
            [0xff, _, high, low, ..] => rest = rest.get(2 + usize::from(u16::from_be_bytes([*high, *low]))..)?,
            _ => return None,
        }
    }
}
