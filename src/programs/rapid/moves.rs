//! Instructions of the controller that move the robot to a position among their arguments (ABB, *Technical reference manual RAPID Instructions,
//! Functions and Data types*; *Application manual*s of arc and spot welding).

/// Where the targets stand among the arguments between commas.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Targets {
    /// Arguments before them.
    pub skipped: usize,
    /// How many there are.
    pub count: usize,
}

/// What the switches of a move say.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct MoveSwitches {
    /// True where something else corrects the path.
    pub is_led: bool,
    /// True where no offset of external axes counts.
    pub has_no_offset: bool,
}

/// The first argument.
const ONE: Targets = Targets { skipped: 0, count: 1 };
/// Targets of a move on a circle.
pub(super) const TWO_POINTS: usize = 2;
/// The point on a circle, and its end.
const TWO: Targets = Targets { skipped: 0, count: TWO_POINTS };
/// Behind a signal and the point that is found.
const BEHIND_FOUND: usize = 2;

/// Instructions that move external axes alone.
const OF_EXTERNAL_AXES: [(&str, Targets); 2] =
    [("MOVEEXTJ", ONE), ("SEARCHEXTJ", Targets { skipped: BEHIND_FOUND, ..ONE })];

const MOVES: [(&str, Targets); 50] = [
    ("MOVEABSJ", ONE),
    ("MOVEJ", ONE),
    ("MOVEL", ONE),
    ("MOVEC", TWO),
    ("MOVEJDO", ONE),
    ("MOVELDO", ONE),
    ("MOVECDO", TWO),
    ("MOVEJAO", ONE),
    ("MOVELAO", ONE),
    ("MOVECAO", TWO),
    ("MOVEJGO", ONE),
    ("MOVELGO", ONE),
    ("MOVECGO", TWO),
    ("MOVEJSYNC", ONE),
    ("MOVELSYNC", ONE),
    ("MOVECSYNC", TWO),
    ("TRIGGABSJ", ONE),
    ("TRIGGJ", ONE),
    ("TRIGGL", ONE),
    ("TRIGGC", TWO),
    ("TRIGGJIOS", ONE),
    ("TRIGGLIOS", ONE),
    ("SEARCHL", Targets { skipped: BEHIND_FOUND, ..ONE }),
    ("SEARCHC", Targets { skipped: BEHIND_FOUND, ..TWO }),
    ("ARCL", ONE),
    ("ARCL1", ONE),
    ("ARCL2", ONE),
    ("ARCLSTART", ONE),
    ("ARCL1START", ONE),
    ("ARCL2START", ONE),
    ("ARCLEND", ONE),
    ("ARCL1END", ONE),
    ("ARCL2END", ONE),
    ("ARCC", TWO),
    ("ARCC1", TWO),
    ("ARCC2", TWO),
    ("ARCCSTART", TWO),
    ("ARCC1START", TWO),
    ("ARCC2START", TWO),
    ("ARCCEND", TWO),
    ("ARCC1END", TWO),
    ("ARCC2END", TWO),
    ("ARCMOVEABSJ", ONE),
    ("ARCMOVEJ", ONE),
    ("ARCMOVEL", ONE),
    ("ARCMOVEC", TWO),
    ("SPOTL", ONE),
    ("SPOTJ", ONE),
    ("SPOTML", ONE),
    ("SPOTMJ", ONE),
];

/// Where the targets of an instruction of this name (in capital letters) stand; `None` for one that is no known move.
pub(super) fn targets_of(name: &str) -> Option<Targets> {
    MOVES.iter().find(|(known, _)| *known == name).map(|(_, targets)| *targets)
}

/// Where the target of an instruction that moves external axes alone stands.
pub(super) fn external_target_of(name: &str) -> Option<Targets> {
    OF_EXTERNAL_AXES.iter().find(|(known, _)| *known == name).map(|(_, targets)| *targets)
}

/// True for a move to axis angles.
pub(super) fn is_to_joints(name: &str) -> bool {
    name.ends_with("ABSJ")
}

/// True for a move on which the axes, not the tool, go straight.
pub(super) fn is_of_joints(name: &str) -> bool {
    name.ends_with('J') || ["MOVEJ", "TRIGGJ"].iter().any(|kind| name.starts_with(kind))
}

/// True for an instruction that writes the point which it finds, where it stops: its second argument.
pub(super) fn writes_found(name: &str) -> bool {
    ["SEARCHL", "SEARCHC", "SEARCHEXTJ"].contains(&name)
}
