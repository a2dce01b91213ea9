//! How the edges of a picture look, and the picture made ready for the fit by it.
//!
//! The area of a pixel blurs an edge by 0.29 px, and the best optics by a quarter of a pixel more: 0.38 px together. A picture with
//! steeper edges was sharpened, or taken apart and put together by a codec. What such an edge looks like in its samples depends on where in
//! a pixel it lies. Such a picture is smoothed first, which adds a known blur and takes away what lies beyond the sampling limit.

use super::fit::{Bend, Look, Saddle, Seed, Window, refine};
use super::lattice::Lattice;
use super::neighbours::{REACH, bend, bent_seed, is_in_line, seed};
use super::refusal::Refusal;
use super::smooth::Source;
use crate::detect::Picture;
use crate::linalg::median;

/// Corners that say how the edges look, at most.
const SAMPLES: usize = 12;
/// Start of the first fits, before the look of the edges is known.
const START: Look = Look { blur_px: 1.2, halo: true };
/// Edges steeper than those of this blur are smoothed first, px ...
const LEAST_BLUR_PX: f64 = 0.38;
/// ... where these are a greater share of the corners ...
const STEEP_SHARE: f64 = 0.1;
/// ... by this, px.
const SMOOTHING_PX: f64 = 0.7;
/// Edges are bent where this share of them, taken for straight, moves corners by less ...
const BENT_SHARE: f64 = 0.9;
/// ... than so much at most, px.
const BENT_PX: f64 = 0.01;
/// Usual halo above which the model has one, share of the step.
const LEAST_HALO: f64 = 0.1;

/// A picture as the corners are fitted in it.
pub(super) struct Sight<'a> {
    source: Source<'a>,
    window: Window,
    look: Look,
    /// Whether the lens bends the edges of a window.
    is_bent: bool,
}

impl<'a> Sight<'a> {
    /// Looks at some corners of a lattice.
    pub fn of(picture: &'a Picture, lattice: &Lattice, window: Window) -> Self {
        let seeds = samples(lattice);
        let mut sight = Self { source: Source::plain(picture), window, look: START, is_bent: false };
        let fits = sight.sample(&seeds);
        // A corner that cannot be fitted as it is counts as too steep.
        let steep = seeds.len() - fits.iter().filter(|s| !is_steep(s)).count();
        if steep as f64 > STEEP_SHARE * seeds.len() as f64 {
            return sight.smoothed(lattice);
        }
        sight.look = usual(&fits);
        sight
    }

    /// The same picture smoothed.
    pub fn smoothed(self, lattice: &Lattice) -> Self {
        let source = Source::smoothed(self.source.picture(), SMOOTHING_PX);
        let mut sight = Self { source, look: START, ..self };
        sight.look = usual(&sight.sample(&samples(lattice)));
        sight
    }

    /// Takes edges for as bent as the corners show, where that moves corners; whether it does.
    pub fn bend(&mut self, lattice: &Lattice) -> bool {
        let Window { reach, radius_px, .. } = self.window;
        // Taken for straight, an edge lies a third of its sagitta off.
        let moved = |b: Bend| b.curvature.abs() * radius_px.min(reach * b.side[0].hypot(b.side[1])).powi(2) / 6.0;
        let both = |(&key, &uv)| [0, 1].into_iter().filter_map(move |axis| bend(lattice, key, uv, axis));
        let all = lattice.iter().flat_map(both);
        self.is_bent = quantile(all.map(moved), BENT_SHARE).is_some_and(|moved| moved > BENT_PX);
        self.is_bent
    }

    /// Sigma of the smoothing, if any, px.
    pub fn smoothing_px(&self) -> Option<f64> {
        self.source.smoothing_px
    }

    /// Whether a corner whose fit does not converge may do so once the picture is smoothed: it was sharpened.
    pub fn may_be_smoothed(&self) -> bool {
        self.look.halo && self.smoothing_px().is_none()
    }

    /// Whether neighbouring pixels have noise in common: the picture was sharpened or smoothed.
    pub fn has_correlated_noise(&self) -> bool {
        self.look.halo || self.smoothing_px().is_some()
    }

    fn sample(&self, seeds: &[Seed]) -> Vec<Saddle> {
        seeds.iter().filter_map(|seed| self.fit(seed).ok()).collect()
    }

    /// Fits a corner of a lattice, or one that it lacks, by neighbours up to so many squares away.
    pub fn corner(&self, lattice: &Lattice, key: (i32, i32), reach: i32) -> Result<Saddle, Refusal> {
        if !self.is_bent {
            return self.fit(&seed(lattice, key, reach).ok_or(Refusal::NoNeighbours)?);
        }
        let seed = bent_seed(lattice, key, reach).ok_or(Refusal::NoNeighbours)?;
        let mut saddle = self.fit(&seed)?;
        if !lattice.contains_key(&key) {
            // Where it is tells how its edges run.
            saddle = self.fit(&seed.at(lattice, key, saddle.uv))?;
        }
        match is_in_line(lattice, key, saddle.uv) {
            Some(false) => Err(Refusal::OffTheLattice),
            _ => Ok(saddle),
        }
    }

    fn fit(&self, seed: &Seed) -> Result<Saddle, Refusal> {
        let [x, y] = seed.bends.map(|bend| bend.filter(|_| self.is_bent));
        let sides = [x.map_or(seed.sides[0], |bend| bend.side), y.map_or(seed.sides[1], |bend| bend.side)];
        refine(&self.source, &Seed { sides, bends: [x, y], ..*seed }, self.window, self.look)
    }
}

/// Seeds of corners in all parts of a lattice.
fn samples(lattice: &Lattice) -> Vec<Seed> {
    let step = lattice.len().div_ceil(SAMPLES).max(1);
    lattice.keys().step_by(step).filter_map(|&key| seed(lattice, key, REACH)).collect()
}

/// Without a halo, which says that the picture was sharpened, noise alone may have made an edge look steep.
fn is_steep(corner: &Saddle) -> bool {
    let [blur_px, sigma_px] = corner.steepness_px();
    let doubt = if corner.halo > LEAST_HALO { 0.0 } else { sigma_px };
    blur_px + doubt < LEAST_BLUR_PX
}

/// What most fits with a halo show. One of no halo may have come out as one of -1, whose edge has the blur of the halo.
fn usual(fits: &[Saddle]) -> Look {
    let middle = |of: &dyn Fn(&Saddle) -> f64| median(fits.iter().map(of));
    let halo = middle(&|s| s.halo).is_some_and(|halo| halo > LEAST_HALO);
    let blur_px = middle(&|s| if halo { s.blur_px } else { s.steepness_px()[0] });
    Look { blur_px: blur_px.unwrap_or(START.blur_px), halo }
}

/// The value below which a share of the values lies.
pub(in crate::detect) fn quantile(values: impl Iterator<Item = f64>, share: f64) -> Option<f64> {
    let mut sorted: Vec<f64> = values.collect();
    sorted.sort_by(f64::total_cmp);
    sorted.get((share * sorted.len() as f64) as usize).copied()
}
