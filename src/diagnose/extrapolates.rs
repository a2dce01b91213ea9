//! Is the corrected robot any good where no stop was?

use super::kind::{CheckContext, Kind, Quantity, Weight};
use crate::assess::{Accuracy, Uncertainty, extrapolation_m};
use crate::error::Code;

/// Outside the region of the stops the corrected robot is known worse than the nominal one misses inside.
#[derive(Debug, Clone, PartialEq)]
pub struct Extrapolates {
    /// Sigma of the flange outside the region of the stops, m.
    pub outside_m: f64,
    /// Error of the nominal robot in the region of the stops, m.
    pub nominal_m: f64,
}

pub(super) fn check(uncertainty: &Uncertainty, _: &Accuracy, setting: &CheckContext) -> Option<Extrapolates> {
    let nominal_m = uncertainty.flange?.nominal_m;
    let outside_m = extrapolation_m(&uncertainty.workspace, nominal_m, setting.limits)?;
    Some(Extrapolates { outside_m, nominal_m })
}

impl Kind for Extrapolates {
    fn code(&self) -> Code {
        Code::Extrapolates
    }

    fn weight(&self) -> Weight {
        Weight::Note
    }

    fn quantities(&self) -> Vec<Quantity> {
        vec![
            Quantity::new("flange_sigma_outside", self.outside_m, "m"),
            Quantity::new("nominal_error", self.nominal_m, "m"),
        ]
    }

    fn place(&self) -> String {
        "workspace".into()
    }

    fn seen(&self) -> String {
        format!(
            "outside the region of the stops the flange is known to {:.1} mm only (inside, the nominal robot is off by {:.1} mm)",
            1e3 * self.outside_m,
            1e3 * self.nominal_m
        )
    }

    fn remedy(&self) -> String {
        "keep programs within the region, or add stops where they go; elsewhere the nominal robot may be better".into()
    }
}
