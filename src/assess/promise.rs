//! What can be promised of the flange: its expected error where the stops were, by the model and its covariance.
//!
//! The error is that of a single stop at readings of its own, base frame and a point of the flange brought together: what a user
//! measures who has found base and tool frames, and what points of a tracker leave. Of the calibrated robot it is what the
//! covariance says, and what no model removes: joint noise and local errors. A description that holds less of the model is
//! displaced against it besides, by so much RMS over the region; both parts add as squares.

use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};

use super::points::{MeasuredPoint, fit_points};
use super::root_mean_square;
use super::stops::halton_stops;
use crate::model::joint_terms::Term;
use crate::model::robot::{Robot, Stop};

/// Samples of the region of the stops.
const SAMPLES: usize = 250;

/// Expected error of the position of the flange in the region of the stops, RMS of the length, m.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct FlangeErrors {
    /// Of the nominal robot.
    pub nominal_m: f64,
    /// Of the corrected origins with the joint offsets alone: what a URDF holds.
    pub urdf_m: f64,
    /// Of the whole model: with what compensation.toml holds, too.
    pub model_m: f64,
    /// The part of each of them that no model removes: joint noise and local errors of a stop.
    pub scatter_m: f64,
}

impl FlangeErrors {
    /// `covariance` is that of the dense columns, twists and terms first; `joint_sigma` that of the readings at a stop, rad or m.
    /// `None` without stops, or where they are so much alike that no frame can be fitted.
    pub fn new(robot: &Robot, covariance: &DMatrix<f64>, joint_sigma: &[f64], stops: &[Stop]) -> Option<Self> {
        let samples = halton_stops(&ranges(stops)?, SAMPLES);
        // Local errors belong to single readings of the series: at others they are noise.
        let with = |kept: fn(Term) -> bool| {
            let mut robot = robot.clone();
            robot.terms.retain(|t| kept(t.term));
            robot
        };
        let whole = with(|t| !matches!(t, Term::Local(_)));
        let positions = |approach: bool| {
            let at = |s: &Stop| {
                let stop = if approach { s.clone() } else { Stop::at(&s.readings) };
                let pose = whole.pose_at(&stop, &vec![0.0; s.readings.len()]);
                MeasuredPoint { position_m: pose.translation, readings: s.readings.clone() }
            };
            samples.iter().map(at).collect::<Vec<_>>()
        };
        let still = positions(false);
        let columns = 6 * whole.twists.len() + whole.terms.len();
        let of_robot = covariance.view((0, 0), (columns, columns)).into_owned();
        let expected = fit_points(&whole, &still)?.expected(&whole, &still, &of_robot, joint_sigma)?;
        let approached = positions(true);
        let displaced = |robot: &Robot| Some(fit_points(robot, &approached)?.rms_m);
        let own = expected.with_joint_noise_m;
        Some(Self {
            nominal_m: own.hypot(displaced(&Robot::nominal(robot.chain.clone()))?),
            urdf_m: own.hypot(displaced(&with(|t| t == Term::Offset))?),
            model_m: own,
            scatter_m: (own.powi(2) - expected.model_m.powi(2)).max(0.0).sqrt(),
        })
    }
}

/// Smallest and largest reading of every joint.
fn ranges(stops: &[Stop]) -> Option<Vec<(f64, f64)>> {
    let range = |r: usize| {
        let all = stops.iter().map(|s| s.readings[r]);
        (all.clone().fold(f64::INFINITY, f64::min), all.fold(f64::NEG_INFINITY, f64::max))
    };
    stops.first().map(|s| (0..s.readings.len()).map(range).collect())
}

/// Joint noise of a stop, RMS over stops with different noise, rad or m.
pub fn usual_joint_sigma(of_stops: &[Vec<f64>]) -> Vec<f64> {
    let readings = of_stops.first().map_or(0, Vec::len);
    let of = |r: usize| root_mean_square(&of_stops.iter().map(|s| (s[r] * s[r], 1.0)).collect::<Vec<_>>());
    (0..readings).map(of).collect()
}
