//! Pictures of so few grey levels that edges jump from pixel to pixel.
//!
//! In a picture of one bit an edge lies anywhere between two pixels: its place is uniform over a pixel along its normal, with a standard
//! deviation of `1 / sqrt(12)` px. With `L` levels a blurred edge passes `L - 1` steps, each of which tells as much of its own place. Pixels
//! along an edge are wrong alike where it follows the rows, and independently where it is oblique; no more is counted than [`ALONG`] of them,
//! so that a corner or a centre has `1 / ((L - 1) sqrt(12 ALONG))` px per axis: 0.1 px for one bit. No residual tells of that: the fit sees a
//! sharp picture.

use super::Detection;
use crate::error::{Code, Notice};

/// Pixels along an edge whose errors count as independent.
const ALONG: f64 = 8.0;

/// Standard deviation of a point per axis by the rounding to so many levels, px.
fn rounding_px(levels: usize) -> f64 {
    1.0 / ((levels as f64 - 1.0) * (12.0 * ALONG).sqrt())
}

/// Adds the rounding to the covariances of the markers that are `new` (by id).
pub fn allow_for_rounding(detection: &mut Detection, levels: usize, new: impl Fn(u32) -> bool) {
    let sigma_px = rounding_px(levels);
    let variance = sigma_px * sigma_px;
    for observation in detection.observations.iter_mut().filter(|o| new(o.marker)) {
        observation.covariance = observation.covariance.map(|[uu, uv, vv]| [uu + variance, uv, vv + variance]);
    }
    let found = detection.circles.iter_mut().flat_map(|c| &mut c.found).filter(|f| new(f.marker));
    found.for_each(|f| f.measured.widen(1.0, sigma_px));
}

/// What is said of them where anything was found.
pub fn few_grey_levels(detection: &Detection, levels: usize) -> Option<Notice> {
    let sigma_px = rounding_px(levels);
    let what =
        format!("it has {levels} grey levels: points are known to {sigma_px:.2} px, as edges jump from pixel to pixel");
    let remedy = "store images in grey levels (8 bits or more), without a threshold";
    (!detection.observations.is_empty()).then(|| Notice::new(Code::FewGreyLevels, "image", what, remedy))
}

/// What is said of a series with dark and white images, too.
pub fn flat_field_left_out() -> Notice {
    let what = "dark and white images are not applied to it: so few grey levels are no measure of the light";
    Notice::new(Code::FlatFieldLeftOut, "image", what, "store images in grey levels (8 bits or more)")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::series::{Edge, Observation};

    #[test]
    fn rounding_is_that_of_eight_pixels_and_all_steps() {
        // 0.29 px over the root of eight.
        assert!((rounding_px(2) - 0.1021).abs() < 1e-4 && (rounding_px(5) - 0.0255).abs() < 1e-4);
    }

    #[test]
    fn what_a_second_look_adds_is_widened_and_what_was_known_is_not_again() {
        let of = |marker| Observation { marker, edge: Edge::Outer, uv: [0.0; 2], covariance: Some([0.01, 0.0, 0.01]) };
        let mut detection = Detection { observations: vec![of(1), of(2)], ..Detection::default() };
        allow_for_rounding(&mut detection, 2, |marker| marker == 2);
        let variances: Vec<f64> = detection.observations.iter().map(|o| o.covariance.unwrap()[0]).collect();
        // 1 / 96 px^2 for one bit.
        assert!(variances[0] == 0.01 && (variances[1] - 0.01 - 1.0 / 96.0).abs() < 1e-12, "{variances:?}");
    }
}
