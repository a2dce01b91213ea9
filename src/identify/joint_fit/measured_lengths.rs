//! Measured distances take part in a fit where they agree with what it says without them: a wrong one with a small sigma would bend the robot, and
//! what it bends would take the blame.

use crate::assess::Limits;
use crate::problem::Problem;
use crate::solve::{LengthMisfit, LinearProblem, Outcome, Status};

/// Leaves all of them out.
pub(super) fn leave_all_out(problem: &mut Problem) {
    problem.lengths.iter_mut().for_each(|l| l.left_out = true);
}

/// Lets those take part that a fit without them does not contradict; true where there are any. What has no fit without them needs them.
pub(super) fn take_agreeing(outcome: &mut Outcome, limits: &Limits) -> bool {
    let misfits = misfits(outcome);
    let contradicted = contradicted(&misfits, limits);
    let lengths = &mut outcome.adjustment.problem.lengths;
    for (k, length) in lengths.iter_mut().enumerate() {
        length.left_out = contradicted.contains(&k);
    }
    lengths.iter().any(|l| !l.left_out)
}

/// Leaves the one out that the others contradict most; true where there is one.
pub(super) fn leave_worst_out(outcome: &mut Outcome, limits: &Limits) -> bool {
    let problem = &outcome.adjustment.problem;
    let used: Vec<usize> = problem.used_lengths().map(|(k, _)| k).collect();
    if used.is_empty() {
        return false;
    }
    let beyond = |m: &LengthMisfit| used.contains(&m.index) && m.is_beyond(limits.distance_sigmas, used.len());
    let worst = misfits(outcome).into_iter().filter(beyond).max_by(|a, b| a.deviate.abs().total_cmp(&b.deviate.abs()));
    if let Some(worst) = worst {
        outcome.adjustment.problem.lengths[worst.index].left_out = true;
    }
    worst.is_some()
}

/// Of a fit that converged; else none.
fn misfits(outcome: &Outcome) -> Vec<LengthMisfit> {
    let has_any = !outcome.adjustment.problem.lengths.is_empty();
    let linear = outcome.linear().filter(|_| has_any && outcome.status == Status::Converged);
    let covariance = linear.and_then(|linear| LinearProblem::covariance(linear).ok());
    covariance.map_or_else(Vec::new, |covariance| outcome.adjustment.length_misfits(&covariance))
}

/// Those beyond chance, and those that are doubtful and off by the same ratio: they have the same cause.
fn contradicted(misfits: &[LengthMisfit], limits: &Limits) -> Vec<usize> {
    let count = misfits.len();
    let beyond: Vec<&LengthMisfit> = misfits.iter().filter(|m| m.is_beyond(limits.distance_sigmas, count)).collect();
    let is_alike = |m: &LengthMisfit| {
        let doubtful = m.is_beyond(limits.plate_size_sigmas, count);
        doubtful && beyond.iter().any(|b| b.is_alike(m, limits.plate_size_sigmas))
    };
    misfits.iter().filter(|m| m.is_beyond(limits.distance_sigmas, count) || is_alike(m)).map(|m| m.index).collect()
}
