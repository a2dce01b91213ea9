//! Data of one name in several data lists: what is not `GLOBAL` belongs to the program of that name alone, and hides there what is.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use super::assigned::assigned;
use crate::programs::names::in_scope;
use crate::programs::references::variable;
use crate::programs::scan::Reader;
use crate::programs::text_file::TextFile;

/// Names that several data lists have.
#[derive(Default)]
pub(super) struct Scopes {
    /// Data lists in which a name is not global.
    local: BTreeMap<String, BTreeSet<usize>>,
    /// Names that a data list, or that of the controller, has for all.
    global: BTreeSet<String>,
    /// Files without their extensions.
    modules: Vec<String>,
}

impl Scopes {
    /// Of these files.
    pub fn new(files: &[TextFile]) -> Self {
        let module = |file: &TextFile| Path::new(&file.name).with_extension("").to_string_lossy().to_lowercase();
        Self { local: BTreeMap::new(), global: BTreeSet::new(), modules: files.iter().map(module).collect() }
    }

    /// Looks through a data list, of a program or of the controller.
    pub fn look_through(&mut self, mut reader: Reader<'_>, is_of_program: bool) {
        while !reader.done() {
            let is_local = is_of_program && !reader.rest_of_line_has("GLOBAL");
            if let Some((name, _)) = assigned(&mut reader) {
                let name = variable(&name).to_owned();
                match is_local {
                    true => _ = self.local.entry(name).or_default().insert(reader.index),
                    false => _ = self.global.insert(name),
                }
            }
            reader.skip_line();
        }
    }

    /// Names of their own for words of a file, where its module has data of a name that others have, too.
    pub fn names(&self, reader: &Reader<'_>) -> BTreeMap<usize, String> {
        let own = |name: &str| {
            let all = self.local.get(name).filter(|all| all.len() > 1 || self.global.contains(name))?;
            all.iter().copied().find(|&list| self.modules[list] == self.modules[reader.index])
        };
        let mut names = BTreeMap::new();
        for at in (0..).take_while(|&at| reader.token(at).is_some()) {
            if let Some(name) = reader.name_of(at)
                && let Some(list) = own(&name)
            {
                names.insert(at, in_scope(&name, list));
            }
        }
        names
    }
}
