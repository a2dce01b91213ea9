//! Whether a tracker, given places or measured distances have the size of the robot, by the lengths of its links and all else that is known.

use super::kind::{CheckContext, Kind, Quantity, Subject};
use super::plate_size::{DoubtedSize, with_sizes_released};
use super::rail::{OR_THE_RAIL, is_on_rail, with_gears_released};
use crate::assess::{Accuracy, Limits};
use crate::error::Code;
use crate::fit::Fit;
use crate::problem::{Adjustment, BodySeen, InstrumentKind, Problem};
use crate::solve::{ComponentOptions, LengthStandard, Status, Stretch, estimate_components};

/// Rounds of a correction of the size and a fit with it.
const ROUNDS: usize = 4;

/// Share of its sigma to which the size is found.
const FOUND: f64 = 0.1;

/// What a plate says of a tracker or of given places that contradict it and the links.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum PlateSays {
    /// There is none that tells a size.
    Nothing,
    /// The same as the links alone.
    AsLinks,
    /// Another size, and the links do not tell which of them is right.
    Otherwise {
        /// Standard deviation of the size by the links alone.
        by_links: f64,
    },
}

/// Measured lengths that contradict everything else.
#[derive(Debug, Clone, PartialEq)]
pub struct ContradictedLengths {
    /// Name of the tracker or of given places; none for measured distances.
    pub instrument: Option<String>,
    /// Lengths as stated over those as they are, less one.
    pub off: f64,
    /// Its standard deviation.
    pub sigma: f64,
    /// What plates say.
    pub plate: PlateSays,
    /// True where a rail moves the arm, whose readings may be as wrong.
    pub on_rail: bool,
}

impl ContradictedLengths {
    /// True where the size of a plate is doubted because of it.
    pub(super) fn explains(&self, other: &DoubtedSize) -> bool {
        self.plate != PlateSays::Nothing && matches!(other, DoubtedSize::Contradicted { .. })
    }

    /// True where it is of what this instrument measures.
    pub(super) fn is_of(&self, instrument: &str) -> bool {
        self.instrument.as_deref() == Some(instrument)
    }
}

pub(super) fn check(fit: &Fit, _: &Accuracy, setting: &CheckContext) -> Vec<ContradictedLengths> {
    standards(&fit.problem).filter_map(|standard| contradicted(fit, standard, setting.limits)).collect()
}

fn is_beyond(told: &Stretch, sigmas: f64) -> bool {
    told.off.abs() > sigmas * told.sigma
}

fn contradicted(fit: &Fit, standard: LengthStandard, limits: &Limits) -> Option<ContradictedLengths> {
    let suspected = fit.linear().stretch(standard).filter(|told| is_beyond(told, limits.plate_size_suspected))?;
    let on_gears = with_gears_released(&fit.adjustment);
    let adjustment = on_gears.as_ref().unwrap_or(&fit.adjustment);
    let told = match found(adjustment, standard) {
        Some(told) => told,
        None if on_gears.is_none() => suspected,
        None => return None,
    };
    if !is_beyond(&told, limits.plate_size_sigmas) || told.sigma >= limits.plate_size_told {
        return None;
    }
    let (instrument, plate) = match standard {
        LengthStandard::Instrument(own) => {
            (Some(fit.problem.instruments[own].name.clone()), plate_says(adjustment, standard, told, limits)?)
        }
        LengthStandard::Distances => (None, PlateSays::Nothing),
    };
    let on_rail = is_on_rail(&fit.state);
    Some(ContradictedLengths { instrument, off: told.off, sigma: told.sigma, plate, on_rail })
}

/// Which of plate and instrument the links by themselves contradict; `None` where it is the plate alone, of which [`super::plate_size`] speaks.
fn plate_says(whole: &Adjustment, standard: LengthStandard, told: Stretch, limits: &Limits) -> Option<PlateSays> {
    let alone = with_sizes_released(whole).and_then(|released| found(&released, standard));
    let Some(alone) = alone else { return Some(PlateSays::Nothing) };
    // The plate against the links, by way of the instrument.
    let of_plate = Stretch { off: alone.off - told.off, sigma: alone.sigma.hypot(told.sigma) };
    let contradicts = |told: &Stretch| is_beyond(told, limits.plate_size_sigmas);
    match (contradicts(&alone), contradicts(&of_plate)) {
        (true, false) => Some(PlateSays::AsLinks),
        (false, true) => None,
        _ => Some(PlateSays::Otherwise { by_links: alone.sigma }),
    }
}

/// What measures lengths beside plates. Sockets alone measure none.
fn standards(problem: &Problem) -> impl Iterator<Item = LengthStandard> {
    let instruments = problem.instruments.iter().enumerate().filter(|(_, i)| i.kind != InstrumentKind::Socket);
    let distances = problem.used_lengths().next().map(|_| LengthStandard::Distances);
    instruments.map(|(own, _)| LengthStandard::Instrument(own)).chain(distances)
}

/// By fits of its own, sizes of the errors included: one that is stated wrongly makes the links look worse than they are, and what they say less
/// certain. Where the rounds do not end it, it is what the last of them says.
fn found(whole: &Adjustment, standard: LengthStandard) -> Option<Stretch> {
    let mut adjustment = whole.clone();
    let mut size = 1.0;
    let mut last = None;
    for _ in 0..ROUNDS {
        let outcome = estimate_components(adjustment, &ComponentOptions::default());
        let fit = Some(outcome).filter(|o| o.status == Status::Converged)?.fit().ok()?;
        let Stretch { off, sigma } = fit.linear().stretch(standard)?;
        size *= 1.0 + off;
        last = Some(Stretch { off: size - 1.0, sigma });
        if off.abs() < FOUND * sigma {
            break;
        }
        adjustment = fit.adjustment;
        shrink(&mut adjustment.problem, standard, 1.0 + off);
    }
    last
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
        let own = self.instrument.as_ref().map_or_else(|| Subject::Place("[[distance]]".into()), body);
        let plate = matches!(self.plate, PlateSays::Otherwise { .. }).then(|| Subject::Body("plate".into()));
        [own].into_iter().chain(plate).collect()
    }

    fn quantities(&self) -> Vec<Quantity> {
        vec![Quantity::new("relative_size", self.off, "1").with_sigma(self.sigma)]
    }

    fn place(&self) -> String {
        self.instrument.clone().unwrap_or_else(|| "[[distance]]".into())
    }

    fn seen(&self) -> String {
        let Self { off, sigma, .. } = self;
        if let PlateSays::Otherwise { by_links } = self.plate {
            return format!(
                "it and the plate contradict each other: its lengths are {:.2} % (+- {:.2} %) {} than by the plate, and the links, which know the size to {:.2} %, do not tell which is right",
                100.0 * off.abs(),
                100.0 * sigma,
                if *off > 0.0 { "longer" } else { "shorter" },
                100.0 * by_links,
            );
        }
        format!(
            "what it measured is {:.2} % (+- {:.2} %) {} than the links of the robot and all else say, and every length goes wrong with it",
            100.0 * off.abs(),
            100.0 * sigma,
            if *off > 0.0 { "longer" } else { "shorter" },
        )
    }

    fn remedy(&self) -> String {
        let remedy = match self.plate {
            PlateSays::Otherwise { .. } => {
                "check it against a length that is known, and measure two far markers of the plate and give [scale] in plate.toml"
            }
            _ => {
                "check its unit, its scale bar and its compensation of temperature and refraction against a length that is known; if it is right, the URDF is of another robot or size"
            }
        };
        format!("{remedy}{}", if self.on_rail { OR_THE_RAIL } else { "" })
    }
}
