//! The way through the targets of a program: in which order they are visited, and from where the robot comes to each.

use std::collections::BTreeMap;

use super::flow::{Flow, Followed};
use super::program::{Approach, Left, Program, Target, TargetKind};

/// File of a target, and its first byte there.
type Place = (usize, usize);

/// Where a routine has left the robot: none where it has not moved it, and no place where the text does not tell.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct Stands(Option<Option<Place>>);

/// Of several ways to here the one that stands last in the text counts, as it does for the targets behind it.
impl Followed for Stands {
    fn merged(&self, other: &Self, _: &str) -> Self {
        Self(self.0.or(other.0))
    }

    fn at_top(&self) -> Self {
        Self(None)
    }

    fn behind_call(&self, end: &Self) -> Self {
        Self(end.0.or(self.0))
    }
}

/// A program that is being read.
pub(super) struct Itinerary {
    /// What was found so far.
    pub program: Program,
    /// File and first byte of a target -> its index in the program.
    visited: BTreeMap<Place, usize>,
    /// From where the robot comes to the next target.
    from: Approach,
    /// From where it came to the branches, loops and routines that are open.
    open: Vec<Approach>,
}

impl Itinerary {
    /// Nothing visited yet.
    pub fn new() -> Self {
        let program = Program { files: vec![], targets: vec![], left: vec![], edits: vec![], notices: vec![] };
        Self { program, visited: BTreeMap::new(), from: Approach::Unknown, open: Vec::new() }
    }

    /// The next target comes from nowhere in particular.
    pub fn start_afresh(&mut self) {
        self.from = Approach::Unknown;
        self.open.clear();
    }

    /// A statement with branches, or a loop.
    pub fn branches_begin(&mut self) {
        self.open.push(self.from);
    }

    /// Another branch of the innermost statement: the robot comes to it from where it came to the first.
    pub fn next_branch(&mut self) {
        self.from = self.open.last().copied().unwrap_or(self.from);
    }

    /// Behind a statement with branches: which of them was taken is not known.
    pub fn branches_end(&mut self) {
        if self.open.pop().is_some_and(|before| before != self.from) {
            self.from = self.from.beyond();
        }
    }

    /// A routine inside another one: nobody knows from where it is called.
    pub fn routine_begins(&mut self) {
        self.open.push(self.from);
        self.from = Approach::Unknown;
    }

    /// Behind such a routine.
    pub fn routine_ends(&mut self) {
        self.from = self.open.pop().unwrap_or(Approach::Unknown);
    }

    /// Where the routine that is being read has moved the robot.
    pub fn stands(&self) -> Stands {
        let place = |k: usize| self.program.targets.get(k).map(|t| (t.file, t.kind.first_byte()));
        Stands(Some(self.from.target().and_then(place)))
    }

    /// Follows a call of a routine: behind it the robot comes from where that has left it.
    pub fn call<T: Followed>(&mut self, name: String, flow: &mut Flow<(T, Stands)>, now: &mut (T, Stands)) {
        let before = std::mem::take(&mut now.1);
        flow.call(name, now);
        match now.1.0 {
            None => now.1 = before,
            Some(place) => {
                let index = place.and_then(|place| self.visited.get(&place));
                self.from = index.map_or(Approach::Unknown, |&index| Approach::Beyond(index));
            }
        }
    }

    /// True for a target that was visited.
    pub fn has(&self, file: usize, kind: &TargetKind) -> bool {
        self.visited.contains_key(&(file, kind.first_byte()))
    }

    /// A target that stays as it is; `same_posture` where the robot keeps its posture on the way there.
    pub fn leave(&mut self, left: Left, same_posture: bool) {
        self.from = if same_posture { self.from.beyond() } else { Approach::Unknown };
        self.program.left.push(left);
    }

    /// A target that no motion goes to.
    pub fn declare(&mut self, target: Target) {
        self.visited.insert((target.file, target.kind.first_byte()), self.program.targets.len());
        self.program.targets.push(target);
    }

    /// Visits a target, perhaps again. False where it was visited before with another tool or work object.
    #[must_use]
    pub fn visit(&mut self, mut target: Target) -> bool {
        let place = (target.file, target.kind.first_byte());
        let Some(&known) = self.visited.get(&place) else {
            target.approach = self.from;
            self.from = Approach::From(self.program.targets.len());
            self.declare(target);
            return true;
        };
        let same = match (&self.program.targets[known].kind, &target.kind) {
            (TargetKind::Pose(a), TargetKind::Pose(b)) => {
                (a.flange_from_tool, a.base_from_work) == (b.flange_from_tool, b.base_from_work)
            }
            _ => true,
        };
        if same {
            self.from = Approach::From(known);
        }
        same
    }

    /// The robot goes on beyond the target, in its posture.
    pub fn go_beyond(&mut self) {
        self.from = self.from.beyond();
    }

    /// The next target is approached from one of several: from none in particular.
    pub fn lose(&mut self) {
        self.from = Approach::Unknown;
    }
}
