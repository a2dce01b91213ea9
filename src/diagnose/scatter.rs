//! Do the images scatter as the noise model says?

use std::fmt;

use super::kind::{CheckContext, Kind, Quantity, Subject, Weight};
use crate::assess::{Accuracy, Uncertainty};
use crate::error::{Code, Notice};

/// The images scatter more than the noise model says.
#[derive(Debug, Clone, PartialEq)]
pub struct LargeScatter {
    /// Sigma of the flange by clusters of images over that by the noise model.
    pub ratio: f64,
}

pub(super) fn check(uncertainty: &Uncertainty, _: &Accuracy, _: &CheckContext) -> Option<LargeScatter> {
    let ratio = uncertainty.clustered_ratio.filter(|_| uncertainty.larger_stated);
    ratio.map(|ratio| LargeScatter { ratio })
}

impl fmt::Display for LargeScatter {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.notice().fmt(f)
    }
}

impl Kind for LargeScatter {
    fn code(&self) -> Code {
        Code::LargeScatter
    }

    fn weight(&self) -> Weight {
        Weight::Note
    }

    fn subjects(&self) -> Vec<Subject> {
        Vec::new()
    }

    fn quantities(&self) -> Vec<Quantity> {
        vec![Quantity::new("flange_ratio", self.ratio, "1")]
    }

    fn notice(&self) -> Notice {
        Notice::new(
            self.code(),
            "uncertainty",
            format!(
                "the images scatter {:.1} times as much as the noise model says (flange, clusters of images); the larger sigmas are stated",
                self.ratio
            ),
            "look for what changes from image to image: a loose camera or plate, motion, focus, light",
        )
    }
}
