//! Did a tracker write the same again and again while the arm moved on?

use super::kind::{CheckContext, Kind, Quantity, Subject, Weight};
use crate::error::Code;
use crate::problem::{Adjustment, BodyRejection, stop_name};

/// Stops at which a tracker was stuck: what it wrote there is left out.
#[derive(Debug, Clone, PartialEq)]
pub struct RepeatedMeasurements {
    /// Series and tracker.
    pub of: [String; 2],
    /// The stops with one reading that it is not of, in order.
    pub stops: Vec<String>,
}

/// Every run of stops once, whatever the number of targets.
pub(super) fn check(Adjustment { problem, .. }: &Adjustment, setting: &CheckContext) -> Vec<RepeatedMeasurements> {
    let mut runs: Vec<(usize, Vec<usize>)> = Vec::new();
    let repeated = problem.body_measurements.iter().enumerate();
    for (k, measured) in repeated.filter(|(_, m)| m.rejected == Some(BodyRejection::Repeated)) {
        let of_run = |other: &usize| {
            let other = &problem.body_measurements[*other];
            (other.instrument, other.body, other.read.0, other.seen)
                == (measured.instrument, measured.body, measured.read.0, measured.seen)
        };
        match runs.iter_mut().find(|(_, run)| run.first().is_some_and(of_run)) {
            Some((_, run)) => run.push(k),
            None => runs.push((measured.instrument, vec![k])),
        }
    }
    let mut all: Vec<RepeatedMeasurements> = Vec::new();
    for (instrument, run) in runs {
        let name = |k: &usize| stop_name(setting.series, problem.body_measurements[*k].read);
        let series = setting.series[problem.body_measurements[run[0]].read.0].name.clone();
        let of = [series, problem.instruments[instrument].name.clone()];
        let found = RepeatedMeasurements { of, stops: run.iter().map(name).collect() };
        if !all.contains(&found) {
            all.push(found);
        }
    }
    all
}

impl Kind for RepeatedMeasurements {
    fn code(&self) -> Code {
        Code::MeasurementsRepeated
    }

    fn weight(&self) -> Weight {
        Weight::Note
    }

    fn subjects(&self) -> Vec<Subject> {
        self.stops.iter().cloned().map(Subject::Stop).collect()
    }

    fn quantities(&self) -> Vec<Quantity> {
        vec![Quantity::new("measurements_repeated", self.stops.len() as f64, "1")]
    }

    fn place(&self) -> String {
        let [series, tracker] = &self.of;
        format!("series {series}, {tracker}")
    }

    fn seen(&self) -> String {
        format!(
            "the tracker wrote one reading at successive stops, to the last digit, though the arm had moved on: those that fit no other are left out, {}",
            self.stops.join(", ")
        )
    }

    fn remedy(&self) -> String {
        "measure again at these stops, and see why the tracker wrote an old reading".into()
    }
}
