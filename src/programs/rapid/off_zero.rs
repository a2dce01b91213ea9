//! Where targets, and assignments to them, put external axes.

use super::value::{Node, node};
use crate::programs::external::{NO_AXIS, PutAnywhere};
use crate::programs::scan::{Reader, TokenKind};

/// Where a target puts its external axes, by their number from 0; `None` where it does not tell of any, or has none of its own.
pub(super) fn places(target: &Node) -> Option<Vec<(usize, Option<f64>)>> {
    let Node::List(parts) = target else { return None };
    let Node::List(external) = parts.last()? else { return None };
    let place = |node: &Node| if let Node::Number(value, _) = node { Some(*value) } else { None };
    let all = external.iter().map(place).enumerate();
    Some(all.filter(|(_, place)| place.is_none_or(|value| value < NO_AXIS)).collect())
}

/// The external axes of a target.
const EXTERNAL: &str = "EXTAX";

/// Notes where a target, or an assignment to one of them, puts external axes where the reader stands.
pub(super) fn external_axes(all: &mut PutAnywhere, reader: &mut Reader<'_>) {
    let start = reader.at;
    let mut put =
        |places: Vec<(usize, Option<f64>)>| places.into_iter().for_each(|(axis, place)| all.note(axis, place));
    let letter = reader.name().filter(|_| reader.ahead_is_mark(-1, b'.'));
    let letter = letter.filter(|_| reader.ahead_is_mark(1, b':') && reader.ahead_is_mark(2, b'='));
    let axis = letter.as_ref().and_then(|name| "ABCDEF".find(name.strip_prefix("EAX_")?));
    if let Some(axis) = axis {
        reader.at += 3;
        let number = reader.take_number().map(|(value, _)| value).filter(|_| reader.is_mark(b';'));
        put(if number.is_some_and(|value| value >= NO_AXIS) { vec![] } else { vec![(axis, number)] });
    } else if letter.as_deref() == Some(EXTERNAL) {
        reader.at += 3;
        put(all_places(reader));
    } else if reader.is_mark(b'[')
        && let Ok(target) = node(reader)
        && (target.is_robtarget() || target.is_jointtarget())
    {
        let is_copy = is_copy(reader, reader.at - 1);
        put(places(&target).unwrap_or_else(|| anywhere(is_copy)));
    }
    reader.at = start;
}

/// Where the reader stands on what all external axes of a target are set to.
fn all_places(reader: &mut Reader<'_>) -> Vec<(usize, Option<f64>)> {
    let list = if reader.is_mark(b'[') { node(reader).ok() } else { None };
    let end = (reader.at..).find(|k| reader.token(*k).is_none_or(|t| t.kind == TokenKind::Mark(b';')));
    let is_copy = end.is_some_and(|end| is_copy(reader, end));
    list.and_then(|list| places(&Node::List(vec![list]))).unwrap_or_else(|| anywhere(is_copy))
}

/// True where what ends before this token is taken from a target (`p.extax`): it is noted where that target stands.
fn is_copy(reader: &Reader<'_>, end: usize) -> bool {
    end > 1 && reader.name_of(end - 1).is_some_and(|name| name == EXTERNAL) && reader.token_is_mark(end - 2, b'.')
}

/// All axes at places that the text does not tell; none where they are those of another target.
fn anywhere(is_copy: bool) -> Vec<(usize, Option<f64>)> {
    (0..6).filter(|_| !is_copy).map(|axis| (axis, None)).collect()
}
