//! Are two targets of a tracker in the place of each other at some stops?

use std::collections::{BTreeMap, BTreeSet};

use super::shifted_measurements::{is_out, misfit, usual_misfit};
use crate::diagnose::kind::{CheckContext, Kind, Quantity, Subject, Weight, some_of};
use crate::error::Code;
use crate::problem::{Adjustment, stop_name};

/// Most stops that are named.
const MOST_STOPS: usize = 6;

/// Stops at which the rows of two targets fit each other's place.
#[derive(Debug, Clone, PartialEq)]
pub struct ExchangedTargets {
    /// The tracker.
    pub tracker: String,
    /// The targets.
    pub targets: [String; 2],
    /// The stops, in their order.
    pub stops: Vec<String>,
    /// How well the worst row fits in the place of the other, m + rad.
    pub misfit: f64,
}

/// Every two targets of a tracker once.
pub fn check(adjustment: &Adjustment, setting: &CheckContext) -> Vec<ExchangedTargets> {
    let problem = &adjustment.problem;
    let all = &problem.body_measurements;
    let out: Vec<usize> = (0..all.len()).filter(|&k| problem.is_by_tracker(&all[k]) && is_out(&all[k])).collect();
    let usual = usual_misfits(adjustment, out.iter().map(|&k| all[k].instrument).collect());
    let mut found: Vec<ExchangedTargets> = Vec::new();
    for (at, &one) in out.iter().enumerate() {
        let is_beside = |other: &usize| {
            let [a, b] = [one, *other].map(|k| (all[k].stop, all[k].instrument));
            a == b && all[one].body != all[*other].body
        };
        for &other in out[at + 1..].iter().filter(|other| is_beside(other)) {
            let usual = usual.get(&all[one].instrument).copied();
            let Some(misfit) = usual.and_then(|usual| exchanged(adjustment, [one, other], usual, setting)) else {
                continue;
            };
            let stop = stop_name(setting.series, all[one].read);
            let tracker = problem.instruments[all[one].instrument].name.clone();
            let mut targets = [one, other].map(|k| problem.bodies[all[k].body].clone());
            targets.sort();
            match found.iter_mut().find(|f| (&f.tracker, &f.targets) == (&tracker, &targets)) {
                Some(known) => {
                    known.stops.push(stop);
                    known.misfit = known.misfit.max(misfit);
                }
                None => found.push(ExchangedTargets { tracker, targets, stops: vec![stop], misfit }),
            }
        }
    }
    found
}

/// Of every tracker, m + rad.
fn usual_misfits(adjustment: &Adjustment, trackers: BTreeSet<usize>) -> BTreeMap<usize, f64> {
    let rows = adjustment.problem.body_measurements.iter();
    let of = |tracker: usize| {
        let own = rows.clone().filter(|row| row.instrument == tracker);
        Some((tracker, usual_misfit(adjustment, own)?))
    };
    trackers.into_iter().filter_map(of).collect()
}

/// How well both rows fit in the place of each other, where they do.
fn exchanged(adjustment: &Adjustment, [one, other]: [usize; 2], usual: f64, setting: &CheckContext) -> Option<f64> {
    let all = &adjustment.problem.body_measurements;
    let fits = |row: usize, place: usize| {
        let own = misfit(adjustment, &all[row], (&all[row], all[row].stop))?;
        let there = misfit(adjustment, &all[row], (&all[place], all[place].stop))?;
        (there < usual + setting.limits.other_readings_explain * own).then_some(there)
    };
    Some(f64::max(fits(one, other)?, fits(other, one)?))
}

impl Kind for ExchangedTargets {
    fn code(&self) -> Code {
        Code::TargetsExchanged
    }

    fn weight(&self) -> Weight {
        Weight::Note
    }

    fn subjects(&self) -> Vec<Subject> {
        self.stops.iter().cloned().map(Subject::Stop).collect()
    }

    fn quantities(&self) -> Vec<Quantity> {
        vec![
            Quantity::new("stops", self.stops.len() as f64, "1"),
            Quantity::new("misfit_exchanged", self.misfit, "m + rad"),
        ]
    }

    fn place(&self) -> String {
        format!("{}, {}", self.tracker, self.targets.join(", "))
    }

    fn seen(&self) -> String {
        let [one, other] = &self.targets;
        format!(
            "{one} and {other} are exchanged at {} stops ({}): each row fits in the place of the other to {:.2} (mm plus mrad)",
            self.stops.len(),
            some_of(&self.stops, MOST_STOPS),
            1e3 * self.misfit
        )
    }

    fn remedy(&self) -> String {
        "exchange the names of these targets at these stops, and all rows are used".into()
    }
}
