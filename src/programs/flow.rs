//! What statements set, as a tool, followed through branches, loops and calls of routines.
//!
//! What holds at the top of a loop depends on its end, and at the top of a routine on its calls, which may stand further on. So a text is read again
//! with what the reading before found there until that repeats itself ([`settled`]).

use std::collections::BTreeMap;

pub(super) use super::held::{Either, Held};
use super::routines::Routines;
use crate::error::Result;

/// Readings after which what differs from one to the next is not known: routines that call each other may never agree.
const MOST_READINGS: usize = 24;
/// Why something is not known.
const BRANCHES: &str = "it is set in a branch or a loop";
const CALLS: &str = "it is not the same at all calls of the routine";

/// All that statements set.
pub(super) trait Followed: Clone + PartialEq {
    /// What is known where either holds; `why` says how they came together.
    fn merged(&self, other: &Self, why: &str) -> Self;
    /// The same at the top of a routine, which has set nothing yet.
    fn at_top(&self) -> Self;
    /// What a caller has behind a call of a routine that ended with `end`.
    fn behind_call(&self, end: &Self) -> Self;
}

/// Two things.
impl<A: Followed, B: Followed> Followed for (A, B) {
    fn merged(&self, other: &Self, why: &str) -> Self {
        (self.0.merged(&other.0, why), self.1.merged(&other.1, why))
    }

    fn at_top(&self) -> Self {
        (self.0.at_top(), self.1.at_top())
    }

    fn behind_call(&self, end: &Self) -> Self {
        (self.0.behind_call(&end.0), self.1.behind_call(&end.1))
    }
}

/// Kinds of statements with branches.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Branching {
    /// Its first branch begins with it.
    If,
    /// Nothing stands before its first branch.
    Cases,
    /// A loop that may not run at all.
    Loop,
    /// A loop that runs at least once.
    LoopTaken,
    /// A loop that ends only where it is left from within.
    LoopForever,
}

/// What a reading found at places that others depend on.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Places<T> {
    /// At the ends of loops, in the order of their beginnings; `None` for one that is still open.
    loops: Vec<Option<T>>,
    /// At the calls of each routine.
    calls: BTreeMap<String, T>,
    /// At the end of each routine.
    ends: BTreeMap<String, T>,
    /// At the jumps of each routine to labels.
    jumps: BTreeMap<String, T>,
}

impl<T> Default for Places<T> {
    fn default() -> Self {
        Self { loops: Vec::new(), calls: BTreeMap::new(), ends: BTreeMap::new(), jumps: BTreeMap::new() }
    }
}

impl<T: Followed> Places<T> {
    fn merged(mut self, other: &Self) -> Self {
        let merge = |own: &mut T, other: &T| *own = own.merged(other, CALLS);
        let loops = self.loops.iter_mut().zip(&other.loops);
        loops.for_each(|(own, other)| own.iter_mut().zip(other).for_each(|(own, other)| merge(own, other)));
        let ends = (&mut self.ends, &other.ends);
        for (own, other) in [(&mut self.calls, &other.calls), ends, (&mut self.jumps, &other.jumps)] {
            own.iter_mut().for_each(|(name, own)| other.get(name).iter().for_each(|other| merge(own, other)));
        }
        self
    }
}

/// What a text says once its readings agree: `read` makes one, given what the one before found.
///
/// # Errors
/// Those of a reading.
pub(super) fn settled<T: Followed, R>(read: impl Fn(Places<T>) -> Result<(R, Places<T>)>) -> Result<R> {
    let (mut known, mut readings) = (Places::default(), 0);
    loop {
        let (said, found) = read(known.clone())?;
        let next = if readings < MOST_READINGS { found } else { found.merged(&known) };
        if next == known {
            return Ok(said);
        }
        known = next;
        readings += 1;
    }
}

/// A reading under way.
pub(super) struct Flow<T> {
    known: Places<T>,
    found: Places<T>,
    open: Vec<Open<T>>,
    routines: Vec<Routine<T>>,
    /// False behind a statement that goes elsewhere.
    is_reached: bool,
    /// Routines of all files.
    named: Routines,
    /// The file that is being read.
    file: usize,
}

/// A statement with branches, or a loop.
struct Open<T> {
    before: T,
    /// What holds at the end of the branches so far.
    ends: Vec<T>,
    kind: Branching,
    /// True where the statement is reached.
    is_reached: bool,
    /// What holds where a loop is left from within.
    leaves: Vec<T>,
    /// What holds where a loop is begun again from within.
    agains: Vec<T>,
    /// False while none of the branches need be taken.
    one_is_taken: bool,
    /// False before the first branch.
    is_in_branch: bool,
    /// Its number among loops.
    number: Option<usize>,
}

struct Routine<T> {
    name: String,
    /// What holds around it.
    around: T,
    /// What holds where it returns.
    end: Option<T>,
    /// Statements open around it.
    open: usize,
    /// True where the text around it is reached.
    is_reached: bool,
}

/// What is known where any of these holds.
fn merged<T: Followed>(all: &[T]) -> Option<T> {
    let (first, others) = all.split_first()?;
    Some(others.iter().fold(first.clone(), |one, other| one.merged(other, BRANCHES)))
}

/// Name of a part of a routine; no routine has a blank in its name.
fn part_name(routine: &str, part: &str) -> String {
    format!("{routine} {part}")
}

impl<T: Followed> Flow<T> {
    /// With what the reading before found.
    pub fn new(known: Places<T>) -> Self {
        Self {
            known,
            found: Places::default(),
            open: Vec::new(),
            routines: Vec::new(),
            is_reached: true,
            named: Routines::default(),
            file: 0,
        }
    }

    /// The same where the files have these routines.
    pub fn among(self, named: &Routines) -> Self {
        Self { named: named.clone(), ..self }
    }

    /// A file begins, whose own routines its calls mean.
    pub fn file_begins(&mut self, file: usize) {
        self.file = file;
    }

    /// True for a name that means a routine of the files here.
    pub fn has_routine(&self, name: &str) -> bool {
        self.named.is_seen(name, self.file)
    }

    /// True where a routine of the files calls one of this name.
    pub fn is_called(&self, name: &str) -> bool {
        self.meant(name).iter().any(|meant| self.known.calls.contains_key(meant))
    }

    /// Names of their own of the routines that a call may mean here; in every file they stand for the same.
    pub fn meant(&self, name: &str) -> Vec<String> {
        self.named.meant(name, self.file)
    }

    /// What this reading found.
    pub fn found(self) -> Places<T> {
        self.found
    }

    /// A statement with branches, or a loop, begins.
    pub fn begin(&mut self, now: &mut T, kind: Branching) {
        let before = now.clone();
        let is_loop = matches!(kind, Branching::Loop | Branching::LoopTaken | Branching::LoopForever);
        let number = is_loop.then_some(self.found.loops.len());
        if let Some(number) = number {
            self.found.loops.push(None);
            if let Some(Some(end)) = self.known.loops.get(number) {
                *now = now.merged(end, BRANCHES);
            }
        }
        self.open.push(Open {
            before,
            ends: Vec::new(),
            kind,
            is_reached: self.is_reached,
            leaves: Vec::new(),
            agains: Vec::new(),
            one_is_taken: matches!(kind, Branching::LoopTaken | Branching::LoopForever),
            is_in_branch: kind != Branching::Cases,
            number,
        });
    }

    /// Another branch begins, with what held before the statement; the last one is taken where no other is.
    pub fn next(&mut self, now: &mut T, is_last: bool) {
        if let Some(open) = self.open.last_mut() {
            let end = std::mem::replace(now, open.before.clone());
            let was_in_branch = std::mem::replace(&mut open.is_in_branch, true);
            open.ends.extend((was_in_branch && self.is_reached).then_some(end));
            open.one_is_taken |= is_last;
            self.is_reached = open.is_reached;
        }
    }

    /// The statement ends.
    pub fn end(&mut self, now: &mut T) {
        let Some(open) = self.open.pop() else { return };
        let agains: Vec<T> = self.is_reached.then(|| now.clone()).into_iter().chain(open.agains).collect();
        if let Some(number) = open.number {
            self.found.loops[number] = merged(&agains);
        }
        let not_taken = (!open.one_is_taken && open.is_reached).then_some(open.before);
        let only_left = open.kind == Branching::LoopForever && !open.leaves.is_empty();
        let ends = agains.into_iter().filter(|_| !only_left);
        let all: Vec<T> = ends.chain(open.leaves).chain(open.ends).chain(not_taken).collect();
        let behind = merged(&all);
        self.is_reached = behind.is_some();
        *now = behind.unwrap_or_else(|| now.clone());
    }

    /// The innermost loop is left from where `now` holds.
    pub fn leaves(&mut self, now: &T) {
        if let Some(open) = self.innermost_loop() {
            open.leaves.push(now.clone());
            self.is_reached = false;
        }
    }

    /// The innermost loop begins again from where `now` holds.
    pub fn begins_again(&mut self, now: &T) {
        if let Some(open) = self.innermost_loop() {
            open.agains.push(now.clone());
            self.is_reached = false;
        }
    }

    fn innermost_loop(&mut self) -> Option<&mut Open<T>> {
        let around = self.routines.last().map_or(0, |routine| routine.open);
        self.open.iter_mut().skip(around).rev().find(|open| open.number.is_some())
    }

    /// A jump may lead here.
    pub fn arrives(&mut self) {
        self.is_reached = true;
    }

    /// A jump to a label of the innermost routine, from where `now` holds.
    pub fn jumps(&mut self, now: &T) {
        if let Some(routine) = self.routines.last() {
            let jumps = self.found.jumps.entry(routine.name.clone());
            jumps.and_modify(|all| *all = all.merged(now, BRANCHES)).or_insert_with(|| now.clone());
        }
        self.goes_elsewhere();
    }

    /// What holds at a label, to which any of these jumps may lead.
    pub fn at_label(&self, now: &T) -> T {
        let jumps = self.routines.last().and_then(|routine| self.known.jumps.get(&routine.name));
        jumps.map_or_else(|| now.clone(), |jumps| now.merged(jumps, BRANCHES))
    }

    /// A routine begins, inside another one where that is still open; `uncalled` holds at its top where nothing calls it.
    pub fn routine_begins(&mut self, name: String, now: &mut T, uncalled: &T) {
        let name = self.meant(&name).pop().unwrap_or(name);
        let top = self.known.calls.get(&name).unwrap_or(uncalled).at_top();
        let around = std::mem::replace(now, top);
        let is_reached = std::mem::replace(&mut self.is_reached, true);
        self.routines.push(Routine { name, around, end: None, open: self.open.len(), is_reached });
    }

    /// The innermost routine returns from where `now` holds; what follows is not reached.
    pub fn returns(&mut self, now: &T) {
        self.ends_with(now);
        self.goes_elsewhere();
    }

    /// What follows is reached by a jump alone.
    pub fn goes_elsewhere(&mut self) {
        self.is_reached = false;
    }

    /// A part of the innermost routine ends, as its handler, behind which the robot goes on elsewhere in the routine.
    pub fn part_ends(&mut self, part: &str, now: &T) {
        if let Some(routine) = self.routines.last().filter(|_| self.is_reached) {
            let name = part_name(&routine.name, part);
            self.passes(&name, now);
        }
        self.goes_elsewhere();
    }

    /// What goes on under this name has passed through what holds here.
    pub fn passes(&mut self, name: &str, now: &T) {
        let ends = self.found.ends.entry(name.to_owned());
        ends.and_modify(|all| *all = all.merged(now, BRANCHES)).or_insert_with(|| now.clone());
    }

    /// What has passed under this name.
    pub fn passed(&self, name: &str) -> Option<&T> {
        self.known.ends.get(name)
    }

    /// False behind a statement that goes elsewhere.
    pub fn is_reached(&self) -> bool {
        self.is_reached
    }

    /// What holds where a part of the innermost routine has run from here.
    pub fn behind_part(&self, part: &str, now: &T) -> Option<T> {
        let name = part_name(&self.routines.last()?.name, part);
        Some(now.behind_call(self.known.ends.get(&name)?))
    }

    fn ends_with(&mut self, now: &T) {
        if let Some(routine) = self.routines.last_mut().filter(|_| self.is_reached) {
            routine.end = Some(routine.end.as_ref().map_or_else(|| now.clone(), |end| end.merged(now, BRANCHES)));
        }
    }

    /// The innermost routine ends.
    pub fn routine_ends(&mut self, now: &mut T) {
        self.ends_with(now);
        let Some(Routine { name, around, end, open, is_reached }) = self.routines.pop() else { return };
        self.is_reached = is_reached;
        self.open.truncate(open);
        *now = around;
        if let Some(end) = end {
            let ends = self.found.ends.entry(name);
            ends.and_modify(|all| *all = all.merged(&end, CALLS)).or_insert(end);
        }
    }

    /// All routines that are still open end.
    pub fn all_end(&mut self, now: &mut T) {
        while !self.routines.is_empty() {
            self.routine_ends(now);
        }
        self.open.clear();
        self.is_reached = true;
    }

    /// A routine is called.
    pub fn call(&mut self, name: String, now: &mut T) {
        let behind = self.behind(&name, now);
        let before = std::mem::replace(now, behind.unwrap_or_else(|| now.clone()));
        self.begins_beside(&name, &before);
    }

    /// A routine is begun beside the text, with `top` at its top.
    pub fn begins_beside(&mut self, name: &str, top: &T) {
        for name in self.meant(name) {
            let calls = self.found.calls.entry(name);
            calls.and_modify(|all| *all = all.merged(top, CALLS)).or_insert_with(|| top.clone());
        }
    }

    /// What a caller of a routine would have behind it; `None` where its end is not known.
    pub fn behind(&self, name: &str, now: &T) -> Option<T> {
        let meant = self.meant(name);
        let ends = meant.iter().filter_map(|name| self.known.ends.get(name));
        merged(&ends.map(|end| now.behind_call(end)).collect::<Vec<_>>())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    type Tool = Held<Option<u8>>;

    /// One thing alone, `None` where it is not known.
    impl<V: Clone + PartialEq> Followed for Held<Option<V>> {
        fn merged(&self, other: &Self, _: &str) -> Self {
            Held::merged(self, other, |_, _| None)
        }

        fn at_top(&self) -> Self {
            Held::at_top(self)
        }

        fn behind_call(&self, end: &Self) -> Self {
            Held::behind_call(self, end)
        }
    }

    /// Behind a statement whose branches leave these tools, begun with tool 0.
    fn behind(branches: &[u8], has_else: bool) -> Option<u8> {
        let both = [Branching::If, Branching::Cases].map(|kind| behind_a(kind, branches, has_else));
        assert_eq!(both[0], both[1]);
        both[0]
    }

    fn behind_a(kind: Branching, branches: &[u8], has_else: bool) -> Option<u8> {
        let (mut flow, mut now) = (Flow::new(Places::default()), Tool::new(Some(0)));
        flow.begin(&mut now, kind);
        for (k, tool) in branches.iter().enumerate() {
            if k > 0 || kind == Branching::Cases {
                flow.next(&mut now, has_else && k + 1 == branches.len());
            }
            assert_eq!(now.value, Some(0));
            now.set(Some(*tool));
        }
        flow.end(&mut now);
        now.value
    }

    #[test]
    fn what_all_branches_leave_alike_holds_behind_them() {
        assert_eq!(behind(&[1], false), None);
        assert_eq!(behind(&[0], false), Some(0));
        assert_eq!(behind(&[1, 1], true), Some(1));
        assert_eq!(behind(&[1, 1], false), None);
        assert_eq!(behind(&[1, 2], true), None);
    }

    /// Tools at the top of a loop, and behind it, that begins with tool 0 and sets this one at its end.
    fn at_loop(kind: Branching, tool: u8) -> [Option<u8>; 2] {
        settled(|known| {
            let (mut flow, mut now) = (Flow::new(known), Tool::new(Some(0)));
            flow.begin(&mut now, kind);
            let top = now.value;
            now.set(Some(tool));
            flow.end(&mut now);
            Ok(([top, now.value], flow.found()))
        })
        .unwrap()
    }

    #[test]
    fn what_a_loop_sets_at_its_end_holds_at_its_top_from_the_second_time_on() {
        assert_eq!(at_loop(Branching::LoopTaken, 1), [None, Some(1)]);
        assert_eq!(at_loop(Branching::Loop, 1), [None, None]);
        assert_eq!(at_loop(Branching::Loop, 0), [Some(0), Some(0)]);
    }

    /// Tools at the top of a loop and behind it that sets tool 3, goes elsewhere in a branch, and sets tool 1 at its end.
    fn at_loop_with(kind: Branching, goes: fn(&mut Flow<Tool>, &Tool)) -> [Option<u8>; 2] {
        settled(|known| {
            let (mut flow, mut now) = (Flow::new(known), Tool::new(Some(0)));
            flow.begin(&mut now, kind);
            let top = now.value;
            now.set(Some(3));
            flow.begin(&mut now, Branching::If);
            goes(&mut flow, &now);
            flow.end(&mut now);
            assert_eq!(now.value, Some(3));
            now.set(Some(1));
            flow.end(&mut now);
            Ok(([top, now.value], flow.found()))
        })
        .unwrap()
    }

    #[test]
    fn what_holds_where_a_loop_is_left_from_within_holds_behind_it() {
        let leaves: fn(&mut Flow<Tool>, &Tool) = |flow, now| flow.leaves(now);
        assert_eq!(at_loop_with(Branching::LoopForever, leaves), [None, Some(3)]);
        assert_eq!(at_loop_with(Branching::LoopTaken, leaves), [None, None]);
        assert_eq!(at_loop_with(Branching::Loop, leaves), [None, None]);
    }

    #[test]
    fn what_holds_where_a_loop_begins_again_from_within_holds_at_its_top() {
        let again: fn(&mut Flow<Tool>, &Tool) = |flow, now| flow.begins_again(now);
        for kind in [Branching::Loop, Branching::LoopTaken, Branching::LoopForever] {
            assert_eq!(at_loop_with(kind, again), [None, None]);
        }
        let behind = settled(|known| {
            let (mut flow, mut now) = (Flow::new(known), Tool::new(Some(0)));
            flow.begin(&mut now, Branching::Loop);
            let top = now.value;
            flow.begins_again(&now);
            now.set(Some(1));
            flow.end(&mut now);
            Ok(([top, now.value], flow.found()))
        });
        assert_eq!(behind.unwrap(), [Some(0), Some(0)]);
    }

    #[test]
    fn text_behind_a_statement_that_goes_elsewhere_is_reached_by_a_jump_alone() {
        for (jumps, wanted) in [(false, Some(3)), (true, None)] {
            let (mut flow, mut now) = (Flow::new(Places::default()), Tool::new(Some(3)));
            flow.begin(&mut now, Branching::LoopTaken);
            flow.leaves(&now);
            if jumps {
                flow.arrives();
            }
            now.set(Some(1));
            flow.end(&mut now);
            assert_eq!(now.value, wanted);
        }
    }

    /// Tools at the top of a routine that may set one, and behind its two calls, with tools 1 and 2.
    fn at_calls(callers: [u8; 2], sets: Option<u8>) -> [Option<u8>; 3] {
        settled(|known| {
            let (mut flow, mut now) = (Flow::new(known), Tool::new(None));
            let behind = callers.map(|tool| {
                now.set(Some(tool));
                flow.call("routine".to_owned(), &mut now);
                now.value
            });
            flow.routine_begins("routine".to_owned(), &mut now, &Tool::new(Some(9)));
            let top = now.value;
            sets.iter().for_each(|tool| now.set(Some(*tool)));
            flow.routine_ends(&mut now);
            assert_eq!(now.value, behind[1]);
            Ok(([top, behind[0], behind[1]], flow.found()))
        })
        .unwrap()
    }

    #[test]
    fn a_routine_begins_with_what_its_calls_have_in_common_and_leaves_what_it_sets() {
        assert_eq!(at_calls([1, 1], None), [Some(1), Some(1), Some(1)]);
        assert_eq!(at_calls([1, 2], None), [None, Some(1), Some(2)]);
        assert_eq!(at_calls([1, 2], Some(3)), [None, Some(3), Some(3)]);
    }

    #[test]
    fn a_routine_that_nothing_calls_begins_with_what_is_said_of_it() {
        let (mut flow, mut now) = (Flow::new(Places::default()), Tool::new(Some(0)));
        flow.routine_begins("alone".to_owned(), &mut now, &Tool::new(Some(9)));
        assert_eq!(now.value, Some(9));
    }

    /// A routine that calls itself with another tool each time: no reading repeats the one before. What it sets where its tool is not known may be known.
    #[test]
    fn a_routine_that_calls_itself_with_other_tools_ends_as_not_known() {
        for otherwise in [None, Some(0)] {
            let top = settled(|known| {
                let (mut flow, mut now) = (Flow::new(known), Tool::new(Some(0)));
                flow.routine_begins("a".to_owned(), &mut now, &Tool::new(Some(1)));
                let top = now.value;
                now.set(top.map(|tool| (tool + 1) % 2).or(otherwise));
                flow.call("a".to_owned(), &mut now);
                flow.routine_ends(&mut now);
                Ok((top, flow.found()))
            });
            assert_eq!(top.unwrap(), None);
        }
    }
}
