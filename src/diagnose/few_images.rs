//! Are there enough images of the robot?

use super::kind::{CheckContext, Kind, Quantity, Subject, Weight};
use crate::assess::Accuracy;
use crate::error::Code;
use crate::fit::Fit;

/// Few images of the robot.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FewImages {
    /// Images of the robot.
    pub images: usize,
    /// True where nothing but trackers and contacts measured: stops of the robot are counted.
    pub are_stops: bool,
}

pub(super) fn check(fit: &Fit, _: &Accuracy, setting: &CheckContext) -> Option<FewImages> {
    let are_stops = setting.on_robot == 0;
    let images = if are_stops { fit.problem.used_stops().len() } else { setting.on_robot };
    (images < setting.limits.few_images).then_some(FewImages { images, are_stops })
}

impl Kind for FewImages {
    fn code(&self) -> Code {
        Code::FewImages
    }

    fn weight(&self) -> Weight {
        Weight::Note
    }

    fn subjects(&self) -> Vec<Subject> {
        Vec::new()
    }

    fn quantities(&self) -> Vec<Quantity> {
        vec![Quantity::new("images", self.images as f64, "1")]
    }

    fn place(&self) -> String {
        "series".into()
    }

    fn seen(&self) -> String {
        format!(
            "{} {} of the robot are few: expect the prior (nominal model) to decide much of the result",
            self.images,
            if self.are_stops { "stops" } else { "images" }
        )
    }

    fn remedy(&self) -> String {
        "take 30 to 50 stops that move every joint through its range".into()
    }
}
