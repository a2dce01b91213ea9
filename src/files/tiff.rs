//! The pages of a TIFF file: some cameras write a small preview before the image.

use std::io::{Read, Result, Seek, SeekFrom};

const LITTLE: [u8; 4] = *b"II*\0";
const BIG: [u8; 4] = *b"MM\0*";
/// Where the header says where the first page is described.
const FIRST: u64 = 4;
/// Size of an entry of a description, bytes.
const ENTRY: usize = 12;
const WIDTH: u32 = 256;
const HEIGHT: u32 = 257;
/// Type of an entry of two bytes.
const SHORT: u32 = 3;
/// More pages are not looked at: their chain may be a circle.
const MOST_PAGES: usize = 1000;

/// A page.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Page {
    /// Where it is described.
    at: u32,
    /// Width and height, px.
    pub size: [u32; 2],
}

/// The pages in their order; none where it is no TIFF file. The source stands anywhere afterwards.
pub(super) fn pages(source: &mut (impl Read + Seek)) -> Result<Vec<Page>> {
    source.rewind()?;
    let mut head = [0; 8];
    source.read_exact(&mut head)?;
    let big = head.starts_with(&BIG);
    if !big && !head.starts_with(&LITTLE) {
        return Ok(Vec::new());
    }
    let number = |bytes: &[u8]| {
        let digit = |sum: u32, byte: &u8| (sum << 8) | u32::from(*byte);
        if big { bytes.iter().fold(0, digit) } else { bytes.iter().rev().fold(0, digit) }
    };
    let mut pages = Vec::new();
    let mut at = number(&head[4..]);
    while at != 0 && pages.len() < MOST_PAGES {
        source.seek(SeekFrom::Start(u64::from(at)))?;
        let mut count = [0; 2];
        source.read_exact(&mut count)?;
        let mut entries = vec![0; ENTRY * number(&count) as usize];
        source.read_exact(&mut entries)?;
        let mut next = [0; 4];
        source.read_exact(&mut next)?;
        let value = |tag: u32| {
            let entry = entries.chunks_exact(ENTRY).find(|entry| number(&entry[..2]) == tag)?;
            let bytes = if number(&entry[2..4]) == SHORT { 2 } else { 4 };
            Some(number(&entry[8..8 + bytes]))
        };
        pages.push(Page { at, size: [WIDTH, HEIGHT].map(|tag| value(tag).unwrap_or(0)) });
        at = number(&next);
    }
    Ok(pages)
}

/// Which of the pages has most pixels, the first of equals.
pub(super) fn largest(pages: &[Page]) -> Option<usize> {
    let pixels = |k: &usize| pages[*k].size.iter().map(|side| u64::from(*side)).product::<u64>();
    (0..pages.len()).rev().max_by_key(pixels)
}

/// The file with this page as its first one.
pub(super) fn beginning_with(page: &Page, source: &mut (impl Read + Seek)) -> Result<Vec<u8>> {
    source.rewind()?;
    let mut bytes = Vec::new();
    source.read_to_end(&mut bytes)?;
    let at = if bytes.starts_with(&BIG) { page.at.to_be_bytes() } else { page.at.to_le_bytes() };
    bytes.iter_mut().skip(FIRST as usize).zip(at).for_each(|(byte, new)| *byte = new);
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use std::io::Cursor;

    use super::*;
    use crate::files::decode_picture;
    use image::{DynamicImage, ImageFormat};

    fn single(side: u32) -> Vec<u8> {
        let mut file = Cursor::new(Vec::new());
        DynamicImage::new_luma8(side, side + 1).write_to(&mut file, ImageFormat::Tiff).unwrap();
        file.into_inner()
    }

    /// One behind the other: offsets of the second are moved, and the first points to it.
    fn double(first: u32, second: u32) -> Vec<u8> {
        let (mut file, tail) = (single(first), single(second));
        let shift = file.len().next_multiple_of(2);
        file.resize(shift, 0);
        let word = |bytes: &[u8], at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap());
        let mut tail = tail;
        let at = word(&tail, 4) as usize;
        let count = usize::from(u16::from_le_bytes([tail[at], tail[at + 1]]));
        for entry in (0..count).map(|k| at + 2 + 12 * k) {
            let (tag, kind) = (u16::from_le_bytes([tail[entry], tail[entry + 1]]), tail[entry + 2]);
            let bytes = [0, 1, 1, 2, 4, 8][usize::from(kind)] * word(&tail, entry + 4);
            // Offsets of strips, and of values that do not fit into an entry.
            if tag == 273 || bytes > 4 {
                assert!(tag != 273 || bytes <= 4, "one strip");
                let moved = word(&tail, entry + 8) + shift as u32;
                tail[entry + 8..entry + 12].copy_from_slice(&moved.to_le_bytes());
            }
        }
        let first_at = word(&file, 4) as usize;
        let next = first_at + 2 + 12 * usize::from(u16::from_le_bytes([file[first_at], file[first_at + 1]]));
        file[next..next + 4].copy_from_slice(&((shift + at) as u32).to_le_bytes());
        file.extend(tail);
        file
    }

    #[test]
    fn the_largest_page_is_decoded() {
        for (first, second, taken) in [(3, 8, 1), (8, 3, 0), (5, 5, 0)] {
            let file = double(first, second);
            let pages = pages(&mut Cursor::new(&file)).unwrap();
            assert_eq!(pages.iter().map(|p| p.size[0]).collect::<Vec<_>>(), [first, second]);
            assert_eq!(largest(&pages), Some(taken));
            assert_eq!(decode_picture(Cursor::new(&file)).unwrap().width(), first.max(second));
        }
        assert_eq!(pages(&mut Cursor::new(single(4))).unwrap().len(), 1);
        assert_eq!(pages(&mut Cursor::new(b"no tiff file")).unwrap(), []);
    }
}
