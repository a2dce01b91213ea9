//! What every finding answers, and what its checks look at.

use serde::{Deserialize, Serialize};

use crate::assess::Limits;
use crate::error::Code;
pub use crate::error::Quantity;
use crate::fit::{Fit, FreePoses};
use crate::problem::MeasuredSeries;
use crate::solve::NoiseInformation;

/// What every check may look at.
#[derive(Clone, Copy)]
pub struct CheckContext<'a> {
    /// The series as measured.
    pub series: &'a [MeasuredSeries],
    /// The stand-alone camera poses.
    pub free: &'a FreePoses,
    /// Images of the robot before any was left out.
    pub on_robot: usize,
    /// What the data say of a joint noise that was stated; none where it is estimated.
    pub stated_noise: Option<StatedNoise<'a>>,
    /// Names of the parameters that the user holds.
    pub fixed: &'a [String],
    /// Numbers that decide.
    pub limits: &'a Limits,
}

/// A joint noise that was stated, and the same fit with the noise that the data show.
#[derive(Clone, Copy)]
pub struct StatedNoise<'a> {
    /// As stated, rad or m.
    pub sigma: f64,
    /// The fit that found it.
    pub found: &'a Fit,
    /// What the data tell of it, also of that which counts as none; none where they tell nothing.
    pub told: Option<&'a NoiseInformation>,
}

impl CheckContext<'_> {
    /// The fit whose joint noise was found from the data. One that was stated too small makes the arm look as if something had moved.
    pub(super) fn with_noise_found<'f>(&'f self, fit: &'f Fit) -> &'f Fit {
        self.stated_noise.map_or(fit, |stated| stated.found)
    }
}

/// How much a finding weighs, the lightest first.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Weight {
    /// The user should know; the result stands.
    Note,
    /// A quality gate failed: the result is not to be trusted.
    Gate,
    /// There is no result.
    Refusal,
}

/// What a finding is about.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(tag = "kind", content = "name", rename_all = "snake_case")]
pub enum Subject {
    /// A file, line, or another place in words.
    Place(String),
    /// A series.
    Series(String),
    /// A stop (a row of joints.csv).
    Stop(String),
    /// An image (a row of joints.csv).
    Image(String),
    /// A camera.
    Camera(String),
    /// A joint, by its URDF name.
    Joint(String),
    /// Plate or mounting.
    Body(String),
    /// A marker, by its id.
    Marker(u32),
    /// A parameter, by its name in the layout.
    Parameter(String),
}

/// What every kind of finding answers.
pub(super) trait Kind {
    /// Stable name for programs.
    fn code(&self) -> Code;
    /// How much it weighs.
    fn weight(&self) -> Weight {
        Weight::Gate
    }
    /// What it is about.
    fn subjects(&self) -> Vec<Subject> {
        Vec::new()
    }
    /// Its numbers, in SI units but for px.
    fn quantities(&self) -> Vec<Quantity> {
        Vec::new()
    }
    /// File, image, joint or body that it is about, in words.
    fn place(&self) -> String;
    /// What was seen of it, and why it matters.
    fn seen(&self) -> String;
    /// What to do.
    fn remedy(&self) -> String;
}

/// Names of the first few, and how many more there are.
pub(super) fn some_of(names: &[String], most: usize) -> String {
    let more = names.len().saturating_sub(most);
    let rest = if more > 0 { format!(" and {more} more") } else { String::new() };
    format!("{}{rest}", names[..names.len() - more].join(", "))
}
