//! What statements of a script set for the moves behind them.

use std::collections::BTreeMap;

use crate::geom::Pose;
use crate::programs::flow::{Either, Followed, Held};
use crate::programs::program::{StatedFrame, Understood};
use crate::programs::reason::{LeftReason, Why};

/// What moves the tool on top of the targets, and how many such things there are.
const CONVEYOR: usize = 0;
const PATH_OFFSET: usize = 1;
const ON_TOP: usize = 2;
/// Calls that begin and end them.
const SWITCHES: [(&[u8], usize, bool); 5] = [
    (b"track_conveyor_linear", CONVEYOR, true),
    (b"track_conveyor_circular", CONVEYOR, true),
    (b"stop_conveyor_tracking", CONVEYOR, false),
    (b"path_offset_enable", PATH_OFFSET, true),
    (b"path_offset_disable", PATH_OFFSET, false),
];

/// Why something is not known.
const BESIDE: &str = "one that runs beside it may set it at any time";

const MANY: &str = "very many set it";

/// Threads that run on one way or another.
impl Either for BTreeMap<String, Option<String>> {
    fn either(&self, other: &Self) -> Self {
        let mut all = self.clone();
        for (name, held) in other {
            all.entry(name.clone())
                .and_modify(|own| *own = own.take().filter(|own| Some(own) == held.as_ref()))
                .or_insert_with(|| held.clone());
        }
        all
    }
}

/// The tool, and why it is not known.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum ToolIs {
    Known(Pose),
    /// Neither the text nor the user has set one.
    Unset,
    /// The text sets it to something that is not written in numbers.
    Computed,
    /// The text sets several, or on some ways none: how, in words.
    Several(String),
}

impl ToolIs {
    /// The tool.
    ///
    /// # Errors
    /// Why it is not known.
    pub fn known(&self) -> Understood<Pose> {
        let words = match self {
            Self::Known(pose) => return Ok(*pose),
            Self::Unset => "no set_tcp(p[..]) before it; give --tool",
            Self::Computed => "the set_tcp before it is computed, not written in numbers; give --tool",
            Self::Several(why) => why,
        };
        Err(Why::new(LeftReason::ToolUnknown, format!("its tool is not known: {words}")))
    }

    /// One of two.
    fn one_of_two(why: &str) -> Self {
        Self::Several(format!("set_tcp sets several on the ways to it, or none on some ({why})"))
    }

    /// That of a move to joints.
    pub fn beside_joints(&self) -> StatedFrame {
        match self {
            Self::Known(pose) => StatedFrame::beside(&Pose::identity(), Some(*pose)),
            Self::Unset | Self::Computed => StatedFrame::Unsaid,
            Self::Several(_) => StatedFrame::Several,
        }
    }
}

impl Either for ToolIs {
    fn either(&self, _: &Self) -> Self {
        Self::one_of_two(MANY)
    }
}

/// What holds at a move.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Active {
    /// The active tool.
    pub tool: Held<ToolIs>,
    /// True for what may move the tool on top of the targets.
    on_top: [Held<bool>; ON_TOP],
    /// What goes on beside the text and may set these: threads, with the variable that holds one where it is run once.
    pub beside: Held<BTreeMap<String, Option<String>>>,
}

impl Active {
    /// Where nothing has set anything yet.
    pub fn new(tool: Option<Pose>) -> Self {
        Self {
            tool: Held::new(tool.map_or(ToolIs::Unset, ToolIs::Known)),
            on_top: [false; ON_TOP].map(Held::new),
            beside: Held::new(BTreeMap::new()),
        }
    }

    /// What goes on beside the text, and ends so, may have set meanwhile.
    pub fn or_set_by(&mut self, end: &Self) {
        self.tool.or_passed_by(&end.tool, |_, _| ToolIs::one_of_two(BESIDE));
        let on_top = self.on_top.iter_mut().zip(&end.on_top);
        on_top.for_each(|(own, end)| own.or_passed_by(end, |_, _| true));
    }

    /// A call that begins or ends a motion on top of that of the targets; false for any other.
    pub fn switched(&mut self, call: &[u8]) -> bool {
        let found = SWITCHES.iter().find(|(name, ..)| *name == call);
        found.iter().for_each(|(_, which, begins)| self.on_top[*which].set(*begins));
        found.is_some()
    }

    /// True where the robot may move by more than its targets say.
    pub fn has_motion_on_top(&self) -> bool {
        self.on_top.iter().any(|on_top| on_top.value)
    }
}

impl Followed for Active {
    fn merged(&self, other: &Self, why: &str) -> Self {
        let on_top = [CONVEYOR, PATH_OFFSET].map(|k| self.on_top[k].merged(&other.on_top[k], |_, _| true));
        Self {
            tool: self.tool.merged(&other.tool, |_, _| ToolIs::one_of_two(why)),
            on_top,
            beside: self.beside.merged(&other.beside, Either::either),
        }
    }

    fn at_top(&self) -> Self {
        Self {
            tool: self.tool.at_top(),
            on_top: self.on_top.each_ref().map(Held::at_top),
            beside: self.beside.at_top(),
        }
    }

    fn behind_call(&self, end: &Self) -> Self {
        let on_top = [CONVEYOR, PATH_OFFSET].map(|k| self.on_top[k].behind_call(&end.on_top[k]));
        Self { tool: self.tool.behind_call(&end.tool), on_top, beside: self.beside.behind_call(&end.beside) }
    }
}
