//! Pixels of ROS image messages in full depth, and which of several pictures is best.

use image::{ColorType, DynamicImage, ImageBuffer, Luma, Rgb};

use super::cdr::Decoded;
use super::messages::RawImage;

/// How the bytes of an encoding are laid out.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Layout {
    /// Place of the brightness in a pixel, and samples per pixel; what else a pixel has is its colour.
    Grey(usize, usize),
    /// Offsets of red, green and blue in a pixel, and samples per pixel.
    Colour([usize; 3], usize),
    /// Colour (0 red, 1 green, 2 blue) at (row, column) of the 2x2 pattern.
    Bayer([[usize; 2]; 2]),
}

/// Layout and bytes per sample of a ROS image encoding.
fn layout(encoding: &str) -> Decoded<(Layout, usize)> {
    let (name, depth) = match encoding {
        "yuv422" | "uyvy" => return Ok((Layout::Grey(1, 2), 1)),
        "yuv422_yuy2" | "yuyv" => return Ok((Layout::Grey(0, 2), 1)),
        // All of the brightness, then the colours.
        "nv12" | "nv21" | "nv24" => ("mono", 1),
        "8UC1" => ("mono", 1),
        "16UC1" => ("mono", 2),
        "8UC3" => ("bgr", 1),
        "16UC3" => ("bgr", 2),
        _ => match (encoding.strip_suffix("16"), encoding.strip_suffix('8')) {
            (Some(name), _) => (name, 2),
            (_, Some(name)) => (name, 1),
            _ => ("", 0),
        },
    };
    let layout = match name {
        "mono" => Layout::Grey(0, 1),
        "rgb" => Layout::Colour([0, 1, 2], 3),
        "bgr" => Layout::Colour([2, 1, 0], 3),
        "rgba" => Layout::Colour([0, 1, 2], 4),
        "bgra" => Layout::Colour([2, 1, 0], 4),
        "bayer_rggb" => Layout::Bayer([[0, 1], [1, 2]]),
        "bayer_bggr" => Layout::Bayer([[2, 1], [1, 0]]),
        "bayer_gbrg" => Layout::Bayer([[1, 2], [0, 1]]),
        "bayer_grbg" => Layout::Bayer([[1, 0], [2, 1]]),
        _ => {
            return Err(format!(
                "has the encoding \"{encoding}\"; known are mono, rgb, bgr, rgba, bgra and bayer_* of 8 or 16 bits, yuv422, yuyv and nv12"
            ));
        }
    };
    Ok((layout, depth))
}

/// A message as a grey or colour image of the same depth; a Bayer mosaic is interpolated bilinearly.
pub(super) fn to_image(raw: &RawImage) -> Decoded<DynamicImage> {
    let (layout, depth) = layout(&raw.encoding)?;
    let samples = match layout {
        Layout::Colour(_, samples) | Layout::Grey(_, samples) => samples,
        Layout::Bayer(_) => 1,
    };
    let (width, height) = (raw.width as usize, raw.height as usize);
    let row_bytes = width.saturating_mul(samples * depth);
    let needed = raw.step.checked_mul(height.saturating_sub(1)).and_then(|n| n.checked_add(row_bytes));
    if width == 0 || height == 0 || raw.step < row_bytes || needed.is_none_or(|n| n > raw.data.len()) {
        return Err(format!(
            "of {width} x {height} px, {} and {} bytes a row has {} bytes",
            raw.encoding,
            raw.step,
            raw.data.len()
        ));
    }
    let sample = |row: usize, index: usize| -> u16 {
        let at = row * raw.step + index * depth;
        match (depth, raw.big_endian) {
            (1, _) => u16::from(raw.data[at]),
            (_, true) => u16::from_be_bytes([raw.data[at], raw.data[at + 1]]),
            (_, false) => u16::from_le_bytes([raw.data[at], raw.data[at + 1]]),
        }
    };
    let image = match layout {
        Layout::Grey(offset, samples) => grey(raw, depth, |r, c| sample(r, c * samples + offset)),
        Layout::Colour(offsets, samples) => colour(raw, depth, |r, c, k| sample(r, c * samples + offsets[k])),
        Layout::Bayer(pattern) => colour(raw, depth, |r, c, k| demosaic(&sample, pattern, (r, c), k, (height, width))),
    };
    image.ok_or_else(|| "is too large".into())
}

fn grey(raw: &RawImage, depth: usize, sample: impl Fn(usize, usize) -> u16) -> Option<DynamicImage> {
    let values = (0..raw.height as usize).flat_map(|r| (0..raw.width as usize).map(move |c| (r, c)));
    let values = values.map(|(r, c)| sample(r, c));
    if depth == 1 {
        let bytes = values.map(|v| v as u8).collect();
        return ImageBuffer::<Luma<u8>, _>::from_raw(raw.width, raw.height, bytes).map(DynamicImage::ImageLuma8);
    }
    let words = values.collect();
    ImageBuffer::<Luma<u16>, _>::from_raw(raw.width, raw.height, words).map(DynamicImage::ImageLuma16)
}

fn colour(raw: &RawImage, depth: usize, sample: impl Fn(usize, usize, usize) -> u16) -> Option<DynamicImage> {
    let places = (0..raw.height as usize).flat_map(|r| (0..raw.width as usize).map(move |c| (r, c)));
    let values = places.flat_map(|(r, c)| [(r, c, 0), (r, c, 1), (r, c, 2)]).map(|(r, c, k)| sample(r, c, k));
    if depth == 1 {
        let bytes = values.map(|v| v as u8).collect();
        return ImageBuffer::<Rgb<u8>, _>::from_raw(raw.width, raw.height, bytes).map(DynamicImage::ImageRgb8);
    }
    let words = values.collect();
    ImageBuffer::<Rgb<u16>, _>::from_raw(raw.width, raw.height, words).map(DynamicImage::ImageRgb16)
}

/// Bilinear interpolation of one colour: the pixel itself, or the mean of its nearest neighbours of that colour.
fn demosaic(
    sample: &impl Fn(usize, usize) -> u16,
    pattern: [[usize; 2]; 2],
    (row, column): (usize, usize),
    colour: usize,
    (height, width): (usize, usize),
) -> u16 {
    if pattern[row % 2][column % 2] == colour {
        return sample(row, column);
    }
    let (mut sum, mut count) = (0_u32, 0_u32);
    for r in row.saturating_sub(1)..(row + 2).min(height) {
        for c in column.saturating_sub(1)..(column + 2).min(width) {
            let near = pattern[r % 2][c % 2] == colour;
            // Of green both edge neighbours exist; diagonal ones would be further away.
            let diagonal = r != row && c != column;
            if near && !(colour == 1 && diagonal) {
                sum += u32::from(sample(r, c));
                count += 1;
            }
        }
    }
    ((sum + count / 2) / count.max(1)) as u16
}

/// Mean squared grey gradient: of pictures of one scene, the largest is the sharpest.
pub(super) fn sharpness(picture: &DynamicImage) -> f64 {
    let grey = picture.to_luma16();
    let (width, height) = (grey.width() as usize, grey.height() as usize);
    let pixels = grey.as_raw();
    let mut sum = 0.0;
    for row in 1..height.max(1) {
        let (above, here) = (&pixels[(row - 1) * width..row * width], &pixels[row * width..(row + 1) * width]);
        let squares = here.windows(2).zip(&above[1..]).map(|(pair, up)| {
            let (right, down) = (f64::from(pair[1]) - f64::from(pair[0]), f64::from(pair[1]) - f64::from(*up));
            right * right + down * down
        });
        sum += squares.sum::<f64>();
    }
    sum / (width * height).max(1) as f64
}

/// Samples of a picture that are averaged at most; a larger one is taken by itself.
const MOST_SAMPLES: usize = 64 << 20;

/// The mean of pictures that come one by one.
#[derive(Default)]
pub(super) struct Mean {
    /// Sums over the pictures, 16-bit counts.
    sums: Vec<u32>,
    /// Sum over pictures and pixels of the squared counts.
    squares: u128,
    pictures: u32,
    like: Option<(ColorType, u32, u32)>,
    /// A picture did not fit to the others.
    broken: bool,
}

impl Mean {
    pub fn add(&mut self, picture: &DynamicImage) {
        let like = (picture.color(), picture.width(), picture.height());
        let samples = like.1 as usize * like.2 as usize * if like.0.has_color() { 3 } else { 1 };
        self.broken |= *self.like.get_or_insert(like) != like || samples > MOST_SAMPLES;
        if self.broken {
            self.sums = Vec::new();
            return;
        }
        self.sums.resize(samples, 0);
        let words = if like.0.has_color() { picture.to_rgb16().into_raw() } else { picture.to_luma16().into_raw() };
        for (sum, value) in self.sums.iter_mut().zip(words) {
            *sum += u32::from(value);
            self.squares += u128::from(value) * u128::from(value);
        }
        self.pictures += 1;
    }

    /// The mean picture in 16 bits (8-bit counts times 257), and the noise of one picture in counts of its own depth: rms
    /// over the pixels of the standard deviation over the pictures. `None` for fewer than two, or of different sizes.
    pub fn finish(self) -> Option<(DynamicImage, f64)> {
        let (color, width, height) = self.like.filter(|_| !self.broken && self.pictures > 1)?;
        let n = f64::from(self.pictures);
        let of_sums: u128 = self.sums.iter().map(|s| u128::from(*s) * u128::from(*s)).sum();
        // Exact in whole numbers: n times the sum of the squared deviations.
        let scatter = (u128::from(self.pictures) * self.squares).saturating_sub(of_sums) as f64;
        let variance = scatter / (n * (n - 1.0) * self.sums.len() as f64);
        let count = if color.bytes_per_pixel() == color.channel_count() { 257.0 } else { 1.0 };
        let means: Vec<u16> = self.sums.iter().map(|sum| (f64::from(*sum) / n).round() as u16).collect();
        let mean = match color.has_color() {
            true => DynamicImage::ImageRgb16(ImageBuffer::from_raw(width, height, means)?),
            false => DynamicImage::ImageLuma16(ImageBuffer::from_raw(width, height, means)?),
        };
        Some((mean, variance.sqrt() / count))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn raw(width: u32, height: u32, encoding: &str, step: usize, data: &[u8]) -> RawImage {
        RawImage { width, height, encoding: encoding.into(), big_endian: false, step, data: data.to_vec() }
    }

    #[test]
    fn grey_and_colour_keep_their_depth() {
        let image = to_image(&raw(2, 2, "mono8", 3, &[1, 2, 99, 3, 4])).unwrap();
        assert_eq!(image.as_luma8().unwrap().as_raw(), &[1, 2, 3, 4]);
        let mut deep = raw(2, 1, "mono16", 4, &[1, 2, 3, 4]);
        assert_eq!(to_image(&deep).unwrap().as_luma16().unwrap().as_raw(), &[0x0201, 0x0403]);
        deep.big_endian = true;
        assert_eq!(to_image(&deep).unwrap().as_luma16().unwrap().as_raw(), &[0x0102, 0x0304]);
        let image = to_image(&raw(1, 1, "bgra8", 4, &[1, 2, 3, 4])).unwrap();
        assert_eq!(image.as_rgb8().unwrap().as_raw(), &[3, 2, 1]);
        let image = to_image(&raw(2, 2, "yuv422_yuy2", 5, &[1, 128, 2, 128, 99, 3, 128, 4, 128])).unwrap();
        assert_eq!(image.as_luma8().unwrap().as_raw(), &[1, 2, 3, 4]);
        let image = to_image(&raw(2, 1, "uyvy", 4, &[128, 1, 128, 2])).unwrap();
        assert_eq!(image.as_luma8().unwrap().as_raw(), &[1, 2]);
        let image = to_image(&raw(2, 2, "nv12", 2, &[1, 2, 3, 4, 128, 128])).unwrap();
        assert_eq!(image.as_luma8().unwrap().as_raw(), &[1, 2, 3, 4]);
        let image = to_image(&raw(1, 1, "rgb16", 6, &[1, 0, 2, 0, 3, 0])).unwrap();
        assert_eq!(image.as_rgb16().unwrap().as_raw(), &[1, 2, 3]);
    }

    #[test]
    fn short_or_unknown_pictures_are_refused() {
        assert!(to_image(&raw(2, 2, "mono8", 2, &[1, 2, 3])).unwrap_err().contains("3 bytes"));
        assert!(to_image(&raw(2, 2, "mono8", 1, &[1; 9])).is_err());
        assert!(to_image(&raw(0, 2, "mono8", 2, &[1; 9])).is_err());
        assert!(to_image(&raw(u32::MAX, u32::MAX, "rgb16", usize::MAX, &[1; 9])).is_err());
        assert!(to_image(&raw(2, 2, "yuv411", 4, &[1; 9])).unwrap_err().contains("yuv411"));
        assert!(to_image(&raw(2, 2, "32FC1", 8, &[1; 16])).is_err());
    }

    #[test]
    fn a_mosaic_of_a_plain_colour_becomes_that_colour() {
        for (name, pattern) in [
            ("rggb", [[0, 1], [1, 2]]),
            ("bggr", [[2, 1], [1, 0]]),
            ("gbrg", [[1, 2], [0, 1]]),
            ("grbg", [[1, 0], [2, 1]]),
        ] {
            let data: Vec<u8> = (0..30).map(|i| [10, 20, 30][pattern[i / 6 % 2][i % 6 % 2]]).collect();
            let image = to_image(&raw(6, 5, &format!("bayer_{name}8"), 6, &data)).unwrap();
            assert!(image.as_rgb8().unwrap().pixels().all(|p| p.0 == [10, 20, 30]), "{name}");
        }
        // Red grows by 4 a column: linear interpolation is exact inside.
        let data: Vec<u8> = (0..36).map(|i| if i / 6 % 2 == 0 && i % 2 == 0 { 4 * (i % 6) } else { 0 }).collect();
        let image = to_image(&raw(6, 6, "bayer_rggb8", 6, &data)).unwrap();
        assert_eq!(image.as_rgb8().unwrap().get_pixel(3, 3).0[0], 12);
    }

    #[test]
    fn the_sharper_picture_wins_and_the_mean_has_less_noise() {
        let stripes = |low: u8, high: u8| {
            let pixel = |x: u32, _| Luma([if (x / 4).is_multiple_of(2) { low } else { high }]);
            DynamicImage::ImageLuma8(ImageBuffer::from_fn(32, 16, pixel))
        };
        assert!(sharpness(&stripes(0, 200)) > sharpness(&stripes(40, 160)));
        let average = |pictures: &[DynamicImage]| {
            let mut mean = Mean::default();
            pictures.iter().for_each(|p| mean.add(p));
            mean.finish()
        };
        let (mean, noise) = average(&[stripes(10, 100), stripes(12, 102), stripes(14, 104)]).unwrap();
        assert_eq!(mean.as_luma16().unwrap().get_pixel(0, 0).0[0], 12 * 257);
        assert!((noise - 2.0).abs() < 1e-12, "{noise}");
        assert!(average(&[stripes(1, 2)]).is_none());
    }
}
