//! The robot of a command: a URDF, and its chain from base to tip.

use std::path::Path;

use crate::cli::terminal::say::say_line;
use crate::error::{Code, Error, Notice, Result};
use crate::urdf::{self, Chain, RobotDescription};

/// The chain of a URDF, with a note where the tip was chosen among several leaves, and what was noticed of it.
pub fn read_chain(file: &Path, base: Option<&str>, tip: Option<&str>) -> Result<Chain> {
    noted_chain(&urdf::read(file)?, base, tip)
}

/// As [`read_chain`], of a URDF that has been read.
pub fn noted_chain(description: &RobotDescription, base: Option<&str>, tip: Option<&str>) -> Result<Chain> {
    let chain = description.chain(base, tip)?;
    let tip = description.tip_notice(base, tip);
    tip.iter().for_each(say);
    say_notices(description);
    Ok(chain)
}

fn say(notice: &Notice) {
    say_line!("note      {}", notice.coded());
}

/// Says what was noticed of a description.
pub fn say_notices(description: &RobotDescription) {
    Notice::said_once(&description.notices).iter().for_each(say);
}

/// Refuses a description in degrees, by which a robot is to be moved.
pub fn refuse_degrees(description: &RobotDescription) -> Result<()> {
    let degrees = description.notices.iter().find(|notice| notice.code == Code::UrdfAngleUnit);
    degrees.map_or(Ok(()), |Notice { code, place, what, remedy }| Err(Error::new(*code, place, what, remedy)))
}
