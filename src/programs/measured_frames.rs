//! Tool and work object where they really are, instead of where the program has them.

use nalgebra::{Matrix3, Vector3};

use super::frame_candidates::{Candidates, MeasuredTool, Reference, SameFrames};
use super::program::{StatedFrame, Target, TargetKind, Understood};
use super::reason::{LeftReason, Why};
use crate::geom::Pose;

/// What is known of a robot beyond the model that it is written as.
pub trait KnownError: std::fmt::Debug + Sync {
    /// Where the tool is beside where the model has it, at readings, along the axes of the base, m.
    fn error_m(&self, readings: &[f64]) -> Vector3<f64>;
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
    /// The tool as the user states it: that of targets that are joint values and whose text says none, and the one that was measured where the program has several.
    pub tool: Option<Pose>,
    /// The work object, likewise.
    pub work: Option<Pose>,
    /// The frame of poses that are on the stated work object though their text cannot say so: the base, of URScript.
    pub unsaid: Option<Pose>,
    /// What says that two frames are the same.
    pub same: SameFrames,
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

/// The measured frames beside those of one program.
#[derive(Debug, Clone)]
pub(super) struct FramesOfProgram<'a> {
    measured: &'a MeasuredFrames,
    tools: Candidates,
    works: Candidates,
}

/// A tool and a work object of a program: `flange_from_tool`, `base_from_work`.
fn own_frames(kind: &TargetKind, measured: &MeasuredFrames) -> [StatedFrame; 2] {
    match kind {
        TargetKind::Pose(pose) => {
            let stated = measured.work.filter(|_| measured.unsaid == Some(pose.base_from_work));
            [pose.flange_from_tool, stated.unwrap_or(pose.base_from_work)].map(StatedFrame::One)
        }
        TargetKind::Joints(joints) => {
            let [tool, work] = *joints.frames;
            [tool.else_as_stated(measured.tool), work.else_as_stated(measured.work)]
        }
    }
}

/// The frame of a target, where it is known.
fn known(own: StatedFrame, reason: LeftReason, word: &str, flag: &str) -> Understood<Pose> {
    match own {
        StatedFrame::One(pose) => Ok(pose),
        StatedFrame::Unsaid => {
            let words = format!(
                "the {word} was measured, and the text does not tell which {word} these joints mean: give it with {flag}"
            );
            Err(Why::new(reason, words))
        }
        StatedFrame::Elsewhere => {
            let words = format!(
                "the {word} was measured, and these joints are used with one that is elsewhere: a tool fixed in the room, work that moves"
            );
            Err(Why::new(reason, words))
        }
        StatedFrame::Several => {
            let words = format!(
                "the {word} was measured, and these joints are used with several, or with one that the text does not tell for certain: state it again before the motion, or give them a target for each"
            );
            Err(Why::new(reason, words))
        }
    }
}

impl<'a> FramesOfProgram<'a> {
    /// Looks which frames of a program stand for the measured ones.
    pub fn new(measured: &'a MeasuredFrames, targets: &[Target]) -> Self {
        let (mut tools, mut works) = (Vec::new(), Vec::new());
        for target in targets {
            let [tool, work] = own_frames(&target.kind, measured);
            tools.extend(tool.pose());
            works.extend(work.pose());
        }
        let tool = measured.to.tool.map(|to| Reference::tool(to, &measured.same));
        let work = measured.to.work.map(|to| Reference::work(to, &measured.same));
        let clearly = measured.same.clearly_nearer;
        Self {
            measured,
            tools: Candidates::of(&tools, tool, measured.tool, clearly),
            works: Candidates::of(&works, work, measured.work, clearly),
        }
    }

    /// What becomes of a target; else why it cannot be told.
    pub fn moved(&self, kind: &TargetKind) -> Understood<Moved> {
        let [own_tool, own_work] = own_frames(kind, self.measured);
        let (tool, base) = (self.tool(own_tool)?, self.base(own_work)?);
        let point = self.measured.to.tool.map(|t| Pose::new(Matrix3::identity(), t.point()));
        Ok(Moved { base, tool, flange_from_tool: point.or(own_tool.pose()).unwrap_or_else(Pose::identity) })
    }

    fn tool(&self, own: StatedFrame) -> Understood<Pose> {
        let from = self.measured.from.as_ref().map(|f| f.tool);
        let (to, own) = match (&self.measured.to.tool, from) {
            (None, _) => return Ok(Pose::identity()),
            (Some(to), Some(Some(from))) => return Ok(from.onto(to)),
            (Some(to), _) => (to, own),
        };
        let unknown = |words: String| Why::new(LeftReason::ToolUnknown, words);
        let own = known(own, LeftReason::ToolUnknown, "tool", "--tool")?;
        self.tools.check(&own).map_err(|why| unknown(why.in_words("tool", "--tool")))?;
        Ok(MeasuredTool::Pose(own).onto(to))
    }

    fn base(&self, own: StatedFrame) -> Understood<Pose> {
        let from = self.measured.from.as_ref().map(|f| f.work);
        let unknown = |words: String| Why::new(LeftReason::FrameUnknown, words);
        let to = match (&self.measured.to.work, from) {
            (None, _) => return Ok(Pose::identity()),
            (Some(to), Some(Some(from))) => return Ok(*to * from.inverse()),
            (Some(to), _) => to,
        };
        if let Some(within) = self.measured.base_within {
            let (rad, m) = to.distance(&Pose::identity());
            if m > within.0 || rad > within.1 {
                let words = format!(
                    "the touched places are said to stand in the base, and their frame lies {:.0} mm and {:.1} degrees from it: name the frame that they stand in ([contact] frame)",
                    1e3 * m,
                    rad.to_degrees()
                );
                return Err(unknown(words));
            }
            return Ok(*to);
        }
        let own = known(own, LeftReason::FrameUnknown, "work object", "--work")?;
        self.works.check(&own).map_err(|why| unknown(why.in_words("work object", "--work")))?;
        Ok(*to * own.inverse())
    }
}
