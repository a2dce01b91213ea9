//! Measurements of bodies that were left out at the start, and fit the robot that was found.

use std::collections::BTreeMap;

use super::placed::missed;
use crate::assess::Limits;
use crate::linalg::median;
use crate::problem::{Adjustment, BodyRejection};

/// How far a measurement is from where the robot that was found has the body, joint errors left out.
fn misfit(adjustment: &Adjustment, k: usize) -> Option<f64> {
    let Adjustment { problem, state } = adjustment;
    let measured = &problem.body_measurements[k];
    let posture = problem.stops[measured.stop].posture.as_ref()?;
    let tip = state.robot.base_from_tip_at(posture);
    Some(missed(&(measured.seen, tip), &(state.instruments[measured.instrument], state.bodies[measured.body])))
}

/// Takes back what was left out with the nominal robot, and fits the robot that was found as the others of its kind do. Their misfit has the joint
/// noise in it, which that of one that is left out has, too. True where there are some.
pub(in crate::identify) fn take_bodies_back(adjustment: &mut Adjustment, limits: &Limits) -> bool {
    let problem = &adjustment.problem;
    let is_out = |k: usize| matches!(problem.body_measurements[k].rejected, Some(BodyRejection::Residual { .. }));
    let out: Vec<usize> = (0..problem.body_measurements.len()).filter(|k| is_out(*k)).collect();
    if out.is_empty() {
        return false;
    }
    let kind = |k: usize| {
        let measured = &problem.body_measurements[k];
        (problem.instruments[measured.instrument].component, measured.seen.coordinates())
    };
    let mut used: BTreeMap<(usize, usize), Vec<f64>> = BTreeMap::new();
    for (k, _) in problem.used_bodies() {
        used.entry(kind(k)).or_default().extend(misfit(adjustment, k));
    }
    let usual: BTreeMap<(usize, usize), Option<f64>> = used.iter().map(|(kind, all)| (*kind, median(all))).collect();
    let fits = |k: &usize| {
        let usual = usual.get(&kind(*k)).copied().flatten();
        misfit(adjustment, *k).zip(usual).is_some_and(|(own, usual)| own < limits.set_aside_factor * usual)
    };
    let back: Vec<usize> = out.into_iter().filter(fits).collect();
    back.iter().for_each(|&k| adjustment.problem.body_measurements[k].rejected = None);
    !back.is_empty()
}
