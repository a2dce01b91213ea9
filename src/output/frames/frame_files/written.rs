//! What is written, and numbers and names as all controllers take them.

use crate::geom::Pose;
use crate::urdf::Payload;

/// Name of the programs.
pub(super) const NAME: &str = "robotcal_frames";

/// A frame with its name.
#[derive(Debug, Clone, PartialEq)]
pub struct Named {
    /// Its name.
    pub name: String,
    /// `parent_from_frame`.
    pub pose: Pose,
}

/// What is written.
#[derive(Debug, Clone, PartialEq)]
pub struct Frames {
    /// Link that carries the tool.
    pub tip: String,
    /// Link in which the work object is given.
    pub base: String,
    /// `tip_from_tool`.
    pub tool: Option<Named>,
    /// `base_from_work`.
    pub work: Option<Named>,
    /// What the tip carries.
    pub payload: Option<Payload>,
}

/// A name as a variable of any controller: letters, digits and `_`, a letter first, not too long.
pub(super) fn variable(prefix: &str, name: &str) -> String {
    const LONGEST: usize = 24;
    let safe = |c: char| if c.is_ascii_alphanumeric() { c.to_ascii_lowercase() } else { '_' };
    let name: String = name.chars().take(LONGEST).map(safe).collect();
    format!("{prefix}_{name}")
}

/// Numbers with so many decimals, separated by commas.
pub(super) fn numbers(values: impl IntoIterator<Item = f64>, decimals: usize) -> String {
    values.into_iter().map(|v| format!("{:.decimals$}", v + 0.0)).collect::<Vec<_>>().join(",")
}
