//! Are the poses of a controller those of a tool?

use super::kind::{Kind, Quantity, Subject, Weight, some_of};
use crate::error::Code;

/// Series that are named.
const NAMED: usize = 6;

/// A tool with which the images fit decidedly better than where the poses are taken for those of the flange.
#[derive(Debug, Clone, PartialEq)]
pub struct ToolInPoses {
    /// Series with such poses.
    pub series: Vec<String>,
    /// Position of the tool on the flange, m.
    pub tool_m: [f64; 3],
    /// Its sigma, m.
    pub sigma_m: [f64; 3],
    /// Gain of the log likelihood.
    pub gain: f64,
}

impl Kind for ToolInPoses {
    fn code(&self) -> Code {
        Code::PosesOfTool
    }

    fn weight(&self) -> Weight {
        Weight::Gate
    }

    fn subjects(&self) -> Vec<Subject> {
        self.series.iter().cloned().map(Subject::Series).collect()
    }

    fn quantities(&self) -> Vec<Quantity> {
        let names = ["tool_x", "tool_y", "tool_z"];
        let place = names.iter().zip(self.tool_m).zip(self.sigma_m);
        let place = place.map(|((name, m), sigma)| Quantity { sigma: Some(sigma), ..Quantity::new(name, m, "m") });
        place.chain([Quantity::new("log_likelihood_gain", self.gain, "1")]).collect()
    }

    fn place(&self) -> String {
        format!("series {}", some_of(&self.series, NAMED))
    }

    fn seen(&self) -> String {
        let [x, y, z] = self.tool_m.map(|m| 1e3 * m);
        let largest = 1e3 * self.sigma_m.iter().fold(0.0f64, |l, s| l.max(*s));
        format!(
            "the poses are not those of the flange: the images fit far better if they are those of a tool at about x {x:.0}, y {y:.0}, z {z:.0} mm (+- {largest:.0}) on it"
        )
    }

    fn remedy(&self) -> String {
        "write poses of the flange (the tool set to zero where they are shown or logged), or record joint readings (joints.csv)".into()
    }
}
