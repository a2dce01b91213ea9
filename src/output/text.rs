//! Numbers, names and records as YAML, TOML, CSV and JSON want them.

use std::collections::BTreeMap;

use serde::Serialize;

use crate::error::{Code, Error, Result};
use crate::series::sha256;

/// Files of a series that people complete by hand.
const COMPLETED: [&str; 4] = ["joints.csv", "series.toml", "plate.toml", "plate.csv"];

/// SHA-256 of the files of a series among these, as they are written: a result that was worked with is not replaced.
pub(super) fn as_written(files: &BTreeMap<String, Vec<u8>>) -> BTreeMap<String, String> {
    let hash = |name: &str| Some((name.to_owned(), sha256(files.get(name)?)));
    COMPLETED.into_iter().filter_map(hash).collect()
}

/// A record as the bytes of a JSON file; `file` is its name, for messages.
///
/// # Errors
/// None in practice: every field can be written as JSON.
pub(super) fn json(record: &impl Serialize, file: &str) -> Result<Vec<u8>> {
    let written = serde_json::to_vec_pretty(record);
    let mut bytes = written.map_err(|e| Error::new(Code::RecordNotWritten, file, e, "report this"))?;
    bytes.push(b'\n');
    Ok(bytes)
}

/// A number that every YAML and TOML reader takes for a float and reads back exactly.
///
/// YAML 1.1 readers want a point in the mantissa and a sign in the exponent.
pub(super) fn number(value: f64) -> String {
    let plain = format!("{:?}", value + 0.0);
    let Some((mantissa, exponent)) = plain.split_once('e') else { return plain };
    let point = if mantissa.contains('.') { "" } else { ".0" };
    let sign = if exponent.starts_with('-') { "" } else { "+" };
    format!("{mantissa}{point}e{sign}{exponent}")
}

/// `[1.0, 2.0]`, in YAML and TOML.
pub(super) fn list(values: impl IntoIterator<Item = f64>) -> String {
    format!("[{}]", values.into_iter().map(number).collect::<Vec<_>>().join(", "))
}

/// A string in double quotes with the escapes that YAML, TOML and JSON share.
pub(super) fn quoted(text: &str) -> String {
    let mut out = String::with_capacity(text.len() + 2);
    out.push('"');
    for c in text.chars() {
        match c {
            '"' => out.push_str("\\\""),
            '\\' => out.push_str("\\\\"),
            '\n' => out.push_str("\\n"),
            '\t' => out.push_str("\\t"),
            c if c.is_control() => out.push_str(&format!("\\u{:04x}", u32::from(c))),
            c => out.push(c),
        }
    }
    out.push('"');
    out
}

/// A name as it is where it is a plain key of YAML and TOML, else in quotes.
pub(super) fn key(name: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '-';
    let letter_first = name.starts_with(|c: char| c.is_ascii_alphabetic());
    // Words that YAML 1.1 takes for booleans or nothing.
    let reserved = ["y", "n", "yes", "no", "on", "off", "true", "false", "null"];
    match letter_first && name.chars().all(plain) && !reserved.contains(&name.to_lowercase().as_str()) {
        true => name.to_owned(),
        false => quoted(name),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_floats_in_yaml_1_1_and_read_back_exactly() {
        for (value, text) in [(0.0, "0.0"), (-0.0, "0.0"), (1e-7, "1.0e-7"), (1.5e-9, "1.5e-9"), (1e20, "1.0e+20")] {
            assert_eq!(number(value), text);
        }
        for value in [0.1 + 0.2, -1.0 / 3.0 * 1e-12, f64::MIN_POSITIVE, 12345.678e30] {
            assert_eq!(number(value).parse::<f64>(), Ok(value));
        }
    }

    #[test]
    fn names_are_quoted_where_they_are_no_plain_key() {
        assert_eq!(key("joint_a1"), "joint_a1");
        assert_eq!(key("joint 1"), "\"joint 1\"");
        assert_eq!(key("NO"), "\"NO\"");
        assert_eq!(key("1"), "\"1\"");
        assert_eq!(quoted("a\"b\\c\n"), r#""a\"b\\c\n""#);
    }
}
