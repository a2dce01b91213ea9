//! Where targets, and assignments to them, put external axes.

use super::value::{Node, node};
use crate::programs::external::{NO_AXIS, PutAnywhere};
use crate::programs::scan::Reader;

/// Where a target puts its external axes, by their number from 0; `None` where it does not tell of any, or has none of its own.
pub(super) fn places(target: &Node) -> Option<Vec<(usize, Option<f64>)>> {
    let Node::List(parts) = target else { return None };
    let Node::List(external) = parts.last()? else { return None };
    let place = |node: &Node| if let Node::Number(value, _) = node { Some(*value) } else { None };
    let all = external.iter().map(place).enumerate();
    Some(all.filter(|(_, place)| place.is_none_or(|value| value < NO_AXIS)).collect())
}

/// Notes where a target, or an assignment to one of them, puts external axes where the reader stands.
pub(super) fn external_axes(all: &mut PutAnywhere, reader: &mut Reader<'_>) {
    let start = reader.at;
    let mut put =
        |places: Vec<(usize, Option<f64>)>| places.into_iter().for_each(|(axis, place)| all.note(axis, place));
    let letter = reader.name().filter(|_| reader.ahead_is_mark(-1, b'.'));
    let axis = letter.and_then(|name| "ABCDEF".find(name.strip_prefix("EAX_")?));
    if let Some(axis) = axis.filter(|_| reader.ahead_is_mark(1, b':') && reader.ahead_is_mark(2, b'=')) {
        reader.at += 3;
        let number = reader.take_number().map(|(value, _)| value).filter(|_| reader.is_mark(b';'));
        put(vec![(axis, number)]);
    } else if reader.is_mark(b'[')
        && let Ok(target) = node(reader)
        && (target.is_robtarget() || target.is_jointtarget())
    {
        // What is taken from a target (`p.extax`) is noted where that target stands.
        let is_copy = reader.ahead_is_word(-2, "EXTAX") && reader.ahead_is_mark(-3, b'.');
        let anywhere = || (0..6).filter(|_| !is_copy).map(|axis| (axis, None)).collect();
        put(places(&target).unwrap_or_else(anywhere));
    }
    reader.at = start;
}
