//! Measurements of bodies that were left out at the start, and fit the robot that was found.

use super::body_placed::missed;
use crate::assess::Limits;
use crate::linalg::median;
use crate::problem::{Adjustment, BodyRejection};

/// How far a measurement is from where the robot that was found has the body, joint errors left out.
fn misfit(adjustment: &Adjustment, k: usize) -> Option<f64> {
    let Adjustment { problem, state } = adjustment;
    let measured = &problem.body_measurements[k];
    let posture = problem.stops[measured.stop].posture.as_ref()?;
    let tip = state.robot.pose_at(posture, &vec![0.0; posture.readings.len()]);
    Some(missed(&(measured.seen, tip), &(state.instruments[measured.instrument], state.bodies[measured.body])))
}

/// Takes back what was left out with the nominal robot, and fits the robot that was found as the others of its kind do. Their misfit has the joint
/// noise in it, which that of one that is left out has, too. True where there are some.
pub(super) fn take_bodies_back(adjustment: &mut Adjustment, limits: &Limits) -> bool {
    let problem = &adjustment.problem;
    let kind = |k: usize| {
        let measured = &problem.body_measurements[k];
        (problem.instruments[measured.instrument].component, measured.seen.coordinates())
    };
    let usual = |k: usize| {
        let alike = problem.used_bodies().filter(|(other, _)| kind(*other) == kind(k));
        median(&alike.filter_map(|(other, _)| misfit(adjustment, other)).collect::<Vec<f64>>())
    };
    let is_out = |k: &usize| matches!(problem.body_measurements[*k].rejected, Some(BodyRejection::Residual { .. }));
    let fits = |k: &usize| {
        let (own, usual) = (misfit(adjustment, *k), usual(*k));
        own.zip(usual).is_some_and(|(own, usual)| own < limits.set_aside_factor * usual)
    };
    let back: Vec<usize> = (0..problem.body_measurements.len()).filter(|k| is_out(k) && fits(k)).collect();
    back.iter().for_each(|&k| adjustment.problem.body_measurements[k].rejected = None);
    !back.is_empty()
}
