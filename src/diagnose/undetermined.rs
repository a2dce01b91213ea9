//! Is the corrected robot known better than the nominal one misses?

use super::kind::{CheckContext, Kind, Quantity};
use crate::assess::{Accuracy, Uncertainty};
use crate::error::Code;
use crate::linalg::median;

/// The stops do not determine the robot.
#[derive(Debug, Clone, PartialEq)]
pub struct FlangeUndetermined {
    /// Sigma of the flange in the region of the stops, mm.
    pub sigma_mm: f64,
    /// Held-out error of the nominal robot, mm RMS.
    pub nominal_mm: f64,
}

pub(super) fn check(
    uncertainty: &Uncertainty,
    accuracy: &Accuracy,
    setting: &CheckContext,
) -> Option<FlangeUndetermined> {
    let covered = uncertainty.workspace.iter().filter(|w| w.covered);
    let usual = median(covered.map(|w| w.sigma_m).collect::<Vec<f64>>()).map(|m| 1e3 * m);
    let nominal_mm = accuracy.nominal.rms_mm;
    let found = usual.filter(|mm| *mm > nominal_mm.max(setting.limits.flange_sigma_mm));
    found.map(|sigma_mm| FlangeUndetermined { sigma_mm, nominal_mm })
}

impl Kind for FlangeUndetermined {
    fn code(&self) -> Code {
        Code::FlangeUndetermined
    }

    fn quantities(&self) -> Vec<Quantity> {
        [("flange_sigma", self.sigma_mm), ("nominal_error", self.nominal_mm)]
            .map(|(name, mm)| Quantity::new(name, 1e-3 * mm, "m"))
            .into()
    }

    fn place(&self) -> String {
        "flange".into()
    }

    fn seen(&self) -> String {
        format!(
            "its place is known to {:.1} mm only in the region of the stops, and the nominal robot is off by {:.2} mm: these stops do \
             not determine the robot",
            self.sigma_mm, self.nominal_mm
        )
    }

    fn remedy(&self) -> String {
        "see what is unknown, and what to add".into()
    }
}
