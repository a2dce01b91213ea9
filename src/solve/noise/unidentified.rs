//! Joint noise that the data do not separate from none counts as none.
//!
//! An estimate cannot be below zero: of a robot without joint noise half of the series find some, and their covariances are too
//! large. The most likely size is compared with its spread where there is no noise (the test of a component on the edge of its range;
//! S. Self, K.-Y. Liang 1987).

use super::components::ComponentOptions;
use super::information::{NoiseInformation, noise_information};
use super::tally::JOINT_NOISE_FLOOR;
use crate::problem::Adjustment;
use crate::solve::levenberg::{Ended, Outcome, Settings, solve};

/// Sigmas of an estimate where there is no noise that it must reach: one of a hundred robots without noise gets past.
const IDENTIFIED: f64 = 2.326;

/// Sigmas by its own spread from which on an estimate is identified without asking further.
const PLAIN: f64 = 3.0;

/// Readings of one kind, in all series: one of them alone may have too few stops to tell what all together do.
type Group = Vec<usize>;

/// The fit with such noise at its floor, and what was known of all noise before, where that changed.
pub fn without_unidentified_noise(outcome: Outcome, settings: &Settings) -> (Ended, Option<NoiseInformation>) {
    let found = outcome.ended();
    let Some(told) = found.fit.as_ref().ok().and_then(noise_information) else { return (found, None) };
    let noise = &found.adjustment().problem.noise;
    let series: Vec<usize> = (0..noise.joint.len()).collect();
    let above_floor = |r: &usize| noise.joint.iter().any(|own| own[*r] > JOINT_NOISE_FLOOR);
    let in_doubt: Vec<Group> = groups(found.adjustment())
        .filter(|group| told.mean_variance(&series, group).interval(PLAIN)[0] == 0.0)
        .filter(|group| group.iter().any(above_floor))
        .collect();
    if in_doubt.is_empty() {
        return (found, None);
    }
    let Ok(most_likely) = found.fit.as_ref().map(|fit| fit.most_likely_noise(&ComponentOptions::default())) else {
        return (found, None);
    };
    let at_none = solved_without(found.adjustment(), &in_doubt, settings).ended();
    let Some(spread) = at_none.fit.as_ref().ok().and_then(noise_information) else { return (found, None) };
    let is_identified = |group: &Group| {
        let of_series = |own: &Vec<f64>| group.iter().map(|&r| own[r] * own[r]).sum::<f64>() / group.len() as f64;
        let variance = most_likely.joint.iter().map(of_series).sum::<f64>() / series.len() as f64;
        variance > IDENTIFIED * spread.mean_variance(&series, group).sigma
    };
    let (kept, unidentified): (Vec<Group>, Vec<Group>) = in_doubt.into_iter().partition(is_identified);
    match (kept.is_empty(), unidentified.is_empty()) {
        (_, true) => (found, None),
        (true, _) => (at_none, Some(told)),
        _ => {
            drop(at_none);
            (solved_without(found.adjustment(), &unidentified, settings).ended(), Some(told))
        }
    }
}

/// Groups whose noise is that of single stops alone.
fn groups(Adjustment { problem, state }: &Adjustment) -> impl Iterator<Item = Group> + '_ {
    let of_stops = problem.noise.groups(&state.robot.chain.reading_kinds).into_iter();
    of_stops.filter(|g| g.iter().all(|&r| problem.noise.local.get(r).is_none_or(|s| *s == 0.0)))
}

/// Solved with the noise of some groups at its floor.
fn solved_without(adjustment: &Adjustment, groups: &[Group], settings: &Settings) -> Outcome {
    let mut without = adjustment.clone();
    for own in &mut without.problem.noise.joint {
        groups.iter().flatten().for_each(|&r| own[r] = JOINT_NOISE_FLOOR);
    }
    solve(without, settings)
}
