//! Does the corrected robot predict images that it has not seen better than the nominal one?

use super::kind::{CheckContext, Kind, Quantity, Subject};
use super::lost_images::LostImages;
use crate::assess::Accuracy;
use crate::error::Code;
use crate::fit::Fit;

/// The corrected robot is no better than the nominal one.
#[derive(Debug, Clone, PartialEq)]
pub struct NoGain {
    /// Held-out error of the corrected robot, mm RMS.
    pub calibrated_mm: f64,
    /// Of the nominal one, mm RMS.
    pub nominal_mm: f64,
    /// Whether images were held out; else measurements of trackers and contacts.
    pub by_images: bool,
    /// What cost many images, if that is so.
    pub lost: Option<LostImages>,
}

/// Nothing can be gained where nothing of the robot was free, as with poses of a controller alone.
pub(super) fn check(fit: &Fit, accuracy: &Accuracy, setting: &CheckContext) -> Option<NoGain> {
    let layout = &fit.problem.layout;
    layout.robot().any(|c| layout.columns[c].free).then_some(())?;
    let found = NoGain {
        calibrated_mm: accuracy.calibrated.rms_mm,
        nominal_mm: accuracy.nominal.rms_mm,
        by_images: fit.problem.used_on_robot().next().is_some(),
        lost: LostImages::of(&fit.problem, setting.limits),
    };
    (found.calibrated_mm > found.nominal_mm).then_some(found)
}

impl Kind for NoGain {
    fn code(&self) -> Code {
        Code::NoGain
    }

    fn subjects(&self) -> Vec<Subject> {
        Vec::new()
    }

    fn quantities(&self) -> Vec<Quantity> {
        let errors = [("calibrated", self.calibrated_mm), ("nominal", self.nominal_mm)];
        let errors = errors.map(|(name, mm)| Quantity::new(name, 1e-3 * mm, "m"));
        errors.into_iter().chain(self.lost.as_ref().map(LostImages::quantity)).collect()
    }

    fn place(&self) -> String {
        "hold-out".into()
    }

    fn seen(&self) -> String {
        format!(
            "the corrected robot predicts {} no better than the nominal one ({:.3} mm against {:.3} mm)",
            if self.by_images { "images" } else { "measurements" },
            self.calibrated_mm,
            self.nominal_mm
        )
    }

    fn remedy(&self) -> String {
        match &self.lost {
            Some(lost) => format!("{}; keep the nominal robot until then", lost.remedy()),
            None => "keep the nominal robot, and take more stops, and more different ones".into(),
        }
    }
}
