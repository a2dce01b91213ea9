//! Tool and work object of a move: those of the text, else those that the user states.

use super::untold::{Untold, beside};
use super::value::{Node, frame};
use super::{Datum, Task};
use crate::geom::Pose;
use crate::programs::program::{StatedFrame, Understood};
use crate::programs::reason::{LeftReason, Why};

/// The work object of moves that name none.
const WORLD: &str = "WOBJ0";

impl Datum {
    /// A part of its value, or of that of its declaration where something may change it.
    fn declared_part(&self, part: usize) -> Option<&Node> {
        match self.value.as_ref().or(self.before.as_ref())? {
            Node::List(parts) => parts.get(part),
            _ => None,
        }
    }

    /// True where such a part is this word.
    fn says(&self, part: usize, word: &str) -> bool {
        matches!(self.declared_part(part), Some(Node::Word(found)) if found == word)
    }

    /// The frame that a part of its value is.
    fn frame(&self, part: usize) -> Option<Pose> {
        self.declared_part(part).filter(|_| self.value.is_some()).and_then(frame)
    }
}

impl Task<'_> {
    pub(super) fn tool(&self, name: Option<&str>) -> Understood<Pose> {
        self.tool_of_text(name).or_else(|untold| untold.or_stated(self.setting.tool))
    }

    /// The tool of this name and a work object, where a move to joints has them.
    pub(super) fn beside_joints(&self, tool: Option<&str>, work: Result<Pose, Untold>) -> [StatedFrame; 2] {
        let base = self.setting.base;
        let tool = tool.map_or(Ok(Pose::identity()), |name| self.tool_of_text(Some(name)));
        let in_base = |work: Pose| base * work;
        let stated_work = self.setting.work.map(in_base);
        [beside(&Pose::identity(), tool, self.setting.tool), beside(&base, work.map(in_base), stated_work)]
    }

    fn tool_of_text(&self, name: Option<&str>) -> Result<Pose, Untold> {
        let why = |words: String| Why::new(LeftReason::ToolUnknown, words);
        let name = name.ok_or_else(|| Untold::Nowhere(why("its tool is not named; give --tool".into())))?;
        if name == "TOOL0" {
            return Ok(Pose::identity());
        }
        let datum = self.frame_datum(name, "TOOLDATA");
        if datum.is_some_and(|tool| tool.says(0, "FALSE")) {
            return Err(Untold::Elsewhere(why(format!("{name} is a tool fixed in the room"))));
        }
        let known = datum.filter(|tool| tool.says(0, "TRUE")).and_then(|tool| tool.frame(1));
        known.ok_or_else(|| Untold::Nowhere(why(untold(name, datum, "--tool"))))
    }

    /// Without a name it is `wobj0`.
    pub(super) fn work(&self, name: Option<&Node>) -> Result<Pose, Untold> {
        let why = |words: String| Why::new(LeftReason::FrameUnknown, words);
        let name = match name {
            None => return Ok(Pose::identity()),
            Some(Node::Word(name)) if name == WORLD => return Ok(Pose::identity()),
            Some(Node::Word(name)) => name,
            Some(Node::Perhaps) => {
                return Err(Untold::Several(why("its work object is one that may be handed on or not".into())));
            }
            Some(Node::List(_)) => return Err(Untold::Several(why("its work object is written in the move".into()))),
            Some(_) => return Err(Untold::Nowhere(why("its work object is computed (give --work)".into()))),
        };
        let datum = self.frame_datum(name, "WOBJDATA");
        if datum.is_some_and(|work| work.says(0, "TRUE") || work.says(1, "FALSE")) {
            return Err(Untold::Elsewhere(why(format!("{name} is held by the robot or moved by a unit"))));
        }
        let stands = datum.filter(|work| work.says(0, "FALSE") && work.says(1, "TRUE"));
        let frames = stands.and_then(|work| work.frame(3).zip(work.frame(4)));
        let known = frames.map(|(user, object)| user * object);
        known.ok_or_else(|| Untold::Nowhere(why(untold(name, datum, "--work"))))
    }

    fn frame_datum(&self, name: &str, kind: &str) -> Option<&Datum> {
        self.data.get(name).filter(|datum| datum.kind == kind)
    }
}

/// Why the numbers of a tool or a work object are not known.
fn untold(name: &str, datum: Option<&Datum>, flag: &str) -> String {
    match datum {
        None if name.ends_with("{}") => format!("which element of {name} it is is computed (give {flag})"),
        None => format!("{name} is in none of the files (give its module as well, or {flag})"),
        Some(Datum { changed: Some(by), .. }) => {
            format!("{name} may not be what its declaration says: {by} (give {flag})")
        }
        Some(_) => format!("{name} is not written in numbers (give {flag})"),
    }
}
