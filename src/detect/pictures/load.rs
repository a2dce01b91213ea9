//! Image files to [`Picture`]s in full depth.

use std::io::{BufRead, BufReader, Cursor, Seek};
use std::path::Path;

use image::{DynamicImage, ImageError};

use crate::detect::Picture;
use crate::error::{Code, Error, Result};
use crate::files::jpeg::{self, Lacking};
use crate::files::{self, FileKind, MOST_SIDE_PX, decode_picture};

/// Weights of red, green and blue in the grey value (luma of ITU-R BT.709), applied to the stored counts.
const LUMA_WEIGHTS: [f32; 3] = [0.2126, 0.7152, 0.0722];

/// Reads an image (png, tif, pgm, jpg, bmp; 8 or 16 bit, grey or colour; colour tif of 32-bit floating point, too) without reducing its depth.
///
/// Colour becomes grey by the luma of ITU-R BT.709; an alpha channel is ignored. `bits` says how many bits of a 16-bit file
/// are used when they sit in its low end (10 or 12 for most machine cameras), which fixes the saturation count.
///
/// # Errors
/// A missing, unreadable, empty, truncated or oversized file; `bits` outside 1..=16 or counts beyond it.
pub fn load(path: &Path, bits: Option<u32>) -> Result<Picture> {
    let (file, length) = files::open(path, FileKind::Image)?;
    if length == 0 {
        return Err(Error::new(
            Code::ImageTruncated,
            path.display(),
            "the file is empty",
            "record or copy the image again",
        ));
    }
    load_from(path, BufReader::new(file), bits)
}

/// As [`load`] from the bytes of an image file; `path` is for messages only.
///
/// # Errors
/// As [`load`].
pub fn load_bytes(path: &Path, bytes: &[u8], bits: Option<u32>) -> Result<Picture> {
    load_from(path, Cursor::new(bytes), bits)
}

fn load_from(path: &Path, source: impl BufRead + Seek, bits: Option<u32>) -> Result<Picture> {
    let mut source = source;
    let decoded = match decode_picture(&mut source) {
        Ok(decoded) => decoded,
        Err(_) if jpeg::lacking(&mut source).is_ok_and(|lacking| lacking.is_some()) => {
            return Err(truncated(path, "the file ends before its image does"));
        }
        Err(e) => return Err(decode_error(path, &e)),
    };
    let picture = to_picture(&decoded);
    let lacking = match jpeg::lacking(&mut source).unwrap_or_default() {
        Some(Lacking::Rows) if ends_in_one_value(&picture) => Some("the file ends before the lowest rows of the image"),
        Some(Lacking::Scans) => {
            Some("the file ends without a mark of the end: its last scan may be missing, without which it is blurred")
        }
        Some(Lacking::Rows) | None => None,
    };
    if let Some(what) = lacking {
        return Err(truncated(path, what));
    }
    if picture.width < 2 || picture.height < 2 {
        return Err(Error::new(
            Code::ImageSizeImpossible,
            path.display(),
            format!("is {} x {} px", picture.width, picture.height),
            "check the recording: an image needs at least 2 x 2 px",
        ));
    }
    match bits {
        Some(bits) => with_bits(picture, bits, path),
        None => Ok(picture),
    }
}

/// Rows of a block of JPEG.
const BLOCK: usize = 8;

/// True where the lowest rows have no content: so a decoder fills what a file does not have.
fn ends_in_one_value(picture: &Picture) -> bool {
    let lowest = &picture.pixels[picture.width * picture.height.saturating_sub(BLOCK)..];
    lowest.iter().all(|value| *value == lowest[0])
}

fn truncated(path: &Path, what: &str) -> Error {
    Error::new(Code::ImageTruncated, path.display(), what, "copy or record the image again")
}

fn decode_error(path: &Path, error: &ImageError) -> Error {
    let place = path.display();
    match error {
        ImageError::Unsupported(e) => Error::new(
            Code::ImageUnreadable,
            place,
            format!("not a supported image: {e}"),
            "convert it to png, tif (no BigTIFF), pgm, jpg or bmp, with 8 or 16 bits a channel",
        ),
        ImageError::Limits(e) => Error::new(
            Code::ImageSizeImpossible,
            place,
            format!("the image is too large: {e}"),
            format!("check the file header; sides up to {MOST_SIDE_PX} px and some hundred megapixels are read"),
        ),
        ImageError::IoError(e) if e.kind() == std::io::ErrorKind::UnexpectedEof => {
            truncated(path, "the file is truncated")
        }
        other => Error::new(
            Code::ImageUnreadable,
            place,
            format!("cannot be decoded: {other}"),
            "open it in an image viewer; copy or record it again if it is damaged",
        ),
    }
}

fn with_bits(picture: Picture, bits: u32, path: &Path) -> Result<Picture> {
    if !(1..=16).contains(&bits) {
        return Err(Error::new(
            Code::ImageDepth,
            path.display(),
            format!("bits = {bits} is not a pixel depth"),
            "set `bits` under [camera] in series.toml to 8, 10, 12, 14 or 16, or remove it",
        ));
    }
    let full_scale = ((1u32 << bits) - 1) as f32;
    let peak = picture.pixels.iter().copied().fold(0.0_f32, f32::max);
    if peak > full_scale {
        return Err(Error::new(
            Code::ImageDepth,
            path.display(),
            format!("holds the count {peak}, above {full_scale} of bits = {bits}"),
            "correct `bits` under [camera] in series.toml; remove it when the counts fill the whole file depth",
        ));
    }
    Ok(Picture { full_scale, ..picture })
}

fn to_picture(decoded: &DynamicImage) -> Picture {
    let (width, height) = (decoded.width() as usize, decoded.height() as usize);
    let (pixels, full_scale) = match decoded {
        DynamicImage::ImageLuma8(i) => (i.as_raw().iter().map(|&v| f32::from(v)).collect(), 255.0),
        DynamicImage::ImageLuma16(i) => (i.as_raw().iter().map(|&v| f32::from(v)).collect(), 65535.0),
        DynamicImage::ImageLumaA8(i) => (i.pixels().map(|p| f32::from(p.0[0])).collect(), 255.0),
        DynamicImage::ImageLumaA16(i) => (i.pixels().map(|p| f32::from(p.0[0])).collect(), 65535.0),
        DynamicImage::ImageRgb8(i) => (i.pixels().map(|p| luma(p.0.map(f32::from))).collect(), 255.0),
        DynamicImage::ImageRgba8(i) => {
            (i.pixels().map(|p| luma([p.0[0], p.0[1], p.0[2]].map(f32::from))).collect(), 255.0)
        }
        DynamicImage::ImageRgb16(i) => (i.pixels().map(|p| luma(p.0.map(f32::from))).collect(), 65535.0),
        DynamicImage::ImageRgba16(i) => {
            (i.pixels().map(|p| luma([p.0[0], p.0[1], p.0[2]].map(f32::from))).collect(), 65535.0)
        }
        // Floating-point TIFF.
        _ => of_fractions(decoded.to_rgb32f().pixels().map(|p| luma(p.0)).collect()),
    };
    Picture { width, height, pixels, full_scale }
}

/// Values that are fractions of full scale by the convention of most programs, or counts of 8 or 16 bits as programs write that average
/// images; with full scale.
fn of_fractions(values: Vec<f32>) -> (Vec<f32>, f32) {
    let peak = values.iter().copied().fold(0.0_f32, f32::max);
    match [255.0, 65535.0].into_iter().find(|full_scale| peak <= *full_scale) {
        _ if peak <= 1.0 => (values.iter().map(|v| 65535.0 * v).collect(), 65535.0),
        full_scale => (values, full_scale.unwrap_or(peak)),
    }
}

/// Grey value of a colour; exact for equal channels.
fn luma([r, g, b]: [f32; 3]) -> f32 {
    g + LUMA_WEIGHTS[0] * (r - g) + LUMA_WEIGHTS[2] * (b - g)
}
