//! Tool and base of a motion, and what else statements set for it: `$TOOL`, `$BASE`, `$IPO_MODE` and `$ORI_TYPE`.

use std::collections::BTreeSet;

use super::aggregate::Aggregate;
use crate::geom::Pose;
use crate::programs::external::OffZero;
use crate::programs::flow::{Either, Followed, Held};
use crate::programs::program::StatedFrame;
use crate::programs::scan::Reader;

/// Where a frame comes from.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum FrameIs {
    Known(Pose),
    /// Not set in the text so far.
    Unset,
    /// Set to something that the text does not tell.
    Unknown(Unknown),
}

/// A frame of which the text does not tell which it is.
#[derive(Debug, Clone)]
pub(super) struct Unknown {
    why: String,
    /// Frames in the text of which each may be it.
    may_be: Vec<Pose>,
    /// True where it may not stand still.
    may_move: bool,
}

/// The frames in whatever order.
impl PartialEq for Unknown {
    fn eq(&self, other: &Self) -> bool {
        let has_all = |one: &Self, other: &Self| one.may_be.iter().all(|pose| other.may_be.contains(pose));
        (&self.why, self.may_move) == (&other.why, other.may_move) && has_all(self, other) && has_all(other, self)
    }
}

impl FrameIs {
    /// One whose value the text has nowhere.
    pub fn untold(why: impl Into<String>) -> Self {
        Self::Unknown(Unknown { why: why.into(), may_be: Vec::new(), may_move: false })
    }

    /// One that a kinematic moves.
    pub fn moving(why: impl Into<String>) -> Self {
        Self::Unknown(Unknown { why: why.into(), may_be: Vec::new(), may_move: true })
    }

    /// `$BASE` on an external kinematic.
    pub fn on_kinematic() -> Self {
        Self::moving("it is on an external kinematic")
    }

    /// The same where `EK(..)` stands before the reader.
    pub fn coupled(reader: &Reader<'_>) -> Option<Self> {
        (reader.ahead_is_word(0, "EK") && reader.ahead_is_mark(1, b'(')).then(Self::on_kinematic)
    }

    /// This one, or another that holds at another time.
    pub fn at_some_time(&self, why: &str) -> Self {
        self.either(self, why)
    }

    /// This one or the other.
    pub fn either(&self, other: &Self, why: &str) -> Self {
        let mut may_be = self.may_be();
        other.may_be().into_iter().for_each(|pose| {
            if !may_be.contains(&pose) {
                may_be.push(pose);
            }
        });
        let why = match (self, other) {
            (Self::Unknown(one), Self::Unknown(other)) if one.why == other.why && one != other => &one.why,
            _ => why,
        };
        Self::Unknown(Unknown { why: why.to_owned(), may_be, may_move: self.may_move() || other.may_move() })
    }

    /// The frame; where the text tells none, that which the user states, unless the text has another that may hold.
    pub fn or_stated(&self, stated: Option<Pose>) -> Option<Pose> {
        match self {
            Self::Known(pose) => Some(*pose),
            Self::Unset => stated,
            Self::Unknown(unknown) => stated
                .filter(|stated| !unknown.may_move && unknown.may_be.iter().all(|pose| pose.misfit(stated) < 1e-6)),
        }
    }

    /// Why the frame of this name is not known.
    pub fn why(&self, name: &str, flag: &str) -> String {
        match self {
            Self::Unknown(Unknown { why, may_be, may_move: false }) if may_be.is_empty() => {
                format!("{name} is not known: {why}, or give {flag}")
            }
            Self::Unknown(unknown) => format!("{name} is not known: {}", unknown.why),
            Self::Unset | Self::Known(_) => format!("{name} is not set before it; give {flag}"),
        }
    }

    /// The frame of a motion to axes, seen from another one.
    fn beside_joints(&self, stated: Option<Pose>, from: &Pose) -> StatedFrame {
        let one = |pose: Pose| StatedFrame::beside(from, Some(*from * pose));
        match self {
            Self::Known(pose) => one(*pose),
            Self::Unset => StatedFrame::Unsaid,
            Self::Unknown(Unknown { may_move: true, .. }) => StatedFrame::Elsewhere,
            Self::Unknown(unknown) if unknown.may_be.iter().all(|pose| *pose == Pose::identity()) => {
                StatedFrame::Unsaid
            }
            Self::Unknown(_) => self.or_stated(stated).map_or(StatedFrame::Several, one),
        }
    }

    fn may_be(&self) -> Vec<Pose> {
        match self {
            Self::Known(pose) => vec![*pose],
            Self::Unset => Vec::new(),
            Self::Unknown(unknown) => unknown.may_be.clone(),
        }
    }

    fn may_move(&self) -> bool {
        matches!(self, Self::Unknown(Unknown { may_move: true, .. }))
    }
}

/// Why a frame is not known.
const MANY: &str = "one of very many that a routine sets";

impl Either for FrameIs {
    fn either(&self, other: &Self) -> Self {
        self.either(other, MANY)
    }
}

/// `$IPO_MODE`, from what casts no doubt on a target to what leaves none.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum IpoMode {
    /// The robot holds the tool (`#BASE`).
    Base,
    /// The text does not tell which.
    Untold,
    /// The tool is fixed in the room, and the robot holds the work (`#TCP`), or may do so.
    Tcp,
}

impl IpoMode {
    /// Of the value of this name.
    pub fn named(name: Option<&str>) -> Self {
        match name {
            Some("TCP") => Self::Tcp,
            Some("BASE" | "NONE") => Self::Base,
            _ => Self::Untold,
        }
    }

    /// Of motion data; those that do not state it leave it as it is usually.
    pub fn of_data(data: &Aggregate) -> Self {
        if data.has(&[IPO_FRAME]) { Self::named(data.word(IPO_FRAME)) } else { Self::Base }
    }
}

impl Either for IpoMode {
    fn either(&self, other: &Self) -> Self {
        *self.max(other)
    }
}

/// `$IPO_MODE` in motion data.
const IPO_FRAME: &str = "IPO_FRAME";

/// `$TOOL`, `$BASE` and `$IPO_MODE` of a motion.
#[derive(Debug, Clone)]
pub(super) struct Frames {
    pub tool: FrameIs,
    pub base: FrameIs,
    pub ipo_mode: IpoMode,
}

impl Default for Frames {
    fn default() -> Self {
        Self { tool: FrameIs::Unset, base: FrameIs::Unset, ipo_mode: IpoMode::Base }
    }
}

impl Frames {
    /// Whether `$TOOL` goes with the flange, else why not. Where the text tells neither that nor the tool, it is as the user states.
    pub fn is_on_flange(&self) -> std::result::Result<(), &'static str> {
        match self.ipo_mode {
            IpoMode::Untold if matches!(self.tool, FrameIs::Known(_)) => Err(
                "whether the tool is fixed in the room is not known: $IPO_MODE is a value that the text does not tell (write #BASE or #TCP there)",
            ),
            IpoMode::Base | IpoMode::Untold => Ok(()),
            IpoMode::Tcp => Err("the tool is fixed in the room, or may be ($IPO_MODE #TCP)"),
        }
    }

    /// Tool and `base_from_work` of a motion to axes; those that the user states and the foot of the robot beside them.
    pub fn beside_joints(&self, stated: [Option<Pose>; 2], base: &Pose) -> [StatedFrame; 2] {
        let none = Pose::identity();
        let tool = match self.is_on_flange() {
            Ok(()) => self.tool.beside_joints(stated[0], &none),
            Err(_) => StatedFrame::Elsewhere,
        };
        [tool, self.base.beside_joints(stated[1], base)]
    }
}

/// What statements have set for the motions behind them.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Active {
    pub tool: Held<FrameIs>,
    pub base: Held<FrameIs>,
    pub ipo_mode: Held<IpoMode>,
    /// On a path the tool keeps its orientation, or may keep it.
    pub keeps_orientation: Held<bool>,
    /// A sensor moves the robot on top of its targets, or may do so.
    pub is_sensed: Held<bool>,
    /// External axes that do not stand at zero.
    pub off_zero: Held<OffZero>,
    /// Routines and frames that an interrupt or a trigger may run or set at any time.
    pub beside: Held<BTreeSet<String>>,
}

impl Active {
    /// Nothing yet.
    pub fn unset() -> Self {
        let Frames { tool, base, ipo_mode } = Frames::default();
        Self {
            tool: Held::new(tool),
            base: Held::new(base),
            ipo_mode: Held::new(ipo_mode),
            keeps_orientation: Held::new(false),
            is_sensed: Held::new(false),
            off_zero: Held::new(OffZero::default()),
            beside: Held::new(BTreeSet::new()),
        }
    }

    /// The same where a routine that ends so may have been left at any statement.
    pub fn or_left_by(&mut self, end: &Self, why: &str) {
        let either = |one: &FrameIs, other: &FrameIs| one.either(other, why);
        self.tool.or_passed_by(&end.tool, either);
        self.base.or_passed_by(&end.base, either);
        self.ipo_mode.or_passed_by(&end.ipo_mode, IpoMode::either);
        self.keeps_orientation.or_passed_by(&end.keeps_orientation, |_, _| true);
        self.is_sensed.or_passed_by(&end.is_sensed, |_, _| true);
        self.off_zero.or_passed_by(&end.off_zero, OffZero::either);
        self.beside.or_passed_by(&end.beside, |one, other| one | other);
    }

    /// All frames.
    pub fn set(&mut self, frames: Frames) {
        self.tool.set(frames.tool);
        self.base.set(frames.base);
        self.ipo_mode.set(frames.ipo_mode);
    }
}

impl Followed for Active {
    fn merged(&self, other: &Self, why: &str) -> Self {
        let either = |one: &FrameIs, other: &FrameIs| one.either(other, why);
        Self {
            tool: self.tool.merged(&other.tool, either),
            base: self.base.merged(&other.base, either),
            ipo_mode: self.ipo_mode.merged(&other.ipo_mode, IpoMode::either),
            keeps_orientation: self.keeps_orientation.merged(&other.keeps_orientation, |_, _| true),
            is_sensed: self.is_sensed.merged(&other.is_sensed, |_, _| true),
            off_zero: self.off_zero.merged(&other.off_zero, OffZero::either),
            beside: self.beside.merged(&other.beside, |one, other| one | other),
        }
    }

    fn at_top(&self) -> Self {
        Self {
            tool: self.tool.at_top(),
            base: self.base.at_top(),
            ipo_mode: self.ipo_mode.at_top(),
            keeps_orientation: self.keeps_orientation.at_top(),
            is_sensed: self.is_sensed.at_top(),
            off_zero: self.off_zero.at_top(),
            beside: self.beside.at_top(),
        }
    }

    fn behind_call(&self, end: &Self) -> Self {
        Self {
            tool: self.tool.behind_call(&end.tool),
            base: self.base.behind_call(&end.base),
            ipo_mode: self.ipo_mode.behind_call(&end.ipo_mode),
            keeps_orientation: self.keeps_orientation.behind_call(&end.keeps_orientation),
            is_sensed: self.is_sensed.behind_call(&end.is_sensed),
            off_zero: self.off_zero.behind_call(&end.off_zero),
            beside: self.beside.behind_call(&end.beside),
        }
    }
}

/// What a motion or a spline block states for itself (`WITH $TOOL=.., $BASE=.., $IPO_MODE=.., $ORI_TYPE=..`).
#[derive(Debug, Clone, Default)]
pub(super) struct OwnFrames {
    pub tool: Option<FrameIs>,
    pub base: Option<FrameIs>,
    pub ipo_mode: Option<IpoMode>,
    pub keeps_orientation: Option<bool>,
}

impl OwnFrames {
    pub fn or(self, other: Option<&Self>) -> Self {
        let Some(other) = other else { return self };
        Self {
            tool: self.tool.or_else(|| other.tool.clone()),
            base: self.base.or_else(|| other.base.clone()),
            ipo_mode: self.ipo_mode.or(other.ipo_mode),
            keeps_orientation: self.keeps_orientation.or(other.keeps_orientation),
        }
    }

    pub fn over(self, active: &Active) -> Frames {
        Frames {
            tool: self.tool.unwrap_or_else(|| active.tool.value.clone()),
            base: self.base.unwrap_or_else(|| active.base.value.clone()),
            ipo_mode: self.ipo_mode.unwrap_or(active.ipo_mode.value),
        }
    }
}
