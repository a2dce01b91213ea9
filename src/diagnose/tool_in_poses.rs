//! Are the poses of a controller those of a tool, or in another frame than the base?

use super::kind::{Kind, Quantity, Subject, Weight, some_of};
use crate::error::Code;

/// Series that are named.
const NAMED: usize = 6;

/// What poses of a controller are, if they are not those of the flange in the base.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PosesOf {
    /// Of a tool on the flange.
    Tool,
    /// In a frame in the base.
    Frame,
}

/// A tool or a frame with which the images fit decidedly better than where the poses are taken for those of the flange in the base.
#[derive(Debug, Clone, PartialEq)]
pub struct ToolInPoses {
    /// Series with such poses.
    pub series: Vec<String>,
    /// Which.
    pub of: PosesOf,
    /// Position of the tool on the flange, or of the frame in the base, m.
    pub place_m: [f64; 3],
    /// Its sigma, m.
    pub sigma_m: [f64; 3],
    /// Gain of the log likelihood.
    pub gain: f64,
}

impl Kind for ToolInPoses {
    fn code(&self) -> Code {
        match self.of {
            PosesOf::Tool => Code::PosesOfTool,
            PosesOf::Frame => Code::PosesInFrame,
        }
    }

    fn weight(&self) -> Weight {
        Weight::Gate
    }

    fn subjects(&self) -> Vec<Subject> {
        self.series.iter().cloned().map(Subject::Series).collect()
    }

    fn quantities(&self) -> Vec<Quantity> {
        let names = match self.of {
            PosesOf::Tool => ["tool_x", "tool_y", "tool_z"],
            PosesOf::Frame => ["frame_x", "frame_y", "frame_z"],
        };
        let place = names.iter().zip(self.place_m).zip(self.sigma_m);
        let place = place.map(|((name, m), sigma)| Quantity { sigma: Some(sigma), ..Quantity::new(name, m, "m") });
        place.chain([Quantity::new("log_likelihood_gain", self.gain, "1")]).collect()
    }

    fn place(&self) -> String {
        format!("series {}", some_of(&self.series, NAMED))
    }

    fn seen(&self) -> String {
        let [x, y, z] = self.place_m.map(|m| 1e3 * m);
        let largest = 1e3 * self.sigma_m.iter().fold(0.0f64, |l, s| l.max(*s));
        let place = format!("at about x {x:.0}, y {y:.0}, z {z:.0} mm (+- {largest:.0})");
        match self.of {
            PosesOf::Tool => format!(
                "the poses are not those of the flange: the images fit far better if they are those of a tool {place} on it"
            ),
            PosesOf::Frame => format!(
                "the poses are not in the base of the robot: the images fit far better if they are in a frame {place} in it"
            ),
        }
    }

    fn remedy(&self) -> String {
        "write poses of the flange in the base of the robot (tool and user frame set to zero where they are shown or logged), or record joint readings (joints.csv)".into()
    }
}
