//! How to identify.

use serde::{Deserialize, Serialize};

use super::estimator::Estimator;
use super::selection::Selection;
use crate::assess::Limits;
use crate::error::{Code, Error, Result};
use crate::model::joint_terms::{RobotModel, USUAL_HARMONICS};
use crate::urdf::Payload;

/// What is assumed of the joint readings.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum JointNoise {
    /// Noise per stop and joint, its size estimated from the data.
    Estimated,
    /// Known noise, rad or m; 0 takes the readings as exact.
    Known(f64),
}

impl JointNoise {
    /// As it was stated, rad or m; none where it is estimated.
    pub fn stated(self) -> Option<f64> {
        match self {
            Self::Estimated => None,
            Self::Known(sigma) => Some(sigma),
        }
    }
}

/// What is assumed of how far the markers are from nominal.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum MarkerTolerance {
    /// As the plate says.
    Stated,
    /// A factor on it per plate, estimated from the data where they tell enough.
    Estimated,
}

/// How to identify; recorded as used, so that the solve can be repeated.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Options {
    /// Joint noise.
    pub joint_noise: JointNoise,
    /// Tolerance of the markers.
    pub marker_tolerance: MarkerTolerance,
    /// Joint terms.
    pub model: RobotModel,
    /// Harmonics of the gear in the models that have them.
    pub harmonics: u8,
    /// Which parameters are estimated, and their priors.
    pub selection: Selection,
    /// How the robot is fitted: jointly, or in two stages.
    pub estimator: Estimator,
    /// What the tip carries; none where the chain says it or nobody does.
    pub payload: Option<Payload>,
    /// Numbers that decide verdicts.
    pub limits: Limits,
}

/// Name of all parameters of the robot.
const ROBOT: &str = "robot";

impl Options {
    /// True where the data choose the robot model: whoever names a joint term wants all of them.
    pub(super) fn model_is_open(&self) -> bool {
        self.model == RobotModel::Auto && !self.selection.names_terms()
    }

    /// The same for poses of a controller, whose robot is not known: nothing of it is estimated.
    ///
    /// # Errors
    /// Options that want something of the robot.
    pub(super) fn without_robot(&self) -> Result<Self> {
        let is_asked = !matches!(self.model, RobotModel::Auto | RobotModel::Rigid) || self.payload.is_some();
        if is_asked {
            let what = "a robot model or a payload is given, and no robot";
            return Err(Error::new(Code::OptionConflict, "--robot-model", what, "give --urdf, or leave it out"));
        }
        let mut without = Self { model: RobotModel::Rigid, ..self.clone() };
        if !without.selection.fix.iter().any(|name| name == ROBOT) {
            without.selection.fix.push(ROBOT.to_owned());
        }
        Ok(without)
    }
}

impl Default for Options {
    fn default() -> Self {
        Self {
            joint_noise: JointNoise::Estimated,
            marker_tolerance: MarkerTolerance::Stated,
            model: RobotModel::Auto,
            harmonics: USUAL_HARMONICS,
            selection: Selection::default(),
            estimator: Estimator::default(),
            payload: None,
            limits: Limits::default(),
        }
    }
}
