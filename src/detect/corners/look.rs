//! How the edges of a picture look, and the picture made ready for the fit by it.
//!
//! A Gaussian edge is described by its samples where its blur is half a pixel or more (of the edge's spectrum, less than 1 % lies
//! beyond the sampling limit then). Optics and the area of a pixel together blur more than that or little less; a picture
//! that was sharpened, or taken apart and put together by a codec, does not, and what lies beyond the limit depends on where
//! in a pixel the edge lies. Such a picture is smoothed first, which adds a known blur and takes those parts away.

use std::borrow::Cow;

use super::fit::{Look, Refusal, Saddle, Seed, Window, refine};
use super::smooth::smoothed;
use super::{Lattice, REACH, seed};
use crate::detect::Picture;

/// Corners that say how the edges look, at most.
const SAMPLES: usize = 12;
/// Blur of the starting value, px.
const START_BLUR_PX: f64 = 1.2;
/// Edges steeper than those of this blur are smoothed first, px ...
const LEAST_BLUR_PX: f64 = 0.5;
/// ... where these are a greater share of the corners ...
const STEEP_SHARE: f64 = 0.25;
/// ... by this, px.
const SMOOTHING_PX: f64 = 0.7;
/// Usual halo above which the model has one, share of the step.
const LEAST_HALO: f64 = 0.1;

/// A picture as the corners are fitted in it.
pub(super) struct Sight<'a> {
    picture: Cow<'a, Picture>,
    window: Window,
    look: Look,
    /// Sigma of the smoothing, if any, px.
    pub smoothing_px: Option<f64>,
}

impl<'a> Sight<'a> {
    /// Looks at some corners of a lattice.
    pub fn of(picture: &'a Picture, lattice: &Lattice, window: Window) -> Self {
        let start = Look { blur_px: START_BLUR_PX, halo: true };
        let raw = Self { picture: Cow::Borrowed(picture), window, look: start, smoothing_px: None };
        let step = lattice.len().div_ceil(SAMPLES).max(1);
        let seeds: Vec<Seed> = lattice.keys().step_by(step).filter_map(|&key| seed(lattice, key, REACH)).collect();
        let fits: Vec<Saddle> = seeds.iter().filter_map(|seed| raw.fit(seed).ok()).collect();
        let middle = |of: fn(&Saddle) -> f64| quantile(fits.iter().map(of), 0.5);
        let blur_px = middle(|s| s.blur_px).unwrap_or(START_BLUR_PX);
        let halo = middle(|s| s.halo).is_some_and(|halo| halo > LEAST_HALO);
        // A corner that cannot be fitted as it is counts as too steep.
        let steep = seeds.len() - fits.iter().filter(|s| s.steepness_px() >= LEAST_BLUR_PX).count();
        if (steep as f64) < STEEP_SHARE * seeds.len() as f64 {
            return Self { look: Look { blur_px, halo }, ..raw };
        }
        let picture = smoothed(picture, SMOOTHING_PX);
        let look = Look { blur_px: blur_px.hypot(SMOOTHING_PX), halo };
        Self { picture: Cow::Owned(picture), window, look, smoothing_px: Some(SMOOTHING_PX) }
    }

    /// Fits a corner.
    pub fn fit(&self, seed: &Seed) -> Result<Saddle, Refusal> {
        refine(&self.picture, seed, self.window, self.look)
    }
}

/// The value below which a share of the values lies.
pub(super) fn quantile(values: impl Iterator<Item = f64>, share: f64) -> Option<f64> {
    let mut sorted: Vec<f64> = values.collect();
    sorted.sort_by(f64::total_cmp);
    sorted.get((share * sorted.len() as f64) as usize).copied()
}
