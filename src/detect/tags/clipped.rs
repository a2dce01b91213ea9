//! What clipping leaves unknown of sides in a picture that was smoothed afterwards, in which it is not seen any more.
//!
//! Paper that is clipped moves a side towards its ink by `g`, which the code of the tag tells as a growth; `g` is a mean. A side along the rows
//! of pixels moves by more or less than that, by where it lies between the centres of two rows. Over all places the standard deviation is
//!
//! ```text
//! sigma = 0.045 px^2 |g| / s^2
//! ```
//!
//! by sums over the pixels of min(full scale, light), for edges of a Gaussian of 0.2 to 1.2 px seen by square pixels, `s` with the area of the pixel,
//! and paper of 1.05 to 2.5 times full scale: within 10 % but for the sharpest (0.048 without any blur). A side that crosses `n` rows has less:
//! of a wave in `n` periods along it, what a straight line takes on is `1 / n` at its ends.

use super::edge_line::EdgeLine;
use super::growth::Growth;
use crate::detect::Picture;
use crate::detect::shared::SATURATED;

/// Standard deviation of the place of a side over `|g| / s^2`, px^2.
const OF_PHASE: f64 = 0.045;
/// Lines beside a side in which clipped pixels are looked for, px.
const BESIDE_PX: [f64; 3] = [1.0, 2.0, 3.0];

/// Variance of the place of a side of this length beside paper that was clipped before the picture was smoothed, px^2; 0 where none was.
pub fn variance(raw: &Picture, smoothing_px: f64, side: &EdgeLine, length: f64, growth: Growth) -> f64 {
    let (mut clipped, mut all) = (0.0, 0.0);
    for p in side.beside(length, BESIDE_PX.into_iter()) {
        let [x, y] = p.map(f64::round);
        if x >= 0.0 && y >= 0.0 && x < raw.width as f64 && y < raw.height as f64 {
            all += 1.0;
            clipped += f64::from(u8::from(raw.at(x as usize, y as usize) >= SATURATED * raw.full_scale));
        }
    }
    if clipped == 0.0 {
        return 0.0;
    }
    let of_phase = OF_PHASE / side.blur_before(smoothing_px).powi(2) / side.crossed(length).max(1.0);
    clipped / all * of_phase * of_phase * (growth.px * growth.px + growth.variance)
}
