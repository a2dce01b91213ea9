//! Were the readings rounded before they were written, and is that what the joint noise is?

use super::joint_noise::{noisiest_joint, says_noise_first};
use super::kind::{CheckContext, Kind, Quantity, Subject, Weight};
use crate::assess::Accuracy;
use crate::error::Code;
use crate::fit::Fit;
use crate::problem::Rounding;
use crate::urdf::JointKind;

/// All readings of a series are multiples of one step, which is as large as the joint noise says.
#[derive(Debug, Clone, PartialEq)]
pub struct ReadingsRounded {
    /// Series.
    pub series: String,
    /// The step.
    pub rounding: Rounding,
    /// Joint noise that was found, rad.
    pub sigma_rad: f64,
    /// True where there are no readings of other stops, which might be exact.
    pub is_only: bool,
    /// Gate or note.
    pub weight: Weight,
}

pub(super) fn check(fit: &Fit, _: &Accuracy, setting: &CheckContext) -> Vec<ReadingsRounded> {
    let limits = setting.limits;
    let kinds = &fit.state.robot.chain.reading_kinds;
    let of_series = |(k, of): (usize, &crate::problem::MeasuredSeries)| {
        let (joint, _, sigma_rad) = noisiest_joint(setting.with_noise_found(fit), k)?;
        if kinds[joint] != JointKind::Revolute || !says_noise_first(fit, k) {
            return None;
        }
        let rounding = Rounding::of(of, kinds).filter(|r| !of.readings_are_computed() && r.explains(sigma_rad))?;
        let weight = match sigma_rad {
            s if s > limits.joint_noise => Weight::Gate,
            s if s >= limits.unusual_joint_noise => Weight::Note,
            _ => return None,
        };
        let is_only = (0..setting.series.len()).filter(|k| says_noise_first(fit, *k)).count() == 1;
        Some(ReadingsRounded { series: of.name.clone(), rounding, sigma_rad, is_only, weight })
    };
    setting.series.iter().enumerate().filter_map(of_series).collect()
}

impl ReadingsRounded {
    /// The noise that was found without any move is that of the rounding: nothing is left that moves would explain. Where the rounding is small
    /// enough to go on, moves are told as they are.
    pub(super) fn explains_moves(&self) -> bool {
        self.is_only && self.weight == Weight::Gate
    }
}

impl Kind for ReadingsRounded {
    fn code(&self) -> Code {
        Code::ReadingsRounded
    }

    fn weight(&self) -> Weight {
        self.weight
    }

    fn subjects(&self) -> Vec<Subject> {
        vec![Subject::Series(self.series.clone())]
    }

    fn quantities(&self) -> Vec<Quantity> {
        vec![
            Quantity::new("step", self.rounding.step_rad, "rad"),
            Quantity::new("rounding_noise", self.rounding.sigma_rad(), "rad"),
            Quantity::new("joint_noise", self.sigma_rad, "rad"),
        ]
    }

    fn place(&self) -> String {
        format!("series {}", self.series)
    }

    fn seen(&self) -> String {
        let Rounding { step, unit, .. } = self.rounding;
        format!(
            "all joint readings are multiples of {step} {unit}: they were rounded, which is a noise of {:.2} mrad, and {:.2} mrad are found",
            1e3 * self.rounding.sigma_rad(),
            1e3 * self.sigma_rad
        )
    }

    fn remedy(&self) -> String {
        "write the readings with all digits that the controller has (0.001 deg or better)".into()
    }
}
