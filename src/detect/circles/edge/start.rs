//! What a fit of one marker begins with.

use super::nearby_ink::NearbyInk;
use crate::detect::circles::ellipse::Ellipse;
use crate::detect::correlated::Correlation;

/// Where to start and what to assume.
#[derive(Debug, Clone, Copy)]
pub struct Start<'a> {
    pub ellipse: Ellipse,
    /// Inner over outer radius of an annulus.
    pub ratio: Option<f64>,
    pub paper: f64,
    pub ink: f64,
    pub blur_px: f64,
    /// Prior sigma of ln blur.
    pub blur_sigma: f64,
    /// Prior sigma of the relative shape, where the ellipse is a prediction.
    pub shape_sigma: Option<f64>,
    /// Relative radius that stays clear of other markers.
    pub clear: f64,
    /// Variance of a pixel on paper and on ink, counts^2.
    pub noise: [f64; 2],
    /// Of the noise of neighbouring pixels.
    pub correlation: Correlation,
    /// Prior sigma of the ink's own gradient as a share of the contrast, 1/px.
    pub ink_slope: f64,
    /// Centre of the inner circle less that of the outer one, px.
    pub apart: [f64; 2],
    /// Third harmonic of the contours, where it is predicted.
    pub third: Option<[f64; 2]>,
    /// How well `apart` is known per axis, px, where geometry tells it.
    pub tie_sigma: Option<f64>,
    /// Measured neighbours whose ink reaches the pixels of this marker.
    pub nearby: &'a [NearbyInk],
    pub descent: Descent,
}

/// How a fit begins.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Descent {
    /// With whole steps: from near the end.
    Whole,
    /// With steps that are damped until each lessens the cost.
    Damped,
}
