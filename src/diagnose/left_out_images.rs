//! Do most images belong to their joint readings?

use std::fmt;

use super::kind::{CheckContext, Kind, Quantity, Subject, Weight};
use crate::error::Code;
use crate::problem::{Adjustment, ImageRejection};

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

pub(super) fn check(adjustment: &Adjustment, setting: &CheckContext) -> Option<ImagesLeftOut> {
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

impl fmt::Display for ImagesLeftOut {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { left_out, on_robot, wrongly_paired, weight } = self;
        if *weight == Weight::Gate {
            return write!(f, "images: {left_out} of {on_robot} do not fit their joint readings");
        }
        let named: Vec<&str> = wrongly_paired.iter().map(String::as_str).take(5).collect();
        write!(f, "{left_out} of {on_robot} images do not fit their joint readings ({} ...)", named.join(", "))
    }
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
}
