//! Why an image or an observation is left out: what kind of thing it is, its sizes, and one sentence each.

use std::fmt;

use serde::{Deserialize, Serialize};

use crate::error::Code;

/// Why an image is left out. The name of the variant is the code in solution.json.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "code", rename_all = "snake_case")]
pub enum ImageRejection {
    /// It cannot be read, or the detector does not find the plate in it.
    Unusable {
        /// What is wrong with it.
        #[serde(default = "Code::of_earlier_versions")]
        why: Code,
        /// What the reader or the detector says.
        what: String,
    },
    /// A file of an earlier version says why in words alone.
    InWords {
        /// These words.
        what: String,
    },
    /// observations.csv has none of it.
    NoObservations,
    /// Another image shows exactly the same.
    Duplicate {
        /// Name of the other image.
        of: String,
    },
    /// Fewer markers than a pose needs.
    TooFewMarkers {
        /// Observations found.
        found: usize,
        /// Fewest that are needed.
        needed: usize,
    },
    /// Its markers lie on a line.
    Collinear,
    /// Most of what was found in it contradicts the other images: it was turned or cut, or the plate, the camera or its focus was another.
    Contradictory {
        /// Observations that contradict them.
        contradict: usize,
        /// All of its observations.
        of: usize,
    },
    /// Image and joint readings do not belong together: wrongly paired, or taken while the robot moved.
    WronglyPaired(Mismatch),
    /// The caller does not want it: held out, of another camera.
    Excluded,
}

/// How image and joint readings of a stop contradict each other.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "judged_by", rename_all = "snake_case")]
pub enum Mismatch {
    /// By the closed-form hand-eye transform, before the fit.
    HandEye(Misfit),
    /// By the latent joint error that the image would need.
    JointError {
        /// In usual joint errors, RMS over the joints.
        usual_errors: f64,
        /// Joint that misses most.
        joint: String,
        /// Its error, rad or m.
        error: f64,
    },
    /// By the other images of its stop, of which it would have to share the joint errors.
    OtherImages {
        /// Observations that contradict them.
        contradict: usize,
        /// All of its observations.
        of: usize,
    },
    /// By the finished fit.
    Fit {
        /// Stand-alone camera pose against that of the readings.
        #[serde(flatten)]
        misfit: Misfit,
        /// Image whose readings it fits instead.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        fits: Option<FitsReadings>,
    },
}

/// Distance of two poses.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Misfit {
    /// Of their origins, m.
    pub distance_m: f64,
    /// Angle between them, rad.
    pub angle_rad: f64,
}

/// Another row of joints.csv that an image fits far better than its own.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FitsReadings {
    /// Image of that row.
    pub of: String,
    /// How well, m + rad.
    pub misfit: f64,
}

impl ImageRejection {
    /// What is wrong with the image.
    pub fn code(&self) -> Code {
        match self {
            Self::Unusable { why, .. } => *why,
            Self::InWords { .. } => Code::Noticed,
            Self::NoObservations => Code::ObservationsMissing,
            Self::Duplicate { .. } => Code::ImageDuplicate,
            Self::TooFewMarkers { .. } => Code::MarkersTooFew,
            Self::Collinear => Code::MarkersCollinear,
            Self::Contradictory { .. } => Code::ImageContradictory,
            Self::WronglyPaired(_) => Code::WronglyPaired,
            Self::Excluded => Code::ImageExcluded,
        }
    }

    /// True where reader or detector refused it, whatever was seen in it.
    pub fn is_of_detection(&self) -> bool {
        matches!(self, Self::Unusable { .. } | Self::NoObservations)
    }

    /// True where image and readings do not belong together.
    pub fn is_wrong_pair(&self) -> bool {
        matches!(self, Self::WronglyPaired(_))
    }
}

impl fmt::Display for ImageRejection {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Unusable { what, .. } | Self::InWords { what } => f.write_str(what),
            Self::NoObservations => f.write_str("no observations are given"),
            Self::Duplicate { of } => write!(f, "duplicate: it shows exactly what {of} shows"),
            Self::TooFewMarkers { found, needed } => write!(f, "only {found} markers found, {needed} are needed"),
            Self::Collinear => f.write_str("its markers lie on a line"),
            Self::Contradictory { contradict, of } => write!(
                f,
                "{contradict} of its {of} points contradict the other images: was it turned or cut, or is it of another camera, focus or plate?"
            ),
            Self::WronglyPaired(mismatch) => write!(f, "wrongly paired or taken in motion: {mismatch}"),
            Self::Excluded => f.write_str("not asked for"),
        }
    }
}

impl fmt::Display for Mismatch {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::HandEye(misfit) => write!(f, "its camera pose is {misfit}"),
            Self::JointError { usual_errors, joint, error } => write!(
                f,
                "its joint readings would have to be wrong by {usual_errors:.1} of the usual noise ({joint} alone by {:.2} mrad)",
                1e3 * error.abs()
            ),
            Self::OtherImages { contradict, of } => {
                write!(f, "{contradict} of its {of} markers contradict the other images of its stop")
            }
            Self::Fit { misfit, fits } => {
                write!(f, "{misfit}")?;
                fits.as_ref().map_or(Ok(()), |other| {
                    write!(f, "; it fits the readings of {} to {:.1} (mm plus mrad)", other.of, 1e3 * other.misfit)
                })
            }
        }
    }
}

impl fmt::Display for Misfit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [mm, mrad] = [self.distance_m, self.angle_rad].map(|size| 1e3 * size);
        write!(f, "{mm:.1} mm and {mrad:.1} mrad from where its joint readings put it")
    }
}

/// Why an observation of an image in use is left out.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ObservationRejection {
    /// It disagrees with all others; data snooping takes it back where it no longer does.
    Residual,
    /// The caller does not want it; it stays out.
    Excluded,
}

impl ObservationRejection {
    /// As in observations.csv and solution.json.
    pub fn code(self) -> &'static str {
        match self {
            Self::Residual => "residual",
            Self::Excluded => "excluded",
        }
    }
}
