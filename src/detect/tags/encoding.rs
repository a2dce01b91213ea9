//! How far an encoding of the light moves the sides of tags whose code does not tell.
//!
//! A blurred edge leaves the ink as it runs into the paper. Grey values that are a power of the light have it run in earlier: it is askew, on
//! all sides of a tag alike, which no lens does. With the medians `k` and `k'` of how askew the sides are over the tags of the picture, as they are and
//! in a copy that is decoded by the usual power, their ink has grown by
//!
//! ```text
//! g = -w m,  w = k / (k - k')
//! ```
//!
//! with `m` the median by which the copy has them lie further to the light: nothing where the light is in proportion as it is, and all where it is
//! so in the copy. What grows in print is not askew.

use super::growth::{Growth, OF_MEDIAN};
use crate::detect::Picture;
use crate::linalg::median;

/// The light is this power of the grey values of most cameras' files.
const POWER: f32 = 2.2;
/// Fewest sides that say anything.
const LEAST_SIDES: usize = 2;
/// A share `w` beyond these is of something else.
const SHARES: (f64, f64) = (-0.5, 1.7);
/// Sigma of `w`: between 0 and 1 it is not quite in proportion to the displacement, and other curves are no power.
const UNLIKE: f64 = 0.1;
/// Sigma of a normal distribution over its median distance from the middle.
const NORMAL_MEDIAN: f64 = 1.4826;

/// A copy of the light, where the picture is encoded by the usual power; `None` of one without a full scale.
pub fn decoded(picture: &Picture) -> Option<Picture> {
    let full = picture.full_scale;
    let light = |v: &f32| full * (v.max(0.0) / full).powf(POWER);
    full.is_finite().then(|| Picture { pixels: picture.pixels.iter().map(light).collect(), ..*picture })
}

/// What a side says.
#[derive(Debug, Clone, Copy)]
pub struct Askew {
    /// How askew its edge is, with the variance, and the same in the decoded copy.
    pub as_is: (f64, f64),
    pub decoded: (f64, f64),
    /// How far it lies to the light there, px.
    pub moved_px: f64,
}

/// The growth of ink that the sides of a picture say.
pub fn growth(sides: &[Askew]) -> Option<Growth> {
    if sides.len() < LEAST_SIDES {
        return None;
    }
    let (k, of_k) = middle(sides.iter().map(|s| s.as_is))?;
    let (decoded, of_decoded) = middle(sides.iter().map(|s| s.decoded))?;
    let (moved, of_moved) = middle(sides.iter().map(|s| (s.moved_px, 0.0)))?;
    let apart = k - decoded;
    let share = k / apart;
    let of_share = ((1.0 - share).powi(2) * of_k + share * share * of_decoded) / (apart * apart) + UNLIKE * UNLIKE;
    let variance = of_share * moved * moved + share * share * of_moved;
    let is_known = (SHARES.0..SHARES.1).contains(&share) && variance.is_finite() && variance > 0.0;
    is_known.then_some(Growth { px: -share * moved, variance })
}

/// Median of values with variances, and its own.
fn middle(values: impl Iterator<Item = (f64, f64)> + Clone) -> Option<(f64, f64)> {
    let n = values.clone().count() as f64;
    let middle = median(values.clone().map(|(v, _)| v))?;
    let apart = NORMAL_MEDIAN * median(values.clone().map(|(v, _)| (v - middle).abs()))?;
    let own = values.map(|(_, variance)| variance).sum::<f64>() / n;
    Some((middle, OF_MEDIAN * (apart * apart).max(own) / n))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// In proportion as it is, in the copy, half way between, and beside all of that.
    #[test]
    fn the_growth_is_where_edges_are_not_askew() {
        let of = |as_is: f64, decoded: f64| {
            let side = Askew { as_is: (as_is, 1e-6), decoded: (decoded, 1e-6), moved_px: 0.4 };
            growth(&[side; 20])
        };
        for (as_is, decoded, px) in [(0.0, 0.03, 0.0), (-0.04, 0.0, -0.4), (-0.02, 0.02, -0.2)] {
            let told = of(as_is, decoded).unwrap();
            assert!((told.px - px).abs() < 1e-9 && (0.04..0.05).contains(&told.variance.sqrt()), "{told:?}");
        }
        assert!(of(0.05, 0.03).is_none() && of(0.01, 0.01).is_none() && growth(&[]).is_none());
    }
}
