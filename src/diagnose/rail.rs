//! A rail measures lengths with its readings, which no link does: its gear may be as wrong as any other standard.

use crate::model::joint_terms::Term;
use crate::problem::{Adjustment, State, UNKNOWN_SCALE};
use crate::urdf::JointKind;

/// What else may be the cause on a rail.
pub(super) const OR_THE_RAIL: &str = "; or the rail moves by more or less than it reads: try --robot-model gear";

/// True where a rail moves the arm or what it is measured by.
pub(super) fn is_on_rail(state: &State) -> bool {
    state.robot.chain.reading_kinds.contains(&JointKind::Prismatic)
}

/// With gears of rails that nothing is known of beforehand; `None` where the robot model has none.
pub(super) fn with_gears_released(whole: &Adjustment) -> Option<Adjustment> {
    let Adjustment { problem, state } = whole;
    let kinds = &state.robot.chain.reading_kinds;
    let is_gear = |reading: usize, term: Term| term == Term::Gear && kinds[reading] == JointKind::Prismatic;
    let terms = state.robot.terms.iter().enumerate().filter(|(_, t)| is_gear(t.reading, t.term));
    let columns = terms.map(|(k, _)| problem.layout.terms.start + k).filter(|c| problem.layout.columns[*c].free);
    let columns: Vec<usize> = columns.collect();
    (!columns.is_empty()).then(|| {
        let mut released = whole.clone();
        columns.into_iter().for_each(|c| released.problem.layout.columns[c].prior_sigma = UNKNOWN_SCALE);
        released
    })
}
