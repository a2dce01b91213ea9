//! Tool and base of a motion: `$TOOL`, `$BASE` and `$IPO_MODE`.

use crate::geom::Pose;
use crate::programs::branches::Merged;

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

impl Merged for Frames {
    fn merged(&self, other: &Self) -> Self {
        let alike = |a: &FrameIs, b: &FrameIs| match a == b {
            true => a.clone(),
            false => FrameIs::Unknown("it is set in a branch or a loop".into()),
        };
        Self {
            tool: alike(&self.tool, &other.tool),
            base: alike(&self.base, &other.base),
            tool_in_room: self.tool_in_room || other.tool_in_room,
        }
    }
}

/// What a motion or a spline block states for itself (`WITH $TOOL=.., $BASE=.., $IPO_MODE=..`).
#[derive(Debug, Clone, Default)]
pub(super) struct OwnFrames {
    pub tool: Option<FrameIs>,
    pub base: Option<FrameIs>,
    pub tool_in_room: Option<bool>,
}

impl OwnFrames {
    pub fn or(self, other: &Self) -> Self {
        Self {
            tool: self.tool.or_else(|| other.tool.clone()),
            base: self.base.or_else(|| other.base.clone()),
            tool_in_room: self.tool_in_room.or(other.tool_in_room),
        }
    }

    pub fn over(self, active: &Frames) -> Frames {
        Frames {
            tool: self.tool.unwrap_or_else(|| active.tool.clone()),
            base: self.base.unwrap_or_else(|| active.base.clone()),
            tool_in_room: self.tool_in_room.unwrap_or(active.tool_in_room),
        }
    }
}
