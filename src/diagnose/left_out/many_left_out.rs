//! Do most images say something, whatever the others were left out for?

use crate::assess::Limits;
use crate::diagnose::kind::{CheckContext, Kind, Quantity, Weight};
use crate::error::Code;
use crate::problem::{Adjustment, Problem};

/// A good part of the images takes no part, for whatever reason.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ManyLeftOut {
    /// Images that take no part.
    pub left_out: usize,
    /// Of so many.
    pub of: usize,
    /// Whether images of the robot are counted, or all.
    pub on_robot: bool,
}

/// Images of the robot.
pub fn check(adjustment: &Adjustment, setting: &CheckContext) -> Option<ManyLeftOut> {
    let problem = &adjustment.problem;
    let of = (0..problem.images.len()).filter(|&i| problem.on_robot(i)).count();
    let found = ManyLeftOut { left_out: of - problem.used_on_robot().count(), of, on_robot: true };
    found.is_many(setting.limits).then_some(found)
}

/// Of all images, where no robot takes part.
pub fn many_left_out(problem: &Problem, limits: &Limits) -> Option<ManyLeftOut> {
    let of = problem.images.len();
    let found = ManyLeftOut { left_out: of - problem.used().count(), of, on_robot: false };
    found.is_many(limits).then_some(found)
}

impl ManyLeftOut {
    fn is_many(&self, limits: &Limits) -> bool {
        self.left_out as f64 > limits.doubtful_share_left_out * self.of as f64
    }
}

impl Kind for ManyLeftOut {
    fn code(&self) -> Code {
        Code::ImagesLeftOut
    }

    fn weight(&self) -> Weight {
        Weight::Note
    }

    fn quantities(&self) -> Vec<Quantity> {
        let counts = [("images_left_out", self.left_out), ("images", self.of)];
        counts.map(|(name, count)| Quantity::new(name, count as f64, "1")).into()
    }

    fn place(&self) -> String {
        if self.on_robot { "images of the robot" } else { "images" }.into()
    }

    fn seen(&self) -> String {
        format!("{} of {} were left out", self.left_out, self.of)
    }

    fn remedy(&self) -> String {
        let all = if self.on_robot { ", or show --all" } else { "" };
        format!("look at their reasons (report{all})")
    }
}
