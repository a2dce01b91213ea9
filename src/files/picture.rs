//! Pictures of the formats that are read, in bounded memory.

use std::io::{BufRead, BufReader, Cursor, Read, Seek, SeekFrom};
use std::ops::Range;
use std::path::Path;

use image::error::{ImageFormatHint, LimitError, LimitErrorKind, UnsupportedError, UnsupportedErrorKind};
use image::metadata::Orientation;
use image::{DynamicImage, ImageDecoder, ImageError, ImageFormat, ImageReader, ImageResult, Limits};

use super::{FileKind, jpeg, open, read, tiff};
use crate::error::{Code, Error, Result};

/// Longest side that is accepted, px; the largest industrial sensors have about 20 000.
pub const MOST_SIDE_PX: u32 = 32_768;

/// Memory of one decoded picture together with its grey values of four bytes each.
const MOST_BYTES: u64 = 910_000_000;

const GREY_BYTES: u64 = 4;

const PNG: [u8; 8] = *b"\x89PNG\r\n\x1a\n";
const PNG_END: &[u8] = b"IEND";
/// Bytes at the end of a file in which its mark of the end is sought first.
const TAIL: u64 = 1 << 16;

/// Formats that are read, whatever the name of the file says.
const FORMATS: [ImageFormat; 5] =
    [ImageFormat::Png, ImageFormat::Jpeg, ImageFormat::Tiff, ImageFormat::Pnm, ImageFormat::Bmp];

/// Decodes a picture; its format is told by its content, its size is judged before memory is taken.
///
/// # Errors
/// Other formats, damaged pictures, pictures whose header promises more than the program holds.
pub fn decode_picture(source: impl BufRead + Seek) -> ImageResult<DynamicImage> {
    let mut decoder = decoder(source)?;
    let (width, height) = decoder.dimensions();
    let grey = GREY_BYTES * u64::from(width) * u64::from(height);
    if decoder.total_bytes().saturating_add(grey) > MOST_BYTES {
        return Err(ImageError::Limits(LimitError::from_kind(LimitErrorKind::InsufficientMemory)));
    }
    let mut left = limits();
    left.reserve(decoder.total_bytes())?;
    decoder.set_limits(left)?;
    DynamicImage::from_decoder(decoder)
}

/// Memory that a picture takes once it is decoded, bytes, from its header alone.
///
/// # Errors
/// Other formats, a header that cannot be read.
pub fn decoded_bytes(source: impl BufRead + Seek) -> ImageResult<u64> {
    decoder(source).map(|d| d.total_bytes())
}

/// Pictures that are decoded at a time: as many as `most` bytes allow, in their order, at least one.
pub fn batches(sizes: &[u64], most: u64) -> Vec<Range<usize>> {
    let mut batches: Vec<Range<usize>> = Vec::new();
    let mut in_flight = 0_u64;
    for (k, bytes) in sizes.iter().enumerate() {
        match batches.last_mut() {
            Some(batch) if in_flight.saturating_add(*bytes) <= most => {
                batch.end = k + 1;
                in_flight += bytes;
            }
            _ => {
                batches.push(k..k + 1);
                in_flight = *bytes;
            }
        }
    }
    batches
}

/// Width and height of an image file, px, from its header alone.
///
/// # Errors
/// A file that is none; a header that cannot be read.
pub fn picture_size(path: &Path) -> Result<(u32, u32)> {
    let (file, _) = open(path, FileKind::Image)?;
    let size = decoder(BufReader::new(file)).map(|d| d.dimensions());
    size.map_err(|e| {
        Error::new(
            Code::ImageUnreadable,
            path.display(),
            e,
            "open it in an image viewer; record it again if it is damaged",
        )
    })
}

/// True where what stands beside the pixels (EXIF) asks viewers to turn or mirror the picture.
pub fn is_turned_by_viewers(path: &Path) -> bool {
    let decoder = open(path, FileKind::Image).ok().and_then(|(file, _)| decoder(BufReader::new(file)).ok());
    decoder.is_some_and(|mut d| d.orientation().is_ok_and(|o| o != Orientation::NoTransforms))
}

/// False for a PNG or JPEG file that ends before its image does. The end of the file tells, in most cases.
///
/// # Errors
/// A file that cannot be read.
pub fn is_whole(path: &Path) -> Result<bool> {
    let io = |e: std::io::Error| Error::io(path, &e);
    let (mut file, length) = open(path, FileKind::Image)?;
    let (mut start, mut end) = (Vec::new(), Vec::new());
    file.by_ref().take(PNG.len() as u64).read_to_end(&mut start).map_err(io)?;
    if start != PNG {
        return Ok(!start.starts_with(&jpeg::START) || jpeg::lacking(&mut BufReader::new(file)).map_err(io)?.is_none());
    }
    file.seek(SeekFrom::Start(length.saturating_sub(TAIL))).map_err(io)?;
    file.take(TAIL).read_to_end(&mut end).map_err(io)?;
    let has_end = |bytes: &[u8]| bytes.windows(PNG_END.len()).any(|window| window == PNG_END);
    Ok(has_end(&end) || has_end(&read(path, FileKind::Image)?))
}

/// How many pages a TIFF file has, and which of them is read, from 1 on; `None` for other files and where there is one.
pub fn page_of(path: &Path) -> Option<(usize, usize)> {
    let (file, _) = open(path, FileKind::Image).ok()?;
    let pages = tiff::pages(&mut BufReader::new(file)).ok().filter(|pages| pages.len() > 1)?;
    Some((pages.len(), tiff::largest(&pages)? + 1))
}

/// What pictures are read from.
trait Source: BufRead + Seek {}

impl<T: BufRead + Seek> Source for T {}

/// The file with its largest page first.
fn with_largest_page<'a>(mut source: impl BufRead + Seek + 'a) -> ImageResult<Box<dyn Source + 'a>> {
    // What is damaged is said by the decoder.
    let pages = tiff::pages(&mut source).unwrap_or_default();
    if let Some(page) = tiff::largest(&pages).filter(|page| *page > 0) {
        return Ok(Box::new(Cursor::new(tiff::beginning_with(&pages[page], &mut source)?)));
    }
    source.rewind()?;
    Ok(Box::new(source))
}

fn decoder<'a>(source: impl BufRead + Seek + 'a) -> ImageResult<impl ImageDecoder + 'a> {
    let mut reader = ImageReader::new(with_largest_page(source)?).with_guessed_format()?;
    if !reader.format().is_some_and(|f| FORMATS.contains(&f)) {
        let hint = reader.format().map_or(ImageFormatHint::Unknown, ImageFormatHint::Exact);
        let kind = UnsupportedErrorKind::Format(hint.clone());
        return Err(ImageError::Unsupported(UnsupportedError::from_format_and_kind(hint, kind)));
    }
    reader.limits(limits());
    reader.into_decoder()
}

fn limits() -> Limits {
    let mut limits = Limits::default();
    limits.max_image_width = Some(MOST_SIDE_PX);
    limits.max_image_height = Some(MOST_SIDE_PX);
    limits.max_alloc = Some(MOST_BYTES);
    limits
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A picture of 3 x 2 px with an EXIF orientation, where one is given.
    fn photograph(orientation: Option<u8>) -> tempfile::NamedTempFile {
        let mut jpeg = std::io::Cursor::new(Vec::new());
        DynamicImage::new_luma8(3, 2).write_to(&mut jpeg, ImageFormat::Jpeg).unwrap();
        let mut bytes = jpeg.into_inner();
        if let Some(orientation) = orientation {
            let tag = [0x12, 0x01, 3, 0, 1, 0, 0, 0, orientation, 0, 0, 0];
            let exif = [b"Exif\0\0II*\0\x08\0\0\0\x01\0".as_slice(), &tag, &[0; 4]].concat();
            let head = [0xff, 0xe1, 0, exif.len() as u8 + 2];
            bytes.splice(2..2, head.into_iter().chain(exif));
        }
        let file = tempfile::Builder::new().suffix(".jpg").tempfile().unwrap();
        std::fs::write(file.path(), bytes).unwrap();
        file
    }

    #[test]
    fn pictures_that_viewers_turn_are_known_and_stay_as_they_are() {
        let turned = [None, Some(1), Some(3), Some(6), Some(2)].map(photograph);
        assert_eq!(turned.each_ref().map(|f| is_turned_by_viewers(f.path())), [false, false, true, true, true]);
        for file in &turned {
            assert_eq!(picture_size(file.path()).unwrap(), (3, 2));
        }
    }

    /// What is behind the end of an image is no matter.
    #[test]
    fn half_a_picture_is_not_whole() {
        let noise = image::GrayImage::from_fn(400, 300, |x, y| image::Luma([(x * x * 7 + y * 131 + x * y) as u8]));
        for format in [ImageFormat::Png, ImageFormat::Jpeg, ImageFormat::Bmp] {
            let mut bytes = Cursor::new(Vec::new());
            noise.write_to(&mut bytes, format).unwrap();
            let bytes = bytes.into_inner();
            let file = tempfile::NamedTempFile::new().unwrap();
            for (content, whole) in [
                (bytes.clone(), true),
                ([bytes.as_slice(), &[0; 200_000]].concat(), true),
                (bytes[..bytes.len() / 2].to_vec(), format == ImageFormat::Bmp),
            ] {
                std::fs::write(file.path(), content).unwrap();
                assert_eq!(is_whole(file.path()).unwrap(), whole, "{format:?}");
            }
        }
    }
}
