//! Pictures in 8 bits, for finding corners only.

use std::borrow::Cow;

use calib_targets_core::GrayImageView;

use crate::detect::Picture;
use crate::linalg::wide;

/// A picture in 8 bits.
#[derive(Debug, Clone)]
pub struct Bytes {
    pub width: usize,
    pub height: usize,
    pub data: Vec<u8>,
}

impl Bytes {
    /// Bright 8-bit pictures stay as they are, others are stretched so that all but the brightest thousandth of their pixels fit.
    pub fn of(picture: &Picture) -> Self {
        let scale = if is_bright(picture) { 1.0 } else { 255.0 / bright_level(picture) };
        let mut data = vec![0; picture.pixels.len()];
        wide(
            #[inline(always)]
            || data.iter_mut().zip(&picture.pixels).for_each(|(byte, p)| *byte = whole(p * scale + 0.5)),
        );
        Self { width: picture.width, height: picture.height, data }
    }

    /// Means of two by two pixels.
    pub fn halved(&self) -> Self {
        let (width, height) = (self.width / 2, self.height / 2);
        let mut data = Vec::with_capacity(width * height);
        for pair in self.data.chunks_exact(2 * self.width) {
            let (top, bottom) = pair.split_at(self.width);
            let sum = |(t, b): (&[u8; 2], &[u8; 2])| [t[0], t[1], b[0], b[1]].map(u16::from).iter().sum::<u16>();
            let (top, bottom) = (top.as_chunks::<2>().0, bottom.as_chunks::<2>().0);
            data.extend(top.iter().zip(bottom).map(|p| ((sum(p) + 2) / 4) as u8));
        }
        Self { width, height, data }
    }

    /// At another size: halved as often as that goes, the rest by bilinear interpolation.
    pub fn scaled(&self, scale: f64) -> Cow<'_, Self> {
        if scale == 1.0 {
            return Cow::Borrowed(self);
        }
        if scale <= 0.5 {
            return Cow::Owned(self.halved().scaled(2.0 * scale).into_owned());
        }
        let side = |n: usize| ((n as f64 * scale).floor() as usize).max(1);
        let (width, height) = (side(self.width), side(self.height));
        let source = |k: usize, last: usize| ((k as f64 + 0.5) / scale - 0.5).clamp(0.0, last as f64);
        let at = |x: usize, y: usize| f64::from(self.data[y * self.width + x]);
        let value = |k: usize| {
            let (x, y) = (source(k % width, self.width - 1), source(k / width, self.height - 1));
            let (x0, y0) = (x as usize, y as usize);
            let (x1, y1) = ((x0 + 1).min(self.width - 1), (y0 + 1).min(self.height - 1));
            let (p, q) = (x - x0 as f64, y - y0 as f64);
            let row = |y: usize| at(x0, y) * (1.0 - p) + at(x1, y) * p;
            (row(y0) * (1.0 - q) + row(y1) * q + 0.5) as u8
        };
        Cow::Owned(Self { width, height, data: (0..width * height).map(value).collect() })
    }

    /// Left to right.
    pub fn mirror(&mut self) {
        self.data.chunks_exact_mut(self.width).for_each(<[u8]>::reverse);
    }

    pub fn view(&self) -> GrayImageView<'_> {
        GrayImageView { width: self.width, height: self.height, data: &self.data }
    }
}

/// A number without its fraction, as `as u8` has it; that is not done for several numbers at once.
#[inline(always)]
#[allow(clippy::manual_clamp, reason = "what is not a number becomes 0")]
fn whole(value: f32) -> u8 {
    /// Adding it leaves whole numbers in the low bits of a sum.
    const WHOLE: f32 = 8_388_608.0;
    let value = value.max(0.0).min(255.0);
    let nearest = (value + WHOLE) - WHOLE;
    let below = nearest - if nearest > value { 1.0 } else { 0.0 };
    (below + WHOLE).to_bits() as u8
}

/// Whether an 8-bit picture has more than a thousandth of its pixels in the upper half of its range.
fn is_bright(picture: &Picture) -> bool {
    let mut upper = 0;
    let suffices = |part: &[f32]| {
        upper += wide(
            #[inline(always)]
            || part.iter().map(|&p| u32::from(p >= 128.0)).sum::<u32>(),
        );
        upper as usize > picture.pixels.len() / 1000
    };
    picture.full_scale <= 255.0 && picture.pixels.chunks(picture.width.max(1)).any(suffices)
}

/// Count below which all but a thousandth of the pixels lie.
fn bright_level(picture: &Picture) -> f32 {
    let step = 4096.0 / picture.full_scale;
    let mut histogram = [0usize; 4097];
    for &p in &picture.pixels {
        histogram[((p * step) as usize).min(4096)] += 1;
    }
    let mut above = picture.pixels.len() / 1000;
    for (bin, &count) in histogram.iter().enumerate().rev() {
        if count > above {
            return (bin + 1) as f32 / step;
        }
        above -= count;
    }
    picture.full_scale
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whole_numbers_are_those_of_the_language() {
        let numbers = (-10..2600).map(|k| k as f32 * 0.1).chain([254.99998, 0.49999997, f32::NAN, f32::INFINITY]);
        for number in numbers.chain((0..=256).map(|k| (k as f32).next_down())) {
            assert_eq!(whole(number), number as u8, "{number}");
        }
    }
}
