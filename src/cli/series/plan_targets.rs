//! Joint vectors at which a robot is to be right.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use clap::Args;

use crate::cli::flags::joint_table::{Unit, read_vectors};
use crate::error::{Code, Error, Result};
use crate::model::robot::Robot;
use crate::plan::share_left;
use crate::urdf::Chain;

/// Fewest targets whose error says something: the nine numbers of the frames take up less than a third of theirs.
const LEAST_TARGETS: usize = 10;

/// Share of the mean squared error that the frames must leave: less is a hundredth of the error.
const LEAST_SHARE: f64 = 1e-4;

/// Where a robot is to be accurate.
#[derive(Debug, Args)]
#[command(next_help_heading = "What is to be accurate")]
pub(super) struct TargetArgs {
    /// Accuracy is meant at these joint vectors (ten or more; columns as in joints.csv), not over the workspace
    #[arg(long, value_name = "FILE", conflicts_with_all = ["d_optimal", "parameters"])]
    targets: Option<PathBuf>,
    /// Unit of the revolute joints in that file
    #[arg(long, value_enum, value_name = "UNIT", default_value = "deg", requires = "targets")]
    targets_unit: Unit,
}

impl TargetArgs {
    /// Joint vectors of the file, in rad and m in the order of the chain; rows without any are none.
    pub fn read(&self, chain: &Chain) -> Result<Option<Vec<Vec<f64>>>> {
        let Some(path) = &self.targets else { return Ok(None) };
        let targets = read_vectors(path, chain, (self.targets_unit, "--targets-unit"))?;
        let bits = |q: &Vec<f64>| q.iter().map(|v| v.to_bits()).collect();
        let different: BTreeSet<Vec<u64>> = targets.iter().map(bits).collect();
        if different.len() < LEAST_TARGETS {
            let what = format!(
                "{} different targets are too few: base frame and a point of the flange are brought together there, which three fit exactly",
                different.len()
            );
            return Err(too_few(path, what));
        }
        Ok(Some(targets))
    }

    /// Those at which base frame and a point of the flange leave an error of the robot: of others no measurement there tells one.
    pub fn telling(&self, chain: &Chain) -> Result<Option<Vec<Vec<f64>>>> {
        let (Some(path), Some(targets)) = (&self.targets, self.read(chain)?) else { return Ok(None) };
        if share_left(&Robot::nominal(chain.clone()), &targets) < LEAST_SHARE {
            let what = "the targets are so alike that base frame and a point of the flange, which are brought together there, take up all errors of the robot";
            return Err(too_few(path, what.to_owned()));
        }
        Ok(Some(targets))
    }
}

fn too_few(path: &Path, what: String) -> Error {
    let remedy = format!("give at least {LEAST_TARGETS}, spread over where the robot works, with all joints moved");
    Error::new(Code::TargetsTooFew, path.display(), what, remedy)
}
