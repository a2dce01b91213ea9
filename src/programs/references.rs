//! Values that routines change because they are given them by reference.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;

use super::names::plain;
use super::scan::{Reader, TokenKind};

/// A parameter of a routine.
#[derive(Debug, Clone)]
pub(super) struct Parameter {
    pub name: String,
    pub passing: Passing,
}

/// How a routine gets an argument.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Passing {
    /// What it sets stays with it.
    Value,
    /// What it sets is set where it is called.
    Reference,
    /// The same, given by name.
    NamedReference,
    /// A value that is given by name.
    NamedValue,
}

impl Passing {
    fn is_named(self) -> bool {
        matches!(self, Self::NamedReference | Self::NamedValue)
    }

    fn is_reference(self) -> bool {
        matches!(self, Self::Reference | Self::NamedReference)
    }
}

/// Which argument of a call.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Which {
    /// By its number, from 0.
    Nth(usize),
    /// By its name.
    Named(String),
}

/// An argument that is a name, with an index or components behind it at most.
#[derive(Debug, Clone)]
pub(super) struct Given {
    pub which: Which,
    /// The name with its index.
    pub name: String,
}

/// How a routine is called.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Calling {
    /// As a statement.
    Instruction,
    /// Within an expression.
    Function,
}

/// A call with the arguments that are names.
#[derive(Debug, Clone)]
pub(super) struct Call {
    pub routine: String,
    pub calling: Calling,
    pub given: Vec<Given>,
    /// Routine of the files in which it stands.
    within: Option<usize>,
}

/// A routine in the files.
#[derive(Debug)]
struct Routine {
    name: String,
    parameters: Vec<Parameter>,
    /// Names that its statements set.
    sets: BTreeSet<String>,
}

/// Routines and calls of all files.
#[derive(Debug, Default)]
pub(super) struct References {
    routines: Vec<Routine>,
    calls: Vec<Call>,
    within: Option<usize>,
}

/// The variable of a name with an index.
pub(super) fn variable(name: &str) -> &str {
    name.split(['[', '{']).next().unwrap_or(name)
}

/// Parts of the tokens `range` between marks that stand in no bracket.
pub(super) fn parts(reader: &Reader<'_>, range: Range<usize>, is_between: impl Fn(u8) -> bool) -> Vec<Range<usize>> {
    let (mut all, mut start, mut at) = (Vec::new(), range.start, range.start);
    while at < range.end {
        match reader.token(at).map(|t| t.kind) {
            Some(TokenKind::Mark(b'(' | b'[' | b'{')) => at = reader.closing(at).unwrap_or(at),
            Some(TokenKind::Mark(mark)) if is_between(mark) => {
                all.push(start..at);
                start = at + 1;
            }
            _ => {}
        }
        at += 1;
    }
    all.push(start..range.end.max(start));
    all
}

impl References {
    /// A routine begins.
    pub fn routine_begins(&mut self, name: String, parameters: Vec<Parameter>) {
        self.within = Some(self.routines.len());
        self.routines.push(Routine { name, parameters, sets: BTreeSet::new() });
    }

    /// The routine ends.
    pub fn routine_ends(&mut self) {
        self.within = None;
    }

    /// A statement sets a name.
    pub fn sets(&mut self, name: &str) {
        if let Some(within) = self.within {
            self.routines[within].sets.insert(variable(name).to_owned());
        }
    }

    /// A routine is called.
    pub fn calls(&mut self, routine: String, calling: Calling, given: Vec<Given>) {
        if !given.is_empty() {
            self.calls.push(Call { routine, calling, given, within: self.within });
        }
    }

    /// Parameters of all routines.
    pub fn parameters(&self) -> impl Iterator<Item = &Parameter> {
        self.routines.iter().flat_map(|routine| &routine.parameters)
    }

    /// Names that calls may change, with a routine that may do it; `writes` tells it of routines in none of the files.
    pub fn changed(&self, writes: impl Fn(&Call, &Given) -> bool) -> BTreeMap<String, String> {
        let mut sets: Vec<BTreeSet<String>> = self.routines.iter().map(|routine| routine.sets.clone()).collect();
        let mut by_name = BTreeMap::<&str, Vec<usize>>::new();
        self.routines.iter().enumerate().for_each(|(k, r)| by_name.entry(&r.name).or_default().push(k));
        let mut changed = BTreeMap::new();
        loop {
            let mut is_settled = true;
            for call in &self.calls {
                for given in &call.given {
                    let is_changed = match by_name.get(call.routine.as_str()) {
                        Some(all) => all.iter().any(|&k| self.routines[k].sets_given(&given.which, &sets[k])),
                        None => writes(call, given),
                    };
                    is_settled &= !(is_changed && self.note(call, given, &mut sets, &mut changed));
                }
            }
            if is_settled {
                return changed;
            }
        }
    }

    /// Notes that a call changes what it is given; false where that is known.
    fn note(
        &self,
        call: &Call,
        given: &Given,
        sets: &mut [BTreeSet<String>],
        changed: &mut BTreeMap<String, String>,
    ) -> bool {
        let name = variable(&given.name);
        let own = call.within.filter(|&k| self.routines[k].parameters.iter().any(|p| p.name == name));
        match own {
            Some(k) => sets[k].insert(name.to_owned()),
            None if changed.contains_key(&given.name) => false,
            None => changed.insert(given.name.clone(), call.routine.clone()).is_none(),
        }
    }
}

impl Routine {
    /// True where the routine sets what it is given as this argument by reference.
    fn sets_given(&self, which: &Which, sets: &BTreeSet<String>) -> bool {
        let mut numbered = self.parameters.iter().filter(|p| !p.passing.is_named());
        let parameter = match which {
            Which::Nth(k) => numbered.nth(*k),
            Which::Named(name) => self.parameters.iter().find(|p| plain(&p.name) == *name),
        };
        parameter.is_some_and(|p| p.passing.is_reference() && sets.contains(&p.name))
    }
}
