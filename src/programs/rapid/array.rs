//! Arrays of targets: `TYPE name{3} := [..]`, of which moves use one by its number or any by a variable.

use super::value::{Node, array_of, check, computed};
use super::{Datum, Task};
use crate::error::Result;
use crate::programs::program::Understood;

impl Task<'_> {
    /// The elements of an array as data of their own, where it has numbers and one dimension.
    pub(super) fn elements_declared(&mut self, name: &str, datum: &Datum, values: &Node, place: &str) -> Result<()> {
        let Node::List(values) = values else { return Ok(()) };
        for (k, value) in values.iter().enumerate() {
            let element = format!("{name}{{{}}}", k + 1);
            check(&datum.kind, &element, value, place)?;
            let value = (!self.data.contains_key(&element)).then(|| value.clone());
            self.data.insert(element, Datum { value, ..datum.clone() });
        }
        Ok(())
    }

    /// Data of a name, or of the elements of an array, are computed: `by` says what changes them.
    pub(super) fn is_assigned(&mut self, name: &str, by: &str) {
        let own = |key: &String| key == name || array_of(key) == Some(name);
        for (_, datum) in self.data.iter_mut().filter(|(key, _)| own(key)) {
            datum.before = datum.value.take().or(datum.before.take());
            datum.changed.get_or_insert_with(|| by.to_owned());
        }
    }

    /// True for some element of an array of which the text gives all: `name{}`.
    pub(super) fn has_known_elements(&self, name: &str) -> bool {
        let Some(array) = name.strip_suffix("{}") else { return false };
        let mut elements = self.data.iter().filter(|(key, _)| array_of(key) == Some(array)).peekable();
        elements.peek().is_some() && elements.all(|(_, datum)| datum.value.is_some())
    }

    /// A move to some element of an array: to all of them, in an order that the text does not tell.
    pub(super) fn visit_any(
        &mut self,
        array: &str,
        name: &str,
        from: (usize, usize),
        tool: &Option<String>,
        work: Option<&Node>,
    ) -> Result<Understood<()>> {
        let mut elements: Vec<String> = self.data.keys().filter(|k| array_of(k) == Some(array)).cloned().collect();
        elements.sort_by_key(|e| (e.len(), e.clone()));
        if elements.is_empty() {
            return Ok(Err(computed(array)));
        }
        for element in elements {
            self.way.lose(self.switching.stands());
            self.may_carry();
            if let Err(why) = self.visit(&Node::Word(element), name, from, tool, work)? {
                self.leave(from, name, why);
            }
        }
        self.way.lose(self.switching.stands());
        Ok(Ok(()))
    }
}
