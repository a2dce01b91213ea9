//! Does a joint move by another ratio than it is read by, or with the reading of another joint?
//!
//! Joint noise takes up an error of a gear ratio, as it grows with the reading: where it is large, single readings are given a part of their own
//! or of another reading ([`solve_slopes`]) by the stand-alone camera poses, those of images that were left out among them.

use super::kind::{CheckContext, Kind, Quantity, Subject, Weight};
use crate::assess::{Accuracy, Limits};
use crate::error::Code;
use crate::fit::Fit;
use crate::init::{SeenStop, Slope, solve_slopes};
use crate::model::robot::Robot;

/// A joint that does not move by what is read.
#[derive(Debug, Clone, PartialEq)]
pub struct ReadingRatio {
    /// Name of the joint.
    pub joint: String,
    /// The joint whose reading moves it, too; none where its own ratio is another.
    pub with: Option<String>,
    /// How it moves over its reading, or over that of the other joint, and the standard deviation.
    pub ratio: (f64, f64),
    /// Median misfit of the camera poses that is left with it, rad + m.
    pub left: f64,
    /// Share of the squares of the misfit that it explains.
    pub share: f64,
    /// Gate, or refusal where nothing could be fitted.
    pub weight: Weight,
}

/// Where joint noise is larger than robots have.
pub(super) fn check(fit: &Fit, _: &Accuracy, setting: &CheckContext) -> Option<ReadingRatio> {
    let fit = setting.with_noise_found(fit);
    let (problem, chain, limits) = (&fit.problem, &fit.state.robot.chain, setting.limits);
    let is_noisy = problem.noise.joint.iter().flatten().any(|sigma| *sigma >= limits.unusual_joint_noise);
    if !is_noisy || chain.base_moves() || chain.pose_coordinates().is_some() {
        return None;
    }
    let largest = setting.free.most_seen_stops(problem, 0..problem.images.len());
    told(&Robot::nominal(chain.clone()), &largest, limits)
}

impl ReadingRatio {
    /// That of which stops at which nothing fits are explained; `None` where what is left is no fit either.
    pub fn of_misfit(robot: &Robot, stops: &[SeenStop], misfit: f64, limits: &Limits) -> Option<Self> {
        let most = limits.suspicious_misfit.min(limits.mistake_explains * misfit);
        let found = told(robot, stops, limits).filter(|found| found.left < most)?;
        Some(Self { weight: Weight::Refusal, ..found })
    }

    /// True of what seems to stand elsewhere because of it.
    pub(super) const fn explains(&self) -> bool {
        matches!(self.weight, Weight::Gate)
    }
}

/// The part that explains most of the misfit, where the stops are enough to tell it from every other.
fn told(robot: &Robot, stops: &[SeenStop], limits: &Limits) -> Option<ReadingRatio> {
    if stops.len() < limits.zeros_images {
        return None;
    }
    let slopes = solve_slopes(robot, stops)?;
    let mut tried = slopes.tried.iter();
    let best = tried.next()?;
    let share = 1.0 - best.square / slopes.square;
    // Logarithm of the likelihoods, the size of the errors being unknown.
    let log_odds = |other: f64| 0.5 * 6.0 * slopes.stops as f64 * (other / best.square).ln();
    let next = tried.next().map_or(slopes.square, |next| next.square);
    tracing::debug!(?best, without = slopes.square, next, "slopes of readings");
    (share > limits.displaced_share && log_odds(next) > limits.decisive_log_odds)
        .then(|| ReadingRatio::of(robot, best, share))
}

impl ReadingRatio {
    fn of(robot: &Robot, best: &Slope, share: f64) -> Self {
        let [own, by] = best.readings;
        let name = |reading: usize| robot.chain.readings[reading].clone();
        let (part, sigma) = best.part;
        let with = (own != by).then(|| name(by));
        let ratio = if own == by { 1.0 + part } else { part };
        Self { joint: name(own), with, ratio: (ratio, sigma), left: best.left, share, weight: Weight::Gate }
    }
}

impl Kind for ReadingRatio {
    fn code(&self) -> Code {
        if self.with.is_some() { Code::JointInfluenced } else { Code::JointRatioWrong }
    }

    fn weight(&self) -> Weight {
        self.weight
    }

    fn subjects(&self) -> Vec<Subject> {
        std::iter::once(&self.joint).chain(&self.with).cloned().map(Subject::Joint).collect()
    }

    fn quantities(&self) -> Vec<Quantity> {
        let name = if self.with.is_some() { "part" } else { "ratio" };
        vec![
            Quantity::new(name, self.ratio.0, "1").with_sigma(self.ratio.1),
            Quantity::new("misfit_undone", self.left, "rad + m"),
            Quantity::new("share_of_misfit", self.share, "1"),
        ]
    }

    fn place(&self) -> String {
        self.joint.clone()
    }

    fn seen(&self) -> String {
        let (ratio, sigma) = self.ratio;
        let what = match &self.with {
            None => format!("it moves by {ratio:.5} (sigma {sigma:.5}) times what it reads"),
            Some(with) => {
                format!("it moves by {ratio:+.5} (sigma {sigma:.5}) times the reading of {with} with that joint")
            }
        };
        format!(
            "{what}: this explains {:.0} % of the squares by which readings and images miss each other",
            100.0 * self.share
        )
    }

    fn remedy(&self) -> String {
        match &self.with {
            None => format!(
                "correct the gear ratio of {0} in the controller, or the unit of its column: multiply the column {0} of joints.csv by {1:.6} to go on",
                self.joint, self.ratio.0
            ),
            Some(with) => format!(
                "state the coupling of both joints in the controller, or add {:.6} times the column {with} to the column {} of joints.csv to go on",
                self.ratio.0, self.joint
            ),
        }
    }
}
