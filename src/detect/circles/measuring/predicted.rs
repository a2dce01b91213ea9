//! Markers whose image is predicted: by their neighbours, or by a camera and a pose after a first solve.

use super::agreement::centroid;
use super::measure::{Camera, Target};
use super::rescue::{is_thin, tie_sigma};
use crate::detect::Picture;
use crate::detect::circles::candidates::candidate::Profile;
use crate::detect::circles::edge::model::Pixels;
use crate::detect::circles::edge::nearby_ink::NearbyInk;
use crate::detect::circles::edge::refine::{Fit, refine};
use crate::detect::circles::edge::start::Start;
use crate::detect::circles::ellipse::Ellipse;
use crate::detect::circles::types::{Found, Imaged, Measured, Reason};
use crate::series::{Edge, Marker};

/// A marker whose image is predicted.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Predicted {
    /// Identity.
    pub marker: u32,
    /// Area centroid and ellipse of the outer circle's image.
    pub outer: Ellipse,
    /// Inner over outer radius; `None` for a disc.
    pub ratio: Option<f64>,
    /// Relative standard deviation of the predicted semi-axes.
    pub shape_sigma: f64,
    /// Relative radius (1 is the outer contour) out to which no other ink lies.
    pub clear: f64,
    /// Centroid of the inner circle less that of the outer one, px.
    pub apart: [f64; 2],
    /// Third harmonic of the contour in the frame where the ellipse is the unit circle.
    pub third: Option<[f64; 2]>,
    /// Rms of what is left of the contour beside ellipse and third harmonic, px.
    pub rest_px: f64,
}

/// What is known of the surroundings of a predicted marker.
pub struct Surroundings<'a> {
    /// Contours of neighbours whose ink reaches its pixels.
    pub nearby: &'a [NearbyInk],
    /// Its centre and the light as they are believed to be.
    pub believed: &'a Measured,
}

/// Relative sigma of a shape that the neighbours predict, and of one that camera and pose predict.
const BY_NEIGHBOURS: f64 = 0.05;
const BY_CAMERA: f64 = 0.01;
/// How well the blur of the picture is that of a marker (of its logarithm).
const BLUR_SIGMA: f64 = 0.2;
/// Samples of a contour.
const RING: usize = 24;
/// Part of its band that a marker must have in the picture, where camera and pose tell its shape.
const ENOUGH: f64 = 0.4;

impl Predicted {
    /// A marker whose neighbours tell where it is.
    pub(in crate::detect::circles) fn at(marker: u32, outer: Ellipse, ratio: Option<f64>, clear: f64) -> Self {
        Self { marker, outer, ratio, shape_sigma: BY_NEIGHBOURS, clear, apart: [0.0; 2], third: None, rest_px: 0.0 }
    }

    /// The image of a marker by a map from the plate around its centre (m) to the picture (px). Nearest other ink lies
    /// `free_m` from the centre. `None` where the map does not reach.
    pub fn by_map(marker: &Marker, free_m: f64, map: impl Fn([f64; 2]) -> Option<[f64; 2]>) -> Option<Self> {
        let radius = marker.outer_radius_m;
        let step = std::f64::consts::TAU / RING as f64;
        let on_ring = |k: usize| map([radius * (k as f64 * step).cos(), radius * (k as f64 * step).sin()]);
        let ring: Vec<[f64; 2]> = (0..RING).map(on_ring).collect::<Option<_>>()?;
        let origin = ring[0];
        let near: Vec<[f32; 2]> = ring.iter().map(|p| [0, 1].map(|a| (p[a] - origin[a]) as f32)).collect();
        let centre = centroid(&map, radius)?;
        let outer = Ellipse { centre, ..Ellipse::fit(&near)? };
        let inner = (marker.inner_radius_m > 0.0).then_some(marker.inner_radius_m);
        let inner_centre = inner.map_or(Some(centre), |r| centroid(&map, r))?;
        let (third, rest) = third_harmonic(&outer, &ring);
        let rest_px = rest * outer.semi_axes()[0];
        Some(Self {
            marker: marker.id,
            outer,
            ratio: inner.map(|r| r / radius),
            shape_sigma: BY_CAMERA,
            clear: free_m / radius,
            apart: [0, 1].map(|a| inner_centre[a] - centre[a]),
            third: Some(third),
            rest_px,
        })
    }

    /// What is believed of the marker before it is measured.
    pub(super) fn presumed(&self, picture: &Picture, camera: &Camera) -> Measured {
        let profile = Profile::of(picture, &self.outer);
        let hole = |k: f64| Ellipse {
            centre: [0, 1].map(|a| self.outer.centre[a] + self.apart[a]),
            shape: self.outer.shape.map(|v| v / (k * k)),
        };
        Measured {
            outer: Imaged { edge: Edge::Outer, ellipse: self.outer, covariance: [0.0; 3] },
            inner: None,
            hole: self.ratio.map(hole),
            blur_px: camera.blur_px,
            paper: f64::from(profile.paper),
            ink: f64::from(profile.ring),
            rms: 0.0,
            gradient: [0.0; 2],
            visible: 0.0,
        }
    }

    /// Measures the marker where it is predicted. The predicted centre may be wrong by about a quarter of a radius; the
    /// shape is held to the prediction, so that a part of the contour determines the centre.
    pub(in crate::detect::circles) fn measure(
        &self,
        picture: &Picture,
        camera: &Camera,
        pixels: &mut Pixels,
    ) -> Result<Fit, Reason> {
        let believed = self.presumed(picture, camera);
        let surroundings = Surroundings { nearby: &[], believed: &believed };
        let fit = self.measure_among(picture, camera, &surroundings, pixels)?;
        self.credible(&fit, camera)?;
        Ok(fit)
    }

    /// The same with what is known of the surroundings, whether it is credible or not.
    pub(super) fn measure_among(
        &self,
        picture: &Picture,
        camera: &Camera,
        surroundings: &Surroundings,
        pixels: &mut Pixels,
    ) -> Result<Fit, Reason> {
        let profile = Profile::of(picture, &self.outer);
        if profile.paper - profile.ring <= 0.1 * profile.paper {
            return Err(Reason::LowContrast);
        }
        let light = surroundings.believed;
        let target = Target {
            ellipse: Ellipse { centre: light.outer.ellipse.centre, ..self.outer },
            ratio: self.ratio,
            paper: light.paper,
            ink: light.ink,
            clear: self.clear,
            shape_sigma: Some(self.shape_sigma),
        };
        let [major, minor] = self.outer.semi_axes();
        let thin = self.third.is_some() && self.ratio.is_some_and(|k| is_thin(k, minor, camera.blur_px));
        let start = Start {
            apart: self.apart,
            third: self.third,
            tie_sigma: thin.then(|| tie_sigma(self.apart, major)),
            nearby: surroundings.nearby,
            ..target.start(camera, BLUR_SIGMA)
        };
        refine(picture, &start, pixels)
    }

    /// It must look as predicted, size and place, and leave no more than noise: with its shape held, something that
    /// touches it from the side moves its centre without making it look wrong.
    pub(super) fn credible(&self, fit: &Fit, camera: &Camera) -> Result<(), Reason> {
        let m = &fit.measured;
        let off = self.outer.relative_radius(m.outer.ellipse.centre);
        let size = (m.outer.ellipse.mean_radius() / self.outer.mean_radius()).ln().abs();
        if off > 0.4 || size > 0.12 {
            return Err(Reason::OutOfPlace);
        }
        let is_noise = m.rms.powi(2) < 2.0 * camera.noise[0] + (0.02 * (m.paper - m.ink)).powi(2);
        if is_noise { Ok(()) } else { Err(Reason::EdgeModel) }
    }

    /// A place in the picture is that of this marker.
    pub(in crate::detect::circles) fn lies_at(&self, uv: [f64; 2]) -> bool {
        self.outer.relative_radius(uv) < 0.5
    }

    /// What the model lacks of a contour moves the centroid where a part `f` of it is missing: the mean over the rest of
    /// something that is zero in the mean over all, with the rms `r`, is at most `r sqrt(f) / (1 - f)` (Cauchy and Schwarz).
    fn allow_for_rest(&self, measured: &mut Measured) {
        let missing = (1.0 - measured.visible).clamp(0.0, 0.9);
        let variance = self.rest_px.powi(2) * missing / (1.0 - missing).powi(2);
        for edge in std::iter::once(&mut measured.outer).chain(&mut measured.inner) {
            edge.covariance[0] += variance;
            edge.covariance[2] += variance;
        }
    }

    /// The centres of inner and outer edge are as far apart as predicted, within four sigma of measurement and
    /// prediction.
    fn edges_agree(&self, fit: &Fit) -> bool {
        let Some(inner) = &fit.measured.inner else { return true };
        let outer = &fit.measured.outer;
        let predicted = tie_sigma(self.apart, self.outer.semi_axes()[0]);
        (0..2).all(|a| {
            let variance =
                outer.covariance[2 * a] + inner.covariance[2 * a] - 2.0 * fit.cross[a] + predicted * predicted;
            let off = inner.ellipse.centre[a] - outer.ellipse.centre[a] - self.apart[a];
            off * off < 16.0 * variance
        })
    }

    /// What is kept of a fit: enough of the marker was seen, and its edges are where they are predicted.
    pub(super) fn accepted(&self, mut fit: Fit) -> Option<Found> {
        self.allow_for_rest(&mut fit.measured);
        let sound = fit.measured.visible >= ENOUGH && self.edges_agree(&fit);
        sound.then_some(Found { marker: self.marker, measured: fit.measured, rescued: true })
    }

    /// So much of the marker is in the picture that a look is worth it: its centre, and room for a part of its contour.
    pub(super) fn is_in(&self, picture: &Picture, smallest_px: f64) -> bool {
        let size = [picture.width as f64, picture.height as f64];
        let [major, minor] = self.outer.semi_axes();
        let inside = (0..2).all(|a| self.outer.centre[a] > 0.0 && self.outer.centre[a] < size[a] - 1.0);
        inside && minor > smallest_px && major < 0.25 * size[0]
    }
}

/// `(a3, b3)` of a contour beside its ellipse, and the rms of what is left, in units of the radius.
fn third_harmonic(ellipse: &Ellipse, ring: &[[f64; 2]]) -> ([f64; 2], f64) {
    let n = ellipse.normaliser();
    let polar = |p: &[f64; 2]| {
        let d = [0, 1].map(|a| p[a] - ellipse.centre[a]);
        let w = n.map(|row| row[0] * d[0] + row[1] * d[1]);
        let (sin, cos) = (3.0 * w[1].atan2(w[0])).sin_cos();
        (w[0].hypot(w[1]) - 1.0, cos, sin)
    };
    let polar: Vec<(f64, f64, f64)> = ring.iter().map(polar).collect();
    let mean = |value: &dyn Fn(&(f64, f64, f64)) -> f64| polar.iter().map(value).sum::<f64>() / ring.len() as f64;
    let third = [2.0 * mean(&|(h, cos, _)| h * cos), 2.0 * mean(&|(h, _, sin)| h * sin)];
    let rest = mean(&|(h, cos, sin)| (h - third[0] * cos - third[1] * sin).powi(2)).sqrt();
    (third, rest)
}
