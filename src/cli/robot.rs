//! The robot of a command: a URDF, and its chain from base to tip.

use std::path::Path;

use super::say::say_line;
use crate::error::Result;
use crate::urdf::{self, Chain, RobotDescription};

/// The chain of a URDF, with a note where the tip was chosen among several leaves.
pub(super) fn read_chain(file: &Path, base: Option<&str>, tip: Option<&str>) -> Result<Chain> {
    noted_chain(&urdf::read(file)?, base, tip)
}

/// As [`read_chain`], of a URDF that has been read.
pub(super) fn noted_chain(description: &RobotDescription, base: Option<&str>, tip: Option<&str>) -> Result<Chain> {
    let chain = description.chain(base, tip)?;
    if let Some(notice) = description.tip_notice(base, tip) {
        say_line!("note      {}", notice.coded());
    }
    Ok(chain)
}
