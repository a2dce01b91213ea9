//! Which table a mistake of rows is in: where another instrument fits the readings at the same stops as they are, not in that of the readings.

use std::collections::{BTreeMap, BTreeSet};

use super::misfit::{BodyAtStop, usual_misfit};
use crate::assess::Limits;
use crate::diagnose::RowsOf;
use crate::init::{PosePair, hand_eye_misfit};
use crate::model::robot::Robot;
use crate::problem::{Adjustment, BodyMeasurement, BodySeen, InstrumentKind, Problem};

/// Images of a mounting and a placement, by their indices.
type Group = [(usize, PosePair)];

/// Of measurements of a body: images that are in use have passed the start.
pub(super) fn rows_of_bodies(
    Adjustment { problem, state }: &Adjustment,
    measured: &[usize],
    limits: &Limits,
) -> RowsOf {
    let own = measured.iter().map(|k| problem.body_measurements[*k].stop).collect();
    let Some((table, body)) =
        measured.first().map(|k| &problem.body_measurements[*k]).map(|m| (table(problem, m), m.body))
    else {
        return RowsOf::Readings;
    };
    let seen: BTreeSet<usize> = problem.used_on_robot().map(|i| problem.images[i].stop).collect();
    let images_fit = seen.len() >= limits.hand_eye_images && are_same(&own, &seen);
    // Of several targets in one table, rows of one may be shifted alone.
    let is_other = |measured: &BodyMeasurement| self::table(problem, measured) != table || measured.body != body;
    match images_fit || bodies_fit(problem, &state.robot, (&own, is_other), limits) {
        true => RowsOf::Measured(table),
        false => RowsOf::Readings,
    }
}

/// Of images of one mounting and placement, among those of all.
pub(in crate::identify) fn rows_of_images(
    problem: &Problem,
    robot: &Robot,
    (own, all): (&Group, &[Vec<(usize, PosePair)>]),
    limits: &Limits,
) -> RowsOf {
    let Some(series) = own.first().map(|(i, _)| problem.images[*i].series) else { return RowsOf::Readings };
    let stops_of = |group: &Group| group.iter().map(|(i, _)| problem.images[*i].stop).collect::<BTreeSet<usize>>();
    let own = stops_of(own);
    let fits = |group: &Vec<(usize, PosePair)>| {
        let pairs: Vec<PosePair> = group.iter().map(|(_, pair)| *pair).collect();
        let is_other = group.first().is_some_and(|(i, _)| problem.images[*i].series != series);
        is_other
            && pairs.len() >= limits.hand_eye_images
            && are_same(&own, &stops_of(group))
            && hand_eye_misfit(&pairs) < limits.suspicious_misfit
    };
    if all.iter().any(fits) {
        return RowsOf::Camera;
    }
    match bodies_fit(problem, robot, (&own, |_: &BodyMeasurement| true), limits) {
        true => RowsOf::Pictures,
        false => RowsOf::Readings,
    }
}

/// True where most of these stops are among others.
fn are_same(own: &BTreeSet<usize>, others: &BTreeSet<usize>) -> bool {
    2 * own.intersection(others).count() > own.len()
}

/// Whether some tracker, or given places, fit the readings at most of these stops.
fn bodies_fit(
    problem: &Problem,
    robot: &Robot,
    (own, is_other): (&BTreeSet<usize>, impl Fn(&BodyMeasurement) -> bool),
    limits: &Limits,
) -> bool {
    let mut groups: BTreeMap<(usize, usize), Vec<BodyAtStop>> = BTreeMap::new();
    for (_, measured) in problem.used_bodies() {
        let has_frame = problem.instruments[measured.instrument].kind != InstrumentKind::Socket;
        if has_frame && is_other(measured) {
            groups.entry((measured.instrument, measured.body)).or_default().extend(BodyAtStop::of(problem, measured));
        }
    }
    groups.values().any(|seen| {
        seen.len() >= limits.hand_eye_images
            && are_same(own, &seen.iter().map(|s| s.stop).collect())
            && usual_misfit(robot, seen) < limits.suspicious_misfit
    })
}

/// The table that a measurement stands in.
pub(super) fn table(problem: &Problem, measured: &BodyMeasurement) -> &'static str {
    match (problem.instruments[measured.instrument].kind, measured.seen) {
        (InstrumentKind::Tracker, BodySeen::Point(_)) => "points.csv",
        (InstrumentKind::Tracker, BodySeen::Pose(_)) => "poses.csv",
        (InstrumentKind::Socket | InstrumentKind::Places, _) => "contacts.csv",
    }
}
