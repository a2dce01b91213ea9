//! Pictures of so few grey levels that edges jump from pixel to pixel.
//!
//! In a picture of one bit an edge lies anywhere between two pixels: its place is uniform over a pixel along its normal, with a standard
//! deviation of `1 / sqrt(12)` px. With `L` levels a blurred edge passes `L - 1` steps, each of which tells as much of its own place. Pixels
//! along an edge are wrong alike where it follows the rows, and independently where it is oblique; no more is counted than [`ALONG`] of them,
//! so that a corner or a centre has `1 / ((L - 1) sqrt(12 ALONG))` px per axis: 0.1 px for one bit. No residual tells of that: the fit sees a
//! sharp picture.

use std::collections::BTreeSet;

use super::{Detection, Picture};
use crate::error::{Code, Notice};

/// A picture with as many levels has blurred edges.
const ENOUGH: usize = 8;
/// Pixels along an edge whose errors count as independent.
const ALONG: f64 = 8.0;

/// Number of grey levels of a picture that has too few.
pub fn few_levels(picture: &Picture) -> Option<usize> {
    let mut seen = BTreeSet::new();
    let mut last = None;
    for value in picture.pixels.iter().map(|v| v.to_bits()) {
        if last != Some(value) && seen.insert(value) && seen.len() >= ENOUGH {
            return None;
        }
        last = Some(value);
    }
    (seen.len() > 1).then_some(seen.len())
}

/// Standard deviation of a point per axis by the rounding to so many levels, px.
fn rounding_px(levels: usize) -> f64 {
    1.0 / ((levels as f64 - 1.0) * (12.0 * ALONG).sqrt())
}

/// Adds the rounding to the covariances, and says so where anything was found.
pub fn allow_for_rounding(detection: &mut Detection, levels: usize) {
    let sigma_px = rounding_px(levels);
    let variance = sigma_px * sigma_px;
    for observation in &mut detection.observations {
        observation.covariance = observation.covariance.map(|[uu, uv, vv]| [uu + variance, uv, vv + variance]);
    }
    let found = detection.circles.iter_mut().flat_map(|c| &mut c.found);
    found.for_each(|f| f.measured.widen(1.0, sigma_px));
    if !detection.observations.is_empty() {
        let what = format!(
            "it has {levels} grey levels: points are known to {sigma_px:.2} px, as edges jump from pixel to pixel"
        );
        let remedy = "store images in grey levels (8 bits or more), without a threshold";
        detection.notices.push(Notice::new(Code::FewGreyLevels, "image", what, remedy));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn levels_are_counted_up_to_enough() {
        let of = |levels: u32| Picture {
            width: 40,
            height: 2,
            pixels: (0..80).map(|k| (k % levels * 30) as f32).collect(),
            full_scale: 255.0,
        };
        assert_eq!([1, 2, 7, 8].map(|n| few_levels(&of(n))), [None, Some(2), Some(7), None]);
        // 0.29 px over the root of eight.
        assert!((rounding_px(2) - 0.1021).abs() < 1e-4 && (rounding_px(5) - 0.0255).abs() < 1e-4);
    }
}
