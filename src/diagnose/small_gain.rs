//! Is the corrected robot so much better than the nominal one that it is worth installing?

use super::kind::{CheckContext, Kind, Quantity, Weight};
use crate::assess::Accuracy;
use crate::error::Code;
use crate::fit::Fit;

/// The corrected robot is hardly better than the nominal one.
#[derive(Debug, Clone, PartialEq)]
pub struct SmallGain {
    /// Held-out error of the corrected robot, mm RMS.
    pub calibrated_mm: f64,
    /// Of the nominal one, mm RMS.
    pub nominal_mm: f64,
}

/// Nothing can be gained where nothing of the robot was free; no gain at all is a finding of its own.
pub(super) fn check(fit: &Fit, accuracy: &Accuracy, setting: &CheckContext) -> Option<SmallGain> {
    let layout = &fit.problem.layout;
    layout.robot().any(|c| layout.columns[c].free).then_some(())?;
    let found = SmallGain { calibrated_mm: accuracy.calibrated.rms_mm, nominal_mm: accuracy.nominal.rms_mm };
    let is_small = found.calibrated_mm * setting.limits.doubtful_gain > found.nominal_mm;
    (is_small && found.calibrated_mm <= found.nominal_mm).then_some(found)
}

impl Kind for SmallGain {
    fn code(&self) -> Code {
        Code::SmallGain
    }

    fn weight(&self) -> Weight {
        Weight::Note
    }

    fn quantities(&self) -> Vec<Quantity> {
        let errors = [("calibrated", self.calibrated_mm), ("nominal", self.nominal_mm)];
        errors.map(|(name, mm)| Quantity::new(name, 1e-3 * mm, "m")).into()
    }

    fn place(&self) -> String {
        "hold-out".into()
    }

    fn seen(&self) -> String {
        let Self { calibrated_mm, nominal_mm } = self;
        format!("the gain is small: {nominal_mm:.3} mm before, {calibrated_mm:.3} mm after")
    }

    fn remedy(&self) -> String {
        "the robot repeats no better, or the stops move its joints too little: take more, and more different ones"
            .into()
    }
}
