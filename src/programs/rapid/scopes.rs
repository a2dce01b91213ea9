//! Data of one name in several modules and routines: local ones hide those around them.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;

use super::switching::{ROUTINES, routine_name};
use super::value::TYPES;
use crate::programs::names::in_scope;
use crate::programs::routines::Routines;
use crate::programs::scan::Reader;

/// Where data are declared: the file, and the routine in it.
type Scope = (usize, Option<usize>);

/// A declaration of data.
struct Declaration {
    scope: Scope,
    /// True where other modules do not see it.
    is_local: bool,
}

/// All declarations of the files by name, and where routines stand.
#[derive(Default)]
pub(super) struct Scopes {
    declared: BTreeMap<String, Vec<Declaration>>,
    /// Tokens of the routines of each file.
    routines: BTreeMap<usize, Vec<Range<usize>>>,
    /// Names of the routines.
    named: Routines,
}

impl Scopes {
    /// Looks through a file.
    pub fn look_through(&mut self, mut reader: Reader<'_>) {
        let mut begin = None;
        while !reader.done() {
            let word = reader.name().unwrap_or_default();
            let routines = self.routines.entry(reader.index).or_default();
            if ROUTINES.contains(&word.as_str()) {
                begin = Some(reader.at);
                self.named.declare(routine_name(&reader), reader.index, reader.ahead_is_word(-1, "LOCAL"));
            } else if word.strip_prefix("END").is_some_and(|kind| ROUTINES.contains(&kind)) {
                routines.extend(begin.take().map(|begin| begin..reader.at));
            } else if TYPES.contains(&word.as_str()) && !reader.ahead_is_word(-1, "FUNC") {
                let routine = begin.map(|_| routines.len());
                let is_local = routine.is_some() || reader.ahead_is_word(-2, "LOCAL");
                if let Some(name) = reader.name_of(reader.at + 1) {
                    let declaration = Declaration { scope: (reader.index, routine), is_local };
                    self.declared.entry(name).or_default().push(declaration);
                }
            }
            reader.at += 1;
        }
    }

    /// Routines of all files.
    pub fn routines(&self) -> &Routines {
        &self.named
    }

    /// Names of their own for words of a file that mean local data, where there are others of their name.
    pub fn names(&self, reader: &Reader<'_>) -> BTreeMap<usize, String> {
        let several = |all: &[Declaration]| all.iter().map(|d| d.scope).collect::<BTreeSet<_>>().len() > 1;
        let mut names = BTreeMap::new();
        for at in 0.. {
            if reader.token(at).is_none() {
                break;
            }
            let is_other = at > 0 && [b'\\', b'.'].iter().any(|mark| reader.token_is_mark(at - 1, *mark));
            let Some(name) = reader.name_of(at).filter(|_| !is_other) else { continue };
            let all = self.declared.get(&name).filter(|all| several(all));
            let number = all.and_then(|all| self.number(all, reader.index, at));
            names.extend(number.map(|number| (at, in_scope(&name, number))));
        }
        names
    }

    /// Number of the scope of local data that a word at a token means.
    fn number(&self, all: &[Declaration], file: usize, at: usize) -> Option<usize> {
        let routines = self.routines.get(&file)?;
        let around = routines.iter().position(|tokens| tokens.contains(&at));
        let of = |scope: Scope| all.iter().position(|declared| declared.scope == scope);
        let found = around.and_then(|routine| of((file, Some(routine)))).or_else(|| of((file, None)))?;
        all[found].is_local.then_some(found)
    }
}
