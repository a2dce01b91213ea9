//! New joint origins spliced into the text of a URDF; every other byte stays.

use std::collections::BTreeMap;
use std::ops::Range;
use std::path::Path;

use roxmltree::{Attribute, Node};

use super::elements::{child, numbers};
use super::read::{elements, parse, version, without_undeclared_prefixes};
use crate::error::{Code, Error, Result};
use crate::geom::Pose;

/// What a re-read origin may differ from the wanted one: rounding of three angles and their sines (m and rad).
const ROUNDING: f64 = 1e-13;

/// Replacement of a byte range by new text.
type Edit = (Range<usize>, String);

/// Returns `text` with the `<origin>` of each joint in `new` set to its pose (`parent_from_joint`, m).
///
/// Only the values of `xyz` and `rpy` change (of `quat_xyzw` where the file uses that); a missing attribute or a missing
/// `<origin>` is inserted. An attribute that already says the same keeps its bytes. Numbers are the shortest that read
/// back as the same `f64`.
///
/// # Errors
/// XML that cannot be read, a joint that does not exist or stands twice, numbers that are none or not finite, and a
/// result that would not read back as asked for.
pub fn patch_origins(text: &str, new: &BTreeMap<String, Pose>) -> Result<String> {
    let mut edits = Vec::new();
    visit(text, new, |name, joint, has_quaternions| {
        let wanted = &new[name];
        if !wanted.rotation.iter().chain(wanted.translation.iter()).all(|v| v.is_finite()) {
            let what = "its new origin is not finite";
            return Err(Error::new(Code::OriginNotWritten, place(name), what, "look at the solution, not at the URDF"));
        }
        edits.extend(joint_edits(text, joint, wanted, has_quaternions)?);
        Ok(())
    })?;
    edits.sort_by_key(|(range, _)| range.start);
    let patched = splice(text, &edits);
    check(&patched, new)?;
    Ok(patched)
}

/// Calls `action` for every joint of the text that is in `new`, each exactly once.
fn visit(
    text: &str,
    new: &BTreeMap<String, Pose>,
    mut action: impl FnMut(&str, Node<'_, '_>, bool) -> Result<()>,
) -> Result<()> {
    let path = Path::new("URDF");
    let plain = without_undeclared_prefixes(path, text)?;
    let document = parse(path, &plain)?;
    let robot = document.root_element();
    let has_quaternions = version(robot) >= (1, 1);
    let mut seen: BTreeMap<&str, u32> = new.keys().map(|name| (name.as_str(), 0)).collect();
    for joint in elements(robot, "joint") {
        let Some((name, count)) = joint.attribute("name").and_then(|n| seen.get_key_value(n)) else { continue };
        let (name, count) = (*name, *count);
        seen.insert(name, count + 1);
        action(name, joint, has_quaternions)?;
    }
    match seen.into_iter().find(|(_, count)| *count != 1) {
        Some((name, count)) => {
            let what = format!("stands {count} times in the URDF, not once");
            Err(Error::new(Code::UrdfTwice, place(name), what, "correct the URDF or the name"))
        }
        None => Ok(()),
    }
}

fn place(joint: &str) -> String {
    format!("URDF, joint \"{joint}\"")
}

fn joint_edits(text: &str, joint: Node<'_, '_>, wanted: &Pose, has_quaternions: bool) -> Result<Vec<Edit>> {
    let Some(origin) = child(joint, "origin") else {
        return Ok(insert_origin(text, joint, wanted)?.into_iter().collect());
    };
    let quaternion = origin.attribute_node("quat_xyzw").filter(|_| has_quaternions);
    let now = pose_of(joint, has_quaternions)?;
    let mut edits = Vec::new();
    let mut missing = String::new();
    let mut set = |attribute: Option<Attribute<'_, '_>>, key: &str, value: String| -> Result<()> {
        match attribute {
            Some(attribute) => edits.push((value_range(text, &attribute)?, value)),
            None => missing += &format!(" {key}={0}{value}{0}", quote(text, origin)),
        }
        Ok(())
    };
    if now.translation != wanted.translation {
        set(origin.attribute_node("xyz"), "xyz", join(&wanted.xyz()))?;
    }
    if now.rotation != wanted.rotation {
        match quaternion {
            Some(attribute) => set(Some(attribute), "quat_xyzw", join(&wanted.quaternion_xyzw()))?,
            None => set(origin.attribute_node("rpy"), "rpy", join(&wanted.rpy()))?,
        }
    }
    if !missing.is_empty() {
        let end = name_and_attributes_end(origin);
        edits.push((end..end, missing));
    }
    Ok(edits)
}

/// A whole new `<origin>` as first child, with the white space that the first child had.
fn insert_origin(text: &str, joint: Node<'_, '_>, wanted: &Pose) -> Result<Option<Edit>> {
    if *wanted == Pose::identity() {
        return Ok(None);
    }
    let tail = name_and_attributes_end(joint);
    let open_end = text[tail..].find('>').map(|i| tail + i + 1);
    let Some(at) = open_end.filter(|end| !text[tail..*end].contains('/')) else {
        let name = joint.attribute("name").unwrap_or_default();
        return Err(Error::new(
            Code::UrdfLayout,
            place(name),
            "is an empty element",
            "give the joint its parent and child",
        ));
    };
    let rest = &text[at..];
    let indent = &rest[..rest.len() - rest.trim_start_matches([' ', '\t', '\r', '\n']).len()];
    let q = quote(text, joint);
    let (xyz, rpy) = (join(&wanted.xyz()), join(&wanted.rpy()));
    Ok(Some((at..at, format!("{indent}<origin xyz={q}{xyz}{q} rpy={q}{rpy}{q}/>"))))
}

/// `parent_from_joint` as the text states it now.
fn pose_of(joint: Node<'_, '_>, has_quaternions: bool) -> Result<Pose> {
    let Some(origin) = child(joint, "origin") else { return Ok(Pose::identity()) };
    let read = |key: &str, default: &[f64]| match origin.attribute(key) {
        None => Ok(default.to_vec()),
        Some(value) => numbers(value, default.len()).ok_or_else(|| {
            let name = joint.attribute("name").unwrap_or_default();
            let what = format!("origin {key}=\"{value}\" is not {} finite numbers", default.len());
            Error::new(Code::UrdfNumber, place(name), what, "correct the numbers (point as decimal mark)")
        }),
    };
    let xyz = read("xyz", &[0.0; 3])?;
    let xyz = [xyz[0], xyz[1], xyz[2]];
    if has_quaternions && origin.has_attribute("quat_xyzw") {
        let q = read("quat_xyzw", &[0.0; 4])?;
        return Ok(Pose::from_xyz_quaternion(xyz, [q[0], q[1], q[2], q[3]]));
    }
    let rpy = read("rpy", &[0.0; 3])?;
    Ok(Pose::from_xyz_rpy(xyz, [rpy[0], rpy[1], rpy[2]]))
}

/// Byte range of an attribute's value without its quotes.
fn value_range(text: &str, attribute: &Attribute<'_, '_>) -> Result<Range<usize>> {
    let range = attribute.range_value();
    let bytes = text.as_bytes();
    let quotes = (range.start.checked_sub(1).and_then(|i| bytes.get(i)), bytes.get(range.end));
    match quotes {
        (Some(b'"'), Some(b'"')) | (Some(b'\''), Some(b'\'')) => Ok(range),
        _ => {
            let what = format!("the attribute {} is laid out in a way that cannot be edited", attribute.name());
            Err(Error::new(Code::UrdfLayout, "URDF", what, "write it as name=\"value\" without blanks around ="))
        }
    }
}

/// The quote that an element's first attribute uses.
fn quote(text: &str, element: Node<'_, '_>) -> char {
    let last = element.attributes().next().and_then(|a| text[..a.range().end].chars().next_back());
    last.filter(|c| matches!(c, '"' | '\'')).unwrap_or('"')
}

/// Where the name and attributes of an element's opening tag end.
fn name_and_attributes_end(element: Node<'_, '_>) -> usize {
    let name_end = element.range().start + 1 + element.tag_name().name().len();
    element.attributes().map(|a| a.range().end).fold(name_end, usize::max)
}

/// Shortest numbers that read back as the same `f64`, separated by blanks.
pub(super) fn join(values: &[f64]) -> String {
    let number = |v: f64| if v != 0.0 && v.abs() < 1e-4 { format!("{v:e}") } else { format!("{}", v + 0.0) };
    values.iter().map(|v| number(*v)).collect::<Vec<_>>().join(" ")
}

fn splice(text: &str, edits: &[Edit]) -> String {
    let mut patched = String::with_capacity(text.len() + 64 * edits.len());
    let mut at = 0;
    for (range, value) in edits {
        patched += &text[at..range.start];
        patched += value;
        at = range.end;
    }
    patched + &text[at..]
}

/// The patched text must read back as asked for.
fn check(patched: &str, new: &BTreeMap<String, Pose>) -> Result<()> {
    visit(patched, new, |name, joint, has_quaternions| {
        let (read, wanted) = (pose_of(joint, has_quaternions)?, &new[name]);
        let rotation = (read.rotation - wanted.rotation).abs().max();
        if read.translation == wanted.translation && rotation <= ROUNDING {
            return Ok(());
        }
        let what = format!("its new origin does not read back as written (rotation off by {rotation:.1e})");
        Err(Error::new(Code::OriginNotWritten, place(name), what, "give a rotation that is orthonormal"))
    })
}
