//! Predicted markers measured together: from the pixels of each the ink of the others is taken off.
//!
//! Where the paper between two markers is narrow against the blur, neither is measured well without the other. They are
//! measured one by one, each with the contours of the others as they are believed to be: first as predicted, then as
//! measured. That is Gauss and Seidel's iteration on the least squares of all of them; ink at a distance of `g` blurs
//! carries an error over by its part `exp(-g^2 / 2)`, so that a few rounds are enough.

use super::measure::{Camera, INK_SLOPE, ink_slope};
use super::predicted::{Predicted, Surroundings};
use super::rescue::{CROWDED, WITHIN_REACH};
use crate::detect::Picture;
use crate::detect::circles::candidates::levels::noise_of;
use crate::detect::circles::edge::model::Pixels;
use crate::detect::circles::edge::nearby_ink::NearbyInk;
use crate::detect::circles::edge::refine::Fit;
use crate::detect::circles::types::Measured;
use crate::detect::correlated::Correlation;
use crate::linalg::median;

/// Most rounds, and the movement of the centres from one to the next at which they rest, px.
const ROUNDS: usize = 20;
const AT_REST_PX: f64 = 5e-4;
/// Smallest minor semi-axis of a marker that is measured beside others, and of one in a picture without any that are larger, px.
const SMALLEST_PX: [f64; 2] = [2.5, 1.5];
/// Blur to start from where nothing is known of it, px.
const USUAL_BLUR_PX: f64 = 1.0;

/// Measures predicted markers beside those that are `known`; `None` for those that do not look as predicted, or lie so close to
/// such a one that nobody can say what ink reaches them.
pub(super) fn measure_beside(
    picture: &Picture,
    camera: Camera,
    known: &[Measured],
    predicted: &[Predicted],
) -> Vec<Option<Fit>> {
    let mut all = Overlapping::of(picture, camera, SMALLEST_PX[0], known, predicted);
    all.settle(false);
    all.finish()
}

/// The same in a picture of which nothing is known: blur and the evenness of the ink are learned from the markers, too.
pub(super) fn measure_alone(picture: &Picture, predicted: &[Predicted]) -> Vec<Option<Fit>> {
    let variance = f64::from(noise_of(picture)).powi(2);
    let camera =
        Camera { blur_px: USUAL_BLUR_PX, noise: [variance; 2], correlation: Correlation::WHITE, ink_slope: INK_SLOPE };
    let mut first = Overlapping::of(picture, camera, SMALLEST_PX[1], &[], predicted);
    first.settle(true);
    let fits: Vec<Fit> = first.fits.iter().flatten().copied().collect();
    let camera = Camera { ink_slope: ink_slope(&fits), ..first.camera };
    let mut all = Overlapping::of(picture, camera, SMALLEST_PX[1], &[], predicted);
    (all.believed, all.fits) = (first.believed, first.fits);
    all.settle(true);
    all.finish()
}

struct Overlapping<'a> {
    picture: &'a Picture,
    camera: Camera,
    predicted: &'a [Predicted],
    /// Number of the known ones, which come first in `believed`.
    known: usize,
    believed: Vec<Measured>,
    /// Which of the predicted ones are looked at.
    inside: Vec<bool>,
    neighbours: Vec<Neighbours>,
    fits: Vec<Option<Fit>>,
    pixels: Pixels,
}

impl<'a> Overlapping<'a> {
    fn of(
        picture: &'a Picture,
        camera: Camera,
        smallest_px: f64,
        known: &[Measured],
        predicted: &'a [Predicted],
    ) -> Self {
        let mut believed: Vec<Measured> = known.to_vec();
        believed.extend(predicted.iter().map(|p| p.presumed(picture, &camera)));
        let inside: Vec<bool> = predicted.iter().map(|p| p.is_in(picture, smallest_px)).collect();
        let count = known.len();
        let around = |k: usize| Neighbours::of(count + k, &believed, camera.blur_px);
        let neighbours = (0..predicted.len()).map(around).collect();
        let (fits, pixels) = (vec![None; predicted.len()], Pixels::default());
        lend_light(&mut believed, |j| j < count || inside[j - count]);
        Self { picture, camera, predicted, known: count, believed, inside, neighbours, fits, pixels }
    }

    /// Rounds until the centres rest; the blur is taken from the markers where it is to be learned.
    fn settle(&mut self, learn: bool) {
        for round in 0..ROUNDS {
            let mut moved: f64 = 0.0;
            for k in 0..self.predicted.len() {
                let alone = self.neighbours[k].close.is_empty() && !learn;
                if self.inside[k] && (round == 0 || !alone) {
                    moved = moved.max(self.measure(k));
                }
            }
            let blur_px = median(self.fits.iter().flatten().map(|f| f.measured.blur_px));
            if let Some(blur_px) = blur_px.filter(|blur| learn && blur.is_finite()) {
                self.camera.blur_px = blur_px;
                let around = |k: usize| Neighbours::of(self.known + k, &self.believed, blur_px);
                self.neighbours = (0..self.predicted.len()).map(around).collect();
            }
            let (known, fits) = (self.known, &self.fits);
            lend_light(&mut self.believed, |j| j < known || fits[j - known].is_some());
            if moved < AT_REST_PX {
                break;
            }
        }
    }

    /// One marker with the others as they are believed to be; how far its centre has moved, px.
    fn measure(&mut self, k: usize) -> f64 {
        let (own, believed) = (self.known + k, &self.believed);
        let nearby: Vec<NearbyInk> = self.neighbours[k].reaching().flat_map(|j| NearbyInk::of(&believed[j])).collect();
        let surroundings = Surroundings { nearby: &nearby, believed: &believed[own] };
        let fit = self.predicted[k].measure_among(self.picture, &self.camera, &surroundings, &mut self.pixels).ok();
        let measured = fit.map_or(believed[own], |f| f.measured);
        let [now, before] = [&measured, &believed[own]].map(|m| m.outer.ellipse.centre);
        (self.fits[k], self.believed[own]) = (fit, measured);
        (now[0] - before[0]).hypot(now[1] - before[1])
    }

    fn finish(mut self) -> Vec<Option<Fit>> {
        for (fit, p) in self.fits.iter_mut().zip(self.predicted) {
            *fit = fit.take().filter(|f| p.credible(f, &self.camera).is_ok());
        }
        let (known, fits, inside) = (self.known, &self.fits, &self.inside);
        let certain = |j: &usize| j.checked_sub(known).is_none_or(|j| fits[j].is_some() || !inside[j]);
        let one = |(fit, n): (&Option<Fit>, &Neighbours)| fit.filter(|_| n.close.iter().all(certain));
        fits.iter().zip(&self.neighbours).map(one).collect()
    }
}

/// Light and blur for the markers of which nothing is seen: those of the nearest one that is `lit`.
fn lend_light(believed: &mut [Measured], lit: impl Fn(usize) -> bool) {
    let lenders: Vec<Measured> = (0..believed.len()).filter(|&j| lit(j)).map(|j| believed[j]).collect();
    let centre = |m: &Measured| m.outer.ellipse.centre;
    for m in believed.iter_mut().enumerate().filter(|(j, _)| !lit(*j)).map(|(_, m)| m) {
        let far = |l: &Measured| (0..2).map(|a| (centre(l)[a] - centre(m)[a]).powi(2)).sum::<f64>();
        if let Some(near) = lenders.iter().min_by(|a, b| far(a).total_cmp(&far(b))) {
            (m.paper, m.ink, m.blur_px) = (near.paper, near.ink, near.blur_px);
        }
    }
}

/// The markers whose ink reaches the pixels of one, by index.
struct Neighbours {
    /// Their ink reaches its edge.
    close: Vec<usize>,
    /// Their ink reaches none but its outermost pixels.
    farther: Vec<usize>,
}

impl Neighbours {
    fn of(own: usize, all: &[Measured], blur_px: f64) -> Self {
        let ellipse = all[own].outer.ellipse;
        let (mut close, mut farther) = (Vec::new(), Vec::new());
        for (j, other) in all.iter().enumerate().filter(|(j, _)| *j != own) {
            let other = &other.outer.ellipse;
            let gap = ellipse.gap(other.centre, other.mean_radius() / ellipse.mean_radius());
            if gap < CROWDED * blur_px {
                close.push(j);
            } else if gap < WITHIN_REACH * blur_px {
                farther.push(j);
            }
        }
        Self { close, farther }
    }

    /// Those to be taken off; none where the pixels can be chosen so that none reaches them.
    fn reaching(&self) -> impl Iterator<Item = usize> {
        let crowded = !self.close.is_empty();
        self.close.iter().chain(&self.farther).copied().filter(move |_| crowded)
    }
}
