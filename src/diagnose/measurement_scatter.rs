//! Do measurements of trackers and contacts scatter as their stated sigma says?

use super::kind::{CheckContext, Kind, Quantity, Subject, Weight};
use crate::assess::Accuracy;
use crate::error::Code;
use crate::fit::Fit;

/// Measurements of a tracker or of contacts scatter more than stated.
#[derive(Debug, Clone, PartialEq)]
pub struct MeasurementsScatter {
    /// Tracker or socket.
    pub instrument: String,
    /// True where the rotations scatter, false where the positions do.
    pub turned: bool,
    /// Factor on the stated sigma.
    pub factor: f64,
    /// Gate or note.
    pub weight: Weight,
}

pub(super) fn check(fit: &Fit, _: &Accuracy, setting: &CheckContext) -> Vec<MeasurementsScatter> {
    let (problem, limits) = (&fit.problem, setting.limits);
    let mut found = Vec::new();
    for (component, factors) in problem.noise.body.iter().enumerate() {
        let Some(instrument) = problem.instruments.iter().find(|i| i.component == component) else { continue };
        for (turned, &factor) in [false, true].into_iter().zip(factors) {
            let weight = match factor {
                f if f > limits.measurement_factor => Weight::Gate,
                f if f > limits.doubtful_measurement_factor => Weight::Note,
                _ => continue,
            };
            found.push(MeasurementsScatter { instrument: instrument.name.clone(), turned, factor, weight });
        }
    }
    found
}

impl Kind for MeasurementsScatter {
    fn code(&self) -> Code {
        Code::MeasurementsScatter
    }

    fn weight(&self) -> Weight {
        self.weight
    }

    fn subjects(&self) -> Vec<Subject> {
        vec![Subject::Body(self.instrument.clone())]
    }

    fn quantities(&self) -> Vec<Quantity> {
        let name = if self.turned { "rotation_sigma_factor" } else { "position_sigma_factor" };
        vec![Quantity::new(name, self.factor, "1")]
    }

    fn place(&self) -> String {
        self.instrument.clone()
    }

    fn seen(&self) -> String {
        let kind = if self.turned { "rotations" } else { "positions" };
        let decimals = (2.0 - self.factor.log10().floor()).max(0.0) as usize;
        format!("its {kind} scatter {:.decimals$} times as much as their stated sigma says", self.factor)
    }

    fn remedy(&self) -> String {
        let remedy = match self.turned {
            true => {
                "check the order and direction of the quaternions (qx, qy, qz, qw: instrument_from_target) and that target and tracker stood still, or state sigma_rad in series.toml"
            }
            false => {
                "check units and axes, that each row is of its stop, and that tracker, target and sockets did not move during the series, or state sigma_m in series.toml"
            }
        };
        remedy.into()
    }
}
