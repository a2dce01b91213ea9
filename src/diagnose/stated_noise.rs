//! Is a joint noise that was stated the one that the data show?

use super::kind::{CheckContext, Kind, Quantity, StatedNoise, Weight};
use crate::assess::{Accuracy, Limits, NORMAL_95};
use crate::error::Code;
use crate::fit::Fit;
use crate::urdf::JointKind;

/// The data show another joint noise than the stated one.
#[derive(Debug, Clone, PartialEq)]
pub struct NoiseContradicted {
    /// As stated, rad or m.
    pub stated: f64,
    /// Root mean square of what was found of the joints of one kind, rad or m.
    pub found: f64,
    /// Its 95 % interval.
    pub interval: [f64; 2],
    /// True of angles, false of lengths.
    pub turns: bool,
    /// Gate or note.
    pub weight: Weight,
}

pub(super) fn check(_: &Fit, _: &Accuracy, setting: &CheckContext) -> Option<NoiseContradicted> {
    let StatedNoise { sigma, found, told } = setting.stated_noise?;
    let (kinds, noise, told) = (&found.state.robot.chain.reading_kinds, &found.problem.noise, told?);
    let series: Vec<usize> = (0..noise.joint.len()).collect();
    let of_kind = |kind: JointKind| {
        let readings: Vec<usize> = (0..kinds.len()).filter(|&r| kinds[r] == kind).collect();
        if readings.is_empty() {
            return None;
        }
        let (found, interval) = told.joint_noise(noise, &series, &readings, NORMAL_95);
        let weight = weight_of(sigma, interval, setting.limits)?;
        let turns = kind == JointKind::Revolute;
        Some(NoiseContradicted { stated: sigma, found, interval, turns, weight })
    };
    [JointKind::Revolute, JointKind::Prismatic].into_iter().find_map(of_kind)
}

/// What it weighs that so much was stated where the data show something of an interval; none where both agree.
fn weight_of(stated: f64, [low, high]: [f64; 2], limits: &Limits) -> Option<Weight> {
    match stated {
        s if s * limits.scatter_ratio < low => Some(Weight::Gate),
        s if s < low || s > limits.scatter_ratio * high => Some(Weight::Note),
        _ => None,
    }
}

impl NoiseContradicted {
    /// True where what moved, of this weight, may have made the noise larger than it was stated.
    pub(super) fn is_explained_by(&self, weight: Weight) -> bool {
        weight == Weight::Gate && self.stated < self.interval[0]
    }
}

impl Kind for NoiseContradicted {
    fn code(&self) -> Code {
        Code::JointNoiseContradicted
    }

    fn weight(&self) -> Weight {
        self.weight
    }

    fn quantities(&self) -> Vec<Quantity> {
        let unit = if self.turns { "rad" } else { "m" };
        let [low, high] = self.interval;
        let found = Quantity::new("found_joint_noise", self.found, unit).with_sigma(0.5 * (high - low) / NORMAL_95);
        vec![Quantity::new("stated_joint_noise", self.stated, unit), found]
    }

    fn place(&self) -> String {
        "--joint-noise".into()
    }

    fn seen(&self) -> String {
        let unit = if self.turns { "mrad" } else { "mm" };
        let [stated, found, low, high] =
            [self.stated, self.found, self.interval[0], self.interval[1]].map(|size| 1e3 * size);
        let effect = match self.stated < self.interval[0] {
            true => "readings are trusted too much, and sigmas stated too small",
            false => "readings are trusted too little, and sigmas stated too large",
        };
        format!("{stated:.3} {unit} is stated, and the data show {found:.3} {unit} ({low:.3} to {high:.3}): {effect}")
    }

    fn remedy(&self) -> String {
        "leave out --joint-noise: it is estimated then".into()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn little_more_than_stated_is_said_and_much_more_fails() {
        let limits = Limits::default();
        let weight = |stated: f64| weight_of(stated, [0.8, 1.2], &limits);
        assert_eq!(weight(0.0), Some(Weight::Gate));
        assert_eq!(weight(0.8 / limits.scatter_ratio - 0.01), Some(Weight::Gate));
        assert_eq!(weight(0.79), Some(Weight::Note));
        assert_eq!(weight(0.81), None);
        assert_eq!(weight(1.2 * limits.scatter_ratio - 0.01), None);
        assert_eq!(weight(1.2 * limits.scatter_ratio + 0.01), Some(Weight::Note));
    }
}
