//! Measuring markers whose place is known: all candidates of a picture, or those that someone predicts.

use super::bands::Bands;
use crate::detect::Picture;
use crate::detect::circles::candidates::candidate::{Candidate, candidates, largest_marker};
use crate::detect::circles::candidates::levels::Levels;
use crate::detect::circles::edge::model::Pixels;
use crate::detect::circles::edge::refine::{Fit, refine, refine_steadily};
use crate::detect::circles::edge::start::{Descent, Start};
use crate::detect::circles::ellipse::Ellipse;
use crate::detect::circles::identity::lattice::Buckets;
use crate::detect::circles::types::{DroppedCandidate, Measured, Options, Reason};
use crate::detect::correlated::Correlation;
use crate::linalg::median;

/// Threshold between the envelopes: a little above the middle, where small blurred markers keep their size.
pub const THRESHOLD: f32 = 0.55;

/// What the picture says about blur and noise, from some of its markers.
#[derive(Debug, Clone, Copy)]
pub struct Camera {
    pub blur_px: f64,
    /// Variance of a pixel on paper and on ink, counts^2.
    pub noise: [f64; 2],
    /// Of the noise of neighbouring pixels.
    pub correlation: Correlation,
    /// Typical gradient of the ink beyond its share of the paper's, as a part of the contrast, 1/px.
    pub ink_slope: f64,
}

/// Typical gradient of the ink where nothing is known yet.
pub(super) const INK_SLOPE: f64 = 1e-3;
/// The least that is assumed: a reflection over a few markers must not go unseen.
const LEAST_INK_SLOPE: f64 = 1e-4;

/// A marker to be measured.
#[derive(Debug, Clone, Copy)]
pub struct Target {
    pub ellipse: Ellipse,
    pub ratio: Option<f64>,
    pub paper: f64,
    pub ink: f64,
    pub clear: f64,
    pub shape_sigma: Option<f64>,
}

impl Target {
    pub fn start(&self, camera: &Camera, blur_sigma: f64) -> Start<'static> {
        Start {
            ellipse: self.ellipse,
            ratio: self.ratio,
            paper: self.paper,
            ink: self.ink,
            blur_px: camera.blur_px,
            blur_sigma,
            shape_sigma: self.shape_sigma,
            clear: self.clear,
            noise: camera.noise,
            correlation: camera.correlation,
            ink_slope: camera.ink_slope,
            apart: [0.0; 2],
            third: None,
            tie_sigma: None,
            nearby: &[],
            descent: Descent::Whole,
        }
    }
}

/// How many markers are measured to learn blur and noise.
const LEARNERS: usize = 24;

/// Learns blur and noise from some of the targets, and how far contours lie beside the edges: all of them are moved there.
pub fn learn(picture: &Picture, targets: &mut [Target], guess_blur: f64, noise: f32, pixels: &mut Pixels) -> Camera {
    let variance = f64::from(noise).powi(2);
    let (noise, correlation) = ([variance; 2], Correlation::WHITE);
    let mut camera = Camera { blur_px: guess_blur, noise, correlation, ink_slope: INK_SLOPE };
    let mut beside_px = 0.0;
    for _ in 0..2 {
        camera.ink_slope = INK_SLOPE;
        let stride = targets.len().div_ceil(LEARNERS).max(1);
        let mut look = |fit: fn(&Picture, &Start, &mut Pixels) -> Result<Fit, Reason>| -> (Vec<&Target>, Vec<Fit>) {
            let learners = targets.iter().step_by(stride);
            learners.filter_map(|t| Some((t, fit(picture, &t.start(&camera, 0.7), pixels).ok()?))).unzip()
        };
        let (mut started, mut fits) = look(refine);
        if fits.is_empty() {
            (started, fits) = look(refine_steadily);
        }
        let size = |e: &Ellipse| e.semi_axes().iter().sum::<f64>() / 2.0;
        let beside = started.iter().zip(&fits).map(|(t, f)| size(&f.measured.outer.ellipse) - size(&t.ellipse));
        let (Some(beside), Some(blur)) = (median(beside), median(fits.iter().map(|f| f.measured.blur_px))) else {
            return camera;
        };
        beside_px = beside;
        let settled = (blur / camera.blur_px).ln().abs() < 0.15;
        let noise = [0, 1].map(|side| plain_variance(&fits, side).unwrap_or(variance));
        camera = Camera { blur_px: blur, noise, correlation, ink_slope: ink_slope(&fits) };
        if settled {
            break;
        }
    }
    targets.iter_mut().for_each(|t| t.ellipse = t.ellipse.offset(beside_px).unwrap_or(t.ellipse));
    camera
}

/// Spread of the ink's own gradient over the markers, less what their noise makes of it.
///
/// With a prior of variance `p` and a posterior variance `v` an estimate is the true value times `k = 1 - v / p`, with
/// noise of variance `k v`: its mean square is `k^2 spread^2 + k v`.
pub fn ink_slope(fits: &[Fit]) -> f64 {
    let prior = INK_SLOPE * INK_SLOPE;
    let (mut excess, mut weight) = (0.0, 0.0);
    for (slope, variance) in fits.iter().flat_map(|f| (0..2).map(|a| (f.ink_slope.0[a], f.ink_slope.1[a]))) {
        let share = (1.0 - variance / prior).clamp(0.0, 1.0);
        excess += slope * slope - share * variance;
        weight += share * share;
    }
    if weight <= 0.0 { LEAST_INK_SLOPE } else { (excess / weight).max(0.0).sqrt().clamp(LEAST_INK_SLOPE, 5e-3) }
}

/// Median over markers of the mean square residual on one side of the edge.
fn plain_variance(fits: &[Fit], side: usize) -> Option<f64> {
    let values = fits.iter().map(|f| f.plain[side]).filter(|(_, n)| *n >= 12.0).map(|(sum, n)| sum / n);
    // the levels and gradients of a side take about two degrees of freedom from some hundred pixels: 2 %
    median(values).map(|middle| (1.02 * middle).max(1.0 / 12.0))
}

/// Measures every candidate of a picture without asking which marker it is.
///
/// For plates without a code and for judging the image stage alone. Nothing says which candidates are markers: one that whole steps do not reach
/// is dropped, as damped steps for all letters of a text would take several times as long. Returns the markers in the order of the scan and
/// the candidates that were dropped.
pub fn measure(picture: &Picture, options: &Options) -> (Vec<Measured>, Vec<DroppedCandidate>) {
    let levels = Levels::of(picture, largest_marker(picture, options), THRESHOLD);
    let (candidates, mut dropped) = candidates(picture, &levels, options);
    let index = Buckets::of(&candidates);
    let clear = |i: usize| clear_of(i, &candidates, &index);
    let mut targets: Vec<Target> = candidates.iter().enumerate().map(|(i, c)| target_of(c, None, clear(i))).collect();
    let mut pixels = Pixels::default();
    let guess = median(candidates.iter().map(|c| c.blur_px)).unwrap_or(f64::NAN);
    let camera = learn(picture, &mut targets, guess, levels.noise, &mut pixels);
    let (mut fits, mut bands) = (Vec::new(), Bands::of(picture, targets.len()));
    for target in &targets {
        match refine(picture, &target.start(&camera, 0.3), &mut pixels) {
            Ok(fit) => {
                bands.take(&fit, &pixels);
                fits.push(fit);
            }
            Err(reason) => dropped.push(drop_target(target, reason, None)),
        }
    }
    bands.state(&bands.correlation(), fits.iter_mut());
    (fits.iter().map(|fit| fit.measured).collect(), dropped)
}

/// Relative radius around a candidate out to which there is no other, with room for the blur of its edge.
fn clear_of(i: usize, candidates: &[Candidate], index: &Buckets) -> f64 {
    const FARTHEST: f64 = 3.0;
    let own = &candidates[i];
    let mut clear = FARTHEST;
    index.within(own.ellipse.centre, 2.0 * FARTHEST * own.ellipse.semi_axes()[0], |j| {
        if j != i {
            let other = &candidates[j].ellipse;
            let size = other.mean_radius() / own.ellipse.mean_radius();
            clear = clear.min(own.ellipse.relative_radius(other.centre) - size);
        }
    });
    (clear - 2.1 * own.blur_px / own.ellipse.semi_axes()[1]).max(1.2)
}

/// The target that a candidate makes; `ratio` is that of the plate's marker where it is known.
pub fn target_of(candidate: &Candidate, ratio: Option<f64>, clear: f64) -> Target {
    let seen = candidate.open.then(|| candidate.hole.unwrap_or(0.5).clamp(0.25, 0.85));
    Target {
        ellipse: candidate.ellipse,
        ratio: ratio.or(seen),
        paper: f64::from(candidate.paper),
        ink: f64::from(candidate.ink),
        clear,
        shape_sigma: None,
    }
}

pub fn drop_target(target: &Target, reason: Reason, marker: Option<u32>) -> DroppedCandidate {
    DroppedCandidate { uv: target.ellipse.centre, reason, ellipse: Some(target.ellipse), marker }
}
