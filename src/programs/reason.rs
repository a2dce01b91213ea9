//! Why a target of a program stays as it is.

use serde::Serialize;

/// The closed set of reasons; their names stand in corrections.csv and, with counts, in findings.json.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum LeftReason {
    /// It is computed, not written in numbers.
    Computed,
    /// It is relative to the position before.
    Relative,
    /// It stands in none of the files.
    Undeclared,
    /// It is no target of the language.
    NotATarget,
    /// Numbers are left out, and the target before it is not known.
    Incomplete,
    /// Its tool is not known.
    ToolUnknown,
    /// Its work frame is not known.
    FrameUnknown,
    /// An external axis that the description lacks is not at zero: it may carry the robot or the work.
    ExternalAxis,
    /// On the way there the tool keeps its orientation, whatever the target says.
    OrientationKept,
    /// Its path ends elsewhere, before or beyond its points.
    PathEnd,
    /// It is used with different tools or frames.
    FramesDiffer,
    /// No motion of the files goes there, and so much of it is not known.
    Unvisited,
    /// Nothing tells its posture, or two are possible.
    PostureUnknown,
    /// The model in the controller does not reach it.
    OutOfReach,
    /// Fewer than six joints are free: the tool cannot be moved in all directions.
    TooFewAxes,
    /// The program itself is beyond a limit.
    ProgramBeyondLimit,
    /// The correction would lead beyond a limit.
    BeyondLimit,
    /// It lies next to a singular posture.
    Singular,
    /// The decimals of the text, or the point that it starts from, leave too much.
    Coarse,
}

impl LeftReason {
    /// Stable name for programs, `snake_case`.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Computed => "computed",
            Self::Relative => "relative",
            Self::Undeclared => "undeclared",
            Self::NotATarget => "not_a_target",
            Self::Incomplete => "incomplete",
            Self::ToolUnknown => "tool_unknown",
            Self::FrameUnknown => "frame_unknown",
            Self::ExternalAxis => "external_axis",
            Self::OrientationKept => "orientation_kept",
            Self::PathEnd => "path_end",
            Self::FramesDiffer => "frames_differ",
            Self::Unvisited => "unvisited",
            Self::PostureUnknown => "posture_unknown",
            Self::OutOfReach => "out_of_reach",
            Self::TooFewAxes => "too_few_axes",
            Self::ProgramBeyondLimit => "program_beyond_limit",
            Self::BeyondLimit => "beyond_limit",
            Self::Singular => "singular",
            Self::Coarse => "coarse",
        }
    }
}

/// A reason with its sentence.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Why {
    /// The reason.
    pub reason: LeftReason,
    /// Declared name that it is about, where it is about one.
    pub about: Option<String>,
    /// Declared points from which a computed target starts: it moves with those that are corrected.
    pub starts_from: Vec<DeclaredPoint>,
    /// The sentence.
    pub words: String,
}

/// A point by its declaration.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct DeclaredPoint {
    /// Its name.
    pub name: String,
    /// Index of the file.
    pub file: usize,
    /// Line, from 1.
    pub line: usize,
}

impl Why {
    /// A reason with its sentence.
    pub(super) fn new(reason: LeftReason, words: impl Into<String>) -> Self {
        Self { reason, about: None, starts_from: Vec::new(), words: words.into() }
    }

    /// A reason that is about a declared name.
    pub(super) fn of(name: &str, reason: LeftReason, words: impl Into<String>) -> Self {
        Self { about: Some(name.to_owned()), ..Self::new(reason, words) }
    }

    /// The same of a target that is computed from these points.
    pub(super) fn starting_from(self, starts_from: Vec<DeclaredPoint>) -> Self {
        Self { starts_from, ..self }
    }

    /// An external axis of which the description knows nothing stands elsewhere than at zero.
    pub(super) fn external(axis: &str, value: impl std::fmt::Display) -> Self {
        let words = format!(
            "{axis} is {value}, and the description has no such axis: it may carry the robot or the work (give a description that has it, or --axes-apart where it does neither)"
        );
        Self::new(LeftReason::ExternalAxis, words)
    }

    /// The target leaves such an axis out, which stands elsewhere than at zero, or may do so where no place is known.
    pub(super) fn external_kept(axis: &str, place: Option<f64>) -> Self {
        let stands = place.map_or("may stand elsewhere than at zero".to_owned(), |value| format!("stands at {value}"));
        let words = format!(
            "it leaves out {axis}, which {stands}, and the description has no such axis: it may carry the robot or the work (give a description that has it, or --axes-apart where it does neither)"
        );
        Self::new(LeftReason::ExternalAxis, words)
    }

    /// The target is not written in numbers.
    pub(super) fn computed() -> Self {
        Self::new(LeftReason::Computed, "its target is computed, not written in numbers")
    }
}
