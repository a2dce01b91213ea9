//! Flags that choose what is estimated.

use std::path::PathBuf;

use clap::{Args, ValueEnum};

use crate::error::{Code, Error, Result};
use crate::identify::{Config, JointNoise, MarkerTolerance, Options, Parameters, RobotModel, Selection};

/// Flags that `identify` shares with whatever solves.
#[derive(Debug, Args)]
#[command(next_help_heading = "What is estimated")]
pub struct ChoiceArgs {
    /// Joint noise in rad (m for a prismatic joint) instead of the estimate; 0 takes the readings as exact
    #[arg(long, value_name = "SIGMA")]
    joint_noise: Option<f64>,
    /// How far the markers are from nominal [default: stated]
    #[arg(long, value_enum)]
    marker_tolerance: Option<Tolerance>,
    /// Joint terms beside rigid geometry and offsets [default: auto]
    #[arg(long, value_enum)]
    robot_model: Option<Model>,
    /// Harmonics of every gear, up to 6 [default: 2]
    #[arg(long, value_name = "N")]
    harmonics: Option<u8>,
    /// Parameters of the robot to estimate: all of the model, or a set that a series can tell apart [default: all]
    #[arg(long, value_enum)]
    parameters: Option<Set>,
    /// Estimate these parameters of the robot (joint_2.offset, joint_3.origin, '*.gear'): alone, or beside the minimal set
    #[arg(long, value_name = "NAME")]
    free: Vec<String>,
    /// Hold these parameters at nominal (camera.front.k3, joint_2)
    #[arg(long, value_name = "NAME")]
    fix: Vec<String>,
    /// File with parameters, robot_model, harmonics, free, fix, [prior], [payload] and [limits] (see the guide); flags win, free and fix are added to
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
}

/// Where the tolerance of the markers comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(super) enum Tolerance {
    /// As plate.toml says
    Stated,
    /// From the data, with image noise and joint noise, where they tell 50 coordinates of markers or more
    Estimated,
}

/// Names of the robot models.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Model {
    /// Link geometry and joint offsets
    Rigid,
    /// Also gear scale and two harmonics
    Gear,
    /// Link geometry, joint offsets, and gravity of the joints that carry the arm; of all joints where the URDF states masses
    Sag,
    /// All of these
    GearSag,
    /// All of these, gravity of all joints, and backlash
    Full,
    /// The largest of these that no other beats decisively, by the data (Laplace evidence)
    Auto,
}

/// Names of the sets of parameters.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Set {
    /// All; priors settle what no series can tell
    All,
    /// As many as a series over the whole range of the joints can tell apart
    Minimal,
}

impl From<Model> for RobotModel {
    fn from(model: Model) -> Self {
        match model {
            Model::Rigid => Self::Rigid,
            Model::Gear => Self::Gear,
            Model::Sag => Self::Sag,
            Model::GearSag => Self::GearSag,
            Model::Full => Self::Full,
            Model::Auto => Self::Auto,
        }
    }
}

impl ChoiceArgs {
    /// Flags over the configuration file over `defaults`: those of the program, or of an earlier result.
    pub fn options(&self, defaults: Options) -> Result<Options> {
        let config = self.config.as_deref().map_or(Ok(Config::default()), Config::read)?;
        let parameters = self.parameters.map(|s| if s == Set::Minimal { Parameters::Minimal } else { Parameters::All });
        let joined = |a: &[String], b: &[String], before: Vec<String>| {
            let given: Vec<String> = a.iter().chain(b).cloned().collect();
            if given.is_empty() { before } else { given }
        };
        let before = defaults.selection;
        let model = self.robot_model.map(Into::into).or(config.robot_model).unwrap_or(defaults.model);
        if self.harmonics.is_some_and(|asked| asked > 0) && !model.has_gears() {
            let what = format!("--robot-model {} has no gears, and with them no harmonics", model.name());
            return Err(Error::new(Code::OptionConflict, "--harmonics", what, "leave one of the two out"));
        }
        Ok(Options {
            harmonics: harmonics(self.harmonics.or(config.harmonics))?.unwrap_or(defaults.harmonics),
            joint_noise: joint_noise(self.joint_noise)?.unwrap_or(defaults.joint_noise),
            marker_tolerance: match self.marker_tolerance {
                Some(Tolerance::Estimated) => MarkerTolerance::Estimated,
                Some(Tolerance::Stated) => MarkerTolerance::Stated,
                None => defaults.marker_tolerance,
            },
            model,
            selection: Selection {
                parameters: parameters.or(config.parameters).unwrap_or(before.parameters),
                free: joined(&config.free, &self.free, before.free),
                fix: joined(&config.fix, &self.fix, before.fix),
                prior: if config.prior.is_empty() { before.prior } else { config.prior },
            },
            estimator: defaults.estimator,
            payload: config.payload.or(defaults.payload),
            limits: config.limits.unwrap_or(defaults.limits),
        })
    }
}

/// Most harmonics of a gear: beyond, they are no property of a gear that fifty stops could tell.
const MOST_HARMONICS: u8 = 6;

fn harmonics(count: Option<u8>) -> Result<Option<u8>> {
    match count {
        Some(k) if k > MOST_HARMONICS => Err(Error::new(
            Code::OptionRange,
            "harmonics",
            format!("{k} are too many"),
            format!("give 0 to {MOST_HARMONICS}"),
        )),
        other => Ok(other),
    }
}

fn joint_noise(sigma: Option<f64>) -> Result<Option<JointNoise>> {
    match sigma {
        None => Ok(None),
        Some(s) if (0.0..0.1).contains(&s) => Ok(Some(JointNoise::Known(s))),
        Some(s) => Err(Error::new(
            Code::OptionRange,
            "--joint-noise",
            format!("{s} is no joint noise in rad"),
            "give 0 for exact readings or a value like 0.00005 (0.05 mrad)",
        )),
    }
}
