//! What the detector is asked and what it answers.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;

use super::drift::Drift;
use super::ellipse::Ellipse;
use crate::detect::correlated::Correlation;
use crate::error::{Code, Notice};
use crate::series::{Edge, Observation};

/// What the detector looks for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Options {
    /// Largest diameter of a marker's image, px; `None`: a fifth of the picture's longer side (20 markers
    /// in view under strong perspective).
    pub largest_marker_px: Option<f64>,
    /// Smallest semi-axis of a marker's image, px.
    pub smallest_semi_axis_px: f64,
    /// Smallest ratio of the semi-axes (0.5 is a tilt of 60 degrees).
    pub smallest_aspect: f64,
    /// Smallest contrast between paper and ink as a fraction of the paper's brightness.
    pub smallest_contrast: f64,
    /// Look again, with the contour predicted from the neighbours, for markers that were missed.
    pub rescue: bool,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            largest_marker_px: None,
            smallest_semi_axis_px: 2.2,
            smallest_aspect: 0.22,
            smallest_contrast: 0.12,
            rescue: true,
        }
    }
}

/// Why a candidate was not used.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[non_exhaustive]
pub enum Reason {
    /// Smaller than the smallest semi-axis.
    TooSmall,
    /// Larger than the largest marker.
    TooLarge,
    /// More elongated than the smallest aspect.
    TooElongated,
    /// The contour is not an ellipse.
    NotAnEllipse,
    /// Too little difference between inside and outside.
    LowContrast,
    /// Cut by the border of the picture.
    CutByBorder,
    /// Too many pixels at the top of the sensor's range.
    Saturated,
    /// Two contours of the same sign inside each other, or a hole that is not concentric.
    Nesting,
    /// Not part of any lattice of markers.
    OffLattice,
    /// Part of a lattice whose position on the plate cannot be told.
    NoIdentity,
    /// On the lattice, but outside the plate.
    OffPlate,
    /// Its class is not the one the plate has in this place.
    WrongClass,
    /// The plate's pattern around it does not agree.
    NeighboursDisagree,
    /// It does not lie where its neighbours say.
    OutOfPlace,
    /// The blurred-edge model does not describe its pixels.
    EdgeModel,
    /// The fit of the blurred-edge model did not converge.
    NoConvergence,
    /// The centres of the inner and the outer edge do not agree.
    InnerOuter,
}

impl Reason {
    /// Short name as written to files.
    pub fn name(self) -> &'static str {
        match self {
            Self::TooSmall => "too small",
            Self::TooLarge => "too large",
            Self::TooElongated => "too elongated",
            Self::NotAnEllipse => "not an ellipse",
            Self::LowContrast => "low contrast",
            Self::CutByBorder => "cut by the border",
            Self::Saturated => "saturated",
            Self::Nesting => "nesting",
            Self::OffLattice => "off the lattice",
            Self::NoIdentity => "no identity",
            Self::OffPlate => "off the plate",
            Self::WrongClass => "wrong class",
            Self::NeighboursDisagree => "neighbours disagree",
            Self::OutOfPlace => "out of place",
            Self::EdgeModel => "edge model",
            Self::NoConvergence => "no convergence",
            Self::InnerOuter => "inner and outer edge disagree",
        }
    }
}

impl fmt::Display for Reason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// A candidate that was not used, where, and why.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DroppedCandidate {
    /// Its place, px.
    pub uv: [f64; 2],
    /// Why.
    pub reason: Reason,
    /// The ellipse of its contour, where one was fitted.
    pub ellipse: Option<Ellipse>,
    /// The marker it would have been, where that is known.
    pub marker: Option<u32>,
}

/// The image of one circle as measured by the blurred-edge model.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Imaged {
    /// Which circle of the marker.
    pub edge: Edge,
    /// Area centroid of the circle's image, with the ellipse of its first two harmonics.
    pub ellipse: Ellipse,
    /// Covariance (uu, uv, vv) of the centroid, px^2.
    pub covariance: [f64; 3],
}

/// The fit of the blurred-edge model to one marker.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Measured {
    /// Outer circle.
    pub outer: Imaged,
    /// Inner circle of an annulus, where it is measured for itself.
    pub inner: Option<Imaged>,
    /// The light middle of an annulus, measured for itself or together with the outer circle.
    pub hole: Option<Ellipse>,
    /// Sigma of the blur (optics and pixel aperture together), px.
    pub blur_px: f64,
    /// Brightness of the paper at the marker, counts.
    pub paper: f64,
    /// Brightness of the ink, counts.
    pub ink: f64,
    /// Rms of the residuals, counts.
    pub rms: f64,
    /// Gradient of the illumination (column, row) as a fraction of the paper's brightness, 1/px.
    pub gradient: [f64; 2],
    /// Part of the wanted pixels that could be used (inside the picture, not saturated).
    pub visible: f64,
}

impl Measured {
    /// Its centres with covariances that are so many times as large, and a systematic error, px per axis, beside.
    pub(in crate::detect) fn widen(&mut self, factor: f64, systematic_px: f64) {
        for imaged in std::iter::once(&mut self.outer).chain(&mut self.inner) {
            let [uu, uv, vv] = imaged.covariance.map(|c| c * factor);
            let floor = systematic_px * systematic_px;
            imaged.covariance = [uu + floor, uv, vv + floor];
        }
    }
}

/// One identified marker.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Found {
    /// Identity.
    pub marker: u32,
    /// Measurement.
    pub measured: Measured,
    /// It was found by looking where its neighbours or a first solve said.
    pub rescued: bool,
}

/// How the identification went.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Outcome {
    /// Markers were identified.
    Identified {
        /// Cells of the lattice that agree with the plate.
        agreeing: usize,
        /// Cells that do not.
        disagreeing: usize,
        /// Disagreements of the next best position on the plate.
        runner_up: usize,
    },
    /// Nothing in the picture looks like a marker.
    NoCandidates,
    /// Markers, but no lattice of them.
    NoLattice,
    /// Too few markers, or too many in doubt, to tell where on the plate they are.
    Ambiguous,
    /// The plate's pattern is there, but left and right are exchanged.
    Mirrored,
}

impl Outcome {
    /// Whether noise or a mosaic of colours may hide the markers.
    pub(super) fn is_unseen(self) -> bool {
        matches!(self, Self::NoCandidates | Self::NoLattice | Self::Ambiguous)
    }

    /// What went wrong and what to try; `None` where markers were identified.
    pub(in crate::detect) fn failure(self) -> Option<(Code, &'static str, &'static str)> {
        match self {
            Self::Identified { .. } => None,
            Self::NoCandidates => {
                Some((Code::PlateNotFound, "nothing looks like a marker", "check focus, exposure and view"))
            }
            Self::NoLattice => {
                Some((Code::PlateNotFound, "markers, but no lattice of them", "bring more of the plate into the view"))
            }
            Self::Ambiguous => Some((
                Code::PlateIncomplete,
                "the place on the plate cannot be told",
                "check that plate.toml is the plate in the picture",
            )),
            Self::Mirrored => Some((
                Code::PlateMirrored,
                "the plate is seen in a mirror: left and right are exchanged",
                "switch off the mirroring in the camera driver, or look at the plate without a mirror",
            )),
        }
    }
}

impl Found {
    /// The observations of the marker: outer, then inner.
    pub(super) fn observations(&self) -> Vec<Observation> {
        let one = |imaged: &Imaged| Observation {
            marker: self.marker,
            edge: imaged.edge,
            uv: imaged.ellipse.centre,
            covariance: Some(imaged.covariance),
        };
        let inner = self.measured.inner.as_ref().filter(|i| i.edge == Edge::Inner);
        std::iter::once(&self.measured.outer).chain(inner).map(one).collect()
    }
}

/// What was found in one picture.
#[derive(Debug, Clone, PartialEq)]
pub struct CircleDetection {
    /// Identified contours ordered by marker and edge; `uv` is the area centroid of the contour's image.
    pub observations: Vec<Observation>,
    /// The same markers with all that was measured.
    pub found: Vec<Found>,
    /// Candidates that were not used.
    pub dropped: Vec<DroppedCandidate>,
    /// How the identification went.
    pub outcome: Outcome,
    /// Median blur, px; NaN without markers.
    pub blur_px: f64,
    /// Noise of a pixel on paper and on ink, counts.
    pub noise: [f64; 2],
    /// Of the noise of neighbouring pixels.
    pub correlation: Correlation,
    /// Mean difference inner - outer centre that geometry does not explain, with its standard error, px;
    /// coma of the lens or motion with a changing speed shows here.
    pub inner_outer: Option<InnerOuter>,
    /// By how much lopsided edges displace the centres; not taken off.
    pub lopsided: Option<Drift>,
    /// Markers that were lost as they are, and measured in a smoothed copy of the picture.
    pub smoothed: usize,
}

/// A marker that is as near as this to a lost one is the same, px.
const SAME_PLACE_PX: f64 = 2.0;
/// Share of the identified markers that is many.
const MANY_CLIPPED: f64 = 0.1;
/// Clipped edges, and those that are no blurred steps.
const SPOILT: [Reason; 3] = [Reason::Saturated, Reason::EdgeModel, Reason::NoConvergence];

impl CircleDetection {
    /// Number of dropped candidates for every reason.
    pub fn dropped_counts(&self) -> BTreeMap<Reason, usize> {
        let mut counts = BTreeMap::new();
        for d in &self.dropped {
            *counts.entry(d.reason).or_insert(0) += 1;
        }
        counts
    }

    /// What went wrong and what to try; `None` where markers were measured.
    pub(in crate::detect) fn failure(&self) -> Option<(Code, String, &'static str)> {
        if let Some((code, what, remedy)) = self.outcome.failure() {
            return Some((code, what.to_owned(), remedy));
        }
        let (what, remedy) = self.found.is_empty().then(|| {
            let others =
                || ("no marker that is identified can be measured".to_owned(), "bring more of the plate into the view");
            self.spoilt_edges().unwrap_or_else(others)
        })?;
        Some((Code::MarkersUnmeasured, what, remedy))
    }

    /// For which reasons so many markers are lost that they are looked for in a smoothed copy of the picture: what hides single ones
    /// among them is no reason.
    pub(super) fn spoilt_by(&self) -> &'static [Reason] {
        let clipped = self.dropped.iter().filter(|d| d.marker.is_some() && d.reason == Reason::Saturated).count();
        let many = clipped > 0 && clipped as f64 >= MANY_CLIPPED * (clipped + self.found.len()) as f64;
        match self.spoilt_edges() {
            Some(_) => &SPOILT,
            None if many => &SPOILT[..1],
            None => &[],
        }
    }

    /// Takes the markers that were identified and lost for these reasons from what was found at their places in a smoothed copy of the
    /// picture.
    pub(super) fn complete(&mut self, smoothed: Self, reasons: &[Reason]) {
        let lost = self.dropped.iter().filter(|d| reasons.contains(&d.reason));
        let lost: BTreeMap<u32, [f64; 2]> = lost.filter_map(|d| Some((d.marker?, d.uv))).collect();
        let is_lost = |f: &Found| {
            let centre = f.measured.outer.ellipse.centre;
            lost.get(&f.marker).is_some_and(|uv| (uv[0] - centre[0]).hypot(uv[1] - centre[1]) < SAME_PLACE_PX)
        };
        if self.found.is_empty() {
            (self.blur_px, self.noise, self.correlation) = (smoothed.blur_px, smoothed.noise, smoothed.correlation);
        }
        let before = self.found.len();
        self.found.extend(smoothed.found.into_iter().filter(is_lost));
        self.found.sort_by_key(|f| f.marker);
        self.found.dedup_by_key(|f| f.marker);
        self.smoothed += self.found.len() - before;
        let found: BTreeSet<u32> = self.found.iter().map(|f| f.marker).collect();
        self.dropped.retain(|d| d.marker.is_none_or(|marker| !found.contains(&marker)));
        self.observations = self.found.iter().flat_map(Found::observations).collect();
    }

    /// Why most of the markers that are identified cannot be measured, where their edges are no blurred steps, and what to try.
    pub(in crate::detect) fn spoilt_edges(&self) -> Option<(String, &'static str)> {
        let count =
            |of: &[Reason]| self.dropped.iter().filter(|d| d.marker.is_some() && of.contains(&d.reason)).count();
        let (clipped, edges) = (count(&[Reason::Saturated]), count(&[Reason::EdgeModel, Reason::NoConvergence]));
        let (lost, all) = (clipped + edges, clipped + edges + self.found.len());
        if lost <= self.found.len() {
            return None;
        }
        Some(if clipped >= edges {
            (
                format!("{lost} of {all} identified markers are saturated: the paper is overexposed"),
                "expose for less time or with less gain or light, so that the paper stays below full scale",
            )
        } else {
            (
                format!(
                    "{lost} of {all} identified markers have edges that no blur explains: strong JPEG compression, sharpening or motion"
                ),
                "store images as PNG, or as JPEG of quality 50 or more; switch off sharpening, and see that nothing moves",
            )
        })
    }

    /// The reasons of the dropped candidates in words, in brackets; nothing where there are none.
    pub(in crate::detect) fn dropped_summary(&self) -> String {
        let counts = self.dropped_counts();
        if counts.is_empty() {
            return String::new();
        }
        let parts: Vec<String> = counts.iter().map(|(reason, n)| format!("{n} {reason}")).collect();
        format!(" (candidates dropped: {})", parts.join(", "))
    }
}

/// Mean unexplained difference between the centres of inner and outer circles.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct InnerOuter {
    /// The difference over the picture.
    pub drift: Drift,
    /// Mean size of the difference that perspective and distortion explain, px.
    pub explained_px: f64,
    /// Number of annuli.
    pub count: usize,
}

impl InnerOuter {
    /// The mean difference is significant (4 sigma), larger than 0.005 px, and larger than a twentieth of what geometry explains
    /// (which is not explained better than that): the point spread is asymmetric. The standard error holds how well each difference is
    /// explained. The part along the radius does not count: close and wide views leave some of it, because the map around a marker
    /// knows nothing of the third order of the lens.
    pub fn asymmetric(&self) -> bool {
        self.drift.mean_exceeds(0.005_f64.max(0.05 * self.explained_px))
    }

    pub(in crate::detect) fn notice(&self) -> Notice {
        let [u, v] = self.drift.mean_px;
        let what = format!(
            "inner and outer circles are off by ({u:.4}, {v:.4}) px on the mean of {} annuli: the blur is asymmetric",
            self.count
        );
        Notice::new(
            Code::BlurAsymmetric,
            "image",
            what,
            "look for coma (stop the lens down) or motion during the exposure",
        )
    }
}

/// Displacement by lopsided edges from which on it is told, px. The edges tell some 40 % of what coma displaces the worst
/// marker by, so that this stands for 0.003 px.
pub const LOPSIDED_PX: f64 = 0.0012;
