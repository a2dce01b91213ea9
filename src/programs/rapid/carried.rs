//! External axes: where moves leave those that the description lacks. One that a target does not use (`9E9`) keeps its place.

use std::ops::Range;

use super::Task;
use super::value::{NO_AXIS, Node, external_name, node};
use crate::programs::external::OffZero;
use crate::programs::flow::Either;
use crate::programs::program::Understood;
use crate::programs::scan::Reader;

/// Moves external axes alone.
pub(super) const ALONE: &str = "MOVEEXTJ";

/// Where a target puts its external axes, by their number from 0; `None` where it does not tell of any, or has none of its own.
fn places(target: &Node) -> Option<Vec<(usize, Option<f64>)>> {
    let Node::List(parts) = target else { return None };
    let Node::List(external) = parts.last()? else { return None };
    let place = |node: &Node| if let Node::Number(value, _) = node { Some(*value) } else { None };
    let all = external.iter().map(place).enumerate();
    Some(all.filter(|(_, place)| place.is_none_or(|value| value < NO_AXIS)).collect())
}

/// Notes the external axes that a target, or an assignment to one of them, puts elsewhere than at zero where the reader stands.
pub(super) fn external_axes(all: &mut OffZero, reader: &mut Reader<'_>) {
    let start = reader.at;
    let mut put = |places: Vec<(usize, Option<f64>)>| {
        let off_zero = places.into_iter().filter(|(_, place)| *place != Some(0.0));
        off_zero.for_each(|(axis, _)| all.put(axis, None));
    };
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
        put(places(&target).unwrap_or_default());
    }
    reader.at = start;
}

impl Task<'_> {
    /// Behind a move to a value.
    pub(super) fn carries(&mut self, value: &Node) {
        let target = match value {
            Node::List(_) => Some(value.clone()),
            Node::Word(name) => self.declared(name).ok().map(|(target, _)| target),
            Node::DisplacedTarget(displaced) => self.declared(&displaced.point).ok().map(|(target, _)| target),
            _ => None,
        };
        let Some(places) = target.as_ref().and_then(places) else { return self.may_carry() };
        let mut off_zero = self.switching.now().off_zero.value().clone();
        places.into_iter().for_each(|(axis, place)| off_zero.put(axis, place));
        self.switching.axes_are(off_zero);
    }

    /// Behind something of which the text does not tell where it goes.
    pub(super) fn may_carry(&mut self) {
        let off_zero = self.switching.now().off_zero.value().either(&self.switching.off_zero_anywhere);
        self.switching.axes_are(off_zero);
    }

    /// Refuses a pose that does not use an axis which the description lacks and which may stand elsewhere than at zero.
    pub(super) fn keeps_at_zero(&self, external: &[(f64, Range<usize>); 6]) -> Understood<()> {
        let known = self.setting.axes.len().saturating_sub(6);
        let leaves_out = |axis| axis >= known && external.get(axis).is_none_or(|(value, _)| *value >= NO_AXIS);
        let why = self.switching.now().off_zero.value().why_kept(leaves_out, external_name);
        why.filter(|_| !self.setting.axes_apart).map_or(Ok(()), Err)
    }
}
