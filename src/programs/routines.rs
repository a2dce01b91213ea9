//! Routines of one name in several files: which of them a call means.

use std::collections::BTreeMap;

use super::names::in_scope;

/// Routines of all files.
#[derive(Debug, Clone, Default)]
pub(super) struct Routines {
    /// By name: the files that have one, and whether others see it.
    files: BTreeMap<String, BTreeMap<usize, bool>>,
}

impl Routines {
    /// A file has a routine of this name; others do not see one that is local.
    pub fn declare(&mut self, name: String, file: usize, is_local: bool) {
        *self.files.entry(name).or_default().entry(file).or_default() |= !is_local;
    }

    /// True where a call in a file means a routine of the files.
    pub fn is_seen(&self, name: &str, file: usize) -> bool {
        self.files.contains_key(name) && !self.meant(name, file).is_empty()
    }

    /// Names of their own of the routines that a call in a file may mean: of that in the file, else of all that other files offer. A routine that
    /// is in none of the files has the name as it is.
    pub fn meant(&self, name: &str, file: usize) -> Vec<String> {
        let Some(all) = self.files.get(name) else { return vec![name.to_owned()] };
        if all.contains_key(&file) {
            return vec![in_scope(name, file)];
        }
        let offered = all.iter().filter(|(_, is_offered)| **is_offered);
        offered.map(|(file, _)| in_scope(name, *file)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_call_means_the_routine_of_its_file_else_all_that_others_offer() {
        let mut all = Routines::default();
        [(0, true), (1, false), (2, false)]
            .into_iter()
            .for_each(|(file, local)| all.declare("A".to_owned(), file, local));
        all.declare("B".to_owned(), 0, true);
        let meant = |name: &str, file| all.meant(name, file);
        assert_eq!([0, 1].map(|file| meant("A", file)), [0, 1].map(|file| vec![in_scope("A", file)]));
        assert_eq!(meant("A", 3), [in_scope("A", 1), in_scope("A", 2)]);
        assert_eq!(meant("B", 1), Vec::<String>::new());
        assert_eq!(meant("C", 1), ["C"]);
        assert_eq!(
            [("A", 3), ("B", 0), ("B", 1), ("C", 1)].map(|(name, file)| all.is_seen(name, file)),
            [true, true, false, false]
        );
    }
}
