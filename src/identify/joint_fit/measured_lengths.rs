//! Measured distances take part in a fit where they agree with what it says without them: a wrong one with a small sigma would bend the robot, and
//! what it bends would take the blame.

use crate::assess::Limits;
use crate::problem::Problem;
use crate::solve::{ComponentOptions, LengthMisfit, LinearProblem, Outcome, Status, estimate_components_near};

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

/// Leaves the one out that the others contradict most; true where there is one. A wrong one that takes part grows the noise by which it is judged: one that
/// is doubtful is judged by the fit without it.
pub(super) fn leave_worst_out(outcome: &mut Outcome, components: &ComponentOptions, limits: &Limits) -> bool {
    let used: Vec<usize> = outcome.adjustment.problem.used_lengths().map(|(k, _)| k).collect();
    if used.is_empty() {
        return false;
    }
    let worst = misfits(outcome).into_iter().filter(|m| used.contains(&m.index));
    let Some(worst) = worst.max_by(|a, b| a.deviate.abs().total_cmp(&b.deviate.abs())) else { return false };
    let is_beyond = |misfit: &LengthMisfit, sigmas| misfit.is_beyond(sigmas, used.len());
    if !is_beyond(&worst, limits.distance_doubtful) {
        return false;
    }
    let mut without = outcome.adjustment.clone();
    without.problem.lengths[worst.index].left_out = true;
    if is_beyond(&worst, limits.distance_sigmas) {
        outcome.adjustment = without;
        return true;
    }
    let without = estimate_components_near(without, components);
    let is_contradicted =
        misfits(&without).iter().any(|m| m.index == worst.index && is_beyond(m, limits.distance_sigmas));
    if is_contradicted {
        *outcome = without;
    }
    is_contradicted
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
