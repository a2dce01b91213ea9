//! Do the images scatter as the noise model says?

use super::kind::{CheckContext, Kind, Quantity, Weight};
use crate::assess::{Accuracy, Uncertainty};
use crate::error::Code;

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

impl Kind for LargeScatter {
    fn code(&self) -> Code {
        Code::LargeScatter
    }

    fn weight(&self) -> Weight {
        Weight::Note
    }

    fn quantities(&self) -> Vec<Quantity> {
        vec![Quantity::new("flange_ratio", self.ratio, "1")]
    }

    fn place(&self) -> String {
        "uncertainty".into()
    }

    fn seen(&self) -> String {
        format!(
            "the images scatter {:.1} times as much as the noise model says (flange, clusters of images); the larger sigmas are stated",
            self.ratio
        )
    }

    fn remedy(&self) -> String {
        "look for what changes from image to image: a loose camera or plate, motion, focus, light".into()
    }
}
