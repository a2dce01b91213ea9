//! Joint noise that the data do not tell from none counts as none.
//!
//! An estimate cannot be below zero: of a robot without joint noise half of the series find some, and their covariances are too
//! large. The estimate is compared with its spread where there is no noise (the test of a component on the edge of its range;
//! S. Self, K.-Y. Liang 1987).

use super::components::JOINT_NOISE_FLOOR;
use super::covariance::covariance;
use super::levenberg::{Outcome, Settings, solve};
use super::noise_information::{NoiseInformation, noise_information};
use crate::problem::{Problem, State};

/// Sigmas of an estimate where there is no noise that it must reach: one of a hundred robots without noise gets past.
const TOLD: f64 = 2.326;

/// Sigmas by its own spread from which on an estimate is told without asking further.
const PLAIN: f64 = 3.0;

/// Readings of one kind, in all series: one of them alone may have too few stops to tell what all together do.
type Group = Vec<usize>;

/// The outcome with such noise at its floor, and what was known of all noise before, where that changed; the problem keeps it so.
pub fn without_untold_noise(
    problem: &mut Problem,
    outcome: Outcome,
    settings: &Settings,
) -> (Outcome, Option<NoiseInformation>) {
    let Some(told) = information(problem, &outcome) else { return (outcome, None) };
    let series: Vec<usize> = (0..problem.noise.joint.len()).collect();
    let above_floor = |r: &usize| problem.noise.joint.iter().any(|own| own[*r] > JOINT_NOISE_FLOOR);
    let in_doubt: Vec<Group> = groups(problem, &outcome.state)
        .filter(|group| told.mean_variance(&series, group).interval(PLAIN)[0] == 0.0)
        .filter(|group| group.iter().any(above_floor))
        .collect();
    if in_doubt.is_empty() {
        return (outcome, None);
    }
    let (without, at_none) = solved_without(problem, &outcome.state, &in_doubt, settings);
    let Some(spread) = information(&without, &at_none) else { return (outcome, None) };
    let is_told =
        |group: &Group| told.mean_variance(&series, group).variance > TOLD * spread.mean_variance(&series, group).sigma;
    let (kept, untold): (Vec<Group>, Vec<Group>) = in_doubt.into_iter().partition(is_told);
    let (mended, outcome) = match (kept.is_empty(), untold.is_empty()) {
        (_, true) => return (outcome, None),
        (true, _) => (without, at_none),
        _ => solved_without(problem, &outcome.state, &untold, settings),
    };
    *problem = mended;
    (outcome, Some(told))
}

/// Groups whose noise is that of single stops alone.
fn groups<'a>(problem: &'a Problem, state: &State) -> impl Iterator<Item = Group> + 'a {
    let of_stops = problem.noise.groups(&state.robot.chain.reading_kinds).into_iter();
    of_stops.filter(|g| g.iter().all(|&r| problem.noise.local.get(r).is_none_or(|s| *s == 0.0)))
}

fn information(problem: &Problem, outcome: &Outcome) -> Option<NoiseInformation> {
    let lin = outcome.linearised.as_ref()?;
    noise_information(problem, &outcome.state, lin, &covariance(problem, &outcome.state, lin).ok()?)
}

fn solved_without(problem: &Problem, state: &State, groups: &[Group], settings: &Settings) -> (Problem, Outcome) {
    let mut without = problem.clone();
    for own in &mut without.noise.joint {
        groups.iter().flatten().for_each(|&r| own[r] = JOINT_NOISE_FLOOR);
    }
    let outcome = solve(&without, state.clone(), settings);
    (without, outcome)
}
