//! Tool and base of a motion, and what else statements set for it: `$TOOL`, `$BASE`, `$IPO_MODE` and `$ORI_TYPE`.

use std::collections::BTreeSet;

use crate::geom::Pose;
use crate::programs::flow::{Followed, Held};

/// Where a frame comes from.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum FrameIs {
    Known(Pose),
    /// Not set in the text so far.
    Unset,
    /// Set to something that the text does not tell.
    Unknown(String),
}

/// `$TOOL`, `$BASE` and `$IPO_MODE` of a motion.
#[derive(Debug, Clone)]
pub(super) struct Frames {
    pub tool: FrameIs,
    pub base: FrameIs,
    /// The tool is fixed in the room, and the robot holds the work (`#TCP`).
    pub tool_in_room: bool,
}

impl Default for Frames {
    fn default() -> Self {
        Self { tool: FrameIs::Unset, base: FrameIs::Unset, tool_in_room: false }
    }
}

/// What statements have set for the motions behind them.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Active {
    pub tool: Held<FrameIs>,
    pub base: Held<FrameIs>,
    pub tool_in_room: Held<bool>,
    /// On a path the tool keeps its orientation, or may keep it.
    pub keeps_orientation: Held<bool>,
    /// A sensor moves the robot on top of its targets, or may do so.
    pub is_sensed: Held<bool>,
    /// Routines and frames that an interrupt or a trigger may run or set at any time.
    pub beside: Held<BTreeSet<String>>,
}

impl Active {
    /// Nothing yet.
    pub fn unset() -> Self {
        let Frames { tool, base, tool_in_room } = Frames::default();
        Self {
            tool: Held::new(tool),
            base: Held::new(base),
            tool_in_room: Held::new(tool_in_room),
            keeps_orientation: Held::new(false),
            is_sensed: Held::new(false),
            beside: Held::new(BTreeSet::new()),
        }
    }

    /// All frames.
    pub fn set(&mut self, frames: Frames) {
        self.tool.set(frames.tool);
        self.base.set(frames.base);
        self.tool_in_room.set(frames.tool_in_room);
    }
}

impl Followed for Active {
    fn merged(&self, other: &Self, why: &str) -> Self {
        let unknown = |_: &FrameIs, _: &FrameIs| FrameIs::Unknown(why.to_owned());
        Self {
            tool: self.tool.merged(&other.tool, unknown),
            base: self.base.merged(&other.base, unknown),
            tool_in_room: self.tool_in_room.merged(&other.tool_in_room, |_, _| true),
            keeps_orientation: self.keeps_orientation.merged(&other.keeps_orientation, |_, _| true),
            is_sensed: self.is_sensed.merged(&other.is_sensed, |_, _| true),
            beside: self.beside.merged(&other.beside, |one, other| one | other),
        }
    }

    fn at_top(&self) -> Self {
        Self {
            tool: self.tool.at_top(),
            base: self.base.at_top(),
            tool_in_room: self.tool_in_room.at_top(),
            keeps_orientation: self.keeps_orientation.at_top(),
            is_sensed: self.is_sensed.at_top(),
            beside: self.beside.at_top(),
        }
    }

    fn behind_call(&self, end: &Self) -> Self {
        Self {
            tool: self.tool.behind_call(&end.tool),
            base: self.base.behind_call(&end.base),
            tool_in_room: self.tool_in_room.behind_call(&end.tool_in_room),
            keeps_orientation: self.keeps_orientation.behind_call(&end.keeps_orientation),
            is_sensed: self.is_sensed.behind_call(&end.is_sensed),
            beside: self.beside.behind_call(&end.beside),
        }
    }
}

/// What a motion or a spline block states for itself (`WITH $TOOL=.., $BASE=.., $IPO_MODE=.., $ORI_TYPE=..`).
#[derive(Debug, Clone, Default)]
pub(super) struct OwnFrames {
    pub tool: Option<FrameIs>,
    pub base: Option<FrameIs>,
    pub tool_in_room: Option<bool>,
    pub keeps_orientation: Option<bool>,
}

impl OwnFrames {
    pub fn or(self, other: Option<&Self>) -> Self {
        let Some(other) = other else { return self };
        Self {
            tool: self.tool.or_else(|| other.tool.clone()),
            base: self.base.or_else(|| other.base.clone()),
            tool_in_room: self.tool_in_room.or(other.tool_in_room),
            keeps_orientation: self.keeps_orientation.or(other.keeps_orientation),
        }
    }

    pub fn over(self, active: &Active) -> Frames {
        Frames {
            tool: self.tool.unwrap_or_else(|| active.tool.value.clone()),
            base: self.base.unwrap_or_else(|| active.base.value.clone()),
            tool_in_room: self.tool_in_room.unwrap_or(active.tool_in_room.value),
        }
    }
}
