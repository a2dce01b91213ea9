//! Was the robot held near nominal because joint errors are no noise?

use super::kind::{CheckContext, Kind, Quantity, Weight};
use crate::assess::Accuracy;
use crate::error::Code;
use crate::fit::Fit;

/// The corrected robot is held near the nominal one outside the region of the stops.
#[derive(Debug, Clone, PartialEq)]
pub struct HeldNearNominal {
    /// Displacement of the corrected robot against the nominal one that is expected there, RMS of the length, m: as at the stops.
    pub displacement_m: f64,
    /// Normal deviate of how the joint errors repeat over neighbouring readings.
    pub repeats: f64,
}

pub(super) fn check(fit: &Fit, _: &Accuracy, _: &CheckContext) -> Option<HeldNearNominal> {
    let held = fit.problem.restraint.as_ref()?;
    Some(HeldNearNominal { displacement_m: held.displacement_m, repeats: held.repeats })
}

impl Kind for HeldNearNominal {
    fn code(&self) -> Code {
        Code::HeldNearNominal
    }

    fn weight(&self) -> Weight {
        Weight::Note
    }

    fn quantities(&self) -> Vec<Quantity> {
        vec![
            Quantity::new("expected_displacement", self.displacement_m, "m"),
            Quantity::new("repeated_joint_errors", self.repeats, "1"),
        ]
    }

    fn place(&self) -> String {
        "joint errors".into()
    }

    fn seen(&self) -> String {
        format!(
            "they repeat at neighbouring readings ({:.1} standard deviations), so that the fit takes some of them for links; where the stops do not say, the corrected robot is held as near to the nominal one as it is at the stops ({:.2} mm RMS)",
            self.repeats,
            1e3 * self.displacement_m
        )
    }

    fn remedy(&self) -> String {
        "add stops where programs go".into()
    }
}
