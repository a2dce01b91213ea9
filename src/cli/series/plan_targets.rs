//! Joint vectors at which a robot is to be right.

use std::collections::BTreeSet;
use std::path::Path;

use crate::cli::flags::joint_table::{Unit, read_vectors};
use crate::error::{Code, Error, Result};
use crate::model::robot::Robot;
use crate::plan::share_left;
use crate::urdf::Chain;

/// Fewest targets whose error says something: the nine numbers of the frames take up less than a third of theirs.
const LEAST_TARGETS: usize = 10;

/// Share of the mean squared error that the frames must leave: less is a hundredth of the error.
const LEAST_SHARE: f64 = 1e-4;

/// Flag of the unit.
const UNIT: &str = "--targets-unit";

/// Joint vectors of a file, in rad and m in the order of the chain; rows without any are none.
pub(super) fn targets(path: &Path, chain: &Chain, unit: Unit) -> Result<Vec<Vec<f64>>> {
    let targets = read_vectors(path, chain, (unit, UNIT))?;
    let different: BTreeSet<Vec<u64>> = targets.iter().map(|q| q.iter().map(|v| v.to_bits()).collect()).collect();
    if different.len() < LEAST_TARGETS {
        let what = format!(
            "{} different targets are too few: base frame and a point of the flange are brought together there, which three fit exactly",
            different.len()
        );
        return Err(too_few(path, what));
    }
    Ok(targets)
}

/// Those at which base frame and a point of the flange leave an error of the robot: of others no measurement there tells one.
pub(super) fn telling_targets(path: &Path, chain: &Chain, unit: Unit) -> Result<Vec<Vec<f64>>> {
    let targets = targets(path, chain, unit)?;
    if share_left(&Robot::nominal(chain.clone()), &targets) < LEAST_SHARE {
        let what = "the targets are so alike that base frame and a point of the flange, which are brought together there, take up all errors of the robot";
        return Err(too_few(path, what.to_owned()));
    }
    Ok(targets)
}

fn too_few(path: &Path, what: String) -> Error {
    let remedy = format!("give at least {LEAST_TARGETS}, spread over where the robot works, with all joints moved");
    Error::new(Code::TargetsTooFew, path.display(), what, remedy)
}
