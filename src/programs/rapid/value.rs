//! Values in RAPID: aggregates, numbers, names, displaced points.

use std::ops::Range;

use crate::error::{Code, Error, Result};
use crate::geom::Pose;
use crate::programs::external::NO_AXIS;
use crate::programs::reason::{LeftReason, Why};
use crate::programs::scan::Reader;

/// Types of data that say where the robot goes.
pub(super) const TYPES: [&str; 4] = ["ROBTARGET", "JOINTTARGET", "TOOLDATA", "WOBJDATA"];

/// `[..]` with what is in it.
#[derive(Debug, Clone)]
pub(super) enum Node {
    List(Vec<Node>),
    Number(f64, Range<usize>),
    Word(String),
    /// `Offs(..)` or `RelTool(..)`: a name, and what is in the brackets.
    DisplacedTarget(Box<Displacement>),
    /// `\WObj?w`: what the routine was given, or nothing.
    Perhaps,
    Other,
}

/// Values of the external axes of a target, mm or degrees, and where they are written.
pub(super) type ExternalAxes = [(f64, Range<usize>); 6];

impl Node {
    /// Place and quaternion, and confdata and external axes, which may be computed.
    pub fn is_robtarget(&self) -> bool {
        let Self::List(parts) = self else { return false };
        has_shape(parts, &ROBTARGET) && parts[..2].iter().all(|part| matches!(part, Self::List(_)))
    }

    /// Axes of the arm, and external ones, which may be computed.
    pub fn is_jointtarget(&self) -> bool {
        let Self::List(parts) = self else { return false };
        has_shape(parts, &JOINTTARGET) && matches!(parts[0], Self::List(_))
    }

    /// How many values stand in its brackets.
    fn count(&self) -> usize {
        if let Self::List(values) = self { values.len() } else { 0 }
    }
}

/// Numbers in the parts of a robtarget.
const ROBTARGET: [usize; 4] = [3, 4, 4, 6];

/// Numbers in the parts of a jointtarget.
const JOINTTARGET: [usize; 2] = [6, 6];

/// True where all parts that are no lists of so many values are computed: `[p.trans, p.rot, ..]`.
fn has_shape(parts: &[Node], shape: &[usize]) -> bool {
    let fits = |(part, wanted): (&Node, &usize)| !matches!(part, Node::List(_)) || part.count() == *wanted;
    parts.len() == shape.len() && parts.iter().zip(shape).all(fits)
}

/// `Offs(p, x, y, z)` or `RelTool(p, x, y, z \Rx:=.. \Ry:=.. \Rz:=..)`.
#[derive(Debug, Clone)]
pub(super) struct Displacement {
    pub of_tool: bool,
    pub point: String,
    /// `None` where they are not written in numbers.
    pub by: Option<[(f64, Range<usize>); 3]>,
    /// Rotations by their switches, deg; `None` for one that is not written in numbers.
    pub turned: [Option<(f64, Range<usize>)>; 3],
    /// Byte at which a missing rotation goes: switches stand in the order x, y, z.
    pub missing_at: [usize; 3],
    pub file: usize,
}

/// `Offs(..)` or `RelTool(..)` of a name; `None` for anything else. The reader stands on the word and ends behind the bracket.
pub(super) fn displacement(reader: &mut Reader<'_>) -> Option<Displacement> {
    let of_tool = match reader.name()?.as_str() {
        "OFFS" => false,
        "RELTOOL" => true,
        _ => return None,
    };
    let close = reader.closing(reader.at + 1).filter(|_| reader.ahead_is_mark(1, b'('))?;
    reader.at += 2;
    reader.skip_line_ends();
    let name = reader.name();
    reader.at += 1;
    let point = name.map(|name| element(reader, name)).filter(|_| reader.is_mark(b','));
    let mut by = Vec::new();
    while reader.at < close && reader.take_mark(b',') {
        reader.skip_line_ends();
        let number = reader.take_number();
        reader.skip_line_ends();
        let ends = reader.at == close || reader.is_mark(b',') || reader.is_mark(b'\\');
        by.extend(number.filter(|_| ends));
    }
    let mut turned = [None, None, None];
    let mut stands = [None; 3];
    let mut plain = true;
    while reader.at < close {
        reader.skip_line_ends();
        let slash = reader.peek().map_or(0, |t| t.range.start);
        if !reader.take_mark(b'\\') {
            plain = false;
            break;
        }
        let which = ["RX", "RY", "RZ"].iter().position(|n| reader.name().as_deref() == Some(n));
        reader.at += 1;
        let assigned = reader.take_mark(b':') && reader.take_mark(b'=');
        let number = reader.take_number().filter(|_| assigned);
        reader.skip_line_ends();
        let ends = reader.at == close || reader.is_mark(b'\\');
        match (which, number) {
            (Some(k), Some(number)) if ends && of_tool => (turned[k], stands[k]) = (Some(number), Some(slash)),
            _ => plain = false,
        }
        if !plain {
            break;
        }
    }
    reader.at = close;
    let end = reader.ahead(-1).map_or(0, |t| t.range.end);
    reader.at = close + 1;
    let by = <[_; 3]>::try_from(by).ok().filter(|_| plain);
    let missing_at = [0, 1, 2].map(|k: usize| stands[k..].iter().flatten().copied().next().unwrap_or(end));
    Some(Displacement { of_tool, point: point?, by, turned, missing_at, file: reader.index })
}

/// Behind a name: `{3}` names an element, anything else in braces some element. The reader ends behind the braces.
pub(super) fn element(reader: &mut Reader<'_>, name: String) -> String {
    let Some(close) = reader.closing(reader.at).filter(|_| reader.is_mark(b'{')) else { return name };
    reader.at += 1;
    let number = reader.take_number().filter(|_| reader.at == close);
    reader.at = close + 1;
    format!("{name}{{{}}}", number.map_or(String::new(), |(value, _)| value.to_string()))
}

/// True where `:=` stands behind the name, its index and its components on which the reader stands.
pub(super) fn is_set(reader: &mut Reader<'_>) -> bool {
    let start = reader.at;
    let is_switch = reader.ahead_is_mark(-1, b'\\');
    reader.at += 1;
    element(reader, String::new());
    while reader.take_mark(b'.') {
        reader.at += 1;
        element(reader, String::new());
    }
    let is_set = reader.is_mark(b':') && reader.ahead_is_mark(1, b'=');
    reader.at = start;
    is_set && !is_switch
}

/// The array of the name of an element.
pub(super) fn array_of(name: &str) -> Option<&str> {
    name.split_once('{').map(|(array, _)| array)
}

/// A value in the text; the reader ends behind it.
///
/// # Errors
/// A bracket that is not closed.
pub(super) fn node(reader: &mut Reader<'_>) -> Result<Node> {
    if let Some((value, range)) = reader.take_number() {
        return Ok(Node::Number(value, range));
    }
    if !reader.is_mark(b'[') {
        let (name, at) = (reader.name(), reader.at);
        if let Some(displaced) = displacement(reader) {
            return Ok(Node::DisplacedTarget(Box::new(displaced)));
        }
        reader.at = at + 1;
        return Ok(name.map_or(Node::Other, |name| Node::Word(element(reader, name))));
    }
    let Some(close) = reader.closing(reader.at) else {
        return Err(Error::new(Code::ProgramSyntax, reader.place(), "a list [ is not closed", "close it with ]"));
    };
    reader.at += 1;
    let mut list = Vec::new();
    while reader.at < close {
        reader.skip_line_ends();
        let mut item = node(reader)?;
        reader.skip_line_ends();
        while reader.at < close && !reader.is_mark(b',') {
            item = Node::Other;
            reader.at += 1;
        }
        reader.take_mark(b',');
        list.push(item);
    }
    reader.at = close + 1;
    Ok(Node::List(list))
}

pub(super) fn numbers<const N: usize>(node: &Node) -> Option<[(f64, Range<usize>); N]> {
    let Node::List(list) = node else { return None };
    let number = |n: &Node| match n {
        Node::Number(value, range) => Some((*value, range.clone())),
        _ => None,
    };
    list.iter().map(number).collect::<Option<Vec<_>>>()?.try_into().ok()
}

/// `[[x, y, z], [q1, q2, q3, q4]]`, q1 the scalar part.
pub(super) fn frame(node: &Node) -> Option<Pose> {
    let Node::List(list) = node else { return None };
    let (trans, rot) = (list.first()?, list.get(1)?);
    let trans = numbers::<3>(trans)?.map(|(v, _)| 1e-3 * v);
    let [w, x, y, z] = numbers::<4>(rot).filter(|q| !is_zero(q))?.map(|(v, _)| v);
    Some(Pose::from_xyz_quaternion(trans, [x, y, z, w]))
}

/// True for the quaternion of data that have no value yet: `[0,0,0,0]`.
fn is_zero(quaternion: &[(f64, Range<usize>); 4]) -> bool {
    quaternion.iter().all(|(value, _)| *value == 0.0)
}

/// True for a robtarget that has no value yet: its quaternion is zero.
pub(super) fn is_placeholder(target: &Node) -> bool {
    let Node::List(parts) = target else { return false };
    target.is_robtarget() && parts.get(1).and_then(numbers::<4>).is_some_and(|q| is_zero(&q))
}

/// A declared name whose value is computed.
pub(super) fn computed(name: &str) -> Why {
    Why::of(name, LeftReason::Computed, format!("{name} is computed, not written in numbers"))
}

/// A name that none of the files declares.
pub(super) fn undeclared(name: &str) -> Why {
    Why::of(name, LeftReason::Undeclared, format!("{name} is in none of the files (give its module as well)"))
}

/// The shape of the literal of a datum.
pub(super) fn check(kind: &str, name: &str, value: &Node, place: &str) -> Result<()> {
    let shape: &[usize] = match kind {
        "ROBTARGET" => &ROBTARGET,
        "JOINTTARGET" => &JOINTTARGET,
        _ => return Ok(()),
    };
    let Node::List(parts) = value else { return Ok(()) };
    if !has_shape(parts, shape) {
        let found: Vec<usize> = parts.iter().map(Node::count).collect();
        let what = format!("{name} has {found:?} numbers in its brackets, a {} has {shape:?}", kind.to_lowercase());
        return Err(Error::new(Code::ProgramTargets, place, what, "complete it"));
    }
    let norm = (kind == "ROBTARGET").then(|| numbers::<4>(&parts[1])).flatten();
    if let Some(q) = norm.filter(|q| !is_zero(q)) {
        let norm = q.iter().map(|(v, _)| v * v).sum::<f64>().sqrt();
        if (norm - 1.0).abs() > 0.01 {
            return Err(Error::new(
                Code::ProgramQuaternion,
                place,
                format!("the quaternion of {name} has the norm {norm:.4}, not 1"),
                "correct it",
            ));
        }
    }
    Ok(())
}

/// True for a jointtarget in which all axes of the arm stay where they are.
pub(super) fn is_of_external_axes(target: &Node) -> bool {
    let Node::List(parts) = target else { return false };
    let arm = parts.first().filter(|_| parts.len() == 2).and_then(numbers::<6>);
    arm.is_some_and(|axes| axes.iter().all(|(value, _)| *value >= NO_AXIS))
}

/// The first external axis behind the `known` axes, the robot's six included, that is not at zero.
pub(super) fn foreign_axis(external: &ExternalAxes, known: usize) -> Option<(String, f64)> {
    let foreign = external.iter().map(|(value, _)| *value).enumerate().skip(known.saturating_sub(6));
    let mut off_zero = foreign.filter(|(_, value)| *value != 0.0 && *value < NO_AXIS);
    off_zero.next().map(|(axis, value)| (external_name(axis), value))
}

/// Name of an external axis by its number from 0.
pub(super) fn external_name(axis: usize) -> String {
    "abcdef".chars().nth(axis).map_or_else(String::new, |letter| format!("eax_{letter}"))
}
