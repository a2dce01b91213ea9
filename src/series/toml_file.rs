//! TOML files of a series: read with the line of every complaint, and written.

use std::path::Path;

use serde::Serialize;
use serde::de::DeserializeOwned;

use super::inputs::{InputFile, read_text};
use crate::error::{Code, Error, Result, closest_name, conversion, plain_name};
use crate::files::FileKind;

/// A value that must be positive and finite where it is given.
pub(super) fn require_positive(path: &Path, key: &str, value: Option<f64>) -> Result<()> {
    match value {
        Some(v) if !(v > 0.0 && v.is_finite()) => {
            Err(Error::new(Code::SettingRange, path.display(), format!("{key} = {v}"), "give a positive number"))
        }
        _ => Ok(()),
    }
}

/// A coordinate is measured to less, m: a larger number is one in mm.
pub(super) const LARGEST_SIGMA_M: f64 = 0.01;
/// What to do about such a number.
pub(super) const SIGMA_IN_METRES: &str = "write it in metres: 0.00005 for 0.05 mm";

/// A rotation is measured to less, rad: a larger number is one in degrees.
pub(super) const LARGEST_SIGMA_RAD: f64 = 0.05;
/// What to do about such a number.
pub(super) const SIGMA_IN_RAD: &str = "write it in rad: 0.0001 for 0.0057 deg";

/// Refuses the standard deviation of a coordinate that is not positive, or not in metres.
pub(super) fn require_sigma_m(path: &Path, key: &str, value: Option<f64>) -> Result<()> {
    require_sigma_below((LARGEST_SIGMA_M, SIGMA_IN_METRES), path, key, value)
}

/// Refuses the standard deviation of a rotation that is not positive, or not in rad.
pub(super) fn require_sigma_rad(path: &Path, key: &str, value: Option<f64>) -> Result<()> {
    require_sigma_below((LARGEST_SIGMA_RAD, SIGMA_IN_RAD), path, key, value)
}

fn require_sigma_below((largest, remedy): (f64, &str), path: &Path, key: &str, value: Option<f64>) -> Result<()> {
    require_positive(path, key, value)?;
    match value {
        Some(v) if v >= largest => Err(Error::new(Code::SettingRange, path.display(), format!("{key} = {v}"), remedy)),
        _ => Ok(()),
    }
}

/// Refuses other versions of a format.
pub(super) fn check_format(path: &Path, format: u32) -> Result<()> {
    if format == 1 {
        return Ok(());
    }
    let remedy = "this program reads format = 1; a newer one may be needed";
    Err(Error::new(Code::SettingVersion, path.display(), format!("format = {format}"), remedy))
}

/// Text of a TOML file.
pub(super) fn to_toml(file: &str, value: &impl Serialize) -> Result<String> {
    toml::to_string(value)
        .map_err(|e| Error::new(Code::OutputFailed, file, format!("cannot be written: {e}"), "report this"))
}

/// Reads a TOML file; unknown keys and wrong values are named with their line.
pub(crate) fn read_toml<T: DeserializeOwned>(path: &Path, inputs: &mut Vec<InputFile>) -> Result<T> {
    parse_toml(path, &read_text(path, FileKind::Settings, inputs)?)
}

/// A value from the text of a TOML file; `path` is for messages only.
pub(super) fn parse_toml<T: DeserializeOwned>(path: &Path, text: &str) -> Result<T> {
    let value = toml::from_str(text).map_err(|error| {
        let line = error.span().map(|s| 1 + text[..s.start.min(text.len())].matches('\n').count());
        let place = line.map_or_else(|| path.display().to_string(), |l| format!("{}:{l}", path.display()));
        let message = error.message().trim().replace('\n', "; ");
        let has_backslash = line.and_then(|l| text.lines().nth(l - 1)).is_some_and(|line| line.contains('\\'));
        let remedy = toml_remedy(&message, has_backslash);
        Error::new(Code::SettingSyntax, place, message, remedy)
    })?;
    plain_toml(path, text)?;
    Ok(value)
}

/// What to do where a backslash stands in double quotes.
const BACKSLASH: &str = "within double quotes a backslash begins a character such as \\n: write / between folders, or set the path in single quotes";

/// Keys and strings of a TOML file without control characters; the line is that of the innermost key.
fn plain_toml(path: &Path, text: &str) -> Result<()> {
    fn walk(value: &toml::Value, key: &str, check: &dyn Fn(&str, &str, &str) -> Result<()>) -> Result<()> {
        match value {
            toml::Value::String(text) => check(key, text, key),
            toml::Value::Array(all) => all.iter().try_for_each(|v| walk(v, key, check)),
            toml::Value::Table(all) => all.iter().try_for_each(|(k, v)| {
                check("key", k, key)?;
                walk(v, k, check)
            }),
            _ => Ok(()),
        }
    }
    let place = |key: &str| {
        let line = text.lines().position(|l| l.trim_start().starts_with(key) && l.contains('\\'));
        line.map_or_else(|| path.display().to_string(), |l| format!("{}:{}", path.display(), l + 1))
    };
    let check = |kind: &str, name: &str, key: &str| match plain_name(kind, name, place(key)) {
        Err(error) if !text.contains(name) => Err(Error { remedy: BACKSLASH.to_owned(), ..error }),
        checked => checked.map(|_| ()),
    };
    toml::from_str::<toml::Value>(text).map_or(Ok(()), |value| walk(&value, "", &check))
}

/// What to try after a message of the TOML reader, which quotes names in backticks: the offender, then what it knows.
fn toml_remedy(message: &str, has_backslash: bool) -> String {
    let mut quoted = message.split('`').skip(1).step_by(2);
    let first = quoted.next().unwrap_or_default();
    if message.starts_with("unknown") {
        let known: Vec<&str> = quoted.collect();
        return match closest_name(first, known.iter().copied()) {
            Some(meant) => conversion(first, meant).unwrap_or_else(|| format!("is \"{meant}\" meant?")),
            None if message.starts_with("unknown variant") => format!("write \"{}\"", known.join("\" or \"")),
            None => "remove it or correct its name".into(),
        };
    }
    if message.starts_with("missing field") {
        return format!("add {first} = ...");
    }
    let remedy = if has_backslash {
        BACKSLASH
    } else {
        "correct the line (text stands in quotes, numbers have a decimal point)"
    };
    remedy.to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::renaming;

    #[test]
    fn a_value_that_is_none_of_those_known_is_told_which_there_are() {
        let both = &["deg", "rad"][..];
        for (unit, meant) in [("degree", both), ("degr", &["deg"]), ("mrad", both), ("mdeg", both), ("grad", both)] {
            let remedy = toml_remedy(&format!("unknown variant `{unit}`, expected `deg` or `rad`"), false);
            assert!(meant.iter().all(|unit| remedy.contains(&format!("\"{unit}\""))), "{remedy}");
        }
    }

    #[test]
    fn a_key_of_another_unit_is_converted_not_renamed() {
        let remedy = toml_remedy("unknown field `pitch_mm`, expected one of `rows`, `pitch_m`", false);
        assert_eq!(remedy, renaming("pitch_mm", "pitch_m"));
    }
}
