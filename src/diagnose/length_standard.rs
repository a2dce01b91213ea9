//! Whether a tracker, given places or measured distances have the size of the robot, by the lengths of its links and all else that is known.

use super::kind::{CheckContext, Kind, Quantity, Subject};
use crate::assess::Accuracy;
use crate::error::Code;
use crate::fit::Fit;
use crate::problem::{Adjustment, BodySeen, InstrumentKind, Problem};
use crate::solve::{ComponentOptions, LengthStandard, Status, Stretch, estimate_components};

/// Rounds of a correction of the size and a fit with it.
const ROUNDS: usize = 4;

/// Share of its sigma to which the size is found.
const FOUND: f64 = 0.1;

/// Measured lengths that contradict everything else.
#[derive(Debug, Clone, PartialEq)]
pub struct ContradictedLengths {
    /// Name of the tracker or of given places; none for measured distances.
    pub instrument: Option<String>,
    /// Lengths as stated over those as they are, less one.
    pub off: f64,
    /// Its standard deviation.
    pub sigma: f64,
}

pub(super) fn check(fit: &Fit, _: &Accuracy, setting: &CheckContext) -> Vec<ContradictedLengths> {
    let (problem, limits) = (&fit.problem, setting.limits);
    let beyond = |told: &Stretch, sigmas: f64| told.off.abs() > sigmas * told.sigma;
    let contradicted = |standard: LengthStandard| {
        let suspected = fit.linear().stretch(standard).filter(|told| beyond(told, limits.plate_size_suspected));
        let told = suspected.and_then(|_| found(&fit.adjustment, standard))?;
        let holds = beyond(&told, limits.plate_size_sigmas) && told.sigma < limits.plate_size_told;
        let instrument = match standard {
            LengthStandard::Instrument(own) => Some(problem.instruments[own].name.clone()),
            LengthStandard::Distances => None,
        };
        holds.then_some(ContradictedLengths { instrument, off: told.off, sigma: told.sigma })
    };
    standards(problem).filter_map(contradicted).collect()
}

/// What measures lengths beside plates. Sockets alone measure none.
fn standards(problem: &Problem) -> impl Iterator<Item = LengthStandard> {
    let instruments = problem.instruments.iter().enumerate().filter(|(_, i)| i.kind != InstrumentKind::Socket);
    let distances = problem.used_lengths().next().map(|_| LengthStandard::Distances);
    instruments.map(|(own, _)| LengthStandard::Instrument(own)).chain(distances)
}

/// By fits of its own, sizes of the errors included: one that is stated wrongly makes the links look worse than they are, and what they say less
/// certain.
fn found(whole: &Adjustment, standard: LengthStandard) -> Option<Stretch> {
    let mut adjustment = whole.clone();
    let mut size = 1.0;
    for _ in 0..ROUNDS {
        let outcome = estimate_components(adjustment, &ComponentOptions::default());
        let fit = Some(outcome).filter(|o| o.status == Status::Converged)?.fit().ok()?;
        let Stretch { off, sigma } = fit.linear().stretch(standard)?;
        size *= 1.0 + off;
        if off.abs() < FOUND * sigma {
            return Some(Stretch { off: size - 1.0, sigma });
        }
        adjustment = fit.adjustment;
        shrink(&mut adjustment.problem, standard, 1.0 + off);
    }
    None
}

/// Divides what a standard says by a factor.
fn shrink(problem: &mut Problem, standard: LengthStandard, factor: f64) {
    match standard {
        LengthStandard::Distances => problem.lengths.iter_mut().for_each(|l| l.distance_m /= factor),
        LengthStandard::Instrument(own) => {
            for measured in problem.body_measurements.iter_mut().filter(|m| m.instrument == own) {
                match &mut measured.seen {
                    BodySeen::Point(position) => *position /= factor,
                    BodySeen::Pose(pose) => pose.translation /= factor,
                }
            }
        }
    }
}

impl Kind for ContradictedLengths {
    fn code(&self) -> Code {
        Code::LengthsContradicted
    }

    fn subjects(&self) -> Vec<Subject> {
        let body = |name: &String| Subject::Body(name.clone());
        vec![self.instrument.as_ref().map_or_else(|| Subject::Place("[[distance]]".into()), body)]
    }

    fn quantities(&self) -> Vec<Quantity> {
        vec![Quantity::new("relative_size", self.off, "1").with_sigma(self.sigma)]
    }

    fn place(&self) -> String {
        self.instrument.clone().unwrap_or_else(|| "[[distance]]".into())
    }

    fn seen(&self) -> String {
        let Self { off, sigma, .. } = self;
        format!(
            "what it measured is {:.2} % (+- {:.2} %) {} than the links of the robot and all else say, and every length goes wrong with it",
            100.0 * off.abs(),
            100.0 * sigma,
            if *off > 0.0 { "longer" } else { "shorter" },
        )
    }

    fn remedy(&self) -> String {
        "check its unit, its scale bar and its compensation of temperature and refraction against a length that is known; if it is right, the URDF is of another robot or size"
            .into()
    }
}
