//! `$ORI_TYPE`: whether a path of the tool leads to the orientation of its target.

use super::aggregate::Aggregate;
use super::{Module, Value};
use crate::programs::scan::Reader;

/// Values with which it does.
const HEEDED: [&str; 2] = ["VAR", "JOINT"];
/// Data of the controller that have such a value.
const DEFAULT: &str = "LDEFAULT";

/// True for a value with which the tool keeps its orientation.
fn keeps(value: Option<&str>) -> bool {
    value.is_none_or(|value| !HEEDED.contains(&value))
}

/// True for data of a path with which the tool keeps its orientation; `BAS` takes those without `ORI_TYP` for `#VAR`.
fn keeps_with(data: &Aggregate) -> bool {
    data.has(&["ORI_TYP"]) && keeps(data.word("ORI_TYP"))
}

impl Module<'_> {
    /// What `#CONSTANT`, `LP1.ORI_TYP` or `SORI_TYP(LP1)` says: true where the tool keeps its orientation, or where that is not known.
    pub(super) fn keeps_orientation(&self, reader: &Reader<'_>) -> bool {
        let named = |ahead| reader.name_of(reader.at + ahead);
        if reader.is_mark(b'#') {
            return keeps(named(1).as_deref());
        }
        let data = if reader.ahead_is_mark(1, b'(') { named(2) } else { named(0) };
        data.is_none_or(|data| self.keeps_by_data(&Value::Name(data)))
    }

    /// The same of the data of a path.
    pub(super) fn keeps_by_data(&self, value: &Value) -> bool {
        match value {
            Value::Aggregate(data) | Value::Copied(Ok((data, _))) => keeps_with(data),
            Value::Name(name) if self.assigned.changes(name) => true,
            Value::Name(name) => match self.values.get(name) {
                Some(Value::Aggregate(data) | Value::Copied(Ok((data, _)))) => keeps_with(data),
                None => name != DEFAULT,
                Some(_) => true,
            },
            Value::Copied(Err(_)) | Value::Expression => true,
        }
    }
}
