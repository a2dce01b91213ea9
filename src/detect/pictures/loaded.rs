//! A picture with what was found out about it on the way from its file to the detectors.

use super::few_levels::few_levels;
use crate::detect::Picture;

/// A picture as the detectors see it.
#[derive(Debug, Clone, PartialEq)]
pub struct Loaded {
    /// Its grey values, corrected by dark and white images where they are.
    pub picture: Picture,
    /// Number of its grey levels as loaded, where they are too few.
    pub few_levels: Option<usize>,
    /// True where there are dark and white images, which levels so few are no measure for.
    pub is_uncorrected: bool,
}

impl From<Picture> for Loaded {
    fn from(picture: Picture) -> Self {
        Self { few_levels: few_levels(&picture), picture, is_uncorrected: false }
    }
}

impl Loaded {
    /// What is bright in it is dark, and the other way round.
    pub fn negative(self) -> Self {
        Self { picture: self.picture.negative(), ..self }
    }
}
