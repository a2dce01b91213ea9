//! What the bands of all markers of a picture tell of its noise.

use crate::detect::Picture;
use crate::detect::circles::edge::model::Pixels;
use crate::detect::circles::edge::noise::{OfCentres, left, left_and_followed};
use crate::detect::circles::edge::refine::Fit;
use crate::detect::correlated::{Correlation, LagProducts, OddPart};
use crate::detect::pictures::few_levels::few_levels;
use crate::linalg::median;

/// A marker that fits so many times worse than usual, as a square, tells of something else than noise.
const DISTURBED: f64 = 3.0;
/// Markers that are enough, and pixels of their edges.
const ENOUGH: f64 = 32.0;
const LEAST_PIXELS: f64 = 1000.0;
/// How far pixels may lie from opposite each other, half px: where there are many markers, and at most.
const ASTRAY: (f64, f64) = (0.25, 0.5);
/// Markers whose response to noise is computed, at most: they are much alike.
const RESPONSES: f64 = 4.0;

/// Bands of markers that were fitted for white noise.
pub(in crate::detect::circles) struct Bands {
    is_known: bool,
    astray: f64,
    /// Of how many markers that are taken one has its response computed.
    stride: usize,
    /// Of every marker, in their order.
    influences: Vec<Option<OfCentres>>,
    /// Of those that are taken: how badly they fit, and what they leave.
    left: Vec<(f64, LagProducts)>,
    parts: Vec<(f64, OddPart)>,
}

impl Bands {
    /// For so many markers. The noise of a smoothed picture is known from what it was smoothed by, and in one of few grey levels what rounding adds
    /// is known.
    pub fn of(picture: &Picture, markers: usize) -> Self {
        let is_known = picture.full_scale.is_infinite() || few_levels(picture).is_some();
        let markers = markers as f64;
        // Both coordinates are even over the range.
        let astray = (ASTRAY.1 * (ENOUGH / markers).sqrt()).clamp(ASTRAY.0, ASTRAY.1);
        let taken = markers * (astray / ASTRAY.1).powi(2);
        let stride = (taken / RESPONSES).ceil().max(1.0) as usize;
        Self { is_known, astray, stride, influences: Vec::new(), left: Vec::new(), parts: Vec::new() }
    }

    /// Takes the next marker, whose fit ended on these pixels.
    pub fn take(&mut self, fit: &Fit, pixels: &Pixels) {
        if self.is_known {
            return;
        }
        let solved = pixels.solved.as_ref();
        self.influences.push(solved.map(|solved| OfCentres::of(solved, pixels)));
        let far = |c: f64| (2.0 * c - (2.0 * c).round()).abs() > self.astray;
        let Some(solved) = solved.filter(|_| !fit.measured.outer.ellipse.centre.into_iter().any(far)) else { return };
        let mut seen = LagProducts::NOTHING;
        if self.left.len().is_multiple_of(self.stride) {
            let Some(part) = left_and_followed(solved, pixels) else { return };
            part.add_to(&mut seen, 1.0);
            self.parts.push((fit.misfit, part));
        } else {
            left(solved, pixels).add_to(&mut seen, 1.0);
        }
        self.left.push((fit.misfit, seen));
    }

    /// Of the noise of neighbouring pixels.
    pub fn correlation(&self) -> Correlation {
        if self.is_known {
            return Correlation::WHITE;
        }
        let most = DISTURBED * median(self.left.iter().map(|(misfit, _)| *misfit)).unwrap_or(0.0);
        let mut sums = LagProducts::NOTHING;
        self.left.iter().filter(|(misfit, _)| *misfit <= most).for_each(|(_, seen)| sums.add(seen));
        let parts = || self.parts.iter().filter(|(misfit, _)| *misfit <= most).map(|(_, part)| part);
        if sums.pixels() < LEAST_PIXELS || sums.is_white(parts()) {
            return Correlation::WHITE;
        }
        sums.unfollowed(parts(), &Correlation::WHITE).map_or(Correlation::WHITE, |found| found.shrunk())
    }

    /// States the covariances of all markers, in their order.
    pub fn state<'a>(&self, correlation: &Correlation, fits: impl Iterator<Item = &'a mut Fit>) {
        if *correlation == Correlation::WHITE {
            return;
        }
        let known = fits.zip(&self.influences).filter_map(|(fit, of)| Some((fit, of.as_ref()?)));
        known.for_each(|(fit, of)| fit.state(of, correlation));
    }
}
