//! How the starting values fared.

use std::fmt;

use serde::{Deserialize, Serialize};

/// How one starting value fared.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct StartVerdict {
    /// What was started: "focal length of front", "hand-camera and plate pose".
    pub of: String,
    /// Where the value came from.
    pub origin: String,
    /// What it reached.
    #[serde(alias = "verdict", deserialize_with = "also_in_words")]
    pub reached: StartReached,
    /// True for the one that was taken.
    pub won: bool,
}

/// What a starting value reached.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "code", rename_all = "snake_case")]
pub enum StartReached {
    /// Another one was good enough.
    NotNeeded,
    /// A focal length led to camera poses.
    CameraPoses {
        /// RMS of the markers, px per point; none where it led to no poses.
        rms_px: Option<f64>,
    },
    /// A closed form for hand-eye transform and target pose.
    HandEye {
        /// Median over the images of the RMS of the markers, px; none where it was not among those compared.
        median_px: Option<f64>,
        /// Median misfit of the poses, rad + m.
        misfit: f64,
    },
    /// As files of earlier versions have it.
    InWords {
        /// The words.
        what: String,
    },
}

impl fmt::Display for StartReached {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NotNeeded => write!(f, "not needed"),
            Self::CameraPoses { rms_px } => {
                write!(f, "reached {:.3} px per point", rms_px.unwrap_or(f64::INFINITY))
            }
            Self::HandEye { median_px, misfit } => {
                let pixels = median_px.map(|px| format!("median {px:.1} px, ")).unwrap_or_default();
                write!(f, "{pixels}median hand-eye residual {:.2} (mm plus mrad)", 1e3 * misfit)
            }
            Self::InWords { what } => write!(f, "{what}"),
        }
    }
}

/// Files of earlier versions have a sentence.
fn also_in_words<'de, D: serde::Deserializer<'de>>(from: D) -> Result<StartReached, D::Error> {
    #[derive(Deserialize)]
    #[serde(untagged)]
    enum Read {
        InWords(String),
        Reached(StartReached),
    }
    Ok(match Read::deserialize(from)? {
        Read::InWords(words) if words == StartReached::NotNeeded.to_string() => StartReached::NotNeeded,
        Read::InWords(what) => StartReached::InWords { what },
        Read::Reached(reached) => reached,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(reached: &str) -> StartReached {
        let text = format!(r#"{{"of": "a", "origin": "b", {reached}, "won": true}}"#);
        serde_json::from_str::<StartVerdict>(&text).unwrap().reached
    }

    #[test]
    fn what_was_written_is_read_and_sentences_of_earlier_versions_too() {
        for reached in [
            StartReached::NotNeeded,
            StartReached::CameraPoses { rms_px: None },
            StartReached::HandEye { median_px: Some(0.5), misfit: 1e-3 },
        ] {
            assert_eq!(read(&format!("\"reached\": {}", serde_json::to_string(&reached).unwrap())), reached);
        }
        assert_eq!(read(r#""verdict": "not needed""#), StartReached::NotNeeded);
        assert_eq!(read(r#""verdict": "median 1 px""#), StartReached::InWords { what: "median 1 px".into() });
    }
}
