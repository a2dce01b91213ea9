//! Single pixels that tell nothing of the light: hot, dead, or hit in transmission.
//!
//! What a lens draws is no smaller than a pixel and its neighbours. A pixel far above or below all eight of them is none of it; one in a
//! thousand costs a tenth of the markers and more. Whether a picture has such pixels is told where their neighbours are alike; where it has,
//! those at edges are replaced, too. The middle of a small figure, as of a square of 3 px, may be as far from its neighbours. It stays: those beside
//! it are nearer to it than the diagonal ones, while across an edge what one has more its opposite has less.

use crate::detect::Picture;
use crate::error::{Code, Notice};
use crate::linalg::{median, wide};

/// A picture with no more of a kind is left as it is ...
const FEWEST: usize = 20;
/// ... and one of which more than this share of all pixels are such: a mosaic of colours, or a pattern.
const MOST: f64 = 0.01;
/// Least distance to all neighbours: share of full scale, and of the noise.
const LEAST_SHARE: f32 = 0.1;
const LEAST_NOISE: f64 = 12.0;
/// Neighbours are alike where they differ by a smaller share of that distance.
const ALIKE: f32 = 0.25;
/// They are replaced where the means of opposite neighbours differ by a smaller share of the distance to the nearest of these means. Along an edge
/// the means bend by 0.3 of it at most. In a pattern of squares of 3 px that are blurred to a wave it is 1/2: of the height of a middle those beside
/// it have 1/2, the diagonal ones 1/4; with less blur it is more.
const BENT: f32 = 0.4;
/// Pixels by which the noise is told.
const NOISE_PIXELS: usize = 4096;
/// Pixels of a row that are passed over at once.
const BLOCK: usize = 64;

/// A pixel unlike its neighbours.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Lone {
    at: usize,
    is_bright: bool,
    /// Whether its neighbours are alike.
    is_clear: bool,
    /// Differences between the means of opposite neighbours, over the distance to them.
    bend: f32,
    /// What is expected there.
    value: f32,
}

/// The picture without its hot and dead pixels, and how many they are; `None` where it has none to speak of.
pub fn without_hot_pixels(picture: &Picture) -> Option<(Picture, usize)> {
    let (width, height) = (picture.width, picture.height);
    if width < 3 || height < 3 || picture.pixels.len() != width * height {
        return None;
    }
    let least = threshold(picture);
    let lone: Vec<Lone> = (1..height - 1).flat_map(|y| in_row(picture, y, least)).collect();
    let is_spoilt = [false, true].map(|is_bright| {
        let of_kind = || lone.iter().filter(|l| l.is_bright == is_bright);
        of_kind().filter(|l| l.is_clear).count() > FEWEST
            && of_kind().count() as f64 <= MOST * picture.pixels.len() as f64
    });
    let replaced: Vec<&Lone> = lone.iter().filter(|l| is_spoilt[usize::from(l.is_bright)] && l.bend < BENT).collect();
    if replaced.is_empty() {
        return None;
    }
    let mut mended = picture.clone();
    replaced.iter().for_each(|l| mended.pixels[l.at] = l.value);
    Some((mended, replaced.len()))
}

/// How far a pixel must be from all its neighbours, counts.
fn threshold(picture: &Picture) -> f32 {
    let values = &picture.pixels;
    let stride = (values.len() / NOISE_PIXELS).max(1);
    let bend = |k: usize| f64::from((values[k] - 0.5 * (values[k - 1] + values[k + 1])).abs());
    // Of normal noise the median of the absolute values is 0.6745 sigma, and the sum has 3/2 of its variance.
    let noise = median((1..values.len() - 1).step_by(stride).map(bend)).map_or(0.0, |m| m / (0.6745 * 1.5_f64.sqrt()));
    (LEAST_SHARE * picture.full_scale).max((LEAST_NOISE * noise) as f32)
}

/// Of a row that has one above and one below.
fn in_row(picture: &Picture, y: usize, least: f32) -> impl Iterator<Item = Lone> {
    let width = picture.width;
    let row = &picture.pixels[y * width..(y + 1) * width];
    (1..width - 1)
        .step_by(BLOCK)
        .map(move |from| from..(from + BLOCK).min(width - 1))
        .filter(move |block| stands_out(&row[block.start - 1..=block.end], least))
        .flatten()
        .filter_map(move |x| lone(picture, [x, y], least))
}

/// Whether one of these pixels but the first and the last is far from both beside it.
fn stands_out(row: &[f32], least: f32) -> bool {
    let (left, middle, right) = (&row[..row.len() - 2], &row[1..row.len() - 1], &row[2..]);
    let found = wide(
        #[inline(always)]
        || {
            let beside = left.iter().zip(right).zip(middle);
            beside
                .map(|((l, r), m)| {
                    u32::from((m - l > least) & (m - r > least)) | u32::from((l - m > least) & (r - m > least))
                })
                .sum::<u32>()
        },
    );
    found > 0
}

fn lone(picture: &Picture, [x, y]: [usize; 2], least: f32) -> Option<Lone> {
    let at = y * picture.width + x;
    let value = picture.pixels[at];
    let pairs = [[(0, 1), (2, 1)], [(1, 0), (1, 2)], [(0, 0), (2, 2)], [(2, 0), (0, 2)]]
        .map(|pair| pair.map(|(right, down)| picture.at(x + right - 1, y + down - 1)));
    let (low, high) = pairs.iter().flatten().fold((f32::MAX, f32::MIN), |(l, h), v| (l.min(*v), h.max(*v)));
    let is_bright = value - high > least;
    if !is_bright && low - value <= least {
        return None;
    }
    let off = if is_bright { value - high } else { low - value };
    // Along an edge opposite neighbours are alike, and as the pixel between them.
    let apart = |[a, b]: &[f32; 2]| (a - b).abs();
    let [a, b] = pairs.into_iter().min_by(|p, q| apart(p).total_cmp(&apart(q)))?;
    let means = pairs.map(|[a, b]| 0.5 * (a + b));
    let (lowest, highest) = means.iter().fold((f32::MAX, f32::MIN), |(l, h), v| (l.min(*v), h.max(*v)));
    let beyond = if is_bright { value - highest } else { lowest - value };
    Some(Lone {
        at,
        is_bright,
        is_clear: high - low < ALIKE * off,
        bend: (highest - lowest) / beyond,
        value: 0.5 * (a + b),
    })
}

/// What is said of them.
pub fn hot_pixels(count: usize) -> Notice {
    let what = format!("{count} single pixels are far from all their neighbours, and were replaced by what those tell");
    let remedy =
        "give dark images (see the guide on flat fields), cool the camera, or expose for less time at less gain";
    Notice::new(Code::HotPixels, "image", what, remedy)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An oblique soft edge between 40 and 200 counts, a dot of 2 x 2 px, and noise of some counts.
    fn scene() -> Picture {
        let (width, height) = (200, 150);
        let value = |k: usize| {
            let (x, y) = (k % width, k / width);
            let off = (x as f32 - 100.0 + 0.3 * (y as f32 - 75.0)) / 1.5;
            let dot = if (20..22).contains(&x) && (30..32).contains(&y) { 160.0 } else { 0.0 };
            let grain = (k.wrapping_mul(2_654_435_761) >> 9) % 5;
            (40.0 + 160.0 / (1.0 + (-off).exp()) + dot + grain as f32).round()
        };
        Picture { width, height, pixels: (0..width * height).map(value).collect(), full_scale: 255.0 }
    }

    #[test]
    fn lone_pixels_are_replaced_by_what_is_around_them_and_nothing_else_is_changed() {
        let clean = scene();
        assert_eq!(without_hot_pixels(&clean), None);
        for value in [255.0, 0.0] {
            let mut spoilt = clean.clone();
            // One in 7 columns and 11 rows, none beside another: off the dot and the rim.
            let places: Vec<usize> = (0..clean.pixels.len())
                .filter(|k| (k % 200 % 17 == 5) && (k / 200 % 11 == 4) && k % 200 < 195)
                .collect();
            places.iter().for_each(|k| spoilt.pixels[*k] = value);
            let (mended, count) = without_hot_pixels(&spoilt).unwrap();
            // 40 below and 55 above the levels, more than 25.5 counts from all neighbours, but for the noise of 4.
            assert_eq!(count, places.len(), "{value}");
            for (k, (a, b)) in clean.pixels.iter().zip(&mended.pixels).enumerate() {
                let limit = if places.contains(&k) { 20.0 } else { 0.0 };
                assert!((a - b).abs() <= limit, "{value} at {k}: {a} {b}");
            }
        }
    }

    #[test]
    fn squares_of_three_pixels_beside_them_stay() {
        let (width, height) = (200, 150);
        let wave = |k: usize| [0.55, 1.0, 0.55, -0.55, -1.0, -0.55][k % 6];
        // In a corner of the picture 160 middles of bright squares, 36 counts above those beside them, and 160 of dark ones.
        let value = |k: usize| match [k % width, k / width] {
            [x @ 0..48, y @ 0..60] => 120.0 + 80.0 * wave(x) * wave(y),
            _ => 100.0,
        };
        let clean = Picture { width, height, pixels: (0..width * height).map(value).collect(), full_scale: 255.0 };
        assert_eq!(without_hot_pixels(&clean), None);
        let mut spoilt = clean.clone();
        (0..40).for_each(|k| spoilt.pixels[(5 + 3 * k) * width + 120 + k] = 255.0);
        assert_eq!(without_hot_pixels(&spoilt), Some((clean, 40)));
    }

    #[test]
    fn few_of_them_and_a_mosaic_are_left_as_they_are() {
        let mut few = scene();
        (0..FEWEST).for_each(|k| few.pixels[2000 + 205 * k] = 255.0);
        assert_eq!(without_hot_pixels(&few), None);
        let mut mosaic = scene();
        let width = mosaic.width;
        let is_blue = |k: usize| k % width % 2 == 1 && k / width % 2 == 1;
        mosaic.pixels.iter_mut().enumerate().filter(|(k, _)| is_blue(*k)).for_each(|(_, v)| *v *= 0.5);
        assert_eq!(without_hot_pixels(&mosaic), None);
    }
}
