//! Is the corrected robot shown to be better than the nominal one?
//!
//! Two witnesses can show it. Images (or measurements) that the fit had not seen, in pairs: the ratio of what the corrected robot misses to what the nominal
//! one does, with its interval over postures. And what the covariance states of the flange in the region of the stops: the intervals of both errors. One
//! of them is enough, but for a nominal robot that predicts clearly better.

use super::kind::{CheckContext, Kind, Quantity, Weight};
use super::lost_images::LostImages;
use crate::assess::{
    Accuracy, FlangeIntervals, Limits, Ratio, Uncertainty, bootstrap_ratio, by_cluster, cluster_of_images,
};
use crate::error::Code;
use crate::fit::Fit;
use crate::problem::Problem;

/// The corrected robot is not shown to be better than the nominal one.
#[derive(Debug, Clone, PartialEq)]
pub struct NoGain {
    /// Held-out error of the corrected robot, mm RMS.
    pub calibrated_mm: f64,
    /// Of the nominal one, mm RMS.
    pub nominal_mm: f64,
    /// The first over the second, by pairs.
    pub ratio: Ratio,
    /// What is stated of both robots; none where nothing is.
    pub stated: Option<FlangeIntervals>,
    /// Whether images were held out; else measurements of trackers and contacts.
    pub by_images: bool,
    /// What cost many images, if that is so.
    pub lost: Option<LostImages>,
    /// Gate or note.
    pub weight: Weight,
}

/// Nothing can be gained where nothing of the robot was free, as with poses of a controller alone.
pub(super) fn check(
    fit: &Fit,
    uncertainty: &Uncertainty,
    accuracy: &Accuracy,
    setting: &CheckContext,
) -> Option<NoGain> {
    let layout = &fit.problem.layout;
    layout.robot().any(|c| layout.columns[c].free).then_some(())?;
    let [calibrated_mm, nominal_mm] = [&accuracy.calibrated, &accuracy.nominal].map(|e| e.rms_mm);
    let alone = calibrated_mm / nominal_mm;
    let ratio = held_out_ratio(accuracy, &fit.problem, setting.limits);
    let ratio = ratio.unwrap_or(Ratio { value: alone, low: alone, high: alone });
    let stated = uncertainty.flange.and_then(|flange| flange.intervals);
    let weight = weight(ratio, stated.as_ref())?;
    let by_images = fit.problem.used_on_robot().next().is_some();
    let lost = LostImages::of(&fit.problem, setting.limits);
    Some(NoGain { calibrated_mm, nominal_mm, ratio, stated, by_images, lost, weight })
}

/// What it weighs that no gain is shown; `None` where one is.
fn weight(ratio: Ratio, stated: Option<&FlangeIntervals>) -> Option<Weight> {
    let is_stated = stated.is_some_and(|i| i.model_m[1] < i.nominal_m[0]);
    match () {
        () if ratio.high < 1.0 => None,
        () if ratio.low >= 1.0 || !is_stated => Some(Weight::Gate),
        () if ratio.value > 1.0 => Some(Weight::Note),
        () => None,
    }
}

/// The error of the corrected robot over that of the nominal one, where both predict the same; postures are resampled, as images of one share its
/// errors.
fn held_out_ratio(accuracy: &Accuracy, problem: &Problem, limits: &Limits) -> Option<Ratio> {
    let sets = cluster_of_images(problem, limits);
    let markers = |i: usize| problem.images[i].used().count() as f64;
    let of_images = accuracy.per_image_mm.iter().enumerate();
    let of_images = of_images.filter_map(|(i, mm)| Some((sets[i], markers(i), (*mm)?)));
    let of_bodies = accuracy.per_body_mm.iter().enumerate();
    let of_bodies = of_bodies.filter_map(|(k, mm)| Some((problem.body_measurements[k].stop, 1.0, (*mm)?)));
    let all: Vec<(usize, f64, [f64; 2])> = of_images.chain(of_bodies).collect();
    let sets: Vec<usize> = all.iter().map(|(set, ..)| *set).collect();
    let units = |robot: usize| {
        let squares: Vec<(f64, f64)> =
            all.iter().map(|(_, weight, mm)| (weight * mm[robot].powi(2), *weight)).collect();
        by_cluster(&sets, &squares)
    };
    bootstrap_ratio(&units(1), &units(0))
}

impl Kind for NoGain {
    fn code(&self) -> Code {
        Code::NoGain
    }

    fn weight(&self) -> Weight {
        self.weight
    }

    fn quantities(&self) -> Vec<Quantity> {
        let errors = [("calibrated", self.calibrated_mm), ("nominal", self.nominal_mm)];
        let errors = errors.map(|(name, mm)| Quantity::new(name, 1e-3 * mm, "m"));
        let ratio = [("ratio", self.ratio.value), ("ratio_low", self.ratio.low), ("ratio_high", self.ratio.high)];
        let ratio = ratio.map(|(name, value)| Quantity::new(name, value, "1"));
        errors.into_iter().chain(ratio).chain(self.lost.as_ref().map(LostImages::quantity)).collect()
    }

    fn place(&self) -> String {
        "hold-out".into()
    }

    fn seen(&self) -> String {
        let Self { calibrated_mm, nominal_mm, ratio, .. } = self;
        let what = if self.by_images { "images" } else { "measurements" };
        let is_worse = ratio.low >= 1.0;
        let how = if is_worse { "worse than the nominal one" } else { "not clearly better than the nominal one" };
        let stated = match &self.stated {
            _ if is_worse => String::new(),
            None => "; nothing is stated of the flange".into(),
            Some(FlangeIntervals { nominal_m, model_m, .. }) => {
                let [n0, n1, m0, m1] = [nominal_m[0], nominal_m[1], model_m[0], model_m[1]].map(|m| 1e3 * m);
                format!(
                    "; of the flange {n0:.3} to {n1:.3} mm are stated of the nominal robot, {m0:.3} to {m1:.3} mm of the corrected one"
                )
            }
        };
        format!(
            "the corrected robot predicts {what} {how} ({calibrated_mm:.3} mm against {nominal_mm:.3} mm: {:.0} %, 95 % interval {:.0} to {:.0} %){stated}",
            100.0 * ratio.value,
            100.0 * ratio.low,
            100.0 * ratio.high
        )
    }

    fn remedy(&self) -> String {
        match &self.lost {
            Some(lost) => format!("{}; keep the nominal robot until then", lost.remedy()),
            None if self.weight == Weight::Note => {
                "judge both robots by another series (robotcal verify --nominal), or take more stops, and more different ones".into()
            }
            None => "keep the nominal robot, and take more stops, and more different ones".into(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn either_witness_shows_a_gain_and_a_difference_by_chance_decides_nothing() {
        let stated = |model_m: [f64; 2], nominal_m: [f64; 2]| FlangeIntervals {
            nominal_m,
            urdf_m: model_m,
            alone_m: None,
            model_m,
        };
        let (gain, none) = (stated([1e-4, 2e-4], [6e-4, 9e-4]), stated([1e-4, 3e-4], [2e-4, 4e-4]));
        let ratio = |value: f64, low: f64, high: f64| Ratio { value, low, high };
        for (ratio, stated, expected) in [
            (ratio(0.5, 0.4, 0.6), Some(&gain), None),
            (ratio(0.5, 0.4, 0.6), Some(&none), None),
            (ratio(0.5, 0.4, 0.6), None, None),
            (ratio(0.999, 0.8, 1.2), Some(&gain), None),
            (ratio(1.001, 0.8, 1.2), Some(&gain), Some(Weight::Note)),
            (ratio(0.999, 0.8, 1.2), Some(&none), Some(Weight::Gate)),
            (ratio(1.001, 0.8, 1.2), Some(&none), Some(Weight::Gate)),
            (ratio(0.999, 0.8, 1.2), None, Some(Weight::Gate)),
            (ratio(1.3, 1.1, 1.5), Some(&gain), Some(Weight::Gate)),
        ] {
            assert_eq!(weight(ratio, stated), expected, "{ratio} {stated:?}");
        }
    }
}
