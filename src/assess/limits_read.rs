//! Limits by their names, in any format: one visitor, where a derived one has code of every field for every format.

use std::fmt;

use serde::de::{Deserialize, Deserializer, Error, MapAccess, Visitor};

use super::limits::{LimitMut, Limits};

/// A name that there is.
struct Name(&'static str);

impl<'de> Deserialize<'de> for Name {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let name = String::deserialize(deserializer)?;
        let known = Limits::NAMES.iter().find(|known| **known == name);
        known.map(|known| Name(known)).ok_or_else(|| Error::unknown_field(&name, Limits::NAMES))
    }
}

impl<'de> Deserialize<'de> for Limits {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_map(LimitsVisitor)
    }
}

struct LimitsVisitor;

impl<'de> Visitor<'de> for LimitsVisitor {
    type Value = Limits;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("limits by their names")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Limits, A::Error> {
        let mut limits = Limits::default();
        while let Some(Name(name)) = map.next_key()? {
            match limits.of_name(name) {
                Some(LimitMut::Number(number)) => *number = map.next_value()?,
                Some(LimitMut::Count(count)) => *count = map.next_value()?,
                None => return Err(A::Error::unknown_field(name, Limits::NAMES)),
            }
        }
        Ok(limits)
    }
}
