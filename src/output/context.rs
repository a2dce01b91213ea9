//! What the exporters need beside the solution.

use crate::series::InputFile;
use crate::urdf::RobotDescription;

/// What the exporters need beside the solution.
#[derive(Debug, Clone)]
pub struct Context<'a> {
    /// The robot as read, whose text is patched.
    pub robot: &'a RobotDescription,
    /// Name of the robot in file names.
    pub robot_name: &'a str,
    /// Names of the series, in the order in which they were given.
    pub series: Vec<String>,
    /// All files that were read, with their hashes.
    pub inputs: Vec<InputFile>,
    /// Options in words: name and value, in the order in which they are to be shown.
    pub options: Vec<(String, String)>,
    /// The command line.
    pub command: String,
    /// Where joint offsets go (`--offsets`).
    pub offsets: Offsets,
    /// Whether stand-alone poses are wanted (`--poses`).
    pub poses: Poses,
}

/// Where joint offsets go.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Offsets {
    /// Into the origins: controller angles stay as they are.
    Folded,
    /// Those that are determined into the mastering table of the controller; the origins are without them, and hold the others.
    Mastering,
}

/// Whether poses.csv is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Poses {
    /// Write the stand-alone camera poses.
    Written,
    /// Leave them out.
    LeftOut,
}
