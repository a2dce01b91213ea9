//! What a detector hands back for one image.

use super::circles::{self, Correlation, Drift, Ellipse, Found, InnerOuter, LOPSIDED_PX, Outcome};
use crate::error::{Code, Error, Notice};
use crate::series::{Observation, Plate};

/// Identified observations of one image, and what was seen but not used.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Detection {
    /// Identified observations in order of marker id.
    pub observations: Vec<Observation>,
    /// Candidates that were left out, each with its reason.
    pub dropped: Vec<Dropped>,
    /// What was measured of a plate of circles; `None` for corners.
    pub circles: Option<Circles>,
    /// What the user should know though the work went on.
    pub notices: Vec<Notice>,
    /// True where it is of the negative of the picture, in which bright markers are dark.
    pub is_of_negative: bool,
    /// Whether the outer lines of a board were there.
    pub outline: Outline,
    /// Columns and rows of a chessboard or a grid of dots, in either order, where an outer line is missing and all ends are in view.
    pub size_seen: Option<[u32; 2]>,
    /// Lines of a board of another size, in either order, where both of their ends are in view.
    pub other_lines: [Option<u32>; 2],
    /// What is seen of a grid whose larger dots are not, with the ids of one of its turns, beside the failure that this is.
    pub turn_open: Vec<Observation>,
    /// Why the image cannot be used, with no observations then; `None` where it can.
    pub failure: Option<Error>,
}

impl Detection {
    /// A board that is not as large as the plate says, or whose markers stand in another layout.
    pub(super) fn other_size(error: Error) -> Self {
        Self { failure: Some(error), outline: Outline::OtherSize, ..Self::default() }
    }

    /// Whether what another image shows, of so many lines either way, may be a part of the board of another size in this one.
    pub(super) fn may_hold(&self, part: [u32; 2]) -> bool {
        let fits =
            |part: [u32; 2]| part.iter().zip(self.other_lines).all(|(n, lines)| lines.is_none_or(|all| *n <= all));
        fits(part) || fits([part[1], part[0]])
    }

    /// Columns and rows of the plate that the markers span which were found.
    pub(super) fn span(&self, plate: &Plate) -> [u32; 2] {
        let columns = plate.columns.max(1);
        let found: Vec<u32> =
            self.observations.iter().filter_map(|o| plate.index_of(o.marker)).map(|k| k as u32).collect();
        let range = |place: fn(u32, u32) -> u32| {
            let all = found.iter().map(|k| place(*k, columns));
            all.clone().max().zip(all.min()).map_or(0, |(last, first)| last - first + 1)
        };
        [range(|k, columns| k % columns), range(|k, columns| k / columns)]
    }

    /// Takes over what is found with all dots of a grid taken as alike, unless larger ones are seen.
    pub(super) fn leave_turn_open(&mut self, alike: Self) {
        let shows_larger = alike.notices.iter().any(|notice| notice.code == Code::PlateContradicted);
        if alike.failure.is_some() || shows_larger || alike.outline == Outline::LineMissing {
            return;
        }
        let place = self.failure.take().map_or_else(|| "image".to_owned(), |failure| failure.place);
        let what =
            "none of the larger dots is seen: which way round the grid is, only the readings of a robot can tell";
        let remedy =
            "take the image so that all larger dots are seen, or state them in plate.toml: large = [[column, row], ..]";
        self.failure = Some(Error::new(Code::PlateTurnOpen, place, what, remedy));
        self.turn_open = alike.observations;
    }

    /// A board with a code that goes on where it should end.
    pub(super) fn beyond(error: Error) -> Self {
        Self { failure: Some(error), outline: Outline::Beyond, ..Self::default() }
    }
}

/// The sizes of the dots of a grid as an image shows them, where the plate does not state them.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Sizes {
    /// Outer and inner radius of every marker by id, m.
    pub radii_m: Vec<(u32, [f64; 2])>,
    /// Ids of those that are not as most are, where they tell how the grid is turned.
    pub large: Vec<u32>,
}

/// What an image tells about the size of a board.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Outline {
    /// Some outer line of corners or tags is out of view, or the plate has none.
    #[default]
    Open,
    /// All four outer lines of corners were found, and where it ends; or a tag in each outer line.
    Whole,
    /// The lines alone: where the border of the picture cuts what is beyond them, more of the board may follow.
    Lines,
    /// The same beside a larger board, of which another image may show a part alone.
    Beside,
    /// An outer line of corners is not where it should be in view: it is covered, or the board is smaller than the plate says.
    LineMissing,
    /// The same of tags, or of corners beside tags, whose numbers tell their places all the same.
    TagsMissing,
    /// A board without a code ends in view, and not where the plate says; or one with markers has another layout.
    OtherSize,
    /// Markers with a code are seen where there should be none: the board is larger than the plate says.
    Beyond,
}

/// What an image of circles tells beyond their places.
#[derive(Debug, Clone, PartialEq)]
pub struct Circles {
    /// The identified markers in order of their ids.
    pub found: Vec<Found>,
    /// How the identification went.
    pub outcome: Outcome,
    /// Median blur (optics and pixel aperture together), px; NaN without markers.
    pub blur_px: f64,
    /// Noise of a pixel on paper and on ink, counts.
    pub noise: [f64; 2],
    /// Of the noise of neighbouring pixels.
    pub correlation: Correlation,
    /// Sizes that the plate does not state.
    pub sizes: Sizes,
}

/// A candidate that was left out.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Dropped {
    /// Where it was seen, in pixels.
    pub uv: [f64; 2],
    /// Why it was left out; one of a small set of phrases, so that reasons can be counted.
    pub reason: &'static str,
    /// The ellipse of its contour, where one was fitted.
    pub ellipse: Option<Ellipse>,
    /// The marker that it would have been, where that is known.
    pub marker: Option<u32>,
}

impl Dropped {
    /// A point that was left out.
    pub fn point(uv: [f64; 2], reason: &'static str) -> Self {
        Self { uv, reason, ellipse: None, marker: None }
    }
}

/// What the detector of circles found, with a notice when the point spread is asymmetric.
impl From<circles::CircleDetection> for Detection {
    fn from(found: circles::CircleDetection) -> Self {
        let rings = found.inner_outer.filter(InnerOuter::asymmetric).map(|io| io.notice());
        let edges = found.lopsided.filter(|l| l.exceeds(LOPSIDED_PX)).map(lopsided_notice);
        let spoilt = found.spoilt_edges().filter(|_| !found.found.is_empty());
        let spoilt = spoilt.map(|(what, remedy)| Notice::new(Code::MarkersUnmeasured, "image", what, remedy));
        let smoothed = (found.smoothed > 0).then(|| smoothed_notice(found.smoothed, found.found.len()));
        let notices = rings.into_iter().chain(edges).chain(spoilt).chain(smoothed).collect();
        let failure = found.failure().map(|(code, what, remedy)| {
            Error::new(code, "image", format!("{what}{}", found.dropped_summary()), remedy)
        });
        let dropped = |d: &circles::DroppedCandidate| Dropped {
            uv: d.uv,
            reason: d.reason.name(),
            ellipse: d.ellipse,
            marker: d.marker,
        };
        Self {
            observations: found.observations,
            dropped: found.dropped.iter().map(dropped).collect(),
            circles: Some(Circles {
                found: found.found,
                outcome: found.outcome,
                blur_px: found.blur_px,
                noise: found.noise,
                correlation: found.correlation,
                sizes: Sizes::default(),
            }),
            notices,
            failure,
            ..Self::default()
        }
    }
}

/// Clipped paper, strong compression, sharpening, motion.
pub fn smoothed_notice(smoothed: usize, found: usize) -> Notice {
    let what = format!(
        "{smoothed} of {found} markers have clipped edges, or edges that no blur explains, and were measured in a smoothed copy of the image"
    );
    let remedy = "expose for less time, store images as PNG (of a colour sensor after demosaicing), switch off sharpening, and see that nothing moves";
    Notice::new(Code::MarkersSmoothed, "image", what, remedy)
}

fn lopsided_notice(drift: Drift) -> Notice {
    let [u, v] = drift.mean_px;
    let what = format!(
        "the edges are blurred more to one side, which displaces centres by ({u:.4}, {v:.4}) px everywhere and by {:.4} px \
         along the radius in the corner",
        drift.corner_px
    );
    Notice::new(Code::BlurAsymmetric, "image", what, "look for coma (stop the lens down) or motion during the exposure")
}
