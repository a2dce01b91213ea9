//! Raw pictures behind a colour filter (Bayer mosaics) as grey pictures of full resolution.
//!
//! Interpolating the missing colours averages neighbours and so mixes different places of an edge; it blurs, and where
//! a channel is missing on one side it moves edges. A calibration plate is grey: behind each filter every pixel sees
//! the same pattern at its own place, only with another gain. So the gains are balanced and every pixel stays where
//! and what it was.

use super::Picture;
use crate::error::{Error, Result};

/// Order of the filters in the top-left 2 x 2 pixels, row by row (as in the ROS encodings `bayer_rggb8`, `bayer_rggb16`, ...).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Mosaic {
    /// Red, green / green, blue.
    Rggb,
    /// Blue, green / green, red.
    Bggr,
    /// Green, blue / red, green.
    Gbrg,
    /// Green, red / blue, green.
    Grbg,
}

/// A filter colour: index of its gain.
const RED: usize = 0;
const GREEN: usize = 1;
const BLUE: usize = 2;

impl Mosaic {
    /// The mosaic of a ROS encoding such as `bayer_rggb8`; `None` for other encodings.
    pub fn from_ros_encoding(encoding: &str) -> Option<Self> {
        let order = encoding.strip_prefix("bayer_")?;
        match order.strip_suffix("16").or_else(|| order.strip_suffix('8'))? {
            "rggb" => Some(Self::Rggb),
            "bggr" => Some(Self::Bggr),
            "gbrg" => Some(Self::Gbrg),
            "grbg" => Some(Self::Grbg),
            _ => None,
        }
    }

    fn colour(self, x: usize, y: usize) -> usize {
        let cell = match self {
            Self::Rggb => [RED, GREEN, GREEN, BLUE],
            Self::Bggr => [BLUE, GREEN, GREEN, RED],
            Self::Gbrg => [GREEN, BLUE, RED, GREEN],
            Self::Grbg => [GREEN, RED, BLUE, GREEN],
        };
        cell[2 * (y % 2) + x % 2]
    }

    /// Balances the three channels of a raw picture of a grey scene; no pixel is moved or mixed with another.
    ///
    /// The gains make the mean counts of the channels equal over all 2 x 2 cells without a saturated pixel. The
    /// saturation count of the result is that of the channel that saturates first.
    ///
    /// # Errors
    /// A picture whose every cell has a saturated pixel, or a channel without signal.
    pub fn to_grey(self, mut raw: Picture) -> Result<Picture> {
        let sums = self.channel_sums(&raw);
        let dark = sums.iter().any(|&s| s <= 0.0);
        if dark {
            return Err(Error::input(
                "image",
                "a colour channel of the raw picture is black or saturated everywhere",
                "check the exposure and the encoding of the recording",
            ));
        }
        let gains = sums.map(|s| (sums[GREEN] / s) as f32);
        let full_scale = gains.iter().fold(f32::INFINITY, |least, &g| least.min(g * raw.full_scale));
        let width = raw.width;
        for (k, pixel) in raw.pixels.iter_mut().enumerate() {
            *pixel = (*pixel * gains[self.colour(k % width, k / width)]).min(full_scale);
        }
        raw.full_scale = full_scale;
        Ok(raw)
    }

    /// Sums of the channels, each of the two green pixels of a cell counting half.
    fn channel_sums(self, raw: &Picture) -> [f64; 3] {
        let mut sums = [0.0; 3];
        for y in (0..raw.height.saturating_sub(1)).step_by(2) {
            for x in (0..raw.width.saturating_sub(1)).step_by(2) {
                let cell = [(x, y), (x + 1, y), (x, y + 1), (x + 1, y + 1)];
                if cell.iter().any(|&(i, j)| raw.at(i, j) >= raw.full_scale) {
                    continue;
                }
                for (i, j) in cell {
                    let colour = self.colour(i, j);
                    let share = if colour == GREEN { 0.5 } else { 1.0 };
                    sums[colour] += share * f64::from(raw.at(i, j));
                }
            }
        }
        sums
    }
}
