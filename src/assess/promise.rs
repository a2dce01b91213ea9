//! What can be promised of the flange: its expected error in the region of the stops, by the model and its covariance.
//!
//! The error is that of the position relative to what stands still (the plate, or a fixed camera) at a stop of its own. Of the
//! calibrated robot it is what the covariance says ([`FlangeModel`]: right on average over the stops), and what no model removes:
//! joint noise and local errors. A description that holds less of the model is displaced against it besides, by so much RMS over
//! the region; both parts add as squares. The nominal robot is given the base and the tool that fit it best.

use nalgebra::{Vector3, Vector6};
use serde::{Deserialize, Serialize};

use super::flange::FlangeModel;
use super::points::{MeasuredPoint, PointFit, lay_over};
use super::root_of_mean;
use crate::model::joint_terms::Term;
use crate::model::robot::{Posture, Robot};
use crate::solve::{JOINT_NOISE_FLOOR, NoiseInformation, Spread};

/// Expected error of the position of the flange in the region of the stops, RMS of the length, m.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct FlangeErrors {
    /// Of the nominal robot.
    pub nominal_m: f64,
    /// Of the corrected origins with the joint offsets alone: the corrected URDF without its compensation.toml.
    pub urdf_m: f64,
    /// Of the origins that do best by themselves; none where nothing beside origins and offsets was found, and in files of earlier versions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub alone_m: Option<f64>,
    /// Of the whole model: with what compensation.toml holds, too.
    pub model_m: f64,
    /// The part of each of them that no model removes: joint noise and local errors of a stop.
    pub scatter_m: f64,
    /// How far each of them may be off; absent in files of earlier versions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub intervals: Option<FlangeIntervals>,
    /// By how much of every length the size of the plate is in doubt, which none of these numbers has in it: relative, the largest of all plates;
    /// none where it is not, and in files of earlier versions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub without_size_doubt: Option<f64>,
}

/// 95 % intervals of the expected errors, by the covariance of the model, m: how large the error is that this one arm has in truth.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct FlangeIntervals {
    /// Of the nominal robot.
    pub nominal_m: [f64; 2],
    /// Of the corrected URDF without its compensation.toml.
    pub urdf_m: [f64; 2],
    /// Of the origins that do best by themselves.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub alone_m: Option<[f64; 2]>,
    /// Of the whole model.
    pub model_m: [f64; 2],
}

impl FlangeErrors {
    /// Of the best URDF without compensation.toml, with its 95 % interval, m.
    pub fn best_urdf_m(&self) -> (f64, Option<[f64; 2]>) {
        let interval = self.intervals.map(|i| i.alone_m.unwrap_or(i.urdf_m));
        (self.alone_m.unwrap_or(self.urdf_m), interval)
    }

    /// `alone` has the origins that do best by themselves ([`urdf_alone`](super::urdf_alone)). `None` where the nominal robot cannot be laid over the
    /// model.
    pub fn new(
        model: &FlangeModel,
        (robot, alone): (&Robot, Option<&Robot>),
        noise: NoiseAtStop<'_>,
        stops: &[Posture],
    ) -> Option<Self> {
        let samples = model.region();
        // Local errors belong to single readings of the series: at others they are noise.
        let whole = with(robot, |t| !matches!(t, Term::Local(_)));
        let nominal = nominal_laid_over(&whole, &samples)?;
        let lacking = displacements(&whole, &with(robot, |t| t == Term::Offset), &samples, stops);
        let alone_lacks = alone.map(|alone| displacements(&whole, alone, &samples, stops));
        let scatter = noise.scatter(&by_readings(&whole, &samples));
        let scatter_m = scatter.variance.sqrt();
        let model_m = model.sigma_m(&samples).hypot(scatter_m);
        let in_flange = |k: usize| whole.base_from_tip_at(&samples[k]).rotation.transpose() * nominal.residuals_m[k];
        let interval = |known: &dyn Fn(usize) -> Vector3<f64>| model.interval_m(&samples, known, scatter);
        Some(Self {
            nominal_m: model_m.hypot(nominal.rms_m),
            urdf_m: model_m.hypot(rms(&lacking)),
            alone_m: alone_lacks.as_ref().map(|lacking| model_m.hypot(rms(lacking))),
            model_m,
            scatter_m,
            intervals: Some(FlangeIntervals {
                nominal_m: interval(&in_flange),
                urdf_m: interval(&|k| -lacking[k]),
                alone_m: alone_lacks.as_ref().map(|lacking| interval(&|k| -lacking[k])),
                model_m: interval(&|_| Vector3::zeros()),
            }),
            without_size_doubt: None,
        })
    }
}

/// The nominal robot over a corrected one at samples, with a base and a tool that fit best; `None` where none can be found.
pub(super) fn nominal_laid_over(corrected: &Robot, samples: &[Posture]) -> Option<PointFit> {
    let flange = samples.iter().map(|stop| MeasuredPoint::on_tip(corrected, &Vector3::zeros(), stop));
    lay_over(&Robot::nominal(corrected.chain.clone()), &flange.collect::<Vec<_>>())
}

/// The robot with some of its terms.
fn with(robot: &Robot, kept: impl Fn(Term) -> bool) -> Robot {
    let mut robot = robot.clone();
    robot.terms.retain(|t| kept(t.term));
    robot
}

/// How the flange of a second robot stands to that of a first, in the frame of the flange, right on average over the stops, m.
fn displacements(a: &Robot, b: &Robot, samples: &[Posture], stops: &[Posture]) -> Vec<Vector3<f64>> {
    let twist = |s: &Posture| (a.base_from_tip_at(s).inverse() * b.base_from_tip_at(s)).log();
    let mean = stops.iter().map(twist).sum::<Vector6<f64>>() / stops.len().max(1) as f64;
    samples.iter().map(|s| (twist(s) - mean).fixed_rows::<3>(0).into_owned()).collect()
}

fn rms(displacements: &[Vector3<f64>]) -> f64 {
    root_of_mean(displacements.iter().map(|d| d.norm_squared()))
}

/// Mean square over samples by which a reading of each joint moves the position of the flange, m^2 for 1 rad or m.
pub fn by_readings(robot: &Robot, samples: &[Posture]) -> Vec<f64> {
    let mut squares = vec![0.0; robot.chain.readings.len()];
    for sample in samples {
        let moved = robot.kinematics_at(sample).d_readings;
        squares.iter_mut().zip(&moved).for_each(|(sum, d)| *sum += d.fixed_rows::<3>(0).norm_squared());
    }
    squares.iter().map(|sum| sum / samples.len().max(1) as f64).collect()
}

/// What the noise of a stop does to the position of the flange, RMS over postures, m.
pub fn scatter_m(robot: &Robot, joint_sigma: &[f64], postures: &[Posture]) -> f64 {
    NoiseAtStop { joint_sigma, told: None }.scatter(&by_readings(robot, postures)).variance.sqrt()
}

/// Joint noise of a stop.
#[derive(Clone, Copy)]
pub struct NoiseAtStop<'a> {
    /// Per reading, rad or m.
    pub joint_sigma: &'a [f64],
    /// How well the data tell it, with the share of the stops that every series has; none where it counts as known.
    pub told: Option<(&'a NoiseInformation, &'a [f64])>,
}

impl NoiseAtStop<'_> {
    /// Of a sum of the variances with these weights. What counts as none stays none.
    fn scatter(&self, weights: &[f64]) -> Spread {
        let all = weights.iter().zip(self.joint_sigma);
        let counted: Vec<f64> =
            all.clone().map(|(w, sigma)| if *sigma > JOINT_NOISE_FLOOR { *w } else { 0.0 }).collect();
        let sigma = self.told.map_or(0.0, |(told, shares)| told.weighted(shares, &counted).0.sigma);
        Spread { variance: all.map(|(weight, sigma)| weight * sigma * sigma).sum(), sigma }
    }
}

/// Joint noise of a stop, RMS over stops with different noise, rad or m.
pub fn usual_joint_sigma(of_stops: &[Vec<f64>]) -> Vec<f64> {
    let readings = of_stops.first().map_or(0, Vec::len);
    let of = |r: usize| root_of_mean(of_stops.iter().map(|s| s[r] * s[r]));
    (0..readings).map(of).collect()
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::assess::stops::halton_stops;
    use crate::urdf::RobotDescription;

    /// An arm whose axes are all vertical: two turns, a stroke, a turn.
    fn scara() -> Robot {
        let joint = |(name, kind, from, to, xyz): (&str, &str, &str, &str, &str)| {
            format!(
                "<joint name='{name}' type='{kind}'><parent link='{from}'/><child link='{to}'/><origin xyz='{xyz}'/>\
                 <axis xyz='0 0 1'/><limit lower='-3' upper='3' effort='0' velocity='0'/></joint>"
            )
        };
        let rows = [
            ("j1", "revolute", "base", "a", "0 0 0.4"),
            ("j2", "revolute", "a", "b", "0.3 0 0"),
            ("j3", "prismatic", "b", "c", "0.3 0 0"),
            ("j4", "revolute", "c", "d", "0 0 0"),
        ];
        let links: String = ["base", "a", "b", "c", "d"].iter().map(|l| format!("<link name='{l}'/>")).collect();
        let text = format!("<robot name='r'>{links}{}</robot>", rows.map(joint).concat());
        Robot::nominal(RobotDescription::from_text(Path::new("r.urdf"), text).unwrap().chain(None, None).unwrap())
    }

    #[test]
    fn an_arm_whose_axes_are_all_parallel_has_an_error_of_the_nominal_robot() {
        let mut robot = scara();
        let samples = halton_stops(&[(-2.5, 2.5), (-2.5, 2.5), (-0.1, 0.3), (-3.0, 3.0)], 100);
        assert!(nominal_laid_over(&robot, &samples).unwrap().rms_m < 1e-9);
        // The first link is 1 mm longer: base and tool take up a part of it.
        robot.twists[1][0] = 1e-3;
        let rms_m = nominal_laid_over(&robot, &samples).unwrap().rms_m;
        assert!((1e-4..1e-3).contains(&rms_m), "{rms_m:e} m");
        // A shift along the axes is one of base or tool.
        robot.twists[1][0] = 0.0;
        robot.twists[2][2] = 1e-3;
        assert!(nominal_laid_over(&robot, &samples).unwrap().rms_m < 1e-9);
    }
}
