//! Do measurements of trackers and contacts belong to their stops?

use std::collections::BTreeSet;

use crate::diagnose::kind::{CheckContext, Kind, Quantity, Subject, Weight, some_of};
use crate::error::Code;
use crate::problem::{Adjustment, BodyRejection, stop_name};

/// Most that are named.
const MOST_NAMED: usize = 5;

/// Measurements of bodies that do not fit.
#[derive(Debug, Clone, PartialEq)]
pub struct MeasurementsLeftOut {
    /// Stop, instrument and reason of each.
    pub named: Vec<[String; 3]>,
    /// How many there were.
    pub all: usize,
    /// Of several trackers and places the one that all are of, where they are not few.
    pub all_of: Option<String>,
    /// Findings that say why some of them do not fit, by code and place.
    pub explained_by: Vec<(Code, String)>,
    /// Note, gate, or refusal where most are left out.
    pub weight: Weight,
}

/// Beside findings that say why, by code and place.
pub fn check(
    adjustment: &Adjustment,
    explained_by: Vec<(Code, String)>,
    setting: &CheckContext,
) -> Option<MeasurementsLeftOut> {
    let problem = &adjustment.problem;
    let (mut named, mut instruments) = (Vec::new(), BTreeSet::new());
    // What was written again and again has a finding of its own.
    for measured in &problem.body_measurements {
        let Some(why) = measured.rejected.filter(|why| *why != BodyRejection::Repeated) else { continue };
        let name = stop_name(setting.series, measured.read);
        let instrument = &problem.instruments[measured.instrument].name;
        instruments.insert(instrument);
        named.push([name, instrument.clone(), why.to_string()]);
    }
    let (out, all) = (named.len(), problem.body_measurements.len());
    let share = |limit: f64| out as f64 > limit * all as f64;
    let weight = match () {
        () if out == 0 => return None,
        () if share(setting.limits.hopeless_share_of_images_left_out) => Weight::Refusal,
        () if share(setting.limits.share_of_images_left_out) => Weight::Gate,
        () => Weight::Note,
    };
    let is_one = instruments.len() == 1 && problem.instruments.len() > 1 && out >= setting.limits.moved_images;
    let all_of = instruments.first().filter(|_| is_one).map(|name| (*name).clone());
    // A refusal stands alone.
    let explained_by = if weight == Weight::Refusal { Vec::new() } else { explained_by };
    Some(MeasurementsLeftOut { named, all, all_of, explained_by, weight })
}

impl Kind for MeasurementsLeftOut {
    fn code(&self) -> Code {
        Code::MeasurementsLeftOut
    }

    fn weight(&self) -> Weight {
        self.weight
    }

    fn subjects(&self) -> Vec<Subject> {
        self.named.iter().map(|[stop, ..]| Subject::Stop(stop.clone())).collect()
    }

    fn quantities(&self) -> Vec<Quantity> {
        vec![
            Quantity::new("measurements_left_out", self.named.len() as f64, "1"),
            Quantity::new("measurements", self.all as f64, "1"),
        ]
    }

    fn place(&self) -> String {
        "measurements".into()
    }

    fn seen(&self) -> String {
        let named: Vec<String> =
            self.named.iter().map(|[stop, instrument, why]| format!("stop {stop} ({instrument}): {why}")).collect();
        let (out, all) = (self.named.len(), self.all);
        format!("{out} of {all} do not fit the others and are left out: {}", some_of(&named, MOST_NAMED))
    }

    fn remedy(&self) -> String {
        let usual = "check joint_unit, the order and signs of the joints, that every row names its own stop, and that instrument and targets did not move";
        let explained: Vec<String> =
            self.explained_by.iter().map(|(code, place)| format!("{place} ({})", code.name())).collect();
        match &self.all_of {
            _ if !explained.is_empty() => {
                format!("do first what is said of {}; where others are left out, {usual}", explained.join("; "))
            }
            Some(name) => format!(
                "all are of {name}: did it move? Then give the rows before and after another name each; else {usual}"
            ),
            None => usual.to_owned(),
        }
    }
}
