//! Are there enough images of the robot?

use super::kind::{CheckContext, Kind, Quantity, Weight};
use super::lost_images::LostImages;
use crate::assess::Accuracy;
use crate::error::Code;
use crate::fit::Fit;
use crate::problem::different_readings;

/// Few images of the robot.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FewImages {
    /// Images of the robot.
    pub images: usize,
    /// Different readings among them.
    pub different: usize,
    /// True where nothing but trackers and contacts measured: stops of the robot are counted.
    pub are_stops: bool,
    /// What cost many images, if that is so.
    pub lost: Option<LostImages>,
}

pub(super) fn check(fit: &Fit, _: &Accuracy, setting: &CheckContext) -> Option<FewImages> {
    let are_stops = setting.on_robot == 0;
    let (problem, limits) = (&fit.problem, setting.limits);
    let images = if are_stops { problem.used_stops().len() } else { setting.on_robot };
    let stops = problem.used_stops().into_iter().filter_map(|s| problem.stops[s].posture.as_ref());
    let different =
        different_readings(stops.map(|posture| posture.readings.as_slice()), limits.joint_noise, limits.few_images);
    (images.min(different) < limits.few_images).then(|| {
        let lost = LostImages::of(problem, limits);
        FewImages { images, different: different.min(images), are_stops, lost }
    })
}

impl Kind for FewImages {
    fn code(&self) -> Code {
        Code::FewImages
    }

    fn weight(&self) -> Weight {
        Weight::Note
    }

    fn quantities(&self) -> Vec<Quantity> {
        let images = Quantity::new("images", self.images as f64, "1");
        let different = Quantity::new("different", self.different as f64, "1");
        [images, different].into_iter().chain(self.lost.as_ref().map(LostImages::quantity)).collect()
    }

    fn place(&self) -> String {
        "series".into()
    }

    fn seen(&self) -> String {
        let at = if self.different < self.images {
            format!(" at {} different readings", self.different)
        } else {
            String::new()
        };
        format!(
            "{} {}{at} of the robot are few: expect the prior (nominal model) to decide much of the result",
            self.images,
            if self.are_stops { "stops" } else { "images" }
        )
    }

    fn remedy(&self) -> String {
        let more = "take 30 to 50 stops that move every joint through its range";
        self.lost.as_ref().map_or_else(|| more.to_owned(), |lost| format!("{}; {more}", lost.remedy()))
    }
}
