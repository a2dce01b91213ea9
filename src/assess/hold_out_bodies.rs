//! Hold-out of measured bodies by stop: where no image tells of the robot, they are what a model is judged by.

use std::collections::HashSet;

use super::hold_out::{Accuracy, Errors, dealt, nominal, refitted_near};
use super::limits::Limits;
use crate::problem::{Problem, TakenFrom};
use crate::solve::{LinearProblem, side_by_side};
use crate::stage::stage;

/// Predicts what was measured of bodies by models that have not seen the stop; `None` for too few stops.
pub fn hold_out_bodies(fit: LinearProblem, limits: &Limits) -> Option<Accuracy> {
    let _stage = stage("hold-out");
    let problem = &fit.adjustment.problem;
    let stops: Vec<usize> = {
        let mut all: Vec<usize> = problem.used_bodies().map(|(_, m)| m.stop).collect();
        all.dedup();
        all
    };
    if stops.len() < limits.hand_eye_images {
        return None;
    }
    let folds = dealt(stops.into_iter().map(|stop| vec![stop]).collect());
    let nominal = nominal(fit.adjustment);
    let before = predictions(problem, nominal.linear()?, &folds)?;
    let after = predictions(problem, fit, &folds)?;
    let mut per_body_mm = vec![None; problem.body_measurements.len()];
    for ((k, a), (_, b)) in before.iter().zip(&after) {
        per_body_mm[*k] = Some([*a, *b]);
    }
    let [nominal, calibrated] = [summary(&before), summary(&after)];
    Some(Accuracy { nominal, calibrated, per_image_mm: Vec::new(), per_body_mm, folds: folds.len() })
}

/// Distance of what was measured from what is predicted, mm, with the index of the measurement, ascending: of all that is in use in a problem, by
/// fits of it, or of some of it.
fn predictions(problem: &Problem, fit: LinearProblem, folds: &[Vec<usize>]) -> Option<Vec<(usize, f64)>> {
    let states = side_by_side(problem, folds, |_, held| refitted_near(fit.without_bodies_at(held)));
    let mut errors = Vec::new();
    for (held, state) in folds.iter().zip(&states) {
        let held: HashSet<usize> = held.iter().copied().collect();
        for (k, measured) in problem.used_bodies().filter(|(_, m)| held.contains(&m.stop)) {
            let posture = problem.stops[measured.stop].posture.as_ref()?;
            let predicted = state.instrument_from_body(measured, TakenFrom::exact(posture))?;
            errors.push((k, 1e3 * (measured.seen.position() - predicted.translation).norm()));
        }
    }
    errors.sort_by_key(|(k, _)| *k);
    Some(errors)
}

fn summary(errors: &[(usize, f64)]) -> Errors {
    let squares: f64 = errors.iter().map(|(_, mm)| mm * mm).sum();
    Errors {
        rms_px: 0.0,
        rms_mm: (squares / errors.len().max(1) as f64).sqrt(),
        worst_mm: errors.iter().map(|(_, mm)| *mm).fold(0.0, f64::max),
        images: errors.len(),
    }
}
