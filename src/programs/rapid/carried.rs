//! External axes: where moves leave those that the description lacks. One that a target does not use (`9E9`) keeps its place.

use std::ops::Range;

use super::Task;
use super::off_zero::places;
use super::value::{Node, external_name};
use crate::programs::external::NO_AXIS;
use crate::programs::flow::Either;
use crate::programs::program::Understood;

/// Moves external axes alone.
pub(super) const ALONE: &str = "MOVEEXTJ";

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
