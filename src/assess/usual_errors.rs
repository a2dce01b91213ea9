//! What a robot that nobody calibrated may be off by: the priors of a fit of the full model.

use crate::model::joint_terms::RobotModel;
use crate::model::robot::Robot;
use crate::problem::{Layout, Names, State};

/// A robot with every term of the full model, what it lacks of them at zero, and the prior sigma of each of its columns (twists, then
/// terms; m, rad or the unit of the term). Those of origins that stay, and of the pose between two bases, are zero.
pub(super) fn usual_errors(robot: &Robot) -> (Robot, Vec<f64>) {
    let mut full = RobotModel::Full.robot(robot.chain.clone());
    full.twists.clone_from(&robot.twists);
    for own in &robot.terms {
        match full.terms.iter_mut().find(|t| (t.reading, t.term) == (own.reading, own.term)) {
            Some(term) => term.value = own.value,
            None => full.terms.push(*own),
        }
    }
    let state = State {
        robot: full,
        mountings: Vec::new(),
        placements: Vec::new(),
        instruments: Vec::new(),
        bodies: Vec::new(),
        cameras: Vec::new(),
        plates: Vec::new(),
        joint_errors: Vec::new(),
        ties: Vec::new(),
    };
    let layout = Layout::new(&state, &Names::default());
    let is_own = |c: usize| layout.columns[c].free && !layout.is_between_bases(c);
    let sigmas = (0..layout.len()).map(|c| if is_own(c) { layout.columns[c].prior_sigma } else { 0.0 }).collect();
    (state.robot, sigmas)
}
