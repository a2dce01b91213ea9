//! A picture as corners are fitted in it: as it is, or after a smoothing of known effect, a Gaussian on the raster of the pixels, that is done
//! only where it is asked for.

use std::ops::RangeInclusive;

use crate::detect::Picture;
use crate::linalg::wide;

/// A picture as corners are fitted in it.
pub(super) struct Source<'a> {
    picture: &'a Picture,
    /// Sigma of the smoothing, if any, px.
    pub smoothing_px: Option<f64>,
    /// Weights of the pixels along a row or column; a single one without smoothing.
    kernel: Vec<f32>,
}

/// Grey values in a rectangle.
pub(super) struct Patch {
    left: usize,
    top: usize,
    width: usize,
    pixels: Vec<f32>,
}

impl Patch {
    /// Grey value at a column and a row of the picture.
    pub fn at(&self, x: usize, y: usize) -> f32 {
        self.pixels[(y - self.top) * self.width + x - self.left]
    }
}

impl<'a> Source<'a> {
    /// The picture as it is.
    pub fn plain(picture: &'a Picture) -> Self {
        Self { picture, smoothing_px: None, kernel: vec![1.0] }
    }

    /// The picture smoothed by a Gaussian of `sigma_px`.
    pub fn smoothed(picture: &'a Picture, sigma_px: f64) -> Self {
        let reach = (4.0 * sigma_px).ceil() as usize;
        let weight = |k: usize| (-0.5 * ((k as f64 - reach as f64) / sigma_px).powi(2)).exp();
        let total: f64 = (0..=2 * reach).map(weight).sum();
        let kernel = (0..=2 * reach).map(|k| (weight(k) / total) as f32).collect();
        Self { picture, smoothing_px: Some(sigma_px), kernel }
    }

    /// The picture without smoothing.
    pub fn picture(&self) -> &'a Picture {
        self.picture
    }

    /// Count at which pixels are clipped: none is, once it is smoothed.
    pub fn full_scale(&self) -> f64 {
        if self.smoothing_px.is_some() { f64::INFINITY } else { f64::from(self.picture.full_scale) }
    }

    /// Grey values of these columns and rows.
    pub fn patch(&self, columns: RangeInclusive<usize>, rows: RangeInclusive<usize>) -> Patch {
        let (left, top, picture) = (*columns.start(), *rows.start(), self.picture);
        let (width, height) = (columns.end() + 1 - left, rows.end() + 1 - top);
        let mut pixels = vec![0.0_f32; width * height];
        let reach = self.kernel.len() / 2;
        // A row with its neighbours on both sides, that beyond the picture are those at its ends.
        let mut row = vec![0.0_f32; width + 2 * reach];
        let (from, to) = (left.saturating_sub(reach), (left + width + reach).min(picture.width));
        let (first, end) = (from + reach - left, to + reach - left);
        wide(
            #[inline(always)]
            || {
                for (y, out) in (top..).zip(pixels.chunks_exact_mut(width)) {
                    row[first..end].fill(0.0);
                    for (k, weight) in self.kernel.iter().enumerate() {
                        let start = (y + k).saturating_sub(reach).min(picture.height - 1) * picture.width;
                        let values = &picture.pixels[start + from..start + to];
                        row[first..end].iter_mut().zip(values).for_each(|(sum, value)| *sum += weight * value);
                    }
                    let ends = [row[first], row[end - 1]];
                    row[..first].fill(ends[0]);
                    row[end..].fill(ends[1]);
                    for (k, weight) in self.kernel.iter().enumerate() {
                        out.iter_mut().zip(&row[k..]).for_each(|(sum, value)| *sum += weight * value);
                    }
                }
            },
        );
        Patch { left, top, width, pixels }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_patch_is_a_part_of_the_whole_smoothed_picture() {
        let (width, height) = (23, 17);
        let pixels = (0..width * height).map(|k| (k * k % 251) as f32).collect();
        let picture = Picture { width, height, pixels, full_scale: 255.0 };
        let source = Source::smoothed(&picture, 0.7);
        let whole = source.patch(0..=width - 1, 0..=height - 1);
        for (x0, y0, x1, y1) in [(0, 0, 5, 6), (9, 4, 12, 12), (20, 15, 22, 16)] {
            let patch = source.patch(x0..=x1, y0..=y1);
            let same = |x: usize, y: usize| patch.at(x, y) == whole.at(x, y);
            assert!((y0..=y1).all(|y| (x0..=x1).all(|x| same(x, y))), "{x0} {y0}");
        }
        let plain = Source::plain(&picture).patch(3..=7, 5..=9);
        assert!((5..=9).all(|y| (3..=7).all(|x| plain.at(x, y) == picture.at(x, y))));
    }
}
