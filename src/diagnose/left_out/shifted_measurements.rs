//! Do measurements that were left out one after the other fit the readings of their neighbours?

use std::collections::BTreeMap;

use crate::assess::{Limits, best_run};
use crate::diagnose::kind::{CheckContext, Kind, Quantity, Subject, Weight};
use crate::error::Code;
use crate::linalg::median;
use crate::problem::{Adjustment, BodyMeasurement, BodyRejection, BodySeen, TakenFrom, stop_name};

/// Rows of a tracker that stand beside the readings of a neighbour, and are left out.
#[derive(Debug, Clone, PartialEq)]
pub struct ShiftedMeasurements {
    /// Series and tracker.
    pub of: [String; 2],
    /// The first and the last stop.
    pub stops: [String; 2],
    /// How many there are.
    pub rows: usize,
    /// True where they fit the readings of the row below, else of the one above.
    pub below: bool,
    /// How well the worst of them does, m + rad.
    pub misfit: f64,
    /// True where something else that was measured at each of these stops fits its readings.
    pub others_fit: bool,
}

/// One for every tracker and target; of targets that are shifted alike the first.
pub fn check(adjustment: &Adjustment, setting: &CheckContext) -> Vec<ShiftedMeasurements> {
    let problem = &adjustment.problem;
    let mut groups: BTreeMap<(usize, usize), Vec<usize>> = BTreeMap::new();
    for (k, measured) in problem.body_measurements.iter().enumerate() {
        if problem.is_by_tracker(measured) {
            groups.entry((measured.instrument, measured.body)).or_default().push(k);
        }
    }
    let mut all: Vec<ShiftedMeasurements> = Vec::new();
    for group in groups.values() {
        let found = Group { adjustment, group }.shifted(setting);
        let new = found.filter(|f| !all.iter().any(|known| known.is_like(f)));
        all.extend(new);
    }
    all
}

/// How far a row of an instrument is from where the readings of a stop have what a row beside it measures (or it itself), m + rad.
pub(super) fn misfit(
    Adjustment { problem, state }: &Adjustment,
    row: &BodyMeasurement,
    (as_of, stop): (&BodyMeasurement, usize),
) -> Option<f64> {
    let posture = problem.stops[stop].posture.as_ref()?;
    let predicted = state.instrument_from_body(as_of, TakenFrom::exact(posture))?;
    Some(match row.seen {
        BodySeen::Point(at) => (at - predicted.translation).norm(),
        BodySeen::Pose(pose) => pose.misfit(&predicted),
    })
}

/// How far rows in use usually are from where the readings of their stops have them, m + rad.
pub(super) fn usual_misfit<'r>(
    adjustment: &Adjustment,
    rows: impl IntoIterator<Item = &'r BodyMeasurement>,
) -> Option<f64> {
    let used = rows.into_iter().filter(|row| row.rejected.is_none());
    median(used.filter_map(|row| misfit(adjustment, row, (row, row.stop))))
}

/// True of a row that was left out for not fitting.
pub(super) const fn is_out(row: &BodyMeasurement) -> bool {
    matches!(row.rejected, Some(BodyRejection::Residual { .. } | BodyRejection::JointError { .. }))
}

struct Group<'a> {
    adjustment: &'a Adjustment,
    /// Indices of the measurements in the order of their stops.
    group: &'a [usize],
}

impl Group<'_> {
    fn measured(&self, row: usize) -> &BodyMeasurement {
        &self.adjustment.problem.body_measurements[self.group[row]]
    }

    /// How far a row is from where the readings of a stop have it.
    fn misfit(&self, row: usize, stop: usize) -> Option<f64> {
        misfit(self.adjustment, self.measured(row), (self.measured(row), stop))
    }

    /// The run of rows that were left out and fit those of a neighbour, in one direction and order of the stops.
    fn shifted(&self, setting: &CheckContext) -> Option<ShiftedMeasurements> {
        let problem = &self.adjustment.problem;
        let usual = usual_misfit(self.adjustment, (0..self.group.len()).map(|row| self.measured(row)))?;
        let own: Vec<usize> = (0..self.group.len()).map(|row| self.measured(row).stop).collect();
        let orders = problem.orders_of_rows(&own);
        let ways = orders.iter().flat_map(|order| [true, false].map(|below| (order, below)));
        ways.filter_map(|(order, below)| self.run(order, below, usual, setting)).max_by_key(|found| found.rows)
    }

    fn run(&self, order: &[usize], below: bool, usual: f64, setting: &CheckContext) -> Option<ShiftedMeasurements> {
        let problem = &self.adjustment.problem;
        let limits = setting.limits;
        let fits: Vec<Option<f64>> =
            (0..self.group.len()).map(|row| self.as_the_neighbour(row, (order, below), usual, limits)).collect();
        let gain = |fits: &Option<f64>| if fits.is_some() { 1.0 } else { -1.0 };
        let rows = best_run(&fits.iter().map(gain).collect::<Vec<f64>>());
        let shifted: Vec<usize> = rows.clone().filter(|row| fits[*row].is_some()).collect();
        let [first, last] = [*shifted.first()?, *shifted.last()?].map(|row| self.measured(row));
        let name = |measured: &BodyMeasurement| stop_name(setting.series, measured.read);
        let is_seen = |row: &usize| problem.is_measured_at(self.measured(*row).stop);
        (shifted.len() >= limits.moved_images).then(|| ShiftedMeasurements {
            of: [setting.series[first.read.0].name.clone(), problem.instruments[first.instrument].name.clone()],
            stops: [first, last].map(name),
            rows: shifted.len(),
            below,
            misfit: rows.filter_map(|row| fits[row]).fold(0.0, f64::max),
            others_fit: shifted.iter().all(is_seen),
        })
    }

    /// How well a row that was left out fits the readings of its neighbour; `None` where it does not.
    fn as_the_neighbour(
        &self,
        row: usize,
        (order, below): (&[usize], bool),
        usual: f64,
        limits: &Limits,
    ) -> Option<f64> {
        let problem = &self.adjustment.problem;
        let measured = self.measured(row);
        let other = problem.neighbour(order, measured.stop, below).filter(|_| is_out(measured))?;
        let (own, as_other) = (self.misfit(row, measured.stop)?, self.misfit(row, other)?);
        (as_other < usual + limits.other_readings_explain * own).then_some(as_other)
    }
}

impl ShiftedMeasurements {
    /// True of another target of the same tracker in the same rows.
    fn is_like(&self, other: &Self) -> bool {
        (&self.of, &self.stops, self.below) == (&other.of, &other.stops, other.below)
    }
}

impl Kind for ShiftedMeasurements {
    fn code(&self) -> Code {
        Code::RowsShifted
    }

    fn weight(&self) -> Weight {
        Weight::Note
    }

    fn subjects(&self) -> Vec<Subject> {
        self.stops.iter().cloned().map(Subject::Stop).collect()
    }

    fn quantities(&self) -> Vec<Quantity> {
        vec![
            Quantity::new("measurements_shifted", self.rows as f64, "1"),
            Quantity::new("misfit_shifted", self.misfit, "m + rad"),
        ]
    }

    fn place(&self) -> String {
        let [series, tracker] = &self.of;
        format!("series {series}, {tracker}")
    }

    fn seen(&self) -> String {
        let [first, last] = &self.stops;
        format!(
            "from {first} to {last} measurements and joint readings are shifted by one row: {} measurements that were left out fit the readings of the row {}",
            self.rows,
            if self.below { "below" } else { "above" }
        )
    }

    fn remedy(&self) -> String {
        let [first, last] = &self.stops;
        let table = match self.others_fit {
            true => "that of the tracker, and leave joints.csv as it is, which others fit",
            false => "joints.csv or that of the tracker",
        };
        format!(
            "look for a row that was lost or written twice before {first}, and shift the names of the stops by one row from there to {last} in {table}"
        )
    }
}
