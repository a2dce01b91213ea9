//! What dark and white images say of the sensor and the light, and whether they changed from the begin of a series to its end.
//!
//! Frames named `begin*` and `end*` are compared block by block: of white ones, each frame over its own mean, so that light that is a little
//! brighter at the end is told from a sensor or lens that is uneven in another way; of dark ones the counts over full scale.

use std::path::{Path, PathBuf};

use crate::detect::{Picture, load};
use crate::error::Result;

/// Blocks across and down the image.
const BLOCKS: [usize; 2] = [16, 12];

/// Dark and white images in numbers.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct FlatFieldFacts {
    /// Number of dark images.
    pub dark_images: usize,
    /// Number of white images.
    pub white_images: usize,
    /// Mean of the dark images over full scale.
    pub dark_level: f64,
    /// Sensitivity of the darkest block over that of the brightest; 1 without white images.
    pub darkest: f64,
    /// Pixels without signal.
    pub dead: usize,
    /// Change of the dark images from begin to end; none where no frames are named so.
    pub dark_drift: Option<LightDrift>,
    /// Change of the white images.
    pub white_drift: Option<LightDrift>,
}

/// Change from frames `begin*` to frames `end*`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LightDrift {
    /// Of all pixels in common: relative for white images, over full scale for dark ones.
    pub level: f64,
    /// What is left between the blocks, RMS, in the same unit.
    pub pattern: f64,
    /// What the scatter of single frames leaves of that, RMS; none where there is one frame of each.
    pub noise: Option<f64>,
}

/// Means of the blocks of a picture over full scale.
pub(super) fn block_means(pixels: &[f32], width: usize, height: usize, full_scale: f32) -> Vec<f64> {
    let mut sums = vec![(0.0, 0usize); BLOCKS[0] * BLOCKS[1]];
    for (y, row) in pixels.chunks_exact(width.max(1)).enumerate() {
        for (x, value) in row.iter().enumerate() {
            let at = (y * BLOCKS[1] / height) * BLOCKS[0] + x * BLOCKS[0] / width;
            sums[at].0 += f64::from(*value);
            sums[at].1 += 1;
        }
    }
    sums.into_iter().filter(|s| s.1 > 0).map(|(sum, n)| sum / n as f64 / f64::from(full_scale)).collect()
}

/// Which frames of a folder are compared.
#[derive(Clone, Copy, PartialEq)]
pub enum Light {
    Dark,
    White,
}

fn named<'a>(paths: &'a [PathBuf], start: &str) -> Vec<&'a PathBuf> {
    let is = |p: &&PathBuf| p.file_name().is_some_and(|n| n.to_string_lossy().to_lowercase().starts_with(start));
    paths.iter().filter(is).collect()
}

/// Change from begin to end; none where not both are named.
///
/// # Errors
/// An unreadable image.
pub fn drift(paths: &[PathBuf], bits: Option<u32>, light: Light) -> Result<Option<LightDrift>> {
    let [begin, end] = ["begin", "end"].map(|start| named(paths, start));
    if begin.is_empty() || end.is_empty() {
        return Ok(None);
    }
    let frames = |all: &[&PathBuf]| all.iter().map(|p| frame(p, bits)).collect::<Result<Vec<Vec<f64>>>>();
    Ok(drift_of(&frames(&begin)?, &frames(&end)?, light))
}

fn frame(path: &Path, bits: Option<u32>) -> Result<Vec<f64>> {
    let Picture { pixels, width, height, full_scale, .. } = load(path, bits)?;
    Ok(block_means(&pixels, width, height, full_scale))
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len().max(1) as f64
}

/// From the block means of every frame.
fn drift_of(begin: &[Vec<f64>], end: &[Vec<f64>], light: Light) -> Option<LightDrift> {
    let levels = |frames: &[Vec<f64>]| frames.iter().map(|f| mean(f)).collect::<Vec<f64>>();
    let (b, e) = (levels(begin), levels(end));
    let level = match light {
        Light::Dark => mean(&e) - mean(&b),
        Light::White => mean(&e) / mean(&b) - 1.0,
    };
    // Every frame without its own mean.
    let shapes = |frames: &[Vec<f64>]| -> Vec<Vec<f64>> {
        let shape = |f: &Vec<f64>| {
            let m = mean(f);
            let unit = if light == Light::White { m } else { 1.0 };
            f.iter().map(|v| (v - m) / unit).collect()
        };
        frames.iter().map(shape).collect()
    };
    let (b, e) = (shapes(begin), shapes(end));
    let blocks = b.first()?.len();
    let of_block =
        |frames: &[Vec<f64>], k: usize| frames.iter().filter_map(|f| f.get(k).copied()).collect::<Vec<f64>>();
    let (mut changed, mut scatter, mut free) = (0.0, 0.0, 0.0);
    for k in 0..blocks {
        let (own_b, own_e) = (of_block(&b, k), of_block(&e, k));
        changed += (mean(&own_e) - mean(&own_b)).powi(2) / blocks as f64;
        for own in [&own_b, &own_e] {
            let m = mean(own);
            scatter += own.iter().map(|v| (v - m).powi(2)).sum::<f64>();
            free += own.len() as f64 - 1.0;
        }
    }
    let means = 1.0 / begin.len() as f64 + 1.0 / end.len() as f64;
    let noise = (free > 0.0).then(|| (scatter / free * means).sqrt());
    let pattern = changed.sqrt();
    (level.is_finite() && pattern.is_finite()).then_some(LightDrift { level, pattern, noise })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn brighter_light_is_level_and_a_shaded_corner_is_pattern() {
        let even = vec![0.5; 192];
        let brighter: Vec<f64> = even.iter().map(|v| 1.1 * v).collect();
        let found = drift_of(&[even.clone(), even.clone()], &[brighter], Light::White).unwrap();
        assert!((found.level - 0.1).abs() < 1e-12 && found.pattern < 1e-12, "{found:?}");
        let mut shaded = even.clone();
        shaded[..12].fill(0.4);
        let found = drift_of(&[even.clone(), even], &[shaded], Light::White).unwrap();
        assert!(found.pattern > 0.04 && found.noise == Some(0.0), "{found:?}");
    }

    #[test]
    fn scatter_of_frames_is_told_from_a_change() {
        let wave = |amplitude: f64, phase: f64| {
            (0..192).map(|k| 0.5 + amplitude * (f64::from(k) + phase).sin()).collect::<Vec<f64>>()
        };
        let begin = [wave(0.01, 0.0), wave(0.01, 1.9), wave(0.01, 3.7)];
        let end = [wave(0.01, 0.8), wave(0.01, 2.9), wave(0.01, 4.7)];
        let found = drift_of(&begin, &end, Light::Dark).unwrap();
        assert!(found.pattern < 3.0 * found.noise.unwrap(), "{found:?}");
    }
}
