//! Small pictures of images of the series, for the report: the files that the record names, as long as they are the same.

use std::collections::BTreeMap;
use std::path::Path;

use image::ExtendedColorType;
use image::codecs::jpeg::JpegEncoder;

use crate::detect::{Picture, load_bytes};
use crate::files::{self, FileKind};
use crate::output::photogrammetry::Photogrammetry;
use crate::output::solution_json::ImageRecord;
use crate::series::InputFile;

/// Width of a small picture, px.
const WIDTH_PX: usize = 400;
/// Quality of JPEG, per cent: sharp enough to see markers and blur.
const QUALITY: u8 = 62;
/// Images of each kind that are shown: those with the smallest and the largest residuals, and those left out.
const MOST: [usize; 3] = [2, 3, 4];

/// Why an image is shown.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Shown {
    /// Its residuals are among the smallest.
    Best,
    /// They are among the largest.
    Worst,
    /// It took no part.
    LeftOut,
}

/// A small picture.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Thumbnail {
    /// Columns and rows of the image itself, px.
    pub size: [usize; 2],
    /// JPEG.
    pub jpeg: Vec<u8>,
}

/// Small pictures by the index of their image in the record.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Thumbnails(pub(in crate::output::report) BTreeMap<usize, Thumbnail>);

impl Thumbnails {
    /// Those of the images that the report shows. An image whose file is not there any more, or is another, has none.
    pub fn of_files(record: Photogrammetry) -> Self {
        let images = shown(record).into_iter().map(|(k, _)| k);
        Self(images.filter_map(|k| Some((k, read(file_of(record, &record.images[k])?)?))).collect())
    }
}

/// Images that are worth a look, by their index.
pub(in crate::output::report) fn shown(record: Photogrammetry) -> Vec<(usize, Shown)> {
    let images = || record.images.iter().enumerate();
    let mut used: Vec<(usize, f64)> = images().filter_map(|(k, i)| Some((k, i.rms_px?))).collect();
    used.sort_by(|a, b| a.1.total_cmp(&b.1));
    let best = used.iter().take(MOST[0]).map(|(k, _)| (*k, Shown::Best));
    let worst = used.iter().skip(MOST[0]).rev().take(MOST[1]).map(|(k, _)| (*k, Shown::Worst));
    let out = images().filter(|(_, i)| !i.is_used()).take(MOST[2]).map(|(k, _)| (k, Shown::LeftOut));
    best.chain(worst).chain(out).collect()
}

/// The file of an image: of several of its name the one in the folder of its series.
fn file_of<'a>(record: Photogrammetry<'a>, image: &ImageRecord) -> Option<&'a InputFile> {
    let named: Vec<&InputFile> = record.inputs.iter().filter(|f| f.path.ends_with(Path::new(&image.name))).collect();
    let in_series = |f: &&&InputFile| f.path.iter().any(|part| part.to_str() == Some(image.series.as_str()));
    match named.as_slice() {
        [one] => Some(one),
        several => several.iter().find(in_series).copied(),
    }
}

fn read(file: &InputFile) -> Option<Thumbnail> {
    let bytes = files::read(&file.path, FileKind::Image).ok()?;
    if InputFile::of_bytes(&file.path, &bytes) != *file {
        return None;
    }
    let picture = load_bytes(&file.path, &bytes, None).ok()?;
    Some(Thumbnail { size: [picture.width, picture.height], jpeg: jpeg(&picture)? })
}

/// The picture in [`WIDTH_PX`] columns: means of squares of pixels, from the darkest to the brightest hundredth.
fn jpeg(picture: &Picture) -> Option<Vec<u8>> {
    let step = picture.width.div_ceil(WIDTH_PX).max(1);
    let [w, h] = [picture.width / step, picture.height / step];
    let mean = |k: usize| {
        let (x, y) = (k % w * step, k / w * step);
        let square = (0..step * step).map(|p| picture.at(x + p % step, y + p / step));
        square.sum::<f32>() / (step * step) as f32
    };
    let means: Vec<f32> = (0..w * h).map(mean).collect();
    let mut sorted = means.clone();
    sorted.sort_by(f32::total_cmp);
    let at = |share: f64| sorted.get((share * (sorted.len().max(1) - 1) as f64) as usize).copied().unwrap_or(0.0);
    let (low, high) = (at(0.01), at(0.99));
    let grey = |v: &f32| (255.0 * (v - low) / (high - low).max(1.0)).clamp(0.0, 255.0) as u8;
    let pixels: Vec<u8> = means.iter().map(grey).collect();
    let mut bytes = Vec::new();
    let mut encoder = JpegEncoder::new_with_quality(&mut bytes, QUALITY);
    encoder.encode(&pixels, w as u32, h as u32, ExtendedColorType::L8).ok()?;
    Some(bytes)
}

/// `data:` address of a JPEG.
pub(in crate::output::report) fn data_uri(jpeg: &[u8]) -> String {
    format!("data:image/jpeg;base64,{}", base64(jpeg))
}

const LETTERS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";

/// RFC 4648.
fn base64(bytes: &[u8]) -> String {
    let mut text = String::with_capacity(bytes.len().div_ceil(3) * 4);
    for chunk in bytes.chunks(3) {
        let bits = (0..3).fold(0u32, |bits, k| bits << 8 | u32::from(chunk.get(k).copied().unwrap_or(0)));
        for k in 0..4 {
            let letter = LETTERS[(bits >> (18 - 6 * k) & 63) as usize] as char;
            text.push(if k <= chunk.len() { letter } else { '=' });
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::base64;

    #[test]
    fn base64_is_that_of_the_standard() {
        let pairs = [("", ""), ("f", "Zg=="), ("fo", "Zm8="), ("foo", "Zm9v"), ("foobar", "Zm9vYmFy")];
        pairs.iter().for_each(|(plain, coded)| assert_eq!(base64(plain.as_bytes()), *coded));
    }
}
