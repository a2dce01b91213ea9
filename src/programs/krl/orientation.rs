//! `$ORI_TYPE`: whether a path of the tool leads to the orientation of its target.

use super::{Module, Value};
use crate::programs::scan::Reader;

/// Values with which it does.
const HEEDED: [&str; 2] = ["VAR", "JOINT"];
/// Data of the controller whose component has such a value.
const DEFAULT: &str = "LDEFAULT";

/// True for a value with which the tool keeps its orientation.
fn keeps(value: Option<&str>) -> bool {
    value.is_none_or(|value| !HEEDED.contains(&value))
}

impl Module<'_> {
    /// What `#CONSTANT`, `LP1.ORI_TYP` or `SORI_TYP(LP1)` says: true where the tool keeps its orientation, or where that is not known; `None` where
    /// the data say nothing of it.
    pub(super) fn keeps_orientation(&self, reader: &Reader<'_>) -> Option<bool> {
        let named = |ahead| reader.name_of(reader.at + ahead);
        if reader.is_mark(b'#') {
            return Some(keeps(named(1).as_deref()));
        }
        let data = if reader.ahead_is_mark(1, b'(') { named(2) } else { named(0) };
        data.map_or(Some(true), |data| self.keeps_by_data(&Value::Name(data)))
    }

    /// The same of the data of a path.
    pub(super) fn keeps_by_data(&self, value: &Value) -> Option<bool> {
        match value {
            Value::Aggregate(data) => data.has(&["ORI_TYP"]).then(|| keeps(data.word("ORI_TYP"))),
            Value::Name(name) => match self.values.get(name) {
                _ if self.assigned.changes(name) => Some(true),
                Some(Value::Aggregate(data)) => self.keeps_by_data(&Value::Aggregate(data.clone())),
                Some(Value::Copied(Ok((data, _)))) => self.keeps_by_data(&Value::Aggregate(data.clone())),
                None if name == DEFAULT => None,
                _ => Some(true),
            },
            Value::Copied(Ok((data, _))) => self.keeps_by_data(&Value::Aggregate(data.clone())),
            Value::Copied(Err(_)) | Value::Expression => Some(true),
        }
    }
}
