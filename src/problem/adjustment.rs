//! A problem and where its solution stands.

use super::{Image, ImageRejection, Problem, Slack, State};
use crate::geom::Pose;

/// A problem with a value of every unknown: what a solve starts from and what it leaves.
#[derive(Debug, Clone)]
pub struct Adjustment {
    /// What was measured and what is known beforehand.
    pub problem: Problem,
    /// The unknowns.
    pub state: State,
}

impl Adjustment {
    /// The images that take part, with their indices and what they deviate by.
    pub fn used(&self) -> impl Iterator<Item = (usize, &Image, &Slack)> {
        self.problem.used().map(|(i, image)| (i, image, &self.state.slack[i]))
    }

    /// The adjustment without some of its images: they are held out.
    pub fn without_images(&self, held: &[usize]) -> Self {
        let mut rest = self.clone();
        held.iter().for_each(|&i| rest.problem.images[i].rejected = Some(ImageRejection::Excluded));
        rest
    }

    /// Leaves the local errors out: their columns stay at zero.
    pub fn without_local_errors(&mut self) {
        let Self { problem, state } = self;
        let first = problem.layout.terms.start;
        for c in problem.layout.locals.clone() {
            problem.layout.columns[c].free = false;
            state.robot.terms[c - first].value = 0.0;
        }
        problem.noise.local.fill(0.0);
    }

    /// The priors of local errors and of families follow their components; local errors that are left out keep theirs.
    pub fn hold_component_priors(&mut self) {
        let Self { problem, state } = self;
        problem.families.iter().for_each(|f| f.hold(&mut problem.layout));
        let first = problem.layout.terms.start;
        for c in problem.layout.locals.clone() {
            let column = &mut problem.layout.columns[c];
            if column.free {
                column.prior_sigma = problem.noise.local[state.robot.terms[c - first].reading];
            }
        }
    }

    /// Starts all stops of the robot at right readings: [`Problem::exact_slack`], or none at all for readings that count as exact.
    pub fn start_slack(&mut self, readings_are_exact: bool) {
        let Self { problem, state } = self;
        for (slack, image) in state.slack.iter_mut().zip(&problem.images).filter(|(_, i)| i.stop.is_some()) {
            *slack = if readings_are_exact { Slack::None } else { problem.exact_slack(image) };
        }
    }

    /// What acts through the camera poses (robot, mountings, placements) stays as it is.
    pub fn hold_poses(&mut self) {
        let theta = self.problem.layout.theta_len();
        self.problem.layout.columns[..theta].iter_mut().for_each(|c| c.free = false);
    }

    /// Error of rotation (rad) and of position (m) of the pose that the readings of an image say, against another; `None` off the robot.
    pub fn misfit(&self, pose: &Pose, image: usize) -> Option<(f64, f64)> {
        let predicted = self.state.camera_from_plate(&self.problem.images[image], &Slack::None)?;
        Some(predicted.distance(pose))
    }
}
