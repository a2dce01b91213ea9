//! Do cameras that see the same stops agree where the robot was?
//!
//! What each shows by itself at a stop (its apparent displacement: lens, light and focus make some hundredths of a millimetre) takes up, too, that
//! one of them was moved, is loose or exposes at another time, and then no camera is odd and the readings fit.

use std::collections::BTreeSet;

use super::joint_noise::{of_same_noise, says_noise_first};
use super::kind::{CheckContext, Kind, Quantity, Subject, Weight};
use crate::assess::{Accuracy, Limits};
use crate::error::Code;
use crate::fit::Fit;

/// Cameras contradict each other at the stops that they share.
#[derive(Debug, Clone, PartialEq)]
pub struct CamerasContradict {
    /// Series; all that share its stops.
    pub series: Vec<String>,
    /// The cameras.
    pub cameras: Vec<String>,
    /// By how much from stop to stop, across the optical axes and along them, m (one sigma of each camera).
    pub apart_m: [f64; 2],
    /// Gate or note.
    pub weight: Weight,
}

pub(super) fn check(fit: &Fit, _: &Accuracy, setting: &CheckContext) -> Vec<CamerasContradict> {
    let fit = setting.with_noise_found(fit);
    let shifts_m = fit.problem.apparent_shifts_m();
    let of_series = |k: usize| {
        let apart_m = shifts_m.get(fit.problem.noise_of(k)).copied().flatten()?;
        let weight = weight(apart_m, setting.limits)?;
        Some(CamerasContradict { series: of_same_noise(fit, setting, k), cameras: cameras(fit, k), apart_m, weight })
    };
    (0..setting.series.len()).filter(|k| says_noise_first(fit, *k)).filter_map(of_series).collect()
}

/// What it weighs that cameras contradict each other by so much across and along their axes, m; none where it is usual.
fn weight(apart_m: [f64; 2], limits: &Limits) -> Option<Weight> {
    let usual_m = [limits.cameras_apart_across_m, limits.cameras_apart_along_m];
    let times = apart_m.iter().zip(usual_m).map(|(apart, usual)| apart / usual).fold(0.0, f64::max);
    match times {
        t if t > limits.times_cameras_apart => Some(Weight::Gate),
        t if t > 1.0 => Some(Weight::Note),
        _ => None,
    }
}

/// Those at the stops of a series.
fn cameras(fit: &Fit, series: usize) -> Vec<String> {
    let problem = &fit.problem;
    let noise = problem.noise_of(series);
    let own = problem.used_on_robot().map(|i| &problem.images[i]);
    let own: BTreeSet<usize> = own.filter(|i| problem.noise_of(i.series) == noise).map(|i| i.camera).collect();
    own.into_iter().map(|camera| problem.cameras[camera].clone()).collect()
}

impl CamerasContradict {
    /// True where what moved in a series, and weighs no less, is why.
    pub(super) fn is_of_what_moved_in(&self, series: &str, weight: Weight) -> bool {
        self.weight <= weight && self.series.iter().any(|own| own == series)
    }

    /// True where another focal length of one of them is why.
    pub(super) fn is_of_focus_of(&self, camera: &str, weight: Weight) -> bool {
        self.weight <= weight && self.apart_m[1] > self.apart_m[0] && self.cameras.iter().any(|own| own == camera)
    }
}

impl Kind for CamerasContradict {
    fn code(&self) -> Code {
        Code::CamerasContradict
    }

    fn weight(&self) -> Weight {
        self.weight
    }

    fn subjects(&self) -> Vec<Subject> {
        let series = self.series.iter().cloned().map(Subject::Series);
        series.chain(self.cameras.iter().cloned().map(Subject::Camera)).collect()
    }

    fn quantities(&self) -> Vec<Quantity> {
        let [across, along] = self.apart_m;
        vec![Quantity::new("across", across, "m"), Quantity::new("along", along, "m")]
    }

    fn place(&self) -> String {
        format!("series {}", self.series.join(", "))
    }

    fn seen(&self) -> String {
        let [across, along] = self.apart_m.map(|m| 1e3 * m);
        format!(
            "cameras {} contradict each other from stop to stop, by {across:.2} mm across their optical axes and {along:.2} mm along them, where lens \
             and light make some hundredths: readings and images fit all the same, for either camera counts as uncertain by that",
            self.cameras.join(" and ")
        )
    }

    fn remedy(&self) -> String {
        "identify each camera by itself (a series with its images alone): one that was moved or is loose is named there; see, too, that all expose while the arm stands, and that autofocus and stabilisers are off".into()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cameras_of_a_cell_agree_to_tenths_of_a_millimetre() {
        let limits = Limits::default();
        let of = |across: f64, along: f64| weight([across, along], &limits);
        // Two webcams on a real UR3, and simulated cameras in order.
        assert_eq!([of(1.3e-4, 3.2e-4), of(2e-6, 7e-6)], [None, None]);
        assert_eq!([of(2.6e-4, 0.0), of(0.0, 6e-4)], [Some(Weight::Note); 2]);
        assert_eq!([of(7.6e-4, 0.0), of(0.0, 1.5e-3)], [Some(Weight::Gate); 2]);
    }
}
