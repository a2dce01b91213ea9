//! Do the images scatter as the noise model says?

use super::kind::{CheckContext, Kind, Quantity, Subject, Weight};
use crate::assess::{Accuracy, Uncertainty};
use crate::error::Code;

/// The images scatter more than the noise model says.
#[derive(Debug, Clone, PartialEq)]
pub struct LargeScatter {
    /// Sigma of the flange by clusters of images over that by the noise model.
    pub ratio: f64,
    /// Joint noise as it was stated, rad or m; none where it was estimated.
    pub stated_noise: Option<f64>,
}

pub(super) fn check(uncertainty: &Uncertainty, _: &Accuracy, setting: &CheckContext) -> Option<LargeScatter> {
    let ratio = uncertainty.clustered_ratio.filter(|_| uncertainty.larger_stated);
    ratio.map(|ratio| LargeScatter { ratio, stated_noise: setting.stated_noise })
}

impl Kind for LargeScatter {
    fn code(&self) -> Code {
        Code::LargeScatter
    }

    fn weight(&self) -> Weight {
        if self.stated_noise.is_some() { Weight::Gate } else { Weight::Note }
    }

    fn subjects(&self) -> Vec<Subject> {
        Vec::new()
    }

    fn quantities(&self) -> Vec<Quantity> {
        let stated = self.stated_noise.map(|sigma| Quantity::new("stated_joint_noise", sigma, "rad or m"));
        [Quantity::new("flange_ratio", self.ratio, "1")].into_iter().chain(stated).collect()
    }

    fn place(&self) -> String {
        "uncertainty".into()
    }

    fn seen(&self) -> String {
        let model = match self.stated_noise {
            Some(sigma) => format!("the stated joint noise of {} mrad", 1e3 * sigma),
            None => "the noise model".into(),
        };
        format!(
            "the images scatter {:.1} times as much as {model} says (flange, clusters of images); the larger sigmas are stated",
            self.ratio
        )
    }

    fn remedy(&self) -> String {
        let remedy = match self.stated_noise {
            Some(_) => "leave out --joint-noise: it is estimated then",
            None => "look for what changes from image to image: a loose camera or plate, motion, focus, light",
        };
        remedy.into()
    }
}
