//! The way through the targets of a program: in which order they are visited, and which one comes from the one before it.

use std::collections::BTreeMap;

use super::program::{Kind, Left, Program, Target};

/// A program that is being read.
pub(super) struct Itinerary {
    /// What was found so far.
    pub program: Program,
    /// File and first byte of a target -> its index in the program.
    visited: BTreeMap<(usize, usize), usize>,
    /// True where it is not known from where the robot comes.
    fresh: bool,
}

impl Itinerary {
    /// Nothing visited yet.
    pub fn new() -> Self {
        let program = Program { files: vec![], targets: vec![], left: vec![], edits: vec![], notices: vec![] };
        Self { program, visited: BTreeMap::new(), fresh: true }
    }

    /// The next target comes from nowhere in particular.
    pub fn start_afresh(&mut self) {
        self.fresh = true;
    }

    /// True where the next target comes from the last one.
    pub fn follows(&self) -> bool {
        !self.fresh
    }

    /// True for a target that was visited.
    pub fn has(&self, file: usize, kind: &Kind) -> bool {
        self.visited.contains_key(&(file, kind.first_byte()))
    }

    /// A target that stays as it is.
    pub fn leave(&mut self, left: Left) {
        self.fresh = true;
        self.program.left.push(left);
    }

    /// Visits a target, perhaps again. False where it was visited before with another tool or work object.
    #[must_use]
    pub fn visit(&mut self, target: Target) -> bool {
        self.fresh = false;
        let place = (target.file, target.kind.first_byte());
        let Some(&known) = self.visited.get(&place) else {
            self.visited.insert(place, self.program.targets.len());
            self.program.targets.push(target);
            return true;
        };
        // Visited again: the target after it does not come from the one before it in the list.
        self.fresh = true;
        match (&self.program.targets[known].kind, &target.kind) {
            (Kind::Pose(a), Kind::Pose(b)) => {
                (a.flange_from_tool, a.base_from_work) == (b.flange_from_tool, b.base_from_work)
            }
            _ => true,
        }
    }
}
