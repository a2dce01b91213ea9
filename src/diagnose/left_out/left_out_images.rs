//! Do most images belong to their joint readings?

use crate::diagnose::kind::{CheckContext, Kind, Quantity, Subject, Weight, some_of};
use crate::error::Code;
use crate::problem::{Adjustment, ImageRejection};

/// Most images that are named.
const MOST_IMAGES: usize = 5;

/// Many images of the robot were left out.
#[derive(Debug, Clone, PartialEq)]
pub struct ImagesLeftOut {
    /// Images of the robot that were left out after the start.
    pub left_out: usize,
    /// Images of the robot at the start.
    pub on_robot: usize,
    /// Wrongly paired images.
    pub wrongly_paired: Vec<String>,
    /// Gate, or refusal where most are left out.
    pub weight: Weight,
}

pub fn check(adjustment: &Adjustment, setting: &CheckContext) -> Option<ImagesLeftOut> {
    let (problem, on_robot) = (&adjustment.problem, setting.on_robot);
    let left_out = on_robot - problem.used_on_robot().count();
    let share = |limit: f64| left_out as f64 > limit * on_robot as f64;
    let weight = match () {
        () if share(setting.limits.hopeless_share_of_images_left_out) => Weight::Refusal,
        () if share(setting.limits.share_of_images_left_out) => Weight::Gate,
        () => return None,
    };
    let wrong = problem.images.iter().filter(|i| i.rejected.as_ref().is_some_and(ImageRejection::is_wrong_pair));
    let wrongly_paired = wrong.map(|i| i.name.clone()).collect();
    Some(ImagesLeftOut { left_out, on_robot, wrongly_paired, weight })
}

impl Kind for ImagesLeftOut {
    fn code(&self) -> Code {
        Code::ImagesLeftOut
    }

    fn weight(&self) -> Weight {
        self.weight
    }

    fn subjects(&self) -> Vec<Subject> {
        self.wrongly_paired.iter().cloned().map(Subject::Image).collect()
    }

    fn quantities(&self) -> Vec<Quantity> {
        vec![
            Quantity::new("images_left_out", self.left_out as f64, "1"),
            Quantity::new("images", self.on_robot as f64, "1"),
        ]
    }

    fn place(&self) -> String {
        "images".into()
    }

    fn seen(&self) -> String {
        let Self { left_out, on_robot, wrongly_paired, .. } = self;
        let named = match wrongly_paired.as_slice() {
            [] => String::new(),
            named => format!(" ({})", some_of(named, MOST_IMAGES)),
        };
        format!("{left_out} of {on_robot} do not fit their joint readings{named}")
    }

    fn remedy(&self) -> String {
        "check joint_unit, the order and signs of the joints, that image names stand in the right rows, and that the plate did not move".into()
    }
}
