//! Readings that were rounded before they were written.
//!
//! A value that is rounded to multiples of a step `d` is off by something even within half a step, of the standard deviation `d / sqrt(12)`.

use super::measured_series::MeasuredSeries;
use crate::urdf::JointKind;

/// Steps in which angles are written, the largest first: the unit in rad, and its name.
const STEPS: [(f64, f64, &str); 8] = [
    (0.1, 1.0, "rad"),
    (1.0, DEGREE, "deg"),
    (0.01, 1.0, "rad"),
    (0.5, DEGREE, "deg"),
    (0.1, DEGREE, "deg"),
    (0.001, 1.0, "rad"),
    (0.05, DEGREE, "deg"),
    (0.01, DEGREE, "deg"),
];
const DEGREE: f64 = std::f64::consts::PI / 180.0;
/// A multiple of a step is one to this part of it: what conversion of units leaves.
const EXACT: f64 = 1e-4;
/// Fewer readings that are not zero may all be multiples by intention.
const FEWEST: usize = 12;
/// A noise is explained that is as large as that of the step, within this factor.
const AS_LARGE: f64 = 2.0;

/// All angles of a series are multiples of one step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rounding {
    /// The step in its unit.
    pub step: f64,
    /// `"deg"` or `"rad"`.
    pub unit: &'static str,
    /// The step, rad.
    pub step_rad: f64,
}

impl Rounding {
    /// The largest step of which all angles of a series are multiples; `None` where they are of none.
    pub fn of(series: &MeasuredSeries, kinds: &[JointKind]) -> Option<Self> {
        let rows = series.stops.iter().filter_map(|stop| stop.readings.as_ref());
        let angles = rows.flat_map(|row| row.iter().zip(kinds)).filter(|(_, kind)| **kind == JointKind::Revolute);
        let angles: Vec<f64> = angles.map(|(q, _)| *q).filter(|q| *q != 0.0).collect();
        let is_multiple = |q: f64, step: f64| (q / step - (q / step).round()).abs() < EXACT;
        let found = STEPS.iter().find(|(step, unit, _)| angles.iter().all(|q| is_multiple(*q, step * unit)));
        let rounding = |&(step, in_rad, unit): &(f64, f64, &'static str)| Self { step, unit, step_rad: step * in_rad };
        found.filter(|_| angles.len() >= FEWEST).map(rounding)
    }

    /// Standard deviation of what rounding adds, rad.
    pub fn sigma_rad(&self) -> f64 {
        self.step_rad / 12f64.sqrt()
    }

    /// Whether a joint noise of this standard deviation is that of the rounding.
    pub fn explains(&self, sigma_rad: f64) -> bool {
        let ratio = sigma_rad / self.sigma_rad();
        (1.0 / AS_LARGE..=AS_LARGE).contains(&ratio)
    }
}
