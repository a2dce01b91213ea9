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

/// Readings of one kind with one camera.
type Group = (usize, Vec<usize>);

/// The outcome with such noise at its floor, and what was known of all noise before, where that changed; the problem keeps it so.
pub fn without_untold_noise(
    problem: &mut Problem,
    outcome: Outcome,
    settings: &Settings,
) -> (Outcome, Option<NoiseInformation>) {
    let Some(told) = information(problem, &outcome) else { return (outcome, None) };
    let in_doubt: Vec<Group> = groups(problem, &outcome.state)
        .filter(|(camera, group)| told.mean_variance(*camera, group).interval(PLAIN)[0] == 0.0)
        .filter(|(camera, group)| group.iter().any(|&r| problem.noise.joint[*camera][r] > JOINT_NOISE_FLOOR))
        .collect();
    if in_doubt.is_empty() {
        return (outcome, None);
    }
    let (without, at_none) = solved_without(problem, &outcome.state, &in_doubt, settings);
    let Some(spread) = information(&without, &at_none) else { return (outcome, None) };
    let is_told = |(camera, group): &Group| {
        let found = told.mean_variance(*camera, group).variance;
        found > TOLD * spread.mean_variance(*camera, group).sigma
    };
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
fn groups(problem: &Problem, state: &State) -> impl Iterator<Item = Group> {
    let local = problem.noise.local.clone();
    let of_stops = problem.noise.groups(&state.robot.chain.reading_kinds).into_iter();
    let of_stops: Vec<Vec<usize>> =
        of_stops.filter(|g| g.iter().all(|&r| local.get(r).is_none_or(|s| *s == 0.0))).collect();
    (0..problem.noise.joint.len()).flat_map(move |c| of_stops.clone().into_iter().map(move |g| (c, g)))
}

fn information(problem: &Problem, outcome: &Outcome) -> Option<NoiseInformation> {
    let lin = outcome.linearised.as_ref()?;
    noise_information(problem, &outcome.state, lin, &covariance(problem, &outcome.state, lin).ok()?)
}

fn solved_without(problem: &Problem, state: &State, groups: &[Group], settings: &Settings) -> (Problem, Outcome) {
    let mut without = problem.clone();
    for (camera, group) in groups {
        group.iter().for_each(|&r| without.noise.joint[*camera][r] = JOINT_NOISE_FLOOR);
    }
    let outcome = solve(&without, state.clone(), settings);
    (without, outcome)
}
