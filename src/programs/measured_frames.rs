//! Tool and work object where they really are, instead of where the program has them.

use nalgebra::{Matrix3, Vector3};

use super::program::{TargetKind, Understood};
use super::reason::{LeftReason, Why};
use crate::geom::Pose;

/// What is known of a robot beyond the model that it is written as.
pub trait KnownError: std::fmt::Debug + Sync {
    /// Where the tool is beside where the model has it, at readings, along the axes of the base, m.
    fn error_m(&self, readings: &[f64]) -> Vector3<f64>;
}

/// A tool as it was measured on a robot.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum MeasuredTool {
    /// Its point in the frame of the flange, m; it is turned as the program says.
    Point(Vector3<f64>),
    /// `flange_from_tool`.
    Pose(Pose),
}

impl MeasuredTool {
    fn point(&self) -> Vector3<f64> {
        match self {
            Self::Point(point) => *point,
            Self::Pose(pose) => pose.translation,
        }
    }

    /// `flange_from_tool` where this is taken for `other`: points tell no turn, so that none is made between them.
    fn onto(&self, other: &Self) -> Pose {
        match (self, other) {
            (Self::Pose(a), Self::Pose(b)) => *a * b.inverse(),
            _ => Pose::new(Matrix3::identity(), self.point() - other.point()),
        }
    }
}

/// What was measured of the frames of one robot; what was not is as the program has it.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct RobotFrames {
    /// The tool.
    pub tool: Option<MeasuredTool>,
    /// `base_from_work`.
    pub work: Option<Pose>,
}

/// Frames of the cell, and what says which of the program's they stand for.
#[derive(Debug, Clone, PartialEq)]
pub struct MeasuredFrames {
    /// Of the robot that runs the program.
    pub to: RobotFrames,
    /// Of the robot on which it was taught; `None` for a program as it was planned, whose own frames count.
    pub from: Option<RobotFrames>,
    /// Where the places are given in the base itself: distance and angle from the base of the model beyond which it is another frame, m and rad.
    pub base_within: Option<(f64, f64)>,
    /// Tool of targets that are joint values, where it is known.
    pub tool: Option<Pose>,
    /// Their work object.
    pub work: Option<Pose>,
    /// Distance and angle from the program's work object to the measured one beyond which they are not the same, m and rad.
    pub same_work: (f64, f64),
    /// Distance from the program's tool to the measured one beyond which they are not the same, m.
    pub same_tool_m: f64,
}

/// What becomes of the pose of the flange that a target means: `base * pose * tool`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Moved {
    base: Pose,
    tool: Pose,
    /// Where errors are told, in the frame of the flange.
    pub flange_from_tool: Pose,
}

impl Moved {
    /// Nothing was measured.
    pub fn none() -> Self {
        Self { base: Pose::identity(), tool: Pose::identity(), flange_from_tool: Pose::identity() }
    }

    /// Pose of the flange of the robot that runs the program.
    pub fn applied(&self, flange: &Pose) -> Pose {
        self.base * *flange * self.tool
    }
}

impl MeasuredFrames {
    /// What becomes of a target; else why it cannot be told.
    pub(super) fn moved(&self, kind: &TargetKind) -> Understood<Moved> {
        let (own_tool, own_work) = match kind {
            TargetKind::Pose(pose) => (Some(pose.flange_from_tool), Some(pose.base_from_work)),
            TargetKind::Joints(_) => (self.tool, self.work),
        };
        let tool = match (&self.to.tool, self.from.as_ref().map(|f| f.tool)) {
            (None, _) => Pose::identity(),
            (Some(to), Some(Some(from))) => from.onto(to),
            (Some(to), _) => {
                let own = own_tool.ok_or_else(|| {
                    let words = "the tool was measured, and the text does not tell which tool these joints mean: give it with --tool";
                    Why::new(LeftReason::ToolUnknown, words)
                })?;
                let apart = (own.translation - to.point()).norm();
                if apart > self.same_tool_m {
                    let words = format!("its tool lies {:.1} mm from the measured one: another tool", 1e3 * apart);
                    return Err(Why::new(LeftReason::ToolUnknown, words));
                }
                MeasuredTool::Pose(own).onto(to)
            }
        };
        let base = match (&self.to.work, self.from.as_ref().map(|f| f.work)) {
            (None, _) => Pose::identity(),
            (Some(to), Some(Some(from))) => *to * from.inverse(),
            (Some(to), _) if self.base_within.is_some() => {
                let (rad, m) = to.distance(&Pose::identity());
                if self.base_within.is_some_and(|within| m > within.0 || rad > within.1) {
                    let words = format!(
                        "the touched places are said to stand in the base, and their frame lies {:.0} mm and {:.1} degrees from it: name the frame that they stand in ([contact] frame)",
                        1e3 * m,
                        rad.to_degrees()
                    );
                    return Err(Why::new(LeftReason::FrameUnknown, words));
                }
                *to
            }
            (Some(to), _) => {
                let own = own_work.ok_or_else(|| {
                    let words = "the work object was measured, and the text does not tell which one these joints mean: give it with --work";
                    Why::new(LeftReason::FrameUnknown, words)
                })?;
                let (rad, m) = own.distance(to);
                if m > self.same_work.0 || rad > self.same_work.1 {
                    let words = format!(
                        "its work frame lies {:.0} mm and {:.1} degrees from the measured one: another work object",
                        1e3 * m,
                        rad.to_degrees()
                    );
                    return Err(Why::new(LeftReason::FrameUnknown, words));
                }
                *to * own.inverse()
            }
        };
        let point = self.to.tool.map(|t| Pose::new(Matrix3::identity(), t.point()));
        Ok(Moved { base, tool, flange_from_tool: point.or(own_tool).unwrap_or_else(Pose::identity) })
    }
}
