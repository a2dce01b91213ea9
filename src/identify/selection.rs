//! Which parameters are estimated, and what is known of them beforehand: by name.

use std::collections::BTreeMap;
use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::assess::{Limits, minimal_set, structural};
use crate::error::{Code, Error, Result};
use crate::model::joint_terms::{RobotModel, Term};
use crate::problem::{Layout, State, short_name};
use crate::series::read_toml;
use crate::urdf::Payload;

/// Which parameters of the robot are estimated.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Parameters {
    /// All of the robot model; priors settle what no series can tell.
    #[default]
    All,
    /// As many as a series over the whole range of the joints can tell apart, the others at nominal.
    Minimal,
}

/// A prior that the user states, in the unit of the parameter.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StatedPrior {
    /// Sigma, m.
    pub sigma_m: Option<f64>,
    /// Sigma, rad.
    pub sigma_rad: Option<f64>,
    /// Sigma, px.
    pub sigma_px: Option<f64>,
    /// Sigma of a number without unit.
    pub sigma: Option<f64>,
    /// Mean in that unit; 0 for robot and plate shape.
    pub mean: Option<f64>,
}

/// What is estimated, in the order in which it is applied.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Selection {
    /// Which set to begin with.
    #[serde(default)]
    pub parameters: Parameters,
    /// Parameters of the robot that are estimated: these alone, or beside the minimal set.
    #[serde(default)]
    pub free: Vec<String>,
    /// Parameters that stay at nominal (or at the mean of their prior).
    #[serde(default)]
    pub fix: Vec<String>,
    /// Priors by name, stronger names later.
    #[serde(default)]
    pub prior: BTreeMap<String, StatedPrior>,
}

/// A configuration file (`robotcal.toml`).
#[derive(Debug, Clone, PartialEq, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Config {
    /// Which set of parameters.
    pub parameters: Option<Parameters>,
    /// Which robot model.
    pub robot_model: Option<RobotModel>,
    /// As `--harmonics`.
    pub harmonics: Option<u8>,
    /// As `--free`.
    #[serde(default)]
    pub free: Vec<String>,
    /// As `--fix`.
    #[serde(default)]
    pub fix: Vec<String>,
    /// Priors by name.
    #[serde(default)]
    pub prior: BTreeMap<String, StatedPrior>,
    /// What the tip carries.
    pub payload: Option<Payload>,
    /// Numbers that decide verdicts, instead of the defaults.
    pub limits: Option<Limits>,
}

impl Config {
    /// Reads a configuration file.
    ///
    /// # Errors
    /// Names file and line: unreadable text, unknown keys, wrong values.
    pub fn read(path: &Path) -> Result<Self> {
        let config: Self = read_toml(path, &mut Vec::new())?;
        config.limits.map_or(Ok(()), |limits| limits.check())?;
        Ok(config)
    }
}

impl StatedPrior {
    fn sigma_in(&self, place: &str, name: &str, unit: &str) -> Result<Option<f64>> {
        let given = [("m", self.sigma_m), ("rad", self.sigma_rad), ("px", self.sigma_px), ("1", self.sigma)];
        let key = if unit == "1" { "sigma".to_owned() } else { format!("sigma_{unit}") };
        if let Some((other, _)) = given.iter().find(|(u, v)| *u != unit && v.is_some()) {
            let other = if *other == "1" { "no unit".into() } else { format!("unit {other}") };
            return Err(Error::new(
                Code::PriorUnit,
                place,
                format!("the prior of {} is given with {other}", short_name(name)),
                format!(
                    "its unit is {unit}: write {{ {key} = ... }}; name shifts and rotations apart (x y z, rx ry rz)"
                ),
            ));
        }
        let sigma = given.iter().find(|(u, _)| *u == unit).and_then(|(_, v)| *v);
        match sigma {
            Some(s) if !(s > 0.0 && s.is_finite()) => Err(Error::new(
                Code::SettingRange,
                place,
                format!("{key} = {s}"),
                "give a positive number; --fix holds a parameter",
            )),
            _ => Ok(sigma),
        }
    }
}

impl Selection {
    /// Names a joint term beyond the offsets, which not every robot model has.
    pub fn names_terms(&self) -> bool {
        let names = self.free.iter().chain(&self.fix).chain(self.prior.keys());
        let mut terms = names.filter_map(|n| Term::from_name(n.rsplit('.').next()?));
        terms.any(|t| t != Term::Offset)
    }

    /// Names a parameter of a camera, which not every lens has.
    pub fn names_cameras(&self) -> bool {
        self.free.iter().chain(&self.fix).chain(self.prior.keys()).any(|name| name.starts_with("camera"))
    }

    /// Sets priors, means and what is free, before the first solve.
    ///
    /// # Errors
    /// Unknown names with the closest ones, units that do not belong, and poses, which nothing but the images can tell.
    pub fn apply(&self, layout: &mut Layout, state: &mut State, limits: &Limits) -> Result<()> {
        self.set_priors(layout, state)?;
        let robot = layout.robot();
        if self.parameters == Parameters::Minimal {
            let kept = minimal_set(&state.robot, layout, &structural(&state.robot, layout, limits.share_of_data));
            robot.clone().filter(|c| !kept.contains(c)).for_each(|c| layout.columns[c].free = false);
        } else if !self.free.is_empty() {
            robot.clone().for_each(|c| layout.columns[c].free = false);
        }
        for name in &self.free {
            let columns = layout.named("--free", name)?;
            columns.into_iter().for_each(|c| layout.columns[c].free = true);
        }
        for name in &self.fix {
            let columns = layout.named("--fix", name)?;
            let pose = |c: &&usize| layout.mountings.iter().chain(&layout.placements).any(|r| r.contains(c));
            if columns.iter().find(pose).is_some() {
                return Err(Error::new(
                    Code::ParameterNotFixable,
                    "--fix",
                    format!("'{name}' is a pose of camera or plate, which has no nominal value"),
                    "fix parameters of robot, camera or plate shape",
                ));
            }
            columns.into_iter().for_each(|c| layout.columns[c].free = false);
        }
        Ok(())
    }

    /// Columns whose prior sigma is stated.
    ///
    /// # Errors
    /// Unknown names.
    pub fn with_priors(&self, layout: &Layout) -> Result<Vec<usize>> {
        let stated = self.prior.iter().filter(|(_, p)| p.sigma_m.or(p.sigma_rad).is_some());
        stated
            .map(|(name, _)| layout.named(&format!("[prior] \"{name}\""), name))
            .collect::<Result<Vec<_>>>()
            .map(|c| c.concat())
    }

    fn set_priors(&self, layout: &mut Layout, state: &mut State) -> Result<()> {
        // Names of blocks and with stars first, so that the name of a single parameter has the last word.
        let mut ordered = Vec::new();
        for (name, prior) in &self.prior {
            let place = format!("[prior] \"{name}\"");
            let columns = layout.named(&place, name)?;
            ordered.push((columns, place, prior));
        }
        ordered.sort_by_key(|(columns, _, _)| std::cmp::Reverse(columns.len()));
        ordered.into_iter().try_for_each(|(columns, place, prior)| {
            columns.into_iter().try_for_each(|c| set_prior(layout, state, c, (&place, prior)))
        })
    }

    /// In words, for the record; empty where nothing was chosen.
    pub fn in_words(&self) -> Vec<(String, String)> {
        let mut words = Vec::new();
        if self.parameters == Parameters::Minimal {
            words.push(("parameters".to_owned(), "minimal".to_owned()));
        }
        for (what, names) in [("free", &self.free), ("fixed", &self.fix)] {
            if !names.is_empty() {
                words.push((what.to_owned(), names.join(", ")));
            }
        }
        if !self.prior.is_empty() {
            words.push(("priors".to_owned(), self.prior.keys().cloned().collect::<Vec<_>>().join(", ")));
        }
        words
    }
}

/// Gives a column a prior, and a mean that is stated to its parameter.
fn set_prior(layout: &mut Layout, state: &mut State, c: usize, (place, prior): (&str, &StatedPrior)) -> Result<()> {
    let column = &layout.columns[c];
    if layout.mountings.iter().chain(&layout.placements).any(|r| r.contains(&c)) {
        let what = format!("{} is part of a pose, which takes no prior", short_name(&column.name));
        let remedy = "give priors for robot, camera or plate shape";
        return Err(Error::new(Code::ParameterNotFixable, place, what, remedy));
    }
    let camera = layout.cameras.iter().any(|r| r.contains(&c));
    if camera && (prior.mean.is_none() || prior == &StatedPrior { mean: prior.mean, ..Default::default() }) {
        let what = format!("the prior of {} needs mean and sigma", short_name(&column.name));
        let remedy = "a camera has no nominal values: write { mean = ..., sigma... = ... }";
        return Err(Error::new(Code::SettingMissing, place, what, remedy));
    }
    let sigma = prior.sigma_in(place, &column.name, column.unit)?;
    if let Some(mean) = prior.mean.filter(|m| !m.is_finite()) {
        return Err(Error::new(Code::SettingRange, place, format!("mean = {mean}"), "give a finite number"));
    }
    let column = &mut layout.columns[c];
    column.prior_sigma = sigma.unwrap_or(column.prior_sigma);
    if let Some(mean) = prior.mean {
        column.prior_mean = mean;
        state.set_value(layout, c, mean);
    }
    Ok(())
}
