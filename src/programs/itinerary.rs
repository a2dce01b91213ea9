//! The way through the targets of a program: in which order they are visited, and from where the robot comes to each.

use std::collections::{BTreeMap, BTreeSet};

use super::flow::{Flow, Followed};
use super::program::{Approach, Arrival, Left, MeantPosture, Program, Target, TargetKind};

/// File of a target, and its first byte there.
type Place = (usize, usize);

/// Where the robot may stand.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Stand {
    /// At a target.
    At(Place),
    /// Further than a target, in its posture.
    Beyond(Place),
    /// Where it stood when the routine was called.
    AsCalled,
    /// The text does not tell.
    Unknown,
}

impl Stand {
    fn beyond(self) -> Self {
        match self {
            Self::At(place) => Self::Beyond(place),
            other => other,
        }
    }
}

/// Where the robot may stand: once for every way to here.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Stands(BTreeSet<Stand>);

impl Stands {
    fn at(stand: Stand) -> Self {
        Self(BTreeSet::from([stand]))
    }

    fn beyond(&self) -> Self {
        Self(self.0.iter().map(|stand| stand.beyond()).collect())
    }
}

/// Where a routine has not moved the robot yet.
impl Default for Stands {
    fn default() -> Self {
        Self::at(Stand::AsCalled)
    }
}

impl Followed for Stands {
    fn merged(&self, other: &Self, _: &str) -> Self {
        Self(self.0.union(&other.0).copied().collect())
    }

    fn at_top(&self) -> Self {
        Self::default()
    }

    fn behind_call(&self, end: &Self) -> Self {
        if *end == Self::default() {
            return self.clone();
        }
        let moved = end.0.iter().filter(|stand| **stand != Stand::AsCalled).map(|stand| stand.beyond());
        let kept = end.0.contains(&Stand::AsCalled).then(|| self.beyond().0).into_iter().flatten();
        Self(moved.chain(kept).collect())
    }
}

/// A program that is being read.
pub(super) struct Itinerary {
    /// What was found so far.
    pub program: Program,
    /// File and first byte of a target -> its index in the program.
    visited: BTreeMap<Place, usize>,
    /// Ways to each target, with the posture that the motion means.
    arrivals: BTreeMap<usize, Vec<(Stand, MeantPosture)>>,
    /// From where the robot comes to the next target.
    from: Approach,
    /// From where it came to the branches, loops and routines that are open.
    open: Vec<Approach>,
}

impl Itinerary {
    /// Nothing visited yet.
    pub fn new() -> Self {
        let program = Program { files: vec![], targets: vec![], left: vec![], edits: vec![], notices: vec![] };
        Self { program, visited: BTreeMap::new(), arrivals: BTreeMap::new(), from: Approach::Unknown, open: Vec::new() }
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

    /// Follows a call of a routine: behind it the robot comes from where that has left it.
    pub fn call<T: Followed>(&mut self, name: String, flow: &mut Flow<(T, Stands)>, now: &mut (T, Stands)) {
        let before = std::mem::take(&mut now.1);
        flow.call(name, now);
        if now.1 != Stands::default() {
            self.from = Approach::Unknown;
        }
        now.1 = before.behind_call(&now.1);
    }

    /// True for a target that was visited.
    pub fn has(&self, file: usize, kind: &TargetKind) -> bool {
        self.visited.contains_key(&(file, kind.first_byte()))
    }

    /// A target that stays as it is; `same_posture` where the robot keeps its posture on the way there.
    pub fn leave(&mut self, left: Left, same_posture: bool, now: &mut Stands) {
        match same_posture {
            true => self.go_beyond(now),
            false => self.lose(now),
        }
        self.program.left.push(left);
    }

    /// A target that no motion goes to.
    pub fn declare(&mut self, target: Target) {
        self.visited.insert((target.file, target.kind.first_byte()), self.program.targets.len());
        self.program.targets.push(target);
    }

    /// Visits a target, perhaps again. False where it was visited before with another tool or work object.
    #[must_use]
    pub fn visit(&mut self, mut target: Target, now: &mut Stands) -> bool {
        let place = (target.file, target.kind.first_byte());
        let index = match self.visited.get(&place) {
            Some(&known) if !has_frames_of(&self.program.targets[known].kind, &target.kind) => return false,
            Some(&known) => {
                self.keep_codes(known, &target.kind);
                known
            }
            None => self.program.targets.len(),
        };
        self.arrive(index, &target.kind, now);
        if index == self.program.targets.len() {
            target.approach = self.from;
            self.declare(target);
        }
        self.from = Approach::From(index);
        *now = Stands::at(Stand::At(place));
        true
    }

    /// Codes stand in the text and are corrected, whether the motion that comes first heeds them or not.
    fn keep_codes(&mut self, index: usize, again: &TargetKind) {
        if let (TargetKind::Pose(first), TargetKind::Pose(again)) = (&mut self.program.targets[index].kind, again)
            && first.posture.codes().is_none()
            && again.posture.codes().is_some()
        {
            first.posture = again.posture.clone();
        }
    }

    fn arrive(&mut self, index: usize, kind: &TargetKind, now: &Stands) {
        let posture = match kind {
            TargetKind::Pose(pose) => pose.posture.clone(),
            TargetKind::Joints(_) => MeantPosture::Nearest,
        };
        let known = self.arrivals.entry(index).or_default();
        for stand in &now.0 {
            let arrival = (*stand, posture.clone());
            if !known.contains(&arrival) {
                known.push(arrival);
            }
        }
    }

    /// The robot goes on beyond the target, in its posture.
    pub fn go_beyond(&mut self, now: &mut Stands) {
        self.from = self.from.beyond();
        *now = now.beyond();
    }

    /// The next target is approached from one of several: from none in particular.
    pub fn lose(&mut self, now: &mut Stands) {
        self.from = Approach::Unknown;
        *now = Stands::at(Stand::Unknown);
    }

    /// The program with all ways to its targets.
    pub fn finished(mut self) -> Program {
        let index = |place| self.visited.get(&place).copied();
        let approach = |stand| match stand {
            Stand::At(place) => index(place).map_or(Approach::Unknown, Approach::From),
            Stand::Beyond(place) => index(place).map_or(Approach::Unknown, Approach::Beyond),
            Stand::AsCalled | Stand::Unknown => Approach::Unknown,
        };
        for (target, ways) in std::mem::take(&mut self.arrivals) {
            let arrival = |(stand, posture)| Arrival { from: approach(stand), posture };
            self.program.targets[target].arrivals = ways.into_iter().map(arrival).collect();
        }
        self.program
    }
}

/// True where two poses have the same tool and work object.
fn has_frames_of(one: &TargetKind, other: &TargetKind) -> bool {
    match (one, other) {
        (TargetKind::Pose(a), TargetKind::Pose(b)) => {
            (a.flange_from_tool, a.base_from_work) == (b.flange_from_tool, b.base_from_work)
        }
        _ => true,
    }
}
