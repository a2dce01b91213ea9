//! The way through the targets of a program: in which order they are visited, and from where the robot comes to each.

use std::collections::{BTreeMap, BTreeSet};

use super::flow::{Flow, Followed};
use super::program::{Approach, Arrival, Left, MeantPosture, Program, Target, TargetKind};

/// A target: its file, its first byte there, and which of the uses with different tools or work objects it is.
type Place = (usize, usize, usize);

/// From where a stand is told.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Origin {
    /// A target.
    Target(Place),
    /// Where the robot stood when the program began.
    Begin,
    /// Where the robot stood when the routine was called.
    Call,
    /// The text does not tell.
    Unknown,
}

/// Whether the robot has gone on from there.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Gone {
    /// It stands there.
    Not,
    /// A routine that is in none of the files may have moved it.
    Perhaps,
    /// It stands elsewhere, in the posture of there.
    Beyond,
}

/// Where the robot may stand.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Stand {
    from: Origin,
    gone: Gone,
}

impl Stand {
    fn at(from: Origin) -> Self {
        Self { from, gone: Gone::Not }
    }

    fn gone(self, gone: Gone) -> Self {
        Self { gone: self.gone.max(gone), ..self }
    }
}

/// Where the robot may stand: once for every way to here.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Stands(BTreeSet<Stand>);

impl Stands {
    fn at(from: Origin) -> Self {
        Self(BTreeSet::from([Stand::at(from)]))
    }

    /// Where the program begins.
    pub fn begin() -> Self {
        Self::at(Origin::Begin)
    }

    /// The text does not tell from where it has come.
    pub fn unknown() -> Self {
        Self::at(Origin::Unknown)
    }

    fn gone(&self, gone: Gone) -> Self {
        Self(self.0.iter().map(|stand| stand.gone(gone)).collect())
    }

    /// How far a routine that ended here has moved the robot from where it was called; `None` where that is elsewhere.
    fn gone_from_call(&self) -> Option<Gone> {
        let all = self.0.iter().map(|stand| (stand.from == Origin::Call).then_some(stand.gone));
        all.collect::<Option<Vec<Gone>>>()?.into_iter().max()
    }
}

/// Where a routine has not moved the robot yet.
impl Default for Stands {
    fn default() -> Self {
        Self::at(Origin::Call)
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
        let least = if end.gone_from_call().is_some() { Gone::Not } else { Gone::Beyond };
        let behind = |stand: &Stand| match stand.from {
            Origin::Call => self.gone(stand.gone.max(least)).0,
            Origin::Target(_) | Origin::Begin | Origin::Unknown => BTreeSet::from([stand.gone(Gone::Beyond)]),
        };
        Self(end.0.iter().flat_map(behind).collect())
    }
}

/// A program that is being read.
pub(super) struct Itinerary {
    /// What was found so far.
    pub program: Program,
    /// File and first byte of a target -> its indices in the program, one for each tool and work object that it is used with.
    visited: BTreeMap<(usize, usize), Vec<usize>>,
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
        let program =
            Program { files: vec![], targets: vec![], left: vec![], edits: vec![], notices: vec![], put: vec![] };
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
        self.from = match now.1.gone_from_call() {
            Some(Gone::Not | Gone::Perhaps) => self.from,
            Some(Gone::Beyond) => self.from.beyond(),
            None => Approach::Unknown,
        };
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
        let uses = self.visited.entry((target.file, target.kind.first_byte())).or_default();
        uses.push(self.program.targets.len());
        self.program.targets.push(target);
    }

    /// Visits a target, perhaps again; with another tool or work object it is another one that has the same text.
    pub fn visit(&mut self, mut target: Target, now: &mut Stands) {
        let (file, first) = (target.file, target.kind.first_byte());
        let uses = self.visited.get(&(file, first)).map(Vec::as_slice).unwrap_or_default();
        let known = uses.iter().position(|&k| self.program.targets[k].kind.has_frames_of(&target.kind));
        let place = (file, first, known.unwrap_or(uses.len()));
        let index = known.map_or(self.program.targets.len(), |known| uses[known]);
        self.arrive(index, &target.kind, now);
        if known.is_some() {
            self.keep_codes(index, &target.kind);
            self.keep_frames(index, &target.kind);
        } else {
            target.approach = self.from;
            self.declare(target);
        }
        self.from = Approach::From(index);
        *now = Stands::at(Origin::Target(place));
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

    fn keep_frames(&mut self, index: usize, again: &TargetKind) {
        if let (TargetKind::Joints(first), TargetKind::Joints(again)) = (&mut self.program.targets[index].kind, again) {
            first.again(&again.frames);
        }
    }

    fn arrive(&mut self, index: usize, kind: &TargetKind, now: &Stands) {
        let posture = kind.posture();
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
        *now = now.gone(Gone::Beyond);
    }

    /// A routine that is in none of the files may move the robot: what the next target leaves out is not known, the posture goes on.
    pub fn may_go(&self, now: &mut Stands) {
        *now = now.gone(Gone::Perhaps);
    }

    /// The next target is approached from one of several: from none in particular.
    pub fn lose(&mut self, now: &mut Stands) {
        self.from = Approach::Unknown;
        *now = Stands::unknown();
    }

    /// The program with all ways to its targets.
    pub fn finished(mut self) -> Program {
        let index = |(file, first, which): Place| self.visited.get(&(file, first))?.get(which).copied();
        let approach = |stand: Stand, leaves_out: bool| {
            let from = match stand.from {
                Origin::Target(place) => index(place).map_or(Approach::Unknown, Approach::From),
                Origin::Begin => Approach::Begin,
                Origin::Call => Approach::Call,
                Origin::Unknown => Approach::Unknown,
            };
            match stand.gone {
                Gone::Beyond => from.beyond(),
                Gone::Perhaps if leaves_out => from.beyond(),
                Gone::Perhaps | Gone::Not => from,
            }
        };
        for (target, ways) in std::mem::take(&mut self.arrivals) {
            let target = &mut self.program.targets[target];
            let leaves_out = target.kind.leaves_out();
            let arrival = |(stand, posture)| Arrival { from: approach(stand, leaves_out), posture };
            target.arrivals = ways.into_iter().map(arrival).collect();
        }
        self.program
    }
}
